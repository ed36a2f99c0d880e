"""Obscurances with an ambient light of their own for each cell: `method = "local"`.

    L_indirect(P, l) = R(P) I_A(k, l) W(P),        I_A(k, l) = E_indirect(k, l) / (pi W(k))        k: the cell of P

E_indirect(k, l) is the mean over samples of cell k of the light that their links bring, and W(k) the mean of R(y) rho
over the same links. No ray is traced at P but those of W. The background that these rays see with `outside =
"background"`, S, is known at P: links that see it bring nothing then, and W does not count them.
"""

import numpy as np

from framearray_cli.base.arrays import Rgb
from framearray_cli.base.threads import TaskPool

from ...embree.packets import Tracer, room_in
from ...hits.hits import Hits, reflects
from ...hits.rays import NO_RAYS, Rays
from ...inputs.random import CELLS, r2, random_word
from ...kernels.kernel import kernel
from ..ambient.fitted import rho_of
from ..obscurance_rays import ObscuranceSettings
from .gather import COLOUR, LEVEL, LIGHT, Gathered
from .guards import choose_slots, write_guard_ray
from .lookups import GatherScratch
from .samples import Samples
from .sweeps import Members, mean_by_cell
from .table import ALL, CONSTANT, MEAN, NOWHERE, TINT, Cells, find_cell, shifts, side_of

# Cells of this level are read: 4 h_0 wide. Their samples are enough for a mean, and small rooms have several.
LOCAL_LEVEL = 2
# The least W of a cell, beside which its light would be noise.
_LEAST = 1e-3


def obscurance_of_cells(members: Members, samples: Samples, settings: ObscuranceSettings, pool: TaskPool) -> Rgb:
    """W of each cell, (n_cells, 3), by the links of its samples, with all settings that W of hits has.

    Links that meet nothing within d_max count with the average reflectivity; with the background outside, those that
    leave the scene count 0.
    """
    x = np.minimum(samples.length / settings.d_max, 1.0).astype(np.float32)
    openness = np.empty_like(x)
    rho_of(settings.falloff, settings.tau, x, openness)
    value = np.where((x < 1)[:, None], openness[:, None] * samples.reflectivity, settings.average)
    if settings.sky:
        value[np.isinf(samples.length)] = 0.0
    by_sample = np.ascontiguousarray(value, np.float32)[:, :, None]
    found: Rgb = mean_by_cell(members, by_sample, pool)[:, :, 0]
    return found


def per_obscurance(cells: Cells, obscurance: Rgb) -> Cells:
    """The cells with the light that arrives per W, in place of the light that arrives.

    Where W is 0, as if no link meets anything under an open sky, it is that of all surfaces together.

    Args:
        obscurance: (n_cells, 3) W.
    """
    inverse = 1.0 / np.maximum(obscurance.astype(np.float64), _LEAST)
    cells.tint[:, CONSTANT : CONSTANT + 3] *= inverse
    if cells.light.shape[1] == 3:
        cells.light[:] *= inverse[:, :, None]
    else:
        hue = cells.tint[:, TINT : TINT + 3] * inverse
        level = hue @ cells.weights.astype(np.float64)
        cells.light[:] *= level[:, None, None]
        cells.tint[:, TINT : TINT + 3] = hue / level[:, None]
    unknown = ~obscurance.any(axis=1)
    cells.light[unknown], cells.tint[unknown] = cells.light[ALL], cells.tint[ALL]
    cells.tint[:, MEAN] = cells.light.mean(axis=(1, 2), dtype=np.float64)
    return cells


@kernel
def read_cells(
    hits: Hits, n: int, cells: Cells, tracer: Tracer, room: GatherScratch, tests: Rays, out: Gathered
) -> int:
    """Read the light of hits 0 to n - 1 from their cells, times W, which is known, as S is; see `Gathered`.

    Hits are moved within their surfaces by up to half a cell, at random. Returns the number of rays to guards.
    """
    channels, n_lights, capacity = cells.light.shape[1], cells.light.shape[2], room_in(tests.packets)
    # --- loop state ---
    waiting = NO_RAYS  # rays to guards in the queue
    total = NO_RAYS
    # 1. The cell of each hit.
    for i in range(n):
        out.light[i, LEVEL] = 0.0
        room.cell[i] = NOWHERE
        for channel in range(3):
            out.constant[i, channel] = out.skylight[i, channel] if out.skylight.shape[0] else np.float32(0.0)
        if not reflects(hits, i):
            continue
        p, g = hits.position, hits.geometric
        point, normal = (p[i, 0], p[i, 1], p[i, 2]), (g[i, 0], g[i, 1], g[i, 2])
        a, b = r2(random_word(hits.key[i], CELLS), 0)
        along, across = shifts(normal, a, b)
        side = side_of(normal[0], normal[1], normal[2])
        found = find_cell(cells.grid, cells.slots, LOCAL_LEVEL, side, point, along, across)
        room.cell[i] = found
        if cells.other[found] != NOWHERE:
            write_guard_ray(cells.guard, found, point, normal, tests, waiting, i)
            waiting += 1
            if waiting == capacity:
                choose_slots(tracer, tests, waiting, cells.other, room.cell)
                total, waiting = total + waiting, NO_RAYS
    choose_slots(tracer, tests, waiting, cells.other, room.cell)
    # 2. Its light.
    for i in range(n):
        cell = room.cell[i]
        if cell == NOWHERE:
            continue
        mean = np.float32(0.0)
        for channel in range(3):
            w = out.obscurance[i, channel]
            out.light[i, COLOUR + channel] = w * cells.tint[cell, TINT + channel]
            out.constant[i, channel] += w * cells.tint[cell, CONSTANT + channel]
            mean += cells.weights[channel] * out.light[i, COLOUR + channel]
        out.light[i, LEVEL] = mean * cells.tint[cell, MEAN]
        for channel in range(channels):
            factor = out.obscurance[i, channel] if channels == 3 else mean
            for l in range(n_lights):
                at = LIGHT + channel * n_lights + l
                out.light[i, at] = factor * cells.light[cell, channel, l]
        for channel in range(3):
            hue = out.light[i, COLOUR + channel]
            inverse = np.float32(1.0) / mean if mean > np.float32(0.0) else np.float32(0.0)
            out.light[i, COLOUR + channel] = hue * inverse if channels == 1 else np.float32(1.0)
    return total + waiting
