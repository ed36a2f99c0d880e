"""Building and solving the cells of a job: samples, members, direct light, all bounces.

    E(k)[l] = E_direct(k)[l] + mean over samples i of cell k of R(y_i) E(cell of y_i)[l]

Samples of a cell are summed in the order of `Members`, so the table has the same bits for any number of threads. Cell
ALL is the mean over all samples, of equal weight, including samples of other cells. Light positions are solved in
blocks, which do not depend on the memory that a render may use.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Float64, Int32, Rgb, with_room
from framearray_cli.base.threads import TaskPool

from ...hits.hits import SURFACE, Hits, World, empty_hits
from ...hits.rays import Rays, room_for_tests
from ...inputs.lights import LightArrays
from ...inputs.panes import has_panes
from ...kernels.bundle import bundle
from ...kernels.clock import compile_clock
from ...kernels.kernel import kernel
from ..ambient.intensity import BATCH
from ..direct import direct
from .lookup import (
    ALL,
    COARSEST_READ,
    CONSTANT,
    EDGE_OF_LENGTH,
    LEVELS,
    MEAN,
    TINT,
    Cells,
    Grid,
    find_cells_at,
    write_keys,
)
from .samples import Places, PlaceWork, Samples, SampleWalks, dim_links, draw_samples, find_places

# The light of a bounce has fallen to this share of direct light after the last sweep, at the mean reflectivity.
LEFT_OVER = 0.01
FEWEST_SWEEPS, MOST_SWEEPS = 4, 64
# Cells per task, and samples per partial sum of cell ALL.
_TASK = 4096
_TOGETHER = 4096
# Light positions that are solved together.
LIGHT_BLOCK = 16
# The finest cells have this share of the median length of gather rays.
EDGE_OF_MEDIAN = 1 / 30
# A sample that was found by a ray of half or twice the length weighs 2 to the minus this.
WEIGHT_OF_LEVELS = 1.0
# Links per task.
LINK_BATCH = 1 << 15
# Samples of cells that are weighed together, about.
MEMBERS_TOGETHER = 1 << 18
# Samples are sorted by the cell of this level, so that the samples of a cell lie close together in memory.
SORTING_LEVEL = 1


@bundle
class Members(NamedTuple):
    """The samples of each cell, and what their links meet.

    Attributes:
        first: (n_cells + 1,) samples of cell k: sample[first[k] : first[k + 1]]; cell ALL, which has all, lists none.
        sample: numbers of samples, in rising order within a cell; `weight`: of each in the means of its cell.
        target: (n_samples,) the cell that a sample's link meets, or NOWHERE.
        reflectivity: (n_samples, 3) R there.
    """

    first: Addresses
    sample: Int32
    weight: Float32
    target: Int32
    reflectivity: Rgb


@kernel
def mean_of_samples(members: Members, first: int, n: int, values: Float32, mean: Float32) -> None:
    """Average values of samples, (n_samples, channels, n_lights), over cells first to first + n - 1."""
    for k in range(first, first + n):
        for channel in range(values.shape[1]):
            for l in range(values.shape[2]):
                mean[k, channel, l] = 0.0
        for at in range(members.first[k], members.first[k + 1]):
            i, weight = members.sample[at], members.weight[at]
            for channel in range(values.shape[1]):
                for l in range(values.shape[2]):
                    mean[k, channel, l] += weight * values[i, channel, l]


@kernel
def sweep_cells(members: Members, first: int, n: int, direct: Float32, before: Float32, after: Float32) -> None:
    """Gather the light of one more bounce in cells first to first + n - 1.

    Args:
        direct: (n_cells, 1 or 3, n_lights) E_direct.
        before: (n_cells, 3, n_lights) E of the sweep before; `after`: overwritten.
    """
    channels, n_lights = direct.shape[1], direct.shape[2]
    for k in range(first, first + n):
        for channel in range(3):
            for l in range(n_lights):
                after[k, channel, l] = 0.0
        for at in range(members.first[k], members.first[k + 1]):
            i = members.sample[at]
            target = members.target[i]
            if target < 0:
                continue
            for channel in range(3):
                r = members.weight[at] * members.reflectivity[i, channel]
                for l in range(n_lights):
                    after[k, channel, l] += r * before[target, channel, l]
        for channel in range(3):
            for l in range(n_lights):
                after[k, channel, l] += direct[k, channel if channels == 3 else 0, l]


def _over_cells(n_cells: int, pool: TaskPool, task: Callable[..., None], *arrays: Float32) -> None:
    """Call task(first, n, *arrays) for all cells but ALL, on all threads."""
    starts = range(ALL + 1, n_cells, _TASK)
    list(pool.map(lambda first: task(first, min(_TASK, n_cells - first), *arrays), starts))


def _over_all(
    members: Members, shape: tuple[int, ...], pool: TaskPool, task: Callable[..., None], *arrays: Float32
) -> Float64:
    """The mean over all samples, of that shape, of what task(members, row, 1, *arrays, sums) adds up."""
    n = len(members.target)
    rows = members._replace(
        first=np.append(np.arange(0, n, _TOGETHER), n),
        sample=np.arange(n, dtype=np.int32),
        weight=np.full(n, 1 / max(n, 1), np.float32),
    )
    sums = np.zeros((len(rows.first) - 1, *shape), np.float32)
    list(pool.map(lambda row: task(rows, row, 1, *arrays, sums), range(len(sums))))
    return sums.sum(axis=0, dtype=np.float64)


def mean_by_cell(members: Members, values: Float32, pool: TaskPool) -> Float32:
    """Average values of samples, (n_samples, channels, n_lights), over each cell, (n_cells, channels, n_lights)."""
    mean = np.zeros((len(members.first) - 1, *values.shape[1:]), np.float32)
    _over_cells(len(mean), pool, partial(mean_of_samples, members), values, mean)
    mean[ALL] = _over_all(members, values.shape[1:], pool, mean_of_samples, values)
    return mean


def mean_reflectivity(members: Members) -> Float64:
    """The share of light that one bounce keeps, on average over all samples, (3,), cut at 0.99."""
    met = members.reflectivity[members.target >= 0]
    return np.minimum(met.sum(axis=0, dtype=np.float64) / max(len(members.target), 1), 0.99)


def sweeps_for(reflectivity: Float64) -> int:
    """The number of sweeps for a mean reflectivity, (3,)."""
    most = max(float(reflectivity.max()), 1e-6)
    return min(max(math.ceil(math.log(LEFT_OVER) / math.log(most)), FEWEST_SWEEPS), MOST_SWEEPS)


def solve(members: Members, direct: Float32, pool: TaskPool) -> Float32:
    """The irradiance of all cells with all bounces, (n_cells, 3, n_lights), in units of the lights' colour.

    What the sweeps leave out is the last bounce times r + r^2 + ..., r the mean reflectivity: each further bounce is
    spread almost like the one before, and where no light has come none is added. The number of sweeps depends on r
    only, so that the result is linear in the light.

    Args:
        direct: (n_cells, 1 or 3, n_lights) E_direct.
    """
    r = mean_reflectivity(members)
    before = np.empty((len(direct), 3, direct.shape[2]), np.float32)
    before[:] = direct
    after = np.zeros_like(before)
    dark = np.zeros((-(-len(members.target) // _TOGETHER), *direct.shape[1:]), np.float32)  # of the samples of ALL
    for _ in range(sweeps_for(r)):
        _over_cells(len(direct), pool, partial(sweep_cells, members), direct, before, after)
        after[ALL] = direct[ALL] + _over_all(members, before.shape[1:], pool, sweep_cells, dark, before)
        before, after = after, before
    after -= before  # minus the last bounce
    after *= -(r / (1 - r)).astype(np.float32)[:, None]
    before += after
    return before


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellWork:
    """Arguments of `build_cells`.

    Attributes:
        walks: where samples come from.
        background: (3,) radiance outside the scene.
        count: number of walks.
        edge: h_0, scene units; None: a share of the median length of gather rays, at least `least_edge`.
        threads: number of threads.
    """

    walks: SampleWalks
    background: Rgb
    count: int
    edge: float | None
    threads: int
    least_edge: float = 1e-30


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Built:
    """Cells, and the cost of building them.

    Attributes:
        mean: (n_lights, 3) irradiance E of all samples together; `reflectivity`: (3,) their mean R.
        rays: number of rays.
        shared_s: seconds that do not grow with the number of light positions, compiling left out.
    """

    cells: Cells
    mean: Float64
    reflectivity: Float64
    rays: int
    shared_s: float


def build_cells(work: CellWork) -> Built:
    """Build the cells of a job: only the cell of all surfaces, without light, if no walk meets a second surface."""
    with TaskPool(work.threads, thread_name_prefix="cells") as pool:
        started = time.perf_counter()
        with compile_clock() as clock:
            samples, rays = draw_samples(work.walks, work.count, work.threads)
            if has_panes(work.walks.world.panes):
                rays += dim_links(samples, work.walks.world.panes)
            grid = _grid(samples, work)
            samples = samples.rows(_sorted(grid, samples))
            world = work.walks.world
            places = find_places(PlaceWork(grid=grid, samples=samples, tracer=world.tracer, pool=pool))
            cells = _dark_cells(work, grid, places)
            members = _link(cells, places, samples, world, pool)
        shared_s = time.perf_counter() - started - clock.seconds
        mean, shadow = _light(work, cells, members, samples, pool)
    rays += places.rays
    met = members.reflectivity[members.target >= 0]
    reflectivity = met.sum(axis=0, dtype=np.float64) / max(len(met), 1)
    return Built(cells=cells, mean=mean, reflectivity=reflectivity, rays=rays + shadow, shared_s=shared_s)


def _grid(samples: Samples, work: CellWork) -> Grid:
    """Choose the borders of cells."""
    edge = work.edge or (float(np.median(samples.first_length)) * EDGE_OF_MEDIAN if samples.n else 1.0)
    edge = max(edge, work.least_edge)
    random = np.random.default_rng([work.walks.seed, LEVELS])
    return Grid(edge=edge, jitter=random.random((LEVELS, 3), np.float32))


def _sorted(grid: Grid, samples: Samples) -> Int32:
    """The samples in the order of cells of a fine level: the samples of a cell lie close together in memory."""
    keys = np.empty(samples.n, np.int64)
    write_keys(grid, SORTING_LEVEL, samples.position, samples.geometric, keys)
    return np.argsort(keys, kind="stable").astype(np.int32)


def _dark_cells(work: CellWork, grid: Grid, places: Places) -> Cells:
    """The cells without their light."""
    lights, n = work.walks.lights, len(places.other)
    weights = lights.colour.mean(axis=0, dtype=np.float64) + 1e-6
    return Cells(
        grid=grid,
        slots=places.slots,
        other=places.other,
        guard=places.guard,
        tint=np.zeros((n, 8), np.float32),
        light=with_room((n, lights.channels, lights.n_lights), np.float32, fill=0),
        weights=(weights / weights.sum()).astype(np.float32),
        background=work.background.astype(np.float32),
    )


def _link(cells: Cells, places: Places, samples: Samples, world: World, pool: TaskPool) -> Members:
    """Find the cells that the links of samples meet."""
    target = np.empty(samples.n, np.int32)

    def find(first: int) -> None:
        span = slice(first, first + LINK_BATCH)
        length = samples.length[span]
        find_cells_at(
            cells, len(length), samples.end[span], samples.end_normal[span], length, np.empty(0, np.uint64),
            world.tracer, room_for_tests(BATCH, 1), target[span],
        )  # fmt: skip

    list(pool.map(find, range(0, samples.n, LINK_BATCH)))
    return Members(
        first=places.first,
        sample=places.sample,
        weight=weigh_members(cells.grid, places, samples.first_length),
        target=target,
        reflectivity=samples.reflectivity,
    )


def weigh_members(grid: Grid, places: Places, length: Float32) -> Float32:
    """The weight of each sample in the means of each of its cells; the weights of a cell add up to 1.

    A cell is read by rays of some lengths, more often where such rays end: near an edge of a room rays are shorter than
    in the middle of a wall. So samples that such a ray found count most.

    Args:
        length: (n_samples,) of the ray that found each sample.
    """
    wanted = np.minimum(np.log2(np.maximum(EDGE_OF_LENGTH * length.astype(np.float64) / grid.edge, 1.0)), COARSEST_READ)
    level, first = np.minimum(places.level, COARSEST_READ), places.first
    found: Float32 = np.empty(len(places.sample), np.float32)
    borders = np.searchsorted(first, range(0, len(found), MEMBERS_TOGETHER))
    for a, b in pairwise(np.unique([*borders, len(level)]).tolist()):  # cells a to b - 1
        cell = np.repeat(np.arange(b - a), np.diff(first[a : b + 1]))
        off = wanted[places.sample[first[a] : first[b]]] - level[a:b][cell]
        weight = np.exp2(-WEIGHT_OF_LEVELS * np.abs(off))
        found[first[a] : first[b]] = weight / np.bincount(cell, weight, b - a)[cell]
    return found


def _light(work: CellWork, cells: Cells, members: Members, samples: Samples, pool: TaskPool) -> tuple[Float64, int]:
    """Solve the light of all positions, block by block; return E of cell ALL, and the number of rays."""
    lights = work.walks.lights
    channels, n_lights = lights.channels, lights.n_lights
    light, tint, weights = cells.light, cells.tint, cells.weights
    mean, total, rays = np.zeros((n_lights, 3)), np.zeros((len(tint), 3)), 0
    for first in range(0, n_lights, LIGHT_BLOCK):
        block = range(first, min(first + LIGHT_BLOCK, n_lights))
        by_sample, traced = _direct_light(lights.at(block), work.walks.world, samples, pool, work.threads)
        rays += traced
        own = mean_by_cell(members, by_sample, pool)
        del by_sample  # which takes more memory than all cells
        found = solve(members, own, pool)
        mean[block.start : block.stop] = found[ALL].T * lights.colour[block.start : block.stop]
        total += found.sum(axis=2, dtype=np.float64)
        at = slice(block.start, block.stop)
        light[:, :, at] = found if channels == 3 else np.einsum("kcl,c->kl", found, weights, optimize=False)[:, None]
    tint[:, TINT : TINT + 3] = _tints(total, weights) if channels == 1 else 1.0
    tint[:, MEAN] = light.mean(axis=(1, 2), dtype=np.float64)
    if work.background.any():
        constant = _constant_light(work, members, samples, pool)
        tint[:, CONSTANT : CONSTANT + 3] = constant / np.pi
        mean += constant[ALL]
    return mean, rays


def _tints(total: Float64, weights: Rgb) -> Float64:
    """The colour of the light of each cell, (n_cells, 3), with a mean by weights of 1; grey where there is none."""
    mean = (total @ weights.astype(np.float64))[:, None]
    return np.divide(total, mean, out=np.ones_like(total), where=mean > 0)


def _direct_light(
    lights: LightArrays, world: World, samples: Samples, pool: TaskPool, threads: int
) -> tuple[Float32, int]:
    """E_direct of all samples, (n_samples, channels, n_lights), and the number of shadow rays."""
    out = with_room((samples.n, lights.channels, lights.n_lights), np.float32)
    free: list[Rays] = [room_for_tests(BATCH, lights.n_lights) for _ in range(threads)]
    model = empty_hits(BATCH)
    model.kind[:], model.reflectivity[:] = SURFACE, 1.0

    def light(first: int) -> int:
        n, rays = min(BATCH, samples.n - first), free.pop()
        span = slice(first, first + n)
        here = {name: getattr(samples, name)[span] for name in ("position", "geometric", "shading", "offset")}
        hits: Hits = model._replace(key=np.arange(first, first + BATCH, dtype=np.uint64), **here)
        traced: int = direct(hits, n, lights, world.sight, rays, out[span], True)
        free.append(rays)
        return traced

    return out, sum(pool.map(light, range(0, samples.n, BATCH)))


def _constant_light(work: CellWork, members: Members, samples: Samples, pool: TaskPool) -> Float64:
    """The irradiance of all cells by the background, (n_cells, 3)."""
    escaped = np.isinf(samples.length)[:, None] * samples.reflectivity
    by_sample = np.ascontiguousarray(np.pi * escaped * work.background, np.float32)[:, :, None]
    found = solve(members, mean_by_cell(members, by_sample, pool), pool)
    return found[:, :, 0].astype(np.float64)
