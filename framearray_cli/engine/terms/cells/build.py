"""Building the cells of a job: samples, cells with their members, direct light, all bounces.

Sums have a fixed order, so that the table has the same bits for any number of threads. Light positions are solved in
blocks, which do not depend on the memory that a render may use.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Rgb, with_room

from ...hits.hits import SURFACE, Hits, World, empty_hits
from ...hits.rays import Rays, room_for_tests
from ...inputs.lights import LightArrays, some_lights
from ..ambient.estimate import BATCH
from ..direct import direct
from .places import Places, PlaceWork, find_places
from .samples import Samples, SampleWalks, draw_samples
from .sweeps import Members, mean_by_cell, solve
from .table import ALL, CONSTANT, LEVELS, MEAN, TINT, Cells, Grid, find_targets, write_keys

# Light positions that are solved together.
LIGHT_BLOCK = 16
# The finest cells have this share of the median length of gather rays.
EDGE_OF_MEDIAN = 1 / 30
# Links per task.
LINK_BATCH = 1 << 15
# Samples are sorted by the cell of this level, so that those of a cell lie close together in memory.
SORTING_LEVEL = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellWork:
    """What cells are built of, and how finely.

    Attributes:
        walks: where samples come from.
        background: (3,) radiance outside the scene.
        count: number of walks.
        edge: h_0, scene units; None: a share of the median length of gather rays.
        threads: number of threads.
    """

    walks: SampleWalks
    background: Rgb
    count: int
    edge: float | None
    threads: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Built:
    """Cells, the irradiance E of all samples together, (n_lights, 3), their mean R, (3,), and the rays they took."""

    cells: Cells
    mean: Float64
    reflectivity: Float64
    rays: int


def build_cells(work: CellWork) -> Built | None:
    """Build the cells of a job; None if no walk meets a second surface."""
    samples, rays = draw_samples(work.walks, work.count, work.threads)
    if samples.n == 0:
        return None
    grid = _grid(samples, work)
    with ThreadPoolExecutor(work.threads, thread_name_prefix="cells") as pool:
        samples = samples.rows(_sorted(grid, samples))
        world = work.walks.world
        places = find_places(PlaceWork(grid=grid, samples=samples, tracer=world.tracer, pool=pool))
        cells = _dark_cells(work, grid, places)
        members = _link(cells, places, samples, world, pool)
        cells, mean, shadow = _light(work, cells, members, samples, pool)
    rays += places.rays
    reflectivity = members.reflectivity[members.target >= 0].mean(axis=0, dtype=np.float64)
    return Built(cells=cells, mean=mean, reflectivity=reflectivity, rays=rays + shadow)


def _grid(samples: Samples, work: CellWork) -> Grid:
    """Choose the borders of cells."""
    edge = work.edge or float(np.median(samples.first_length)) * EDGE_OF_MEDIAN
    random = np.random.default_rng([work.walks.seed, LEVELS])
    return Grid(edge=max(edge, 1e-30), jitter=random.random((LEVELS, 3), np.float32))


def _sorted(grid: Grid, samples: Samples) -> Int32:
    """The samples in the order of cells of a fine level, so that those of a cell lie close together in memory."""
    keys = np.empty(samples.n, np.int64)
    write_keys(grid, SORTING_LEVEL, samples.position, samples.geometric, samples.side, False, keys)
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


def _link(cells: Cells, places: Places, samples: Samples, world: World, pool: ThreadPoolExecutor) -> Members:
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
        target=target,
        reflectivity=samples.reflectivity,
        share=places.share,
    )


def _light(
    work: CellWork, cells: Cells, members: Members, samples: Samples, pool: ThreadPoolExecutor
) -> tuple[Cells, Float64, int]:
    """Solve the light of all positions, block by block; return the cells, E of cell ALL, and the number of rays."""
    lights = work.walks.lights
    channels, n_lights = lights.channels, lights.n_lights
    light, tint, weights = cells.light, cells.tint, cells.weights
    mean, total, rays = np.zeros((n_lights, 3)), np.zeros((len(tint), 3)), 0
    for first in range(0, n_lights, LIGHT_BLOCK):
        block = range(first, min(first + LIGHT_BLOCK, n_lights))
        by_sample, traced = _direct_light(some_lights(lights, block), work.walks.world, samples, pool, work.threads)
        rays += traced
        own = mean_by_cell(members, by_sample, pool)
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
    return cells, mean, rays


def _tints(total: Float64, weights: Rgb) -> Float64:
    """The colour of the light of each cell, (n_cells, 3), whose mean by weights is 1; grey where there is none."""
    mean = (total @ weights.astype(np.float64))[:, None]
    found: Float64 = np.divide(total, mean, out=np.ones_like(total), where=mean > 0)
    return found


def _direct_light(
    lights: LightArrays, world: World, samples: Samples, pool: ThreadPoolExecutor, threads: int
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
        hits: Hits = model._replace(**here)
        traced: int = direct(hits, n, lights, world.tracer, rays, out[span], True)
        free.append(rays)
        return traced

    return out, sum(pool.map(light, range(0, samples.n, BATCH)))


def _constant_light(work: CellWork, members: Members, samples: Samples, pool: ThreadPoolExecutor) -> Float64:
    """The irradiance of all cells by the background, (n_cells, 3)."""
    escaped = np.isinf(samples.length)[:, None] * samples.reflectivity
    by_sample = np.ascontiguousarray(np.pi * escaped * work.background, np.float32)[:, :, None]
    return solve(members, mean_by_cell(members, by_sample, pool), pool)[:, :, 0].astype(np.float64)
