"""Light at the ends of gather rays that are too short for any cell.

Where a ray is shorter than the finest cells are wide, the light at its end Q is found there: direct light by
shadow rays, and other light by gather rays that go on until one is long enough.

    E(Q_1)[l] = E_direct(Q_1)[l] + R(Q_2) E_direct(Q_2)[l] + ... + R(Q_2) ... R(Q_n) E(cell of Q_n)[l]
"""

import numpy as np

from ...embree.packets import intersect
from ...hits.hits import World, record_hits
from ...hits.rays import NO_RAYS, RANK, Rays
from ...inputs.lights import LightArrays
from ...inputs.panes import Sight
from ...kernels.kernel import inlined
from ...kernels.simd import LANES, load, store
from ..direct import direct
from ..obscurance_rays import ObscuranceSettings, write_obscurance_rays
from .lookups import GatherScratch, NearHits, near_cell
from .mirrored import MirrorScratch, find_ends
from .table import CONSTANT, MEAN, NOWHERE, TINT, Cells

# Rays that follow one that was too short, at most; the last reads a cell whatever its length.
MOST_STEPS = 4
# The mean over light positions that stands for that of a cell without light, to whose surfaces light may come all the
# same: above 0, so that the light of the path counts, and below all else, so that it colours no other light.
_DIMMEST = np.float32(1e-20)


@inlined
def light_near(
    world: World, lights: LightArrays, cells: Cells, n: int, once: ObscuranceSettings, reach: float,
    room: GatherScratch, tests: Rays, near: NearHits, other: NearHits, mirrors: MirrorScratch,
) -> int:  # fmt: skip
    """Find the light of kept rays 0 to n - 1.

    Args:
        once: settings of one ray per hit that does not end.
        reach: rays shorter than this are too short.
        room: of the rays; R(Q) is read from it.
        tests, other, mirrors: scratch.

    Returns:
        number of rays traced.
    """
    if n == 0:
        return 0
    tracer = world.tracer
    record_hits(world, near.rays.packets, n, False, near.hits)
    for k in range(n):
        near.root[k], near.start[k], near.own[k] = k, near.place[k], near.cell[k]
        for channel in range(3):
            near.through[channel, k] = room.reflectivity[channel, near.place[k]]
        for channel in range(near.light.shape[1]):
            for l in range(near.light.shape[2]):
                near.light[k, channel, l] = 0.0
    total = NO_RAYS
    here, there = near, other
    left = n  # rays that were too short
    for step in range(MOST_STEPS):
        # direct light of the points, and one more ray from each
        total += direct(here.hits, left, lights, Sight(tracer, world.panes), tests, here.irradiance, False)
        for k in range(left):
            here.rays.place[k] = k
            _add_direct(cells, here, k, near)
        write_obscurance_rays(here.hits, here.rays, left, 0, 1, once, False)
        intersect(tracer, here.rays.packets, left, False)
        total += left
        shortest = reach if step + 1 < MOST_STEPS else 0.0
        kept, reflected = find_ends(
            here.hits, world, cells, here.rays, left, 0, 1, here.room, tests, there, shortest, mirrors
        )  # fmt: skip
        total += reflected
        for k in range(left):
            _go_on(here, k, near, there)
        if kept == 0:
            break
        record_hits(world, there.rays.packets, kept, False, there.hits)
        here, there, left = there, here, kept
    for k in range(n):
        _add_end(cells, k, room, near)
    return total


@inlined
def _go_on(here: NearHits, k: int, near: NearHits, there: NearHits) -> None:
    """Note what the ray from point k met, for the kept ray that the point belongs to."""
    root, ray = here.root[k], here.rays.number[RANK, k]
    cell = here.room.cell[ray]
    if cell < NOWHERE:
        there.root[near_cell(cell)] = root
    else:
        near.end[root] = cell
    for channel in range(3):
        near.through[channel, root] *= here.room.reflectivity[channel, ray]


@inlined
def _add_direct(cells: Cells, here: NearHits, k: int, near: NearHits) -> None:
    """Add the direct light at point k to that of the kept ray that the point belongs to."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    root = here.root[k]
    for channel in range(channels):
        weight = near.through[channel, root]
        if channels == 1:
            weight = np.float32(0.0)
            for other in range(3):
                weight += cells.weights[other] * near.through[other, root]
        for l in range(0, n_lights, LANES):
            to = (root * channels + channel) * near.light.shape[2] + l
            found = load(here.irradiance, (k * channels + channel) * n_lights + l) * weight
            store(near.light, to, load(near.light, to) + found)


@inlined
def _add_end(cells: Cells, k: int, room: GatherScratch, near: NearHits) -> None:
    """Add the light of the cell at the end of the path of kept ray k."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    own, cell = near.own[k], near.end[k]
    missed = cell == NOWHERE
    cell = 0 if missed else cell
    # 1. What has no l.
    for channel in range(3):
        r = room.reflectivity[channel, near.start[k]]
        dark = cells.tint[own, MEAN] <= 0.0
        near.hue[k, channel] = r * (_DIMMEST if dark else cells.tint[own, TINT + channel] * cells.tint[own, MEAN])
        arrives = cells.background[channel] if missed else cells.tint[cell, CONSTANT + channel]
        near.constant[k, channel] = near.through[channel, k] * arrives
    # 2. Light by sources, or its mean over channels, sixteen light positions at a time.
    if missed:
        return
    for channel in range(channels):
        weight = near.through[channel, k]
        if channels == 1:
            weight = np.float32(0.0)
            for other in range(3):
                weight += cells.weights[other] * near.through[other, k] * cells.tint[cell, TINT + other]
        for l in range(0, n_lights, LANES):
            to = (k * channels + channel) * near.light.shape[2] + l
            found = load(cells.light, (cell * channels + channel) * n_lights + l) * weight
            store(near.light, to, load(near.light, to) + found)
