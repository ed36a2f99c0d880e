"""Ends of gather rays: the cells that they read, behind mirrors and glass, and rays too short for any cell.

A short ray meets a surface that may have little in common with the rest of its cell: the other side of a fold, or the
inside of a crack. Such rays are kept, see `gather.py`.

Rays that meet mirrors go on, and read the cells that the mirrors show:

    light of a ray = S_1 ... S_n R(Q) E(cell of Q)        S: of the mirrors on the way, Q: where the ray ends

A surface may reflect both ways. Then chance decides, in proportion to the larger of the three channels of each part.
The length of the whole way chooses the cell. Behind the last mirror of a job's depth a mirror counts as diffuse.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Int32, Keys, Real, Rgb

from ...embree.packets import (
    DIRECTION,
    HIT_ROWS,
    ORIGIN,
    TFAR,
    Tracer,
    decode_hits,
    empty_packets,
    hit_triangle,
    intersect,
    room_in,
    set_ray,
)
from ...hits.glass import BEFORE, dim_rays
from ...hits.hits import SURFACE, Hits, World, empty_hits, record_hits
from ...hits.rays import FROM, NO_RAYS, ORDER, REACH, TO, Rays, room_for_hits
from ...inputs.panes import PaneArrays
from ...inputs.random import CONTINUED, MIRRORED, mix, r2, random_word
from ...inputs.surfaces import Surfaces, geometric_normal, position_at, total_at
from ...kernels.bundle import allocated, bundle
from ...kernels.kernel import has_rows, inlined, kernel, prefetch, step
from ...kernels.simd import (
    LANES,
    compress,
    gather,
    integers,
    lane_numbers,
    load_row,
    popcount,
    select,
    store,
    width_of_packets,
)
from ..bounces import mirrored
from ..obscurance import RAYS_TOGETHER
from .lookup import (
    ALL,
    NOWHERE,
    TINT,
    Cells,
    cell_of_key,
    choose_slots,
    coarser_cell,
    first_slot,
    key_of,
    level_of,
    side_of,
    write_guard_ray,
)

# Rays that are kept together: all that are traced together may be too short for cells.
MOST_NEAR = RAYS_TOGETHER
# Rays from a prefetched triangle to the triangle that is looked up; bytes of a triangle and of a slot.
_AHEAD, _TRIANGLE_BYTES, _SLOT_BYTES = 2 * LANES, 36, 16


@bundle
class RayEnds(NamedTuple):
    """Ends of a batch of gather rays.

    Attributes:
        cell: (n_rays,) the cell that each ray reads, NOWHERE, or `near_cell(k)` of ray k that was kept.
        reflectivity: (3, n_rays) R(Q), or 1 where nothing is met, times the reflectivity of mirrors on the way.
        point: (6, LANES) Q and its normal, of sixteen rays.
        level, side: (LANES,) level and side of the cell that each of them reads, and `key`: (LANES,) its key.
    """

    cell: Int32
    reflectivity: Float32
    point: Float32
    level: Int32
    side: Int32
    key: Addresses


class RaySpan(NamedTuple):
    """Traced rays: n rays, rays first_ray to first_ray + n_rays - 1 of each hit."""

    n: int
    first_ray: int
    n_rays: int


@bundle
class NearHits(NamedTuple):
    """Rays that were kept, and the light that they bring.

    Attributes:
        place: (MOST_NEAR,) number of the ray among those traced together; `cell`: the cell that it would read.
        hits: the points Q that they meet.
        rays, ends: their packets, then the packets of one more ray from each Q.
        root: (MOST_NEAR,) the kept ray whose path goes through Q; `start`, `own`: (MOST_NEAR,) `place` and `cell` of
            the rays that paths begin with.
        throughput: (3, MOST_NEAR) product of the reflectivities of the path so far, including Q.
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
    ends: RayEnds
    root: Int32
    start: Int32
    own: Int32
    throughput: Rgb
    end: Int32
    irradiance: Float32
    light: Float32
    hue: Rgb
    constant: Rgb


