"""How far light from cells is from that of paths, measured at some points that the eyes see.

At each point P, rays gather what cells say leaves Q towards P, and one path from each Q estimates the same without
bias. Their mean difference, over two halves of the rays, gives the error of cells at P: products of halves have no
noise on average. This is the correction of two-level Monte Carlo methods, used as a measurement.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64

from ...hits.hits import SURFACE, Hits
from ...hits.rays import room_for_tests
from ...inputs.lights import LightArrays, some_lights
from ..ambient.estimate import BATCH, Workspace, add_background, choose_steps
from ..ambient.from_eyes import EyeWalks, start_at_eyes
from ..ambient.walks import DIFFUSE
from .samples import sides
from .table import CONSTANT, NOWHERE, TINT, Cells, at_lights, find_targets

Rows: TypeAlias = NDArray[np.intp]

POINTS, RAYS = 128, 1024
# Light positions that stand for all, at most.
MOST_LIGHTS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Error of light from cells, over the mean indirect light.

    Attributes:
        bias: signed mean over points and light positions; `bias_error`: its standard error.
        error: root mean square over points and light positions; `error_error`: its standard error.
    """

    bias: float
    bias_error: float
    error: float
    error_error: float


def compare_with_paths(cells: Cells, walks: EyeWalks, threads: int) -> Accuracy | None:
    """Compare the light that cells bring to some points with that of paths; None where there is none."""
    n_lights = walks.lights.n_lights
    at = sorted(set(np.linspace(0, n_lights - 1, MOST_LIGHTS).round().astype(int).tolist()))
    few = EyeWalks(
        cams=walks.cams, seed=walks.seed + 1, paths=None, world=walks.world, lights=some_lights(walks.lights, at),
        background=walks.background,
    )  # fmt: skip
    cells = at_lights(cells, at)
    points, rows = _points(few)
    rows = rows[:POINTS]
    if len(rows) < 2:
        return None
    per_batch = BATCH // RAYS

    def measure(first: int) -> tuple[Float64, Float64]:
        return _residuals(cells, few, points, rows[first : first + per_batch])

    with ThreadPoolExecutor(threads, thread_name_prefix="cells") as pool:
        found = list(pool.map(measure, range(0, len(rows), per_batch)))
    halves = np.concatenate([residual for residual, _ in found])  # (n_points, 2, n_lights)
    mean = float(np.concatenate([light for _, light in found]).mean())
    if mean <= 0:
        return None
    signed = -halves.mean(axis=(1, 2)) / mean
    squares = halves.prod(axis=1).mean(axis=1) / mean**2
    error = float(np.sqrt(max(squares.mean(), 0.0)))
    spread = float(squares.std(ddof=1)) / len(squares) ** 0.5
    return Accuracy(
        bias=float(signed.mean()),
        bias_error=float(signed.std(ddof=1)) / len(signed) ** 0.5,
        error=error,
        error_error=spread / (2 * error) if error**2 > spread else spread**0.5 / 2,
    )


def _points(walks: EyeWalks) -> tuple[Hits, Rows]:
    """Hits of eyes over the whole path, and the numbers of those that reflect diffusely."""
    work = Workspace(some_lights(walks.lights, [0]))
    start_at_eyes(walks.cams, walks.seed, 0, BATCH, walks.world, work.hit_packets, work.hits[0], work.walkers[0])
    hits = work.hits[0]
    return hits, np.flatnonzero((hits.kind == SURFACE) & (hits.reflectivity > 0).any(axis=1))


def _residuals(cells: Cells, walks: EyeWalks, points: Hits, rows: Rows) -> tuple[Float64, Float64]:
    """Path minus cell at some points: mean of each half of the rays and of the channels, (n, 2, n_lights); and the
    mean light of paths, (n, n_lights).
    """
    work, world = Workspace(walks.lights), walks.world
    n = len(rows) * RAYS
    hits, walkers = work.hits[0], work.walkers[0]
    for name in Hits._fields:
        getattr(hits, name)[:n] = np.repeat(getattr(points, name)[rows], RAYS, axis=0)
    hits.key[:n] += np.tile(np.arange(RAYS, dtype=np.uint64), len(rows)) * np.uint64(0x9E3779B97F4A7C15 >> 1 | 1)
    start = hits.position[:n].copy()
    walkers.walk[:n], walkers.throughput[:n], walkers.step[:n] = np.arange(n), 1.0, DIFFUSE
    work.sums[:] = 0.0
    n = work.advance(n, world)
    hits, walkers = work.hits[0], work.walkers[0]
    read = _read(cells, hits, n, start, walks)
    add_background(hits, walkers, n, walks.background, work.sums)
    choose_steps(hits, walkers, n, False)
    walks.follow(work, n)
    light = work.sums[:n].mean(axis=1, dtype=np.float64).reshape(len(rows), 2, RAYS // 2, -1)
    residual = light - read.mean(axis=1, dtype=np.float64).reshape(light.shape)
    return residual.mean(axis=2), light.mean(axis=(1, 2))


def _read(cells: Cells, hits: Hits, n: int, start: Float32, walks: EyeWalks) -> Float32:
    """What cells say leaves hits 0 to n - 1, times pi, (n, 3, n_lights)."""
    surface = hits.kind[:n] == SURFACE
    length = np.where(surface, np.linalg.norm(hits.position[:n] - start, axis=1), np.inf).astype(np.float32)
    normal, target = np.ascontiguousarray(hits.geometric[:n]), np.empty(n, np.int32)
    find_targets(
        cells, hits.position[:n], normal, sides(normal), length, walks.world.tracer, room_for_tests(BATCH, 1), target
    )
    r = (hits.reflectivity[:n] + hits.specular[:n])[:, :, None]
    light = cells.light[target] * cells.tint[target, TINT : TINT + 3, None] * _colour(walks.lights)
    constant = np.pi * cells.tint[target, CONSTANT : CONSTANT + 3, None]
    outside = np.float32(np.pi) * walks.background[None, :, None]
    found: Float32 = np.where((target == NOWHERE)[:, None, None], outside, r * (light + constant))
    return found


def _colour(lights: LightArrays) -> Float32:
    """The unit of irradiance, (1, 3, n_lights)."""
    return lights.colour.T[None]
