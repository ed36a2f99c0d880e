"""Building the cells of a job: samples, cells with their members, direct light, all bounces.

Sums have a fixed order, so that the table has the same bits for any number of threads. Light positions are solved in
blocks, which do not depend on the memory that a render may use.
"""

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Rgb, with_room
from framearray_cli.base.threads import TaskPool

from ...hits.hits import SURFACE, Hits, World, empty_hits
from ...hits.rays import Rays, room_for_tests
from ...inputs.lights import LightArrays
from ...inputs.panes import has_panes
from ...kernels.clock import compile_clock
from ..ambient.estimate import BATCH
from ..direct import direct
from .glass import dim_links
from .places import Places, PlaceWork, find_places
from .samples import Samples, SampleWalks, draw_samples
from .sweeps import Members, mean_by_cell, solve
from .table import (
    ALL,
    COARSEST_READ,
    CONSTANT,
    EDGE_OF_LENGTH,
    LEVELS,
    MEAN,
    TINT,
    Cells,
    Grid,
    find_targets,
    write_keys,
)

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
# Samples are sorted by the cell of this level, so that those of a cell lie close together in memory.
SORTING_LEVEL = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellWork:
    """What cells are built of, and how finely.

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
    """Cells, and what they took.

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
    """The samples in the order of cells of a fine level, so that those of a cell lie close together in memory."""
    keys = np.empty(samples.n, np.int64)
    write_keys(grid, SORTING_LEVEL, samples.position, samples.side, keys)
    order: Int32 = np.argsort(keys, kind="stable").astype(np.int32)
    return order


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
        find_targets(
            cells, samples.end[span], samples.end_normal[span], samples.end_side[span], samples.length[span],
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
    """The colour of the light of each cell, (n_cells, 3), whose mean by weights is 1; grey where there is none."""
    mean = (total @ weights.astype(np.float64))[:, None]
    found: Float64 = np.divide(total, mean, out=np.ones_like(total), where=mean > 0)
    return found


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
