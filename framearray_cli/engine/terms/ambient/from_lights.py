"""Ambient intensity by particles from the light, as in [FA]: deposited power divided by the area that light reaches.

    E[l] = (power deposited, all bounces) / (area of the surface sides that light of position l reaches)

In a house the sunlit roof and facade count too, which makes E[l] too large indoors. `method = "eye"` avoids that.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Rgb

from ...embree.packets import set_ray
from ...hits.hits import SURFACE, Hits, World, trace_hits
from ...inputs.lights import LightArrays
from ...inputs.random import PIXEL, cosine_direction, r2, random_word, stream
from ...inputs.shapes import emitted_power, emitted_ray, sphere_direction
from ...kernels.kernel import kernel
from .estimate import AMBIENT_STREAM, BATCH, TARGET_ERROR, Ambient, Workspace, choose_steps, make_ambient, walk_until
from .lit_area import KEPT_BOUNCES, VertexPool, empty_vertices, keep_vertices, measure_lit_area
from .walks import MAX_BOUNCES, Walkers

# Particles per light position, unless the job sets ambient.paths.
MAX_PARTICLES = 32 * BATCH
# Particles are spread so evenly that their mean errs less than that of independent ones. So they are divided into
# groups with independent random numbers. The spread of the groups' means gives the error, to 1 in sqrt(2 (GROUPS - 1)).
GROUPS = 32
_PARTICLES, _STARTS = 1, 3  # sample numbers of the walks, and of their starting points


class Emitter(NamedTuple):
    """Source s at light position l, which emits particles into a scene of some radius.

    The number after that of the last source stands for the background.
    """

    lights: LightArrays
    s: int
    l: int
    radius: float


def _emit(
    emitter: Emitter, seed: int, first: int, n: int, world: World, packets: Float32, hits: Hits, walkers: Walkers
) -> None:
    """Emit particles first to first + n - 1; their random numbers are the same for every light position.

    The background emits them from a sphere around the scene.
    """
    _write_emitted_rays(emitter, seed, first, n, packets, hits, walkers)
    trace_hits(world, packets, n, coherent=False, near=0.0, mirrors=True, hits=hits)


@kernel
def _write_emitted_rays(
    emitter: Emitter, seed: int, first: int, n: int, packets: Float32, hits: Hits, walkers: Walkers
) -> None:
    """Write the rays of `_emit`, and start their walks."""
    lights, s, l, radius = emitter
    for i in range(n):
        # random point (a, b) of the group's sequence, and the particle's stream
        group, place = (first + i) % GROUPS, (first + i) // GROUPS
        a, b = r2(random_word(stream(seed, AMBIENT_STREAM, group, _STARTS), PIXEL), place)
        key = stream(seed, AMBIENT_STREAM, (first + i) & ((1 << 28) - 1), _PARTICLES)
        # origin o and direction d: background, or source
        if s == lights.kind.shape[0]:
            x, y, z = sphere_direction(a, b)
            ox, oy, oz = radius * x, radius * y, radius * z
            a, b = r2(random_word(key, PIXEL), 0)
            dx, dy, dz = cosine_direction(np.float32(-x), np.float32(-y), np.float32(-z), a, b)
        else:
            c, d = r2(random_word(key, PIXEL), 0)
            ox, oy, oz, dx, dy, dz = emitted_ray(lights, s, l, radius, a, b, c, d)
        set_ray(packets, i, ox, oy, oz, dx, dy, dz, np.float32(np.inf))
        # the walk, with throughput 1
        hits.key[i] = key
        walkers.walk[i] = i
        for channel in range(3):
            walkers.throughput[i, channel] = 1.0


@kernel
def _deposit_power(hits: Hits, walkers: Walkers, n: int, power: Float32, first: int, last: int, sums: Float32) -> None:
    """Add the power of every particle that met a surface to its walk, for light positions first to last - 1."""
    for i in range(n):
        if hits.kind[i] == SURFACE:
            for channel in range(3):
                arriving = walkers.throughput[i, channel] * power[channel]
                for l in range(first, last):
                    sums[walkers.walk[i], channel, l] += arriving


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _ParticleSums:
    """Sums over a batch of particles.

    Attributes:
        spent, rays: number of particles per light position, and of rays.
        total: (3, n_lights) sum of the power that particles deposit.
        groups: (GROUPS, n_lights) the same per group of particles, as mean of the channels.
        reached: only in the first batch: the area that light reaches, its relative variance and its reflectivity; see
            `measure_lit_area`.
    """

    spent: int
    rays: int
    total: Float64
    groups: Float64
    reached: tuple[Float64, Float64, Float64] | None

    def plus(self, other: "_ParticleSums") -> "_ParticleSums":
        """Sums over the particles of both."""
        return _ParticleSums(
            spent=self.spent + other.spent,
            rays=self.rays + other.rays,
            total=self.total + other.total,
            groups=self.groups + other.groups,
            reached=self.reached or other.reached,
        )

    @property
    def area(self) -> tuple[Float64, Float64, Float64]:
        """The area that light reaches, its relative variance and its reflectivity."""
        assert self.reached is not None
        return self.reached

    @property
    def error(self) -> Float64:
        """(n_lights,) relative standard error."""
        error: Float64 = np.sqrt(_group_variance(self.groups, self.spent) + self.area[1])
        return error


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightWalks:
    """Start, scene and lights of particles; arguments of `ambient_by_light`.

    Attributes:
        paths: particles per light position; None: enough for a standard error of 1 %, at most `MAX_PARTICLES`.
        background: (3,) radiance outside the scene, which lights the surfaces too; None: black.
        radius: radius of the scene about its centre.
    """

    seed: int
    paths: int | None
    world: World
    lights: LightArrays
    background: Rgb | None = None
    radius: float = field(init=False)

    def __post_init__(self) -> None:
        corners = self.world.surfaces.corners.reshape(-1, 3).astype(np.float64)
        object.__setattr__(self, "radius", float(np.sqrt((corners**2).sum(axis=1).max())))

    def batch(self, work: Workspace, first: int, n: int) -> _ParticleSums:
        """Follow particles first to first + n - 1 of every source and light position to their ends."""
        lights, rays = self.lights, work.rays
        n_sources, n_lights = len(lights.kind), lights.n_lights
        sky = self.background is not None and bool(self.background.any())
        pool = empty_vertices(n_lights, n_sources + sky) if first == 0 else None
        radius = self.radius
        work.sums[:] = 0.0
        for s in range(n_sources):
            flow = emitted_power(lights, s, radius)
            for l in range(n_lights):
                if lights.lit[s, l]:
                    power = float(flow[l]) * lights.strength[s, :, l] * lights.colour[l]
                    self._follow(work, Emitter(lights, s, l, radius), range(l, l + 1), power, (first, n), pool)
        if sky and self.background is not None:
            power = 4 * np.pi**2 * radius**2 * self.background
            self._follow(work, Emitter(lights, n_sources, 0, radius), range(n_lights), power, (first, n), pool)
        reached = measure_lit_area(work, self.seed, self.world, lights, pool, sky) if pool else None
        deposited = work.sums[:n].astype(np.float64)
        groups = np.zeros((GROUPS, n_lights))
        for group in range(min(GROUPS, n)):  # a batch is a multiple of GROUPS
            groups[group] = deposited[group::GROUPS].mean(axis=1).sum(axis=0)
        total = deposited.sum(axis=0)
        return _ParticleSums(spent=n, rays=work.rays - rays, total=total, groups=groups, reached=reached)

    def _follow(
        self, work: Workspace, emitter: Emitter, positions: range, power: Float32, batch: tuple[int, int],
        pool: VertexPool | None,
    ) -> None:  # fmt: skip
        """Follow particles to their ends, and add what they deposit to `work.sums`.

        Args:
            positions: light positions for which the particles count.
            power: (3,) power of the source at that position.
            batch: number of the first particle, number of particles.
            pool: collects vertices, or None.
        """
        first, n = batch
        carried = power.astype(np.float32)
        _emit(emitter, self.seed, first, n, self.world, work.hit_packets, work.hits[0], work.walkers[0])
        work.rays += n
        for bounce in range(MAX_BOUNCES):
            hits, walkers = work.hits[0], work.walkers[0]
            _deposit_power(hits, walkers, n, carried, positions.start, positions.stop, work.sums)
            choose_steps(hits, walkers, n, False)
            if pool and bounce < KEPT_BOUNCES:
                keep_vertices(pool, hits, walkers, n, positions)
            n = work.advance(n, self.world)
            if n == 0:
                break


def ambient_by_light(walks: LightWalks, threads: int = 1) -> Ambient:
    """Estimate I_A[l] and the average reflectivity by particles from the lights [FA], for any number of threads."""

    def enough(found: _ParticleSums) -> bool:
        return walks.paths is None and bool(found.error.max() <= TARGET_ERROR)

    found = walk_until(walks.batch, enough, walks.paths, walks.lights, threads, MAX_PARTICLES)
    area, _, reflectivity = found.area
    per_area = np.divide(1.0, area, out=np.zeros_like(area), where=area > 0)
    mean = found.total / found.spent * per_area
    return make_ambient(mean, found.error, reflectivity, found.spent, found.rays, walks.paths is None)


def _group_variance(groups: Float64, n: int) -> Float64:
    """Relative variance of the mean of n particles, (n_lights,), from sums per group, (GROUPS, n_lights)."""
    size = np.bincount(np.arange(n) % GROUPS, minlength=GROUPS)[:, None]
    whole = groups.sum(axis=0)
    used = min(n, GROUPS)
    squares = ((groups - size / n * whole) ** 2).sum(axis=0) * used / max(used - 1, 1)
    variance: Float64 = np.divide(squares, whole**2, out=np.zeros_like(whole), where=whole > 0)
    return variance
