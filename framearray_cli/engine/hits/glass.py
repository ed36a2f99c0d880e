"""Rays through thin glass: what share of the light passes all panes on the way, in three channels.

A ray is traced from pane to pane, at most MOST_PANES triangles far. Embree calls nothing back. The way from a hit to
an eye passes panes straight. So a hit behind glass is a hit like any other, and each eye that sees it dims it by the
panes on its own way.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Rgb

from ..embree.packets import (
    DIRECTION,
    HIT_ROWS,
    MASK,
    MISS,
    ORIGIN,
    RAY_ROWS,
    TFAR,
    TNEAR,
    hit_triangle,
    intersect_on,
    is_blocked,
    occlude,
    room_in,
    set_ray,
)
from ..inputs.aov import COVERED, PANE
from ..inputs.cameras import OUTSIDE, Cameras
from ..inputs.panes import PaneArrays, bent_by, colour_at, passed_by, reflectance, step_beyond
from ..kernels.kernel import has_rows, index, inlined, kernel, step
from ..kernels.simd import LANES, store_row, width_of_packets
from .aiming import aim_view
from .hits import SURFACE, Hits
from .rays import FROM, NO_RAYS, REACH, TO, Rays, room_for_tests

MOST_PANES = 32  # triangles of glass that dim a ray; further ones do not
# Rows of `Rays.number`: the rays behind glass, and whether nothing else blocks a ray.
BEHIND, ARRIVES = 0, 1
IDLE = np.float32(-1.0)


@inlined
def pass_panes(panes: PaneArrays, packets: Float32, n: int, first: int, rays: Rays, straight: bool) -> int:
    """Trace rays 0 to n - 1 of packets through all panes up to their ends, and dim what they carry.

    Args:
        packets: with rows for hits; overwritten.
        first: ray k is number j = BEHIND[first + k]: it ends at row REACH of j, and carries `rays.value` of j.
        straight: whether solid bodies let rays pass; nothing is seen straight through them.

    Returns:
        number of rays traced.
    """
    width, total = width_of_packets(), 0
    for _ in range(MOST_PANES):
        intersect_on(panes.tracer, packets, n)
        total += n
        left = 0
        for k in range(n):
            triangle = hit_triangle(panes.tracer, packets, k)
            p, lane = k // width, k % width
            if triangle == MISS:
                packets[p, TFAR, lane] = IDLE
                continue
            j = index(rays.number[BEHIND, first + k])
            d = packets[p, DIRECTION, lane], packets[p, DIRECTION + 1, lane], packets[p, DIRECTION + 2, lane]
            share = passed_by(panes, triangle, reflectance(panes, triangle, d))
            if not straight and bent_by(panes, triangle):
                share = np.float32(0.0)
            colour = colour_at(panes, triangle, packets, k)
            for channel in range(3):
                rays.value[channel, j] *= share * colour[channel]
            packets[p, TNEAR, lane] = packets[p, TFAR, lane] + step_beyond(panes, triangle, d)
            packets[p, TFAR, lane] = rays.row[REACH, j]
            left += 1
        if left == 0:
            break
    return total


@step
def dim_rays(panes: PaneArrays, rays: Rays, n: int, reach: Real) -> int:
    """Dim what the n traced shadow rays carry that nothing blocks, by the panes on their way.

    Args:
        rays: after `occlude`, with their rows; of the packets only row TFAR stays, with its sign.
        reach: where all rays end; 0: at row REACH.

    Returns:
        number of rays traced.
    """
    if not has_rows(panes.optics):
        return 0
    width, row = width_of_packets(), rays.row
    # 1. The rays that arrive, and which of them meet a pane.
    for ray in range(n):
        rays.number[ARRIVES, ray] = 0 if is_blocked(rays.packets, ray) else 1
    occlude(panes.tracer, rays.packets, n, True)
    behind = 0
    for ray in range(n):
        if rays.number[ARRIVES, ray] != 0 and is_blocked(rays.packets, ray):
            rays.number[BEHIND, behind] = ray
            behind += 1
            if reach > 0.0:
                row[REACH, ray] = reach
    # 2. Trace these from pane to pane, in the memory of the packets.
    half = rays.packets.shape[0] // 2
    packets = rays.packets[: 2 * half].reshape(half, HIT_ROWS, rays.packets.shape[2])
    most, total = half * width // LANES * LANES, n
    for first in range(0, behind, most):
        count = min(most, behind - first)
        _clear(packets, count)
        for k in range(count):
            ray = index(rays.number[BEHIND, first + k])
            x, y, z = row[FROM, ray], row[FROM + 1, ray], row[FROM + 2, ray]
            set_ray(packets, k, x, y, z, row[TO, ray], row[TO + 1, ray], row[TO + 2, ray], row[REACH, ray])
        total += pass_panes(panes, packets, count, first, rays, True)
    # 3. Packets as they were, but for the rays themselves.
    _clear(rays.packets, min(2 * behind + 2 * LANES, rays.packets.shape[0] * width))
    for ray in range(n, (n + LANES - 1) // LANES * LANES):
        rays.number[ARRIVES, ray] = 0
    for ray in range((n + LANES - 1) // LANES * LANES):
        rays.packets[ray // width, TFAR, ray % width] = np.float32(1.0) if rays.number[ARRIVES, ray] != 0 else IDLE
    return total


@inlined
def _clear(packets: Float32, n: int) -> None:
    """Clear the packets of rays 0 to n - 1, whose memory held others: no ray has an own time, flags or depth."""
    bits = packets.view(np.int32)
    for first in range(0, n, LANES):
        for number in range(RAY_ROWS):
            store_row(packets, first, number, np.float32(0.0))
        store_row(bits, first, MASK, np.int32(-1))


BEFORE = np.float32(1.0 - 1e-4)  # rays end at this fraction of the way to a hit: glass that lies on it does not count


@inlined
def _aim_before(cams: Cameras, k: int, hits: Hits, i: int, number: int, packets: Float32) -> None:
    """Write a ray of eye k to just before hit i into the packets."""
    o, x, y, z = cams.position, hits.position[i, 0], hits.position[i, 1], hits.position[i, 2]
    reach = np.float32(np.inf)
    if hits.kind[i] == SURFACE:
        x, y, z, reach = x - o[k, 0], y - o[k, 1], z - o[k, 2], BEFORE
    set_ray(packets, number, o[k, 0], o[k, 1], o[k, 2], x, y, z, reach)
    if has_rows(cams.lens):
        aim_view(cams, k, hits, i, number, reach, packets)


@kernel
def transmission_to_eyes(
    cams: Cameras,
    first_eye: int,
    hits: Hits,
    n: int,
    pixel: Int32,
    panes: PaneArrays,
    rays: Rays,
    transmission: Float32,
) -> int:
    """Find what share of the light of hits 0 to n - 1 arrives at eyes first_eye, first_eye + 1, ... that see them.

    Args:
        pixel: (n_eyes, >= n) the pixel of each eye that sees the hit, or OUTSIDE.
        rays: scratch, with rows for hits.
        transmission: (n_eyes, >= n, 3) overwritten; 1 where nothing is in the way, or the eye does not see the hit.

    Returns:
        number of rays.
    """
    capacity = room_in(rays.packets)
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(n):
            for channel in range(3):
                transmission[row, i, channel] = 1.0
            if pixel[row, i] == OUTSIDE:
                continue
            _aim_before(cams, k, hits, i, waiting, rays.packets)
            rays.place[waiting] = row * transmission.shape[1] + i
            waiting += 1
            if waiting == capacity:
                total += _dim(panes, rays, waiting, False, transmission)
                waiting = NO_RAYS
    return total + _dim(panes, rays, waiting, False, transmission)


@kernel
def panes_before(
    cams: Cameras,
    first_eye: int,
    hits: Hits,
    n: int,
    pixel: Int32,
    panes: PaneArrays,
    rays: Rays,
    transmission: Float32,
    named: Int32,
    front: Float32,
) -> int:
    """Find the first pane between eyes first_eye, first_eye + 1, ... and the hits, of 0 to n - 1, that they see.

    Args:
        pixel, rays, transmission: as in `transmission_to_eyes`, which has written `transmission`.
        named: (n_panes, 2) `AovTables.panes`.
        front: (n_eyes, >= n, 2) overwritten: the pane's pair, -1 for none, and the share of the hit that it covers.

    Returns:
        number of rays.
    """
    capacity = room_in(rays.packets)
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(n):
            front[row, i, PANE], front[row, i, COVERED] = -1.0, 0.0
            passed = transmission[row, i, 0] + transmission[row, i, 1] + transmission[row, i, 2]
            if pixel[row, i] == OUTSIDE or passed >= 3.0:
                continue
            _aim_before(cams, k, hits, i, waiting, rays.packets)
            front[row, i, COVERED] = np.float32(1.0) - passed / np.float32(3.0)
            rays.place[waiting] = row * front.shape[1] + i
            waiting += 1
            if waiting == capacity:
                total += _name_panes(panes, rays, waiting, named, front)
                waiting = NO_RAYS
    return total + _name_panes(panes, rays, waiting, named, front)


@inlined
def _name_panes(panes: PaneArrays, rays: Rays, n: int, named: Int32, front: Float32) -> int:
    """Trace the n rays in packets to panes, and note the pair of each; ray k belongs to row place[k] of `front`."""
    packets, width = rays.packets, width_of_packets()
    flat = front.reshape(front.size)
    for k in range(n):
        packets[k // width, TNEAR, k % width] = 0.0
    intersect_on(panes.tracer, packets, n)
    for k in range(n):
        triangle, at = hit_triangle(panes.tracer, packets, k), 2 * rays.place[k]
        if triangle == MISS:
            flat[at + COVERED] = 0.0
            continue
        flat[at + PANE] = named[triangle, 0]
        if named[triangle, 1] != 0:
            flat[at + COVERED] = 1.0
    return n


@kernel
def dim_traced(panes: PaneArrays, rays: Rays, n: int, transmission: Float32) -> int:
    """Dim rays 0 to n - 1 by the panes on the way to what they met.

    Args:
        rays: with traced rays in its packets, which are overwritten.
        transmission: (1, >= n, 3) changed: the share of light that passes each.

    Returns:
        number of rays.
    """
    width = width_of_packets()
    for k in range(n):
        rays.packets[k // width, TFAR, k % width] *= BEFORE
        rays.place[k] = k
    return _dim(panes, rays, n, True, transmission)


@inlined
def _dim(panes: PaneArrays, rays: Rays, n: int, straight: bool, transmission: Float32) -> int:
    """Dim the n rays in packets; ray k belongs to row place[k] of `transmission`. `straight`: see `pass_panes`."""
    packets, width = rays.packets, width_of_packets()
    for k in range(n):
        rays.row[REACH, k] = packets[k // width, TFAR, k % width]
        packets[k // width, TNEAR, k % width] = 0.0
    occlude(panes.tracer, packets, n, True)
    behind = 0
    for k in range(n):
        if not is_blocked(packets, k):
            continue
        p, lane, j = k // width, k % width, index(behind)
        x, y, z = packets[p, ORIGIN, lane], packets[p, ORIGIN + 1, lane], packets[p, ORIGIN + 2, lane]
        dx, dy, dz = packets[p, DIRECTION, lane], packets[p, DIRECTION + 1, lane], packets[p, DIRECTION + 2, lane]
        rays.row[REACH, j], rays.place[j], rays.number[BEHIND, j] = rays.row[REACH, k], rays.place[k], behind
        for channel in range(3):
            rays.value[channel, j] = 1.0
        set_ray(packets, behind, x, y, z, dx, dy, dz, rays.row[REACH, j])
        packets[behind // width, TNEAR, behind % width] = 0.0
        behind += 1
    total: int = n + pass_panes(panes, packets, behind, 0, rays, straight)
    flat = transmission.reshape(transmission.size)
    for k in range(behind):
        for channel in range(3):
            flat[3 * rays.place[k] + channel] *= rays.value[channel, k]
    return total


RAYS = 4096  # traced together


def transmission_along(start: Float32, direction: Float32, reach: Float32, panes: PaneArrays) -> tuple[Rgb, int]:
    """Transmission of thin glass between start and start + reach direction, (n, 3); and the number of rays.

    Args:
        start, direction: (n, 3).
        reach: (n,) may be infinite.
    """
    share = np.ones((len(start), 3), np.float32)
    starts, directions, ends = (np.ascontiguousarray(array, np.float32) for array in (start, direction, reach))
    rays: int = _dim_segments(starts, directions, ends, panes, room_for_tests(RAYS, 1), share)
    return share, rays


@kernel
def _dim_segments(
    start: Float32, direction: Float32, reach: Float32, panes: PaneArrays, tests: Rays, share: Float32
) -> int:
    """Transmission of thin glass along straight segments.

    Args:
        start, direction, reach: (n, 3), (n, 3) and (n,) from start to start + reach direction.
        tests: scratch.
        share: (n, 3) overwritten.

    Returns:
        number of rays.
    """
    capacity, total = room_in(tests.packets), NO_RAYS
    for first in range(0, start.shape[0], capacity):
        count = min(capacity, start.shape[0] - first) + NO_RAYS
        for k in range(count):
            i = first + k
            for axis in range(3):
                tests.row[FROM + axis, k], tests.row[TO + axis, k] = start[i, axis], direction[i, axis]
                tests.value[axis, k] = 1.0
            tests.row[REACH, k] = reach[i]
            x, y, z = direction[i, 0], direction[i, 1], direction[i, 2]
            set_ray(tests.packets, k, start[i, 0], start[i, 1], start[i, 2], x, y, z, reach[i])
        total += dim_rays(panes, tests, count, np.float32(0.0))
        for k in range(count):
            for channel in range(3):
                share[first + k, channel] = tests.value[channel, k]
    return total
