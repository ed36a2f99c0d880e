"""What glass leaves of the light that gather rays and the links of samples bring."""

import numpy as np

from framearray_cli.base.arrays import Float32

from ...embree.packets import DIRECTION, ORIGIN, TFAR, room_in, set_ray
from ...hits.glass import BEFORE, dim_rays, shares_of_ways
from ...hits.rays import FROM, NO_RAYS, REACH, TO, Rays
from ...inputs.panes import Panes
from ...kernels.kernel import optional_step
from ...kernels.simd import width_of_packets
from .samples import Samples

NEARLY = 1e-3  # a way whose length differs by more from that of its link went through mirrors


@optional_step("panes.optics")
def dim_gather_rays(panes: Panes, rays: Rays, n: int, tests: Rays, share: Float32) -> int:
    """Dim what traced rays 0 to n - 1 bring, by the panes on the way to what they met.

    Args:
        tests: scratch.
        share: (3, >= n) changed: what a ray brings is multiplied by it.

    Returns:
        number of rays.
    """
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


def dim_links(samples: Samples, panes: Panes) -> int:
    """Dim what the links of samples bring by the glass on their ways; ways through mirrors are left as they are.

    Args:
        samples: changes `reflectivity`.

    Returns:
        number of rays.
    """
    start = samples.position + samples.offset[:, None] * samples.geometric
    open_sky = np.isinf(samples.length)
    way = np.where(open_sky[:, None], samples.end, samples.end - start)
    reach = np.where(open_sky, np.float32(np.inf), BEFORE).astype(np.float32)
    share, rays = shares_of_ways(start, way, reach, panes)
    direct = open_sky | (np.abs(np.linalg.norm(way, axis=1) - samples.length) <= NEARLY * samples.length)
    samples.reflectivity[direct] *= share[direct]
    return rays
