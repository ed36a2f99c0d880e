"""What thin glass leaves of light on any straight ways."""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..embree.packets import room_in, set_ray
from ..inputs.panes import Panes
from ..kernels.kernel import kernel
from .rays import FROM, NO_RAYS, REACH, TO, Rays, room_for_tests
from .through import dim_rays

RAYS = 4096  # traced together


def shares_of_ways(start: Float32, way: Float32, reach: Float32, panes: Panes) -> tuple[Rgb, int]:
    """Find what passes the glass between start and start + reach way, (n, 3); also return the number of rays.

    Args:
        start, way: (n, 3).
        reach: (n,) may be infinite.
    """
    share = np.ones((len(start), 3), np.float32)
    starts, ways, ends = (np.ascontiguousarray(array, np.float32) for array in (start, way, reach))
    rays: int = _dim_ways(starts, ways, ends, panes, room_for_tests(RAYS, 1), share)
    return share, rays


@kernel
def _dim_ways(start: Float32, way: Float32, reach: Float32, panes: Panes, tests: Rays, share: Float32) -> int:
    """Find what passes the glass on straight ways.

    Args:
        start, way, reach: (n, 3), (n, 3) and (n,) from start to start + reach way.
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
                tests.row[FROM + axis, k], tests.row[TO + axis, k] = start[i, axis], way[i, axis]
                tests.value[axis, k] = 1.0
            tests.row[REACH, k] = reach[i]
            set_ray(tests.packets, k, start[i, 0], start[i, 1], start[i, 2], way[i, 0], way[i, 1], way[i, 2], reach[i])
        total += dim_rays(panes, tests, count, np.float32(0.0))
        for k in range(count):
            for channel in range(3):
                share[first + k, channel] = tests.value[channel, k]
    return total
