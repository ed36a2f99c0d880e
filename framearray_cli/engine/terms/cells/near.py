"""Light at the ends of gather rays that are too short for any cell.

Where a ray is shorter than the finest cells are wide, the light at its end Q is found there: direct light by
shadow rays, and other light by gather rays that go on until one is long enough.

    E(Q_1)[l] = E_direct(Q_1)[l] (1 + R(Q_2) + R(Q_2) R(Q_3) + ...) + R(Q_2) ... R(Q_n) E(cell of Q_n)[l]

The points Q_2 to Q_(n-1) lie in the same crack as Q_1, so its direct light stands for theirs.
"""

import numpy as np

from ...embree.packets import intersect
from ...hits.hits import World, record_hits
from ...hits.rays import RANK, Rays
from ...inputs.lights import LightArrays
from ...kernels.kernel import inlined
from ...kernels.simd import LANES, load, store
from ..direct import direct
from ..obscurance_rays import ObscuranceSettings, write_obscurance_rays
from .lookups import GatherScratch, NearHits, near_cell
from .mirrored import MirrorScratch, find_ends
from .table import CONSTANT, MEAN, NOWHERE, TINT, Cells

# Rays that follow one that was too short, at most; the last reads a cell whatever its length.
MOST_STEPS = 4


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
    total = direct(near.hits, n, lights, tracer, tests, near.irradiance, False)
    for k in range(n):
        near.root[k], near.start[k], near.own[k] = k, near.place[k], near.cell[k]
        for channel in range(3):
            near.through[channel, k] = near.series[channel, k] = 1.0
    here, there = near, other
    left = n  # rays that were too short
    for step in range(MOST_STEPS):
        for k in range(left):
            here.rays.place[k] = k
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
        _add_up(cells, k, room, near)
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
        if cell < NOWHERE:
            near.series[channel, root] += near.through[channel, root]


@inlined
def _add_up(cells: Cells, k: int, room: GatherScratch, near: NearHits) -> None:
    """Write what leaves the end of kept ray k, from its direct light and from the cell at the end of its path."""
    channels, n_lights, total_lights = cells.light.shape[1], cells.light.shape[2], near.irradiance.shape[2]
    ray, own, cell = near.start[k], near.own[k], near.end[k]
    missed = cell == NOWHERE
    cell = 0 if missed else cell
    # 1. What has no l.
    for channel in range(3):
        r = room.reflectivity[channel, ray]
        near.hue[k, channel] = r * cells.tint[own, TINT + channel] * cells.tint[own, MEAN]
        arrives = cells.background[channel] if missed else cells.tint[cell, CONSTANT + channel]
        near.constant[k, channel] = r * near.through[channel, k] * arrives
    # 2. R(Q) E(Q)[l], or its mean over channels, sixteen light positions at a time.
    for channel in range(channels):
        of_direct = of_cell = np.float32(0.0)
        if channels == 3:
            r = room.reflectivity[channel, ray]
            of_direct, of_cell = r * near.series[channel, k], r * near.through[channel, k]
        else:
            for other in range(3):
                r = cells.weights[other] * room.reflectivity[other, ray]
                of_direct += r * near.series[other, k]
                of_cell += r * near.through[other, k] * cells.tint[cell, TINT + other]
        for l in range(0, n_lights, LANES):
            direct_at = (k * channels + channel) * total_lights + near.first + l
            found = load(near.irradiance, direct_at) * of_direct
            if not missed:
                found = found + load(cells.light, (cell * channels + channel) * n_lights + l) * of_cell
            store(near.light, (k * channels + channel) * near.light.shape[2] + l, found)