def room_for_ends(n_rays: int) -> RayEnds:
    """Allocate arrays for n rays."""
    n = -(-n_rays // LANES) * LANES
    return allocated(RayEnds, cell=n, reflectivity=(3, n), point=(6, LANES), level=LANES, side=LANES, key=LANES)


def room_for_near(channels: int, n_lights: int) -> NearHits:
    """Allocate arrays for rays to keep."""
    n = MOST_NEAR
    light = n, channels, -(-n_lights // LANES) * LANES
    return allocated(
        NearHits, place=n, cell=n, hits=empty_hits(n), rays=room_for_hits(n), ends=room_for_ends(n), root=n, start=n,
        own=n, throughput=(3, n), end=n, irradiance=(n, channels, n_lights), light=light, hue=(n, 3), constant=(n, 3),
    )  # fmt: skip


@inlined
def near_cell(k: int) -> int:
    """The number that marks ray k, which was kept, instead of a cell; its own inverse."""
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
def _write_points(surfaces: Surfaces, tracer: Tracer, rays: Rays, first: int, room: RayEnds) -> None:
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
def _write_keys(cells: Cells, rays: Rays, first: int, n: int, room: RayEnds) -> None:
    """Write the keys of the cells that rays first to first + n - 1 read, and prefetch their places in the table."""
    n_slots, q = cells.slots.shape[0] >> 1, room.point
    for lane in range(n):
        level, side = level_of(cells.grid, rays.value[0, first + lane]), side_of(q[3, lane], q[4, lane], q[5, lane])
        key = key_of(cells.grid, level, side, q[0, lane], q[1, lane], q[2, lane])
        room.level[lane], room.side[lane], room.key[lane] = level, side, key
        prefetch(cells.slots.ctypes.data + _SLOT_BYTES * first_slot(key, n_slots), _SLOT_BYTES)


@inlined
def find_cells(
    hits: Hits, world: World, cells: Cells, rays: Rays, span: RaySpan, room: RayEnds, tests: Rays, near: NearHits,
    reach: float,
) -> int:  # fmt: skip
    """Find the cells that traced rays read, and R(Q); `span.n_rays` rows of 16 rays belong to the same hits.

    What rays read is prefetched, unlike in `find_cells_at`.

    Args:
        near: keeps rays shorter than `reach`; their cell is then `near_cell(k)`.

    Returns:
        number of rays kept.
    """
    surfaces, tracer = world.surfaces, world.sight.tracer
    n, first_ray, n_rays = span
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
    """The weight of the light of a cell: R(Q) of a channel, or the mean of R(Q) c over all channels."""
    if cells.light.shape[1] == 3:
        return reflectivity[channel, ray]
    total = np.float32(0.0)
    for other in range(3):
        total += cells.weights[other] * reflectivity[other, ray] * cells.tint[cell, TINT + other]
    return total


@step
def dim_gather_rays(panes: PaneArrays, rays: Rays, n: int, tests: Rays, share: Float32) -> int:
    """Dim the light of traced rays 0 to n - 1 by the panes on their way.

    Args:
        tests: scratch.
        share: (3, >= n) weight of the light of a ray, changed.

    Returns:
        number of rays.
    """
    if not has_rows(panes.optics):
        return 0
    width, capacity, total = width_of_packets(), room_in(tests.packets), NO_RAYS
    for first in range(0, n, capacity):
        count = min(capacity, n - first) + NO_RAYS
        for k in range(count):
            p, lane = (first + k) // width, (first + k) % width
            reach = rays.packets[p, TFAR, lane] * BEFORE
            for axis in range(3):
                tests.row[FROM + axis, k] = rays.packets[p, ORIGIN + axis, lane]
                tests.row[TO + axis, k] = rays.packets[p, DIRECTION + axis, lane]
                tests.value[axis, k] = 1.0
            tests.row[REACH, k] = reach
            x, y, z = tests.row[FROM, k], tests.row[FROM + 1, k], tests.row[FROM + 2, k]
            set_ray(tests.packets, k, x, y, z, tests.row[TO, k], tests.row[TO + 1, k], tests.row[TO + 2, k], reach)
        total += dim_rays(panes, tests, count, np.float32(0.0))
        for k in range(count):
            for channel in range(3):
                share[channel, first + k] *= tests.value[channel, k]
    return total


@bundle
class MirrorScratch(NamedTuple):
    """Rays that met mirrors; without mirrors `depth` is 0, and all arrays are empty.

    Attributes:
        depth: most mirrors on the way of a ray.
        ray: (n_rays,) number of the ray among those traced together; `left`: rows of rays that go on.
        met: (n_rays, HIT_ROWS) the ray and its hit as they were traced.
        weight: (n_rays, 3) S_1 ... S_n R(Q), over the probability of the choices; without R(Q) where nothing is met.
        length: (n_rays,) of the way so far.
        key: (n_rays,) random word of the next choice.
        packets: of reflected rays; `hits`: what they meet.
    """

    depth: int
    ray: Int32
    left: Int32
    met: Float32
    weight: Rgb
    length: Float32
    key: Keys
    packets: Float32
    hits: Hits


def room_for_mirrors(n_rays: int, depth: int) -> MirrorScratch:
    """Allocate arrays for n rays, of which all may meet mirrors."""
    n = n_rays if depth else 0
    return allocated(
        MirrorScratch, depth=depth, ray=n + LANES, left=n, met=(n, HIT_ROWS), weight=(n, 3), length=n, key=n,
        packets=empty_packets(n, HIT_ROWS), hits=empty_hits(n),
    )  # fmt: skip


@bundle
class GatherScratch(NamedTuple):
    """One thread's arrays for gather rays.

    Attributes:
        rays, ends: packets of rays, and where they end.
        tests: rays that are only tested for being blocked.
        near, next: rays too short for cells, and those that follow them.
        mirrors: rays that meet mirrors.
    """

    rays: Rays
    ends: RayEnds
    tests: Rays
    near: NearHits
    next: NearHits
    mirrors: MirrorScratch


def room_for_gathering(n_rays: int, rays: Rays, tests: Rays, channels: int, n_lights: int, depth: int) -> GatherScratch:
    """Allocate arrays for n rays.

    Args:
        rays, tests: packets, which may serve other rays in between.
        depth: most mirrors on the way of a ray; 0 in a scene without mirrors.
    """
    return GatherScratch(
        rays=rays,
        ends=room_for_ends(n_rays),
        tests=tests,
        near=room_for_near(channels, n_lights),
        next=room_for_near(channels, n_lights),
        mirrors=room_for_mirrors(min(n_rays, RAYS_TOGETHER), depth),
    )


@kernel
def find_ends(
    hits: Hits, world: World, cells: Cells, rays: Rays, span: RaySpan, room: RayEnds, tests: Rays, near: NearHits,
    reach: float, mirrors: MirrorScratch,
) -> tuple[int, int]:  # fmt: skip
    """Find the cells that rays read, like `find_cells`, behind mirrors where rays meet any.

    Returns:
        number of rays kept, and of reflected rays.
    """
    n_mirrored = reflected = NO_RAYS
    if mirrors.depth > 0:
        n_mirrored, reflected = _follow_mirrors(hits, world, rays, span, mirrors)
    kept = find_cells(hits, world, cells, rays, span, room, tests, near, reach)
    _put_back(rays, n_mirrored, mirrors, room.reflectivity)
    return kept, reflected


@inlined
def _follow_mirrors(hits: Hits, world: World, rays: Rays, span: RaySpan, room: MirrorScratch) -> tuple[int, int]:
    """Follow traced rays that met mirrors; their packets then contain their ends and their lengths.

    Returns:
        number of rays that met mirrors, and of reflected ones.
    """
    surfaces, tracer = world.surfaces, world.sight.tracer
    n, first_ray, n_rays = span
    # Loop state
    found = NO_RAYS  # rays that met mirrors
    total = NO_RAYS  # reflected rays
    for first in range(0, n, LANES):
        missed, triangle, _, _ = decode_hits(tracer, rays.packets, first)
        at, nothing = gather(surfaces.material, triangle) * np.int32(3), np.float32(0.0)
        mirrors = (gather(surfaces.specular, at) > nothing) | (gather(surfaces.specular, at + np.int32(1)) > nothing)
        mirrors = mirrors | (gather(surfaces.specular, at + np.int32(2)) > nothing)
        mirrors = mirrors & ~missed & (lane_numbers() < np.int32(n - first))
        compress(mirrors, lane_numbers() + np.int32(first), room.ray, found)
        found += popcount(mirrors)
    for k in range(found):
        _start(hits, rays, first_ray, n_rays, room, k)
    waiting = found
    for bounce in range(room.depth + 1):
        if waiting == 0:
            break
        record_hits(world, room.packets, waiting, True, room.hits)
        sent = NO_RAYS
        for i in range(waiting):
            if _goes_on(room, i, bounce, sent):
                sent += 1
            else:
                _put_hit(rays, room, i)
        intersect(tracer, room.packets, sent, False, 0.0)
        total, waiting = total + sent, sent
    return found, total


@inlined
def _start(hits: Hits, rays: Rays, first_ray: int, n_rays: int, room: MirrorScratch, k: int) -> None:
    """Keep ray k as it was traced, and begin its way."""
    ray = room.ray[k]
    written = rays.number[ORDER, ray]
    hit = rays.place[written // (LANES * n_rays) * LANES + written % LANES]
    room.key[k] = random_word(hits.key[hit], MIRRORED + first_ray + written // LANES % n_rays)
    room.left[k], room.length[k] = k, 0.0
    for channel in range(3):
        room.weight[k, channel] = 1.0
    width = width_of_packets()
    for row in range(HIT_ROWS):
        value = rays.packets[ray // width, row, ray % width]
        room.met[k, row] = value
        room.packets[k // width, row, k % width] = value


@inlined
def _goes_on(room: MirrorScratch, i: int, bounce: int, to: int) -> bool:
    """Return True if the ray at hit i is reflected: write it into slot `to`, not above i; else complete its weight."""
    k, r, s = room.left[i], room.hits.reflectivity, room.hits.specular
    if room.hits.kind[i] != SURFACE:
        return False
    diffuse, mirror = max(r[i, 0], r[i, 1], r[i, 2]), max(s[i, 0], s[i, 1], s[i, 2])
    both, nothing = diffuse + mirror, np.float32(0.0)
    if not mirror > nothing or bounce == room.depth:
        for channel in range(3):
            room.weight[k, channel] *= r[i, channel] + s[i, channel]
        return False
    a, _ = r2(room.key[k], 0)
    if not a * both < mirror:
        for channel in range(3):
            room.weight[k, channel] *= r[i, channel] * (both / diffuse)
        return False
    for channel in range(3):
        room.weight[k, channel] *= s[i, channel] * (both / mirror)
    room.key[k], room.left[to] = mix(room.key[k]), k
    width = width_of_packets()
    room.length[k] += room.packets[i // width, TFAR, i % width]
    g, p = room.hits.geometric, room.hits.position
    x, y, z = mirrored(room.hits.incoming[i], room.hits.shading[i], g[i])
    e = room.hits.offset[i]
    ox, oy, oz = p[i, 0] + e * g[i, 0], p[i, 1] + e * g[i, 1], p[i, 2] + e * g[i, 2]
    set_ray(room.packets, to, ox, oy, oz, x, y, z, np.float32(np.inf))
    return True


@inlined
def _put_hit(rays: Rays, room: MirrorScratch, i: int) -> None:
    """Write the end of a way, at hit i, into the packet of the ray that it began with."""
    width, k = width_of_packets(), room.left[i]
    ray = room.ray[k]
    for row in range(DIRECTION, HIT_ROWS):
        rays.packets[ray // width, row, ray % width] = room.packets[i // width, row, i % width]
    rays.packets[ray // width, TFAR, ray % width] += room.length[k]


@inlined
def _put_back(rays: Rays, n: int, room: MirrorScratch, reflectivity: Float32) -> None:
    """Restore the packets of the n rays that met mirrors, and give each its weight, instead of R(Q)."""
    width = width_of_packets()
    for k in range(n):
        ray = room.ray[k]
        for row in range(HIT_ROWS):
            rays.packets[ray // width, row, ray % width] = room.met[k, row]
        for channel in range(3):
            reflectivity[channel, ray] = room.weight[k, channel]
