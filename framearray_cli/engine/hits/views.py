"""What eyes see of hits through thin glass, and what dims the rays that mirrors reflect.

The way from a hit to an eye passes panes straight. So a hit behind glass is a hit like any other, and each eye that
sees it dims it by the panes on its own way.
"""

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Int32

from ..embree.packets import (
    DIRECTION,
    MISS,
    ORIGIN,
    TFAR,
    TNEAR,
    hit_triangle,
    intersect_on,
    is_blocked,
    occlude,
    room_in,
    set_ray,
)
from ..inputs.cameras import OUTSIDE, Cameras
from ..inputs.marks import COVERED, PANE
from ..inputs.panes import Panes
from ..kernels.kernel import index, inlined, kernel
from ..kernels.simd import width_of_packets
from .aiming import aim_view
from .hits import SURFACE, Hits
from .rays import NO_RAYS, REACH, Rays
from .through import BEHIND, pass_panes

BEFORE = np.float32(1.0 - 1e-4)  # rays end at this fraction of the way to a hit: glass that lies on it does not count


@kernel
def views_through(
    cams: Cameras, first_eye: int, hits: Hits, n: int, pixel: Int32, panes: Panes, rays: Rays, through: Float32
) -> int:
    """Find what share of the light of hits 0 to n - 1 arrives at eyes first_eye, first_eye + 1, ... that see them.

    Args:
        pixel: (n_eyes, >= n) the pixel of each eye that sees the hit, or OUTSIDE.
        rays: scratch, with rows for hits.
        through: (n_eyes, >= n, 3) overwritten; 1 where nothing is in the way, or the eye does not see the hit.

    Returns:
        number of rays.
    """
    capacity, o = room_in(rays.packets), cams.position
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(n):
            for channel in range(3):
                through[row, i, channel] = 1.0
            if pixel[row, i] == OUTSIDE:
                continue
            x, y, z = hits.position[i, 0], hits.position[i, 1], hits.position[i, 2]
            reach = np.float32(np.inf)
            if hits.kind[i] == SURFACE:
                x, y, z, reach = x - o[k, 0], y - o[k, 1], z - o[k, 2], BEFORE
            set_ray(rays.packets, waiting, o[k, 0], o[k, 1], o[k, 2], x, y, z, reach)
            aim_view(cams, k, hits, i, waiting, reach, rays.packets)
            rays.place[waiting] = row * through.shape[1] + i
            waiting += 1
            if waiting == capacity:
                total += _dim(panes, rays, waiting, False, through)
                waiting = NO_RAYS
    return total + _dim(panes, rays, waiting, False, through)


@kernel
def panes_before(
    cams: Cameras,
    first_eye: int,
    hits: Hits,
    n: int,
    pixel: Int32,
    panes: Panes,
    rays: Rays,
    through: Float32,
    pair: Int32,
    whole: Bytes,
    front: Float32,
) -> int:
    """Find the first pane on the way of eyes first_eye, first_eye + 1, ... to those of hits 0 to n - 1 that they see.

    Args:
        pixel, rays, through: as in `views_through`, which has written `through`.
        pair, whole: `pane_pair` and `whole` of `Marks`.
        front: (n_eyes, >= n, 2) overwritten: the pane's pair, -1 for none, and the share of the hit that it covers.

    Returns:
        number of rays.
    """
    capacity, o = room_in(rays.packets), cams.position
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(n):
            front[row, i, PANE], front[row, i, COVERED] = -1.0, 0.0
            passed = through[row, i, 0] + through[row, i, 1] + through[row, i, 2]
            if pixel[row, i] == OUTSIDE or passed >= 3.0:
                continue
            x, y, z = hits.position[i, 0], hits.position[i, 1], hits.position[i, 2]
            reach = np.float32(np.inf)
            if hits.kind[i] == SURFACE:
                x, y, z, reach = x - o[k, 0], y - o[k, 1], z - o[k, 2], BEFORE
            set_ray(rays.packets, waiting, o[k, 0], o[k, 1], o[k, 2], x, y, z, reach)
            aim_view(cams, k, hits, i, waiting, reach, rays.packets)
            front[row, i, COVERED] = np.float32(1.0) - passed / np.float32(3.0)
            rays.place[waiting] = row * front.shape[1] + i
            waiting += 1
            if waiting == capacity:
                total += _name_panes(panes, rays, waiting, pair, whole, front)
                waiting = NO_RAYS
    return total + _name_panes(panes, rays, waiting, pair, whole, front)


@inlined
def _name_panes(panes: Panes, rays: Rays, n: int, pair: Int32, whole: Bytes, front: Float32) -> int:
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
        flat[at + PANE] = pair[triangle]
        if whole[triangle]:
            flat[at + COVERED] = 1.0
    return n


@kernel
def dim_traced(panes: Panes, rays: Rays, n: int, through: Float32) -> int:
    """Dim rays 0 to n - 1 by the panes on the way to what they met.

    Args:
        rays: with traced rays in its packets, which are overwritten.
        through: (1, >= n, 3) changed: the share of light that passes each.

    Returns:
        number of rays.
    """
    width = width_of_packets()
    for k in range(n):
        rays.packets[k // width, TFAR, k % width] *= BEFORE
        rays.place[k] = k
    return _dim(panes, rays, n, True, through)


@inlined
def _dim(panes: Panes, rays: Rays, n: int, straight: bool, through: Float32) -> int:
    """Dim the n rays in packets; ray k belongs to row place[k] of `through`. `straight`: see `pass_panes`."""
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
    flat = through.reshape(through.size)
    for k in range(behind):
        for channel in range(3):
            flat[3 * rays.place[k] + channel] *= rays.value[channel, k]
    return total
