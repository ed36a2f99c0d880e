"""How far light from cells is from that of paths, measured at points that the eyes see.

At each point P rays gather what cells bring, and paths estimate the same without bias, both in two halves. The product
of both halves' differences has no noise on average. Many points with few paths each are best: points differ more than
the mean of some paths is noisy. Errors are those of images: of R E, over its mean.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64, with_room
from framearray_cli.base.threads import TaskPool

from ...hits.hits import SURFACE, Hits, empty_hits
from ...hits.rays import room_for_hits, room_for_tests
from ...inputs.random import lattice_steps
from ..accuracy import Accuracy
from ..ambient.estimate import BATCH, Workspace, add_background, choose_steps
from ..ambient.from_eyes import EyeWalks, start_at_eyes
from ..ambient.walks import DIFFUSE
from ..obscurance_rays import ObscuranceSettings
from .gather import COLOUR, LEVEL, LIGHT, Gathered, GatherSettings, gather_cells, gather_settings
from .lookups import room_for_gathering, room_for_near
from .mirrored import room_for_mirrors
from .table import Cells, at_lights

Rows: TypeAlias = NDArray[np.intp]

POINTS, PATHS, RAYS = 1024, 256, 128  # points; paths and gather rays at each
HALVES = 2
# Light positions that stand for all, at most.
MOST_LIGHTS = 8
# Groups of points whose spread gives the standard errors.
GROUPS = 32
NO_LIGHT = "indirect light was not compared with paths: none arrives at the points"


def compare_with_paths(
    cells: Cells, walks: EyeWalks, obscurance: ObscuranceSettings, depth: int, threads: int
) -> Accuracy | str:
    """Compare the light that cells bring to some points with that of paths.

    Args:
        obscurance: of gather rays, but for their number; `depth`: most mirrors that these follow.

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
    rows = rows[:POINTS]
    if len(rows) < GROUPS:
        return (
            f"indirect light was not compared with paths: expected at least {GROUPS} of {BATCH:,} points in the images "
            f"on surfaces that reflect diffusely, found {len(rows)}"
        )
    measuring = _Measuring(cells=at_lights(cells, at), walks=few, settings=settings, depth=depth, points=points)
    per_batch = BATCH // PATHS
    with TaskPool(threads, thread_name_prefix="cells") as pool:
        found = list(pool.map(measuring.batch, np.array_split(rows, -(-len(rows) // per_batch))))
    return _accuracy(np.concatenate([paths for paths, _ in found]), np.concatenate([read for _, read in found]))


def _accuracy(paths: Float64, read: Float64) -> Accuracy | str:
    """The errors of what was read, against paths, (n_points, HALVES, n_lights) each.

    Standard errors are those of the jackknife over groups of points, which follow each other across the images.
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
    start_at_eyes(walks.cams, walks.seed, 0, BATCH, walks.world, work.hit_packets, work.hits[0], work.walkers[0])
    hits = work.hits[0]
    return hits, np.flatnonzero((hits.kind == SURFACE) & (hits.reflectivity > 0).any(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Measuring:
    """What batches of points are measured with."""

    cells: Cells
    walks: EyeWalks
    settings: GatherSettings
    depth: int
    points: Hits

    def batch(self, rows: Rows) -> tuple[Float64, Float64]:
        """R E at some points, mean of the channels, by paths and by cells, (n, HALVES, n_lights) each."""
        return self._by_paths(rows), self._by_cells(rows)

    def _repeated(self, rows: Rows, times: range, hits: Hits) -> int:
        """Write each point that many times, each time with random numbers of its own; return the number of hits."""
        n = len(rows) * len(times)
        for name in Hits._fields:
            getattr(hits, name)[:n] = np.repeat(getattr(self.points, name)[rows], len(times), axis=0)
        hits.key[:n] += np.tile(np.array(times, np.uint64), len(rows)) * np.uint64(0x9E3779B97F4A7C15 >> 1 | 1)
        return n

    def _by_paths(self, rows: Rows) -> Float64:
        walks = self.walks
        work = Workspace(walks.lights)
        hits, walkers = work.hits[0], work.walkers[0]
        n = self._repeated(rows, range(PATHS), hits)
        walkers.walk[:n], walkers.throughput[:n], walkers.step[:n] = np.arange(n), hits.reflectivity[:n], DIFFUSE
        work.sums[:] = 0.0
        left = work.advance(n, walks.world, dimmed=True)
        hits, walkers = work.hits[0], work.walkers[0]
        add_background(hits, walkers, left, walks.background, work.sums)
        choose_steps(hits, walkers, left, False)
        walks.follow(work, left)
        light = work.sums[:n].mean(axis=1, dtype=np.float64)
        found: Float64 = light.reshape(len(rows), HALVES, PATHS // HALVES, -1).mean(axis=2)
        return found

    def _by_cells(self, rows: Rows) -> Float64:
        hits = empty_hits(len(rows) * HALVES)
        n, (channels, n_lights) = self._repeated(rows, range(PATHS, PATHS + HALVES), hits), self.cells.light.shape[1:]
        out = Gathered(
            obscurance=np.empty((n, 3), np.float32),
            skylight=np.empty((n if self.settings.obscurance.sky else 0, 3), np.float32),
            light=with_room((n, LIGHT + channels * n_lights), np.float32),
            constant=np.empty((n, 3), np.float32),
            closeness=np.empty(n, np.float32),
        )
        near, other = (room_for_near(channels, n_lights) for _ in range(2))
        gather_cells(
            hits, n, self.settings, self.walks.world, self.walks.lights, self.cells, room_for_hits(BATCH),
            room_for_gathering(BATCH), room_for_tests(BATCH, n_lights), (near, other),
            room_for_mirrors(BATCH, self.depth), out, False,
        )  # fmt: skip
        light = self._irradiance(out, n) + np.pi * out.constant[:, :, None]
        seen = (light * hits.reflectivity[:, :, None]).mean(axis=1, dtype=np.float64)
        found: Float64 = seen.reshape(len(rows), HALVES, -1)
        return found

    def _irradiance(self, out: Gathered, n: int) -> Float32:
        """E[l] by sources, (n, 3, n_lights)."""
        known = np.where(out.light[:, LEVEL, None] > 0, out.light, np.float32(0.0))  # else not written
        light = known[:, LIGHT:].reshape(n, *self.cells.light.shape[1:])
        found: Float32 = light * known[:, COLOUR : COLOUR + 3, None] * self.walks.lights.colour.T[None]
        return found
