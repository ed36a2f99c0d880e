"""Average ambient intensity I_A[l] = E[l] / pi, and the random walks that estimate it [FA eq. 2].

E[l] is the average irradiance, all bounces counted, over the surface sides from which light comes to the eye. It is
estimated before the first frame by `from_eyes.py`.

A walk carries an RGB throughput. At a surface it continues by the diffuse part, continues by the mirror part, or ends,
with probabilities that keep the throughput at most 1.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Rgb, Triple
from framearray_cli.base.threads import TaskPool

from ...embree.packets import DIRECTION, ORIGIN, TFAR, set_ray
from ...hits.glass import BEFORE, transmission_along
from ...hits.hits import ESCAPED, SURFACE, Hits, World, empty_hits, trace_hits
from ...hits.rays import NO_RAYS, room_for_hits, room_for_tests
from ...inputs.lights import LightArrays
from ...inputs.panes import PaneArrays, Sight, has_panes
from ...inputs.random import CHOICE, HEMISPHERE, above, cosine_direction, mix, r2, random_word
from ...kernels.bundle import allocated, bundle
from ...kernels.kernel import inlined, kernel
from ..direct import direct

DIFFUSE, MIRROR, END = 0, 1, 2
# Largest number of bounces; nearly all walks end by chance long before. 0.97^256 is four ten-thousandths.
MAX_BOUNCES = 256
BATCH = 4096
# Automatic number of walks: batches are added until the standard error is this small, within bounds.
TARGET_ERROR = 0.01
MIN_WALKS, MAX_WALKS = BATCH, 64 * BATCH
# No walk of a frame uses this camera index, so that ambient walks are independent of every frame's samples.
AMBIENT_STREAM = (1 << 20) - 1


@bundle
class Walkers(NamedTuple):
    """Unfinished walks; each is at the hit of the same index.

    Attributes:
        walk: (n,) number of the walk in its batch.
        throughput: (n, 3) RGB.
        step: (n,) the walk's next step: DIFFUSE, MIRROR or END.
    """

    walk: Int32
    throughput: Rgb
    step: Int32


@inlined
def choose_step(hits: Hits, walkers: Walkers, i: int, must_go_on: bool) -> None:
    """Choose how walk i leaves its hit, and divide its throughput by the probability of that choice.

    Args:
        must_go_on: end walks at black surfaces only, choose between the parts by their size, and keep the throughput.
    """
    # sizes of the parts
    r, s = hits.reflectivity[i], hits.specular[i]
    diffuse, mirror = max(r[0], r[1], r[2]), max(s[0], s[1], s[2])
    total = diffuse + mirror
    if hits.kind[i] != SURFACE or total <= 0.0:
        walkers.step[i] = END
        return
    # their probabilities; the rest up to 1 is the probability of an end
    scale = total if must_go_on or total > 1.0 else np.float32(1.0)
    diffuse, mirror = diffuse / scale, mirror / scale
    # the choice
    a, _ = r2(random_word(hits.key[i], CHOICE), 0)
    if a < diffuse:
        walkers.step[i] = DIFFUSE
    elif a < diffuse + mirror:
        walkers.step[i] = MIRROR
    else:
        walkers.step[i] = END
    # throughput times reflectivity over probability
    if must_go_on:
        return
    for channel in range(3):
        if walkers.step[i] == DIFFUSE:
            walkers.throughput[i, channel] *= r[channel] / diffuse
        elif walkers.step[i] == MIRROR:
            walkers.throughput[i, channel] *= s[channel] / mirror


@inlined
def _leave(hits: Hits, i: int, step: int) -> Triple:
    """Direction in which a walk leaves hit i: with density cos(theta) / pi, or mirrored."""
    g, m = hits.geometric[i], hits.shading[i]
    if step == DIFFUSE:
        a, b = r2(random_word(hits.key[i], HEMISPHERE), 0)
        x, y, z = cosine_direction(m[0], m[1], m[2], a, b)
        return above(x, y, z, g[0], g[1], g[2])
    d = hits.incoming[i]
    along = np.float32(2.0) * (d[0] * m[0] + d[1] * m[1] + d[2] * m[2])
    return above(d[0] - along * m[0], d[1] - along * m[1], d[2] - along * m[2], g[0], g[1], g[2])


@kernel
def _write_next_rays(
    hits: Hits, walkers: Walkers, n: int, packets: Float32, next_hits: Hits, next_walkers: Walkers
) -> int:
    """Write the rays of `Workspace.advance`, with the keys, numbers, steps and throughputs of their walks."""
    # Loop state
    m = NO_RAYS  # walks that continue
    for i in range(n):
        if walkers.step[i] == END:
            continue
        # the ray from slightly above its hit
        x, y, z = _leave(hits, i, walkers.step[i])
        g, e, p = hits.geometric[i], hits.offset[i], hits.position[i]
        set_ray(packets, m, p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2], x, y, z, np.float32(np.inf))
        # its next random stream, number, step and throughput
        next_hits.key[m] = mix(hits.key[i])
        next_walkers.walk[m] = walkers.walk[i]
        next_walkers.step[m] = walkers.step[i]
        for channel in range(3):
            next_walkers.throughput[m, channel] = walkers.throughput[i, channel]
        m += 1
    return m


@kernel
def deposit(walkers: Walkers, n: int, irradiance: Float32, colour: Float32, sums: Float32) -> None:
    """Add throughput times irradiance of each walk's hit to the walk's sums.

    Args:
        irradiance: (n, 1 or 3, n_lights), in units of `colour`, (n_lights, 3).
        sums: (n_walks, 3, n_lights).
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        for channel in range(3):
            t = walkers.throughput[i, channel]
            e, total = irradiance[i, channel if channels == 3 else 0], sums[walkers.walk[i], channel]
            for l in range(n_lights):
                total[l] += t * colour[l, channel] * e[l]


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Error of light from cells, over the mean indirect light of images.

    Attributes:
        bias: signed mean over points and light positions; `bias_error`: its standard error.
        error: root mean square over points and light positions, 0 where noise makes the square negative;
            `error_error`: its standard error, upwards where the square is within its own.
        points: number of points that were compared; `paths`: number of paths at each.
    """

    bias: float
    bias_error: float
    error: float
    error_error: float
    points: int
    paths: int

    @property
    def note(self) -> str:
        """The line that renders and reports print."""
        level = f"{self.error:.1%} +- {self.error_error:.1%}"
        return f"indirect light differs from paths by {level}, its mean by {self.bias:+.1%} +- {self.bias_error:.1%}"

    def table(self) -> dict[str, float | int]:
        """Return the table for the manifest."""
        figures = {"mean": self.bias, "mean_error": self.bias_error, "rms": self.error, "rms_error": self.error_error}
        return {key: round(value, 5) for key, value in figures.items()} | {"points": self.points, "paths": self.paths}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ambient:
    """The ambient estimate of a job.

    Attributes:
        intensity: (n_lights, 3) I_A, radiance.
        standard_error: (n_lights,) of I_A, relative to it, of the mean of the channels; 0 where I_A is 0 or given.
        reflectivity: (3,) average reflectivity over the surfaces that E averages; where there are none, over those
            that the eyes see.
        paths: number of walks; 0 where images have no ambient light.
        rays: number of rays traced.
        notes: messages for the user, e.g. that the estimate missed its target error.
        accuracy: of light from cells, which takes its place; None: without cells, or not measured.
        shared_s: seconds of preparing indirect light that do not grow with the number of light positions.
    """

    intensity: Rgb
    standard_error: Float64
    reflectivity: Rgb
    paths: int
    rays: int
    notes: tuple[str, ...] = ()
    accuracy: Accuracy | None = None
    shared_s: float = 0.0

    def at(self, block: range) -> "Ambient":
        """The estimate of a block of light positions."""
        span = slice(block.start, block.stop)
        return replace(self, intensity=self.intensity[span], standard_error=self.standard_error[span])


class Workspace:
    """Arrays for one batch of walks, reused from batch to batch."""

    def __init__(self, lights: LightArrays) -> None:
        self.hit_packets = room_for_hits(BATCH).packets
        self.test_rays = room_for_tests(BATCH, lights.n_lights)
        self.hits = [empty_hits(BATCH), empty_hits(BATCH)]
        self.walkers = [allocated(Walkers, walk=BATCH, throughput=(BATCH, 3), step=BATCH) for _ in range(2)]
        self.leaves = np.zeros((BATCH, 3), np.float32)  # whole packets, because kernels read hits in packets
        self.leaving = [hits._replace(reflectivity=self.leaves) for hits in self.hits]
        self.irradiance = np.empty((BATCH, lights.channels, lights.n_lights), np.float32)
        self.sums = np.empty((BATCH, 3, lights.n_lights), np.float32)
        self.rays = 0

    def advance(self, n: int, world: World, *, dimmed: bool = False) -> int:
        """Move every walk that continues to its next hit (or escape), and return their number.

        `hits[0]` and `walkers[0]` are the current ones before and after.

        Args:
            dimmed: True if the glass on their way dims them.
        """
        packets = self.hit_packets
        n = _write_next_rays(self.hits[0], self.walkers[0], n, packets, self.hits[1], self.walkers[1])
        trace_hits(world.whole, packets, n, coherent=False, near=0.0, mirrors=True, hits=self.hits[1])
        self.hits.reverse()
        self.leaving.reverse()
        self.walkers.reverse()
        self.rays += n
        if dimmed and has_panes(world.panes) and n:
            self._pass_glass(n, world.panes)
        return n

    def _pass_glass(self, n: int, panes: PaneArrays) -> None:
        """Dim the n current walks by the glass that the rays to them went through."""
        rows = self.hit_packets[:, : TFAR + 1].swapaxes(1, 2).reshape(-1, TFAR + 1)[:n]
        start, way = rows[:, ORIGIN : ORIGIN + 3], rows[:, DIRECTION : DIRECTION + 3]
        share, rays = transmission_along(start, way, rows[:, TFAR] * BEFORE, panes)
        self.walkers[0].throughput[:n] *= share
        self.rays += rays

    def add_direct(self, n: int, lights: LightArrays, sight: Sight) -> None:
        """Add the direct irradiance at every current hit that its walk leaves diffusely to the walk's sums."""
        self.leaves[:n] = self.walkers[0].step[:n, None] == DIFFUSE
        self.rays += direct(self.leaving[0], n, lights, sight, self.test_rays, self.irradiance, False)
        deposit(self.walkers[0], n, self.irradiance[:n], lights.colour, self.sums)


