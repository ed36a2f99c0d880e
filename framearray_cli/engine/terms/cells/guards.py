"""Rays that tell on which side of a wall a point is: from above it to the guard of a cell."""

import numpy as np

from framearray_cli.base.arrays import Bytes, Directions, Float32, Int32, Points, Real, Triple

from ...embree.packets import Tracer, is_blocked, occlude, room_in, set_ray
from ...hits.rays import NO_RAYS, Rays
from ...kernels.kernel import inlined, kernel

# Height of guards and of the points that look for them, in edges of the cell: above the curvature of most surfaces.
GUARD_HEIGHT = 0.15
# Columns of guards: a point, and its height above the surface.
HEIGHT, GUARD_COLUMNS = 3, 4
# A ray to a guard ends at this fraction of the way.
_FAR_END = np.float32(1.0 - 1e-3)


@inlined
def write_guard_ray(
    guard: Float32, k: int, point: Triple, normal: Triple, rays: Rays, waiting: int, place: int
) -> None:
    """Write the ray from above a point to guard k into slot `waiting`; `place` is what it is for."""
    height: Real = guard[k, HEIGHT]
    x, y, z = point[0] + height * normal[0], point[1] + height * normal[1], point[2] + height * normal[2]
    set_ray(rays.packets, waiting, x, y, z, guard[k, 0] - x, guard[k, 1] - y, guard[k, 2] - z, _FAR_END)
    rays.place[waiting] = place


@kernel
def choose_slots(tracer: Tracer, rays: Rays, n: int, other: Int32, cells: Int32) -> None:
    """Trace the n queued rays, and give those that do not see the guard of their cell the other slot.

    Args:
        other: see `Cells`; cells: the cell of each place, replaced where a ray is blocked.
    """
    occlude(tracer, rays.packets, n, False)
    for ray in range(n):
        if is_blocked(rays.packets, ray):
            cells[rays.place[ray]] = other[cells[rays.place[ray]]]


@kernel
def see_guards(
    position: Points, normal: Directions, rows: Int32, guard: Float32, tracer: Tracer, rays: Rays, seen: Bytes
) -> None:
    """Write whether point rows[i] sees guard i, for all i, into `seen`."""
    capacity, n = room_in(rays.packets), rows.shape[0]
    for first in range(0, n, capacity):
        m = min(capacity, n - first) + NO_RAYS
        for ray in range(m):
            i, k = rows[first + ray], first + ray
            point = (position[i, 0], position[i, 1], position[i, 2])
            write_guard_ray(guard, k, point, (normal[i, 0], normal[i, 1], normal[i, 2]), rays, ray, k)
        occlude(tracer, rays.packets, m, False)
        for ray in range(m):
            seen[first + ray] = 0 if is_blocked(rays.packets, ray) else 1
