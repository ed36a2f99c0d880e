"""Indirect light by paths: exact, for references, and to measure the error of cells.

With `indirect.exact` as many paths start at each hit as it would have gather rays. A path has direct light under every
l at each vertex, and goes on by chance, without end and without clamping. Its mean is right; its noise is several times
the noise of a ray that reads a cell. Hits have three numbers per l, since light from different places has different
colours.

The error of cells is measured at points that the eyes see. At each point P rays gather the light of cells, and paths
estimate the same light without bias, both in two halves. The product of both halves' differences has no noise on
average. Many points with few paths each are best: points differ more than the mean of some paths is noisy. Errors are
errors of images: of R E, over its mean.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64, Rgb, with_room
from framearray_cli.base.threads import TaskPool

from ...hits.hits import SURFACE, Hits, World, empty_hits
from ...hits.rays import room_for_hits, room_for_tests
from ...inputs.lights import LightArrays, pad_lights
from ...inputs.random import lattice_steps
from ...kernels.bundle import allocated
from ..ambient.from_eyes import EyeWalks, start_at_eyes
from ..ambient.intensity import BATCH, DIFFUSE, MAX_BOUNCES, Accuracy, Workspace, add_background, choose_steps
from ..obscurance import ObscuranceSettings
from .ends import room_for_gathering
from .gather import COLOUR, LEVEL, LIGHT, Gathered, GatherSettings, gather_cells, gather_settings
from .lookup import LEVELS, NOWHERE, Cells, Grid, empty_slots

# Random numbers of the paths of a hit: multiples of this odd number, added to its key.
_NEXT = np.uint64(0x9E3779B97F4A7C15 >> 1 | 1)
Rows: TypeAlias = NDArray[np.intp]
POINTS, PATHS, RAYS = 1024, 256, 128  # points; paths and gather rays at each
HALVES = 2
# Light positions that stand for all, at most.
MOST_LIGHTS = 8
# Groups of points whose spread gives the standard errors.
GROUPS = 32
# Walks that sample the cells for each point: a coarse solution needs no closer look.
WALKS_PER_POINT = 1024
NO_LIGHT = "indirect light was not compared with paths: none arrives at the points"


class PathScratch:
    """One thread's arrays for paths.

    Attributes:
        work: walks, and their sums of light by sources; `constant`: (BATCH, 3, 1) their sums of the background.
    """

    def __init__(self, lights: LightArrays) -> None:
        self.work = Workspace(lights)
        self.constant = np.empty((BATCH, 3, 1), np.float32)


def coloured(lights: LightArrays) -> LightArrays:
    """Lights with three channels."""
    if lights.channels == 3:
        return lights
    strength = np.ascontiguousarray(lights.strength * lights.colour.T[None])
    return pad_lights(lights._replace(strength=strength, colour=np.ones_like(lights.colour)))


def no_cells(lights: LightArrays, background: Rgb) -> Cells:
    """The cell of all surfaces only, without light."""
    channels = lights.channels
    return Cells(
        grid=Grid(edge=1.0, jitter=np.zeros((LEVELS, 3), np.float32)),
        slots=empty_slots(1),
        other=np.full(1, NOWHERE, np.int32),
        guard=np.zeros((1, 4), np.float32),
        tint=np.zeros((1, 8), np.float32),
        light=with_room((1, channels, lights.n_lights), np.float32, fill=0),
        weights=np.full(3, 1 / 3, np.float32),
        background=background.astype(np.float32),
    )


def light_of_paths(
    hits: Hits, n: int, n_paths: int, world: World, lights: LightArrays, background: Rgb,
    scratch: PathScratch, out: Gathered,
) -> int:  # fmt: skip
    """Estimate the indirect light of hits 0 to n - 1 by n_paths paths from each; hits that reflect nothing get none.

    Args:
        out: `light`, with three channels, and `constant` are overwritten.

    Returns:
        number of rays.
    """
    out.light[:n], out.constant[:n] = 0.0, 0.0
    rows = np.flatnonzero((hits.kind[:n] == SURFACE) & (hits.reflectivity[:n] > 0).any(axis=1))
    before = scratch.work.rays
    together = max(BATCH // n_paths, 1)
    for first in range(0, len(rows), together):
        some = rows[first : first + together]
        for path in range(0, n_paths, BATCH):
            paths = range(path, min(path + BATCH, n_paths))
            light, constant = _follow(hits, some, paths, world, lights, background, scratch)
            values = light.reshape(len(some), -1)
            out.light[some, LIGHT : LIGHT + values.shape[1]] += values / np.float32(n_paths)
            out.constant[some] += constant / np.float32(np.pi * n_paths)
        out.light[some, COLOUR : COLOUR + 3] = out.light[some, LEVEL : LEVEL + 1] = 1.0
    return scratch.work.rays - before


def _repeat(hits: Hits, rows: Rows, times: range, out: Hits) -> int:
    """Write each of some hits that many times, each time with random numbers of its own; return the number of hits."""
    n = len(rows) * len(times)
    for name in Hits._fields:
        getattr(out, name)[:n] = np.repeat(getattr(hits, name)[rows], len(times), axis=0)
    out.key[:n] += np.tile(np.array(times, np.uint64), len(rows)) * _NEXT
    return n


def _follow(
    hits: Hits,
    rows: Rows,
    paths: range,
    world: World,
    lights: LightArrays,
    background: Rgb,
    scratch: PathScratch,
) -> tuple[Float32, Float32]:
    """Follow some paths from each of some hits; return sums of irradiance, by sources and by the background."""
    work, constant = scratch.work, scratch.constant
    start, walkers = work.hits[0], work.walkers[0]
    n = _repeat(hits, rows, range(paths.start + 1, paths.stop + 1), start)
    walkers.walk[:n] = np.repeat(np.arange(len(rows)), len(paths))
    walkers.throughput[:n], walkers.step[:n] = 1.0, DIFFUSE
    work.sums[: len(rows)] = constant[: len(rows)] = 0.0
    for _ in range(MAX_BOUNCES):
        n = work.advance(n, world, dimmed=True)
        if n == 0:
            break
        if background.any():
            add_background(work.hits[0], work.walkers[0], n, background, constant)
        choose_steps(work.hits[0], work.walkers[0], n, False)
        work.add_direct(n, lights, world.sight)
    return work.sums[: len(rows)], constant[: len(rows), :, 0]


def compare_with_paths(
    cells: Cells, walks: EyeWalks, obscurance: ObscuranceSettings, depth: int, samples: int, threads: int
) -> Accuracy | str:
    """Compare the light of cells with the light of paths at some points.

    Args:
        obscurance: of gather rays, but for their number; `depth`: most mirrors that these follow.
        samples: number of walks that sampled the cells.

    Returns:
        the error, or the reason why there is none.
    """
    n_lights = walks.lights.n_lights
    at = sorted(set(np.linspace(0, n_lights - 1, MOST_LIGHTS).round().astype(int).tolist()))
    few = EyeWalks(
        cams=walks.cams, seed=walks.seed + 1, paths=None, world=walks.world, lights=walks.lights.at(at),
        background=walks.background,
    )  # fmt: skip
    step_x, step_y = lattice_steps(RAYS // HALVES)
    settings = gather_settings(obscurance._replace(n_rays=RAYS // HALVES, step_x=step_x, step_y=step_y))
    points, rows = _points(few)
    rows = rows[: min(max(samples // WALKS_PER_POINT, 2 * GROUPS), POINTS)]
    if len(rows) < GROUPS:
        return (
            f"indirect light was not compared with paths: expected at least {GROUPS} of {BATCH:,} points in the images "
            f"on surfaces that reflect diffusely, found {len(rows)}"
        )
    measuring = _Measuring(cells=cells.at(at), walks=few, settings=settings, depth=depth, points=points)
    per_batch = BATCH // PATHS
    with TaskPool(threads, thread_name_prefix="cells") as pool:
        found = list(pool.map(measuring.batch, np.array_split(rows, -(-len(rows) // per_batch))))
    return _accuracy(np.concatenate([paths for paths, _ in found]), np.concatenate([read for _, read in found]))


def _accuracy(paths: Float64, read: Float64) -> Accuracy | str:
    """The errors of light from cells against paths, (n_points, HALVES, n_lights) each.

    Standard errors are jackknife errors over groups of points, which follow each other across the images.
    """
    residual = read - paths
    signed, squares, light = residual.mean(axis=(1, 2)), residual.prod(axis=1).mean(axis=1), paths.mean(axis=(1, 2))
    if light.mean() <= 0:
        return NO_LIGHT

    def errors(chosen: NDArray[np.bool_]) -> tuple[float, float]:
        level = light[chosen].mean()
        return signed[chosen].mean() / level, squares[chosen].mean() / level**2

    group = np.arange(len(light)) % GROUPS
    bias, square = errors(group >= 0)
    without = np.array([errors(group != g) for g in range(GROUPS)])
    bias_error, spread = np.sqrt((GROUPS - 1) * without.var(axis=0))
    error = float(np.sqrt(max(square, 0.0)))
    return Accuracy(
        bias=float(bias),
        bias_error=float(bias_error),
        error=error,
        # of a square within its own error the root is not known better than the root of that error
        error_error=float(spread / (2 * error) if error**2 > spread else np.hypot(error, spread**0.5) - error),
        points=len(light),
        paths=PATHS,
    )


def _points(walks: EyeWalks) -> tuple[Hits, Rows]:
    """Hits of eyes over the whole path, and the numbers of those that reflect diffusely."""
    work = Workspace(walks.lights.at([0]))
    hits, _ = start_at_eyes(walks.cams, walks.seed, 0, BATCH, walks.world, work)
    return hits, np.flatnonzero((hits.kind == SURFACE) & (hits.reflectivity > 0).any(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Measuring:
    """Arguments of the batches of points."""

    cells: Cells
    walks: EyeWalks
    settings: GatherSettings
    depth: int
    points: Hits

    def batch(self, rows: Rows) -> tuple[Float64, Float64]:
        """R E at some points, mean of the channels, by paths and by cells, (n, HALVES, n_lights) each."""
        return self._by_paths(rows), self._by_cells(rows)

    def _by_paths(self, rows: Rows) -> Float64:
        walks = self.walks
        work = Workspace(walks.lights)
        hits, walkers = work.hits[0], work.walkers[0]
        n = _repeat(self.points, rows, range(PATHS), hits)
        walkers.walk[:n], walkers.throughput[:n], walkers.step[:n] = np.arange(n), hits.reflectivity[:n], DIFFUSE
        work.sums[:] = 0.0
        left = work.advance(n, walks.world, dimmed=True)
        hits, walkers = work.hits[0], work.walkers[0]
        add_background(hits, walkers, left, walks.background, work.sums)
        choose_steps(hits, walkers, left, False)
        walks.follow(work, left)
        light = work.sums[:n].mean(axis=1, dtype=np.float64)
        return light.reshape(len(rows), HALVES, PATHS // HALVES, -1).mean(axis=2)

    def _by_cells(self, rows: Rows) -> Float64:
        hits = empty_hits(len(rows) * HALVES)
        n, (channels, n_lights) = (
            _repeat(self.points, rows, range(PATHS, PATHS + HALVES), hits),
            self.cells.light.shape[1:],
        )
        out = allocated(
            Gathered, obscurance=(n, 3), skylight=(n if self.settings.obscurance.sky else 0, 3),
            light=(n, LIGHT + channels * n_lights), constant=(n, 3), closeness=n,
        )  # fmt: skip
        rays, tests = room_for_hits(BATCH), room_for_tests(BATCH, n_lights)
        room = room_for_gathering(BATCH, rays, tests, channels, n_lights, self.depth)
        gather_cells(hits, n, self.settings, self.walks.world, self.walks.lights, self.cells, room, out, False)
        light = self._irradiance(out, n) + np.pi * out.constant[:, :, None]
        seen = (light * hits.reflectivity[:, :, None]).mean(axis=1, dtype=np.float64)
        return seen.reshape(len(rows), HALVES, -1)

    def _irradiance(self, out: Gathered, n: int) -> Float32:
        """E[l] by sources, (n, 3, n_lights)."""
        known = np.where(out.light[:, LEVEL, None] > 0, out.light, np.float32(0.0))  # else not written
        light = known[:, LIGHT:].reshape(n, *self.cells.light.shape[1:])
        return light * known[:, COLOUR : COLOUR + 3, None] * self.walks.lights.colour.T[None]
