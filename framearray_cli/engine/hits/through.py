"""Rays through thin glass: what share of the light passes all panes on the way, in three channels.

A ray is traced from pane to pane, at most MOST_PANES triangles far. Embree calls nothing back.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Real

from ..embree.packets import (
    DIRECTION,
    HIT_ROWS,
    MASK,
    MISS,
    RAY_ROWS,
    TFAR,
    TNEAR,
    hit_triangle,
    intersect_on,
    is_blocked,
    occlude,
    set_ray,
)
from ..inputs.panes import Panes, bent_by, colour_of, passed_by, reflectance, step_beyond
from ..kernels.kernel import index, inlined, optional_step
from ..kernels.simd import LANES, store_row, width_of_packets
from .rays import FROM, REACH, TO, Rays

MOST_PANES = 32  # triangles of glass that dim a ray; further ones do not
# Rows of `Rays.number`: the rays behind glass, and whether nothing else blocks a ray.
BEHIND, ARRIVES = 0, 1
IDLE = np.float32(-1.0)


@inlined
def pass_panes(panes: Panes, packets: Float32, n: int, first: int, rays: Rays, straight: bool) -> int:
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
            for channel in range(3):
                rays.value[channel, j] *= share * colour_of(panes, triangle, channel)
            packets[p, TNEAR, lane] = packets[p, TFAR, lane] + step_beyond(panes, triangle, d)
            packets[p, TFAR, lane] = rays.row[REACH, j]
            left += 1
        if left == 0:
            break
    return total


@optional_step("panes.optics")
def dim_rays(panes: Panes, rays: Rays, n: int, reach: Real) -> int:
    """Dim what the n traced shadow rays carry that nothing blocks, by the panes on their way.

    Args:
        rays: after `occlude`, with their rows; of the packets only row TFAR stays, with its sign.
        reach: where all rays end; 0: at row REACH.

    Returns:
        number of rays traced.
    """
    width, row = width_of_packets(), rays.row
    # 1. The rays that arrive, and those of them that meet any pane.
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