@kernel
def choose_steps(hits: Hits, walkers: Walkers, n: int, must_go_on: bool) -> None:
    """Choose the next step of walks 0 to n - 1; see `choose_step`."""
    for i in range(n):
        choose_step(hits, walkers, i, must_go_on)


@kernel
def add_background(hits: Hits, walkers: Walkers, n: int, background: Rgb, sums: Float32) -> None:
    """Add the background's irradiance, pi times its radiance, to the sums of walks that left the scene."""
    for i in range(n):
        if hits.kind[i] == ESCAPED:
            for channel in range(3):
                light = walkers.throughput[i, channel] * np.float32(np.pi) * background[channel]
                for l in range(sums.shape[2]):
                    sums[walkers.walk[i], channel, l] += light


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """Sums over walks, which add up over several batches; E averages over first vertices.

    Attributes:
        spent, rays: number of walks and of rays.
        count, reflectivity: number of first vertices, and the sum of their reflectivities, (3,).
        seen, seen_reflectivity: number of surfaces that the eyes saw, and the sum of their reflectivities, (3,).
        total, squares: (3, n_lights) sum of E over walks, and (n_lights,) sum of the squared mean of its channels.
    """

    spent: int
    rays: int
    count: int
    reflectivity: Float64
    seen: int
    seen_reflectivity: Float64
    total: Float64
    squares: Float64

    def plus(self, other: "Sums") -> "Sums":
        """Sums over the walks of both."""
        return Sums(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)})

    @property
    def average(self) -> Float64:
        """Average reflectivity, (3,)."""
        return self.reflectivity / max(self.count, 1)

    @property
    def error(self) -> Float64:
        """(n_lights,) relative standard error of the mean of the channels; 0 where nothing arrives."""
        mean = self.total.mean(axis=0) / self.count
        variance = np.maximum(self.squares / self.count - mean**2, 0.0) / max(self.count - 1, 1)
        return np.divide(np.sqrt(variance), mean, out=np.zeros_like(mean), where=mean > 0)


