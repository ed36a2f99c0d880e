"""Where gather rays land: the cells that they read, and those among them that are too short for any cell.

A short ray meets a surface that may have little in common with the rest of its cell: the other side of a fold, or the
inside of a crack. Such rays are kept, see `near.py`.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Int32, Real, Rgb, with_room

from ...embree.packets import DIRECTION, HIT_ROWS, TFAR, Tracer, decode_hits, hit_triangle, room_in
from ...hits.hits import Hits, empty_hits
from ...hits.rays import NO_RAYS, ORDER, Rays, room_for_hits
from ...inputs.random import CONTINUED, random_word
from ...inputs.surfaces import Surfaces, geometric_normal, position_at, total_at
from ...kernels.kernel import inlined, prefetch
from ...kernels.simd import LANES, integers, load_row, select, store, width_of_packets
from ..obscurance import RAYS_TOGETHER
from .guards import choose_slots, write_guard_ray
from .table import ALL, NOWHERE, TINT, Cells, cell_of_key, coarser_cell, first_slot, key_of, level_of, side_of

# Rays that are kept together: all that are traced together may be too short for cells.
MOST_NEAR = RAYS_TOGETHER
# Rays between those whose triangles are prefetched and those that are looked up; bytes of a triangle and of a slot.
_AHEAD, _TRIANGLE_BYTES, _SLOT_BYTES = 2 * LANES, 36, 16


class GatherScratch(NamedTuple):
    """Arrays for one batch of gather rays.

    Attributes:
        cell: (n_rays,) the cell that each ray reads, NOWHERE, or `near_cell(k)` of ray k that was kept.
        reflectivity: (3, n_rays) R(Q), or 1 where nothing is met, times the reflectivity of mirrors on the way.
        point: (6, LANES) Q and its normal, of sixteen rays.
        level, side: (LANES,) which cell each of them asks for, and `key`: (LANES,) its key.
    """

    cell: Int32
    reflectivity: Float32
    point: Float32
    level: Int32
    side: Int32
    key: Addresses


class NearHits(NamedTuple):
    """Rays that were kept, and the light that they bring.

    Attributes:
        place: (MOST_NEAR,) number of the ray among those traced together; `cell`: the cell that it would read.
        hits: the points Q that they meet.
        rays, room: their packets, then those of one more ray from each Q.
        root: (MOST_NEAR,) the kept ray whose path goes through Q; `start`, `own`: (MOST_NEAR,) `place` and `cell` of
            the rays that paths begin with.
        through: (3, MOST_NEAR) product of the reflectivities of the path so far, that of Q included.
        end: (MOST_NEAR,) the cell at the end of the path, or NOWHERE.
        irradiance: (MOST_NEAR, channels, n_lights) E_direct(Q).
        light: (MOST_NEAR, channels, n_lights or more, a multiple of LANES) what leaves Q, times pi.
        hue, constant: (MOST_NEAR, 3) its colour times its mean over light positions, as the cell has it, and the
            radiance that leaves Q under every l.
    """

    place: Int32
    cell: Int32
    hits: Hits
    rays: Rays
    room: GatherScratch
    root: Int32
    start: Int32
    own: Int32
    through: Rgb
    end: Int32
    irradiance: Float32
    light: Float32
    hue: Rgb
    constant: Rgb


def room_for_gathering(n_rays: int) -> GatherScratch:
    """Allocate arrays for n rays."""
    n = -(-n_rays // LANES) * LANES
    return GatherScratch(
        cell=np.empty(n, np.int32),
        reflectivity=np.empty((3, n), np.float32),
        point=np.empty((6, LANES), np.float32),
        level=np.empty(LANES, np.int32),
        side=np.empty(LANES, np.int32),
        key=np.empty(LANES, np.int64),
    )


def room_for_near(channels: int, n_lights: int) -> NearHits:
    """Allocate arrays for rays to keep."""
    n = MOST_NEAR
    return NearHits(
        place=np.empty(n, np.int32),
        cell=np.empty(n, np.int32),
        hits=empty_hits(n),
        rays=room_for_hits(n),
        room=room_for_gathering(n),
        root=np.empty(n, np.int32),
        start=np.empty(n, np.int32),
        own=np.empty(n, np.int32),
        through=np.empty((3, n), np.float32),
        end=np.empty(n, np.int32),
        irradiance=with_room((n, channels, n_lights), np.float32),
        light=np.empty((n, channels, -(-n_lights // LANES) * LANES), np.float32),
        hue=np.empty((n, 3), np.float32),
        constant=np.empty((n, 3), np.float32),
    )


@inlined
def near_cell(k: int) -> int:
    """What stands in place of the cell of ray k that was kept; its own inverse."""
    return NOWHERE - 1 - k


@inlined
def _keep_ray(rays: Rays, ray: int, cell: int, near: NearHits, k: int) -> None:
    """Keep a traced ray as number k."""
    near.place[k], near.cell[k] = ray, cell
    width = width_of_packets()
    p, lane, q, to = ray // width, ray % width, k // width, k % width
    for row in range(HIT_ROWS):
        near.rays.packets[q, row, to] = rays.packets[p, row, lane]


@inlined
def _prefetch_triangles(surfaces: Surfaces, tracer: Tracer, rays: Rays, first: int) -> None:
    """Prefetch the triangles that sixteen traced rays met."""
    for ray in range(first, first + LANES):
        triangle = hit_triangle(tracer, rays.packets, ray)
        prefetch(surfaces.corners.ctypes.data + _TRIANGLE_BYTES * max(triangle, 0), _TRIANGLE_BYTES)


@inlined
def _write_points(surfaces: Surfaces, tracer: Tracer, rays: Rays, first: int, room: GatherScratch) -> None:
    """Write Q, its normal, R(Q) and the length of sixteen traced rays; their cell is NOWHERE where they met nothing."""
    missed, triangle, u, v = decode_hits(tracer, rays.packets, first)
    dx, dy = load_row(rays.packets, first, DIRECTION), load_row(rays.packets, first, DIRECTION + 1)
    dz = load_row(rays.packets, first, DIRECTION + 2)
    px, py, pz = position_at(surfaces, triangle, u, v)
    nx, ny, nz = geometric_normal(surfaces, triangle, dx, dy, dz)
    total = total_at(surfaces, triangle, u, v)
    store(room.point, 0, px)
    store(room.point, LANES, py)
    store(room.point, 2 * LANES, pz)
    store(room.point, 3 * LANES, nx)
    store(room.point, 4 * LANES, ny)
    store(room.point, 5 * LANES, nz)
    for channel in range(3):
        store(room.reflectivity, channel * room.reflectivity.shape[1] + first, select(missed, 1.0, total[channel]))
    store(rays.value, first, load_row(rays.packets, first, TFAR))
    store(room.cell, first, select(missed, integers(NOWHERE), np.int32(0)))


@inlined
def _write_keys(cells: Cells, rays: Rays, first: int, n: int, room: GatherScratch) -> None:
    """Write the keys of the cells that rays first to first + n - 1 read, and prefetch their places in the table."""
    n_slots, q = cells.slots.shape[0] >> 1, room.point
    for lane in range(n):
        level, side = level_of(cells.grid, rays.value[0, first + lane]), side_of(q[3, lane], q[4, lane], q[5, lane])
        key = key_of(cells.grid, level, side, q[0, lane], q[1, lane], q[2, lane])
        room.level[lane], room.side[lane], room.key[lane] = level, side, key
        prefetch(cells.slots.ctypes.data + _SLOT_BYTES * first_slot(key, n_slots), _SLOT_BYTES)


@inlined
def find_cells(
    hits: Hits, surfaces: Surfaces, tracer: Tracer, cells: Cells, rays: Rays, n: int, first_ray: int, n_rays: int,
    room: GatherScratch, tests: Rays, near: NearHits, reach: float,
) -> int:  # fmt: skip
    """Find the cells that traced rays 0 to n - 1 read, and R(Q); n_rays rows of 16 rays belong to the same hits.

    Args:
        near: keeps rays shorter than `reach`; their cell is then `near_cell(k)`.

    Returns:
        number of rays kept.
    """
    # Loop state
    waiting = NO_RAYS  # rays to guards in the queue
    kept = NO_RAYS  #    rays kept
    for first in range(0, n, LANES):
        # make room for sixteen rays to guards
        if waiting > room_in(tests.packets) - LANES:
            choose_slots(tracer, tests, waiting, cells.other, room.cell)
            waiting = NO_RAYS
        if first + _AHEAD < n:
            _prefetch_triangles(surfaces, tracer, rays, first + _AHEAD)
        _write_points(surfaces, tracer, rays, first, room)
        last = min(n - first, LANES)
        _write_keys(cells, rays, first, last, room)
        for lane in range(last):
            if room.cell[first + lane] == NOWHERE:
                continue
            # the cell of Q
            q = room.point
            point, normal = (q[0, lane], q[1, lane], q[2, lane]), (q[3, lane], q[4, lane], q[5, lane])
            found = cell_of_key(cells.slots, room.key[lane])
            if found == ALL:
                found = coarser_cell(cells.grid, cells.slots, room.level[lane], room.side[lane], point)
            room.cell[first + lane] = found
            short = rays.value[0, first + lane] < reach
            if cells.other[found] == NOWHERE and not short:
                continue
            # the ray as it was written, before rays were sorted by direction: its hit, and its number there
            written = rays.number[ORDER, first + lane]
            k, ray = written // (LANES * n_rays) * LANES + written % LANES, first_ray + written // LANES % n_rays
            if short:
                near.hits.key[kept] = random_word(hits.key[rays.place[k]], CONTINUED + ray)
                _keep_ray(rays, first + lane, found, near, kept)
                room.cell[first + lane] = near_cell(kept)
                kept += 1
            else:  # the queue holds rays to the guards of doubtful cells
                write_guard_ray(cells.guard, found, point, normal, tests, waiting, first + lane)
                waiting += 1
    choose_slots(tracer, tests, waiting, cells.other, room.cell)
    return kept


@inlined
def weight_of(cells: Cells, reflectivity: Float32, cell: int, ray: int, channel: int) -> Real:
    """What the light of a cell is multiplied by: R(Q) of a channel, or the mean of R(Q) c over all channels."""
    if cells.light.shape[1] == 3:
        r: Real = reflectivity[channel, ray]
        return r
    total = np.float32(0.0)
    for other in range(3):
        total += cells.weights[other] * reflectivity[other, ray] * cells.tint[cell, TINT + other]
    return total
