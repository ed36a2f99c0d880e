"""Indirect light by paths, in place of cells: `indirect.exact`, for references.

From each hit as many paths go out as it would have gather rays. A path has direct light under every l at each vertex,
and goes on by chance, without end and without clamping. Its mean is right; its noise is several times that of a ray
that reads a cell. Hits have three numbers per l, since light from different places has different colours.
"""

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Rgb, with_room

from ...hits.hits import SURFACE, Hits, World
from ...inputs.lights import LightArrays, pad_lights
from ..ambient.estimate import BATCH, Workspace, add_background, choose_steps
from ..ambient.walks import DIFFUSE, MAX_BOUNCES
from .gather import COLOUR, LEVEL, LIGHT, Gathered
from .table import LEVELS, NOWHERE, Cells, Grid, empty_slots

# Random numbers of the paths of a hit: multiples of this, which is odd, added to its key.
_NEXT = np.uint64(0x9E3779B97F4A7C15 >> 1 | 1)


class PathScratch:
    """One thread's arrays for paths.

    Attributes:
        work: walks, and their sums of light by sources; `constant`: (BATCH, 3, 1) those of the background.
    """

    def __init__(self, lights: LightArrays) -> None:
        self.work = Workspace(lights)
        self.constant = np.empty((BATCH, 3, 1), np.float32)


def coloured(lights: LightArrays) -> LightArrays:
    """The same lights with three channels."""
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


def _follow(
    hits: Hits,
    rows: NDArray[np.intp],
    paths: range,
    world: World,
    lights: LightArrays,
    background: Rgb,
    scratch: PathScratch,
) -> tuple[Float32, Float32]:
    """Follow some paths from each of some hits; return sums of irradiance, by sources and by the background."""
    work, constant = scratch.work, scratch.constant
    start, walkers = work.hits[0], work.walkers[0]
    n = len(rows) * len(paths)
    for name in Hits._fields:
        getattr(start, name)[:n] = np.repeat(getattr(hits, name)[rows], len(paths), axis=0)
    start.key[:n] += np.tile(np.array(paths, np.uint64) + np.uint64(1), len(rows)) * _NEXT
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