def walk_until(
    batch: Callable[[Workspace, int, int], Sums], paths: int | None, lights: LightArrays, threads: int
) -> Sums:
    """Walk batches in order, one per thread at a time, until they are enough; later batches do not count.

    So the result is the same for any number of threads.

    Args:
        batch: follows n walks from number `first` on, given (work, first, n).
        paths: number of walks; None: enough for `TARGET_ERROR`, at most `MAX_WALKS`.
    """
    limit, found = paths or MAX_WALKS, None
    workspaces = [Workspace(lights) for _ in range(threads)]
    with TaskPool(threads, thread_name_prefix="ambient") as pool:
        for group in range(0, limit, threads * BATCH):
            starts = range(group, min(group + threads * BATCH, limit), BATCH)
            sizes = [min(BATCH, limit - first) for first in starts]
            for walked in pool.map(batch, workspaces, starts, sizes):
                found = found.plus(walked) if found else walked
                known = paths is None and found.spent >= MIN_WALKS and found.count
                if known and found.error.max() <= TARGET_ERROR:
                    return found
    assert found
    return found


def make_ambient(
    mean: Float64, error: Float64, reflectivity: Float64, spent: int, rays: int, automatic: bool
) -> Ambient:
    """Make an estimate of means, with a note if it missed its target error.

    Args:
        mean: (3, n_lights) irradiance.
        error: (n_lights,) relative standard error.
        reflectivity: (3,) average.
        automatic: True if the program chose the number of walks.
    """
    notes: tuple[str, ...] = ()
    if automatic and error.max() > TARGET_ERROR:
        notes = (
            f"ambient: standard error {error.max():.1%} at light {int(error.argmax())} after {spent:,} walks, "
            "as many as the program takes unasked; set ambient.paths for more",
        )
    return Ambient(
        intensity=(mean.T / math.pi).astype(np.float32),
        standard_error=error,
        reflectivity=reflectivity.astype(np.float32),
        paths=spent,
        rays=rays,
        notes=notes,
    )
