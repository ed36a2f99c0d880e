"""I_A[l] that makes obscurances as bright as path tracing, on average over what the eyes see: `method = "fit"`.

At a diffuse point P that an eye sees, the model's indirect light is R(P) I_A[l] W(P) [FA eq. 2]. Walks from P estimate
the true one, R(P) G(P, l), with G the mean radiance that arrives, all bounces and mirrors counted. Both are means over
cosine-distributed directions, and each walk from P gives one direction of either:

    W:  R(Q) rho(d) for the first point Q that the walk meets within d_max, otherwise the average reflectivity
    G:  the radiance that leaves Q towards P, or the background's

    I_A[l] = sum of R(P) G(P, l) / sum of R(P) W(P), over all walks, channel by channel

So the error of obscurances (light does not arrive uniformly from all directions) affects single places, not the mean
over the images. With `outside = "background"` the light of escaping rays is known exactly, and counts on neither side.
"""

from dataclasses import dataclass, fields

import numpy as np

from framearray_cli.base.arrays import Float32, Float64

from ...kernels.kernel import kernel
from ..falloff import rho
from .estimate import MIN_WALKS, TARGET_ERROR, Ambient, Workspace, choose_steps, make_ambient, walk_until
from .from_eyes import DiffuseSteps, EyeWalks, start_at_eyes, total_reflectivity, walk_to_first_vertices


@dataclass(frozen=True, slots=True, kw_only=True)
class ObscuranceCurve:
    """Range and falloff of the job's obscurances; see `ObscuranceSettings`."""

    d_max: float
    falloff: int
    tau: float
    sky: bool


@kernel
def rho_of(falloff: int, tau: float, x: Float32, out: Float32) -> None:
    """Write rho of each x = d / d_max."""
    for i in range(x.shape[0]):
        out[i] = rho(falloff, tau, x[i])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FitSums:
    """Sums over walks.

    Attributes:
        spent, rays: number of walks and of rays.
        count, reflectivity: number of first vertices, and the sum of their reflectivities, (3,).
        light: (3, n_lights) sum of R(P) G, as irradiance: times pi.
        near, far: (3,) sums of R(P) R(Q) rho(d) over walks that meet something within d_max, of R(P) over the others.
        squares, products: (n_lights,) sums of y^2 and of x y. y and x are the terms of one walk in `light` and in
            near + far, as means over the channels, with the average reflectivity of the batch.
        own: sum of x^2.
    """

    spent: int
    rays: int
    count: int
    reflectivity: Float64
    light: Float64
    near: Float64
    far: Float64
    squares: Float64
    products: Float64
    own: float

    def plus(self, other: "_FitSums") -> "_FitSums":
        """Sums over the walks of both."""
        return _FitSums(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)})

    @property
    def average(self) -> Float64:
        """Average reflectivity, (3,), which stands in for R(Q) where a walk meets nothing within d_max."""
        average: Float64 = self.reflectivity / max(self.count, 1)
        return average

    @property
    def obscurance(self) -> Float64:
        """Sum of R(P) W(P), (3,)."""
        weighed: Float64 = self.near + self.far * self.average
        return weighed

    @property
    def irradiance(self) -> Float64:
        """I_A times pi, (3, n_lights); 0 in a channel that no surface reflects."""
        w = self.obscurance[:, None]
        found: Float64 = np.divide(self.light, w, out=np.zeros_like(self.light), where=w > 0)
        return found

    @property
    def error(self) -> Float64:
        """(n_lights,) relative standard error of the mean of the channels, as that of a ratio of means."""
        w, y = self.obscurance.mean(), self.light.mean(axis=0)
        ratio = y / w if w > 0 else np.zeros_like(y)
        square = np.maximum(self.squares - 2 * ratio * self.products + ratio**2 * self.own, 0.0)
        found: Float64 = np.divide(np.sqrt(square), y, out=np.zeros_like(y), where=y > 0)
        return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FitWalks:
    """Walks from the eyes, and the obscurances that they are compared with."""

    walks: EyeWalks
    curve: ObscuranceCurve

    def batch(self, work: Workspace, first: int, n: int) -> _FitSums:
        """Follow walks first to first + n - 1 to their ends."""
        walks, rays = self.walks, work.rays
        steps = DiffuseSteps(
            reflectivity=np.zeros((n, 3), np.float32),
            position=np.zeros((n, 3), np.float32),
            distance=np.full(n, np.nan, np.float32),
        )
        hits, walkers = work.hits[0], work.walkers[0]
        start_at_eyes(walks.cams, walks.seed, first, n, walks.world, work.hit_packets, hits, walkers)
        work.rays += n
        left = walk_to_first_vertices(work, n, walks.world, steps)
        hits, walkers = work.hits[0], work.walkers[0]
        met = np.zeros((n, 3))  # R(Q) of each walk
        walk = walkers.walk[:left].copy()
        met[walk] = hits.reflectivity[:left] + hits.specular[:left]
        count, reflectivity = left, total_reflectivity(hits, left)
        work.sums[:] = 0.0
        walkers.throughput[:left] = 1.0
        choose_steps(hits, walkers, left, False)  # Q may be a mirror, which the walk follows too
        walks.follow(work, left)
        return self._sums(work.sums[:n].astype(np.float64), steps, met, count, reflectivity, n, work.rays - rays)

    def _sums(
        self, gathered: Float64, steps: DiffuseSteps, met: Float64, count: int, reflectivity: Float64, n: int, rays: int
    ) -> _FitSums:
        """Sum a batch.

        Args:
            gathered: (n, 3, n_lights) pi times the radiance that leaves the first vertex of each walk.
            met: (n, 3) reflectivity R(Q) of first vertices.
        """
        curve, source = self.curve, steps.reflectivity.astype(np.float64)
        escaped = np.isinf(steps.distance)
        if curve.sky:
            source[escaped] = 0.0
        else:
            gathered[escaped] += np.pi * self.walks.background[:, None]
        near = steps.distance < curve.d_max  # False for NaN, too
        far = ~near & ~np.isnan(steps.distance)
        openness = np.zeros(n, np.float32)
        rho_of(
            curve.falloff,
            curve.tau,
            np.divide(steps.distance, curve.d_max, out=np.zeros_like(steps.distance), where=near).astype(np.float32),
            openness,
        )
        share = np.where(near, openness, 0.0)[:, None] * met
        light = source[:, :, None] * gathered
        average = reflectivity / max(count, 1)
        x = (source * (share + np.where(far[:, None], average, 0.0))).mean(axis=1)
        y = light.mean(axis=1)
        return _FitSums(
            spent=n,
            rays=rays,
            count=count,
            reflectivity=reflectivity,
            light=light.sum(axis=0),
            near=(source * share).sum(axis=0),
            far=source[far].sum(axis=0),
            squares=(y**2).sum(axis=0),
            products=(x[:, None] * y).sum(axis=0),
            own=float((x**2).sum()),
        )


def ambient_by_fit(walks: EyeWalks, curve: ObscuranceCurve, threads: int = 1) -> Ambient:
    """Estimate I_A[l] so that indirect light is right on average over the images."""

    def enough(found: _FitSums) -> bool:
        if walks.paths is not None or found.spent < MIN_WALKS or not found.count:
            return False
        return bool(found.error.max() <= TARGET_ERROR)

    found = walk_until(_FitWalks(walks=walks, curve=curve).batch, enough, walks.paths, walks.lights, threads)
    return make_ambient(
        found.irradiance, found.error, found.average, found.spent, found.rays, walks.paths is None and found.count > 0
    )
