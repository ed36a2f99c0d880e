"""Shadow rays of hits that lie close together to environments: packets hold rays of nearly one direction.

Every hit draws a direction of its own, so rays of sixteen hits side by side scatter. Two thousand neighbouring hits
have enough of them to fill packets with rays that start near each other and run nearly the same way; as a map only
turns, they do so under every light position. So hits are sorted once by the direction that they draw.
"""

import numpy as np

from framearray_cli.base.arrays import Float32

from ..embree.packets import room_in
from ..hits.hits import Hits, reflects_in_lanes, triple
from ..hits.rays import NO_RAYS, ORDER, RANK, Rays
from ..inputs.lights import LightArrays
from ..inputs.maps import MASK, map_point
from ..inputs.panes import Sight
from ..kernels.kernel import has_rows, inlined, optional_step
from ..kernels.simd import LANES, gather, lane_numbers, load, select, store
from .direct_queue import Sixteen, queue_hits, trace_queue
from .obscurance_rays import CELLS, cell_of, sort_rays

TOGETHER = 2048  # hits; batches hold multiples of it, so that their size does not decide which rays share a packet


@inlined
def is_map(lights: LightArrays, s: int) -> bool:
    """Whether source s is an environment."""
    found: bool = has_rows(lights.maps.tint) and lights.maps.grid[s, MASK] > 0
    return found


@optional_step("lights.maps.tint")
def add_maps(hits: Hits, n: int, lights: LightArrays, sight: Sight, rays: Rays, irradiance: Float32) -> int:
    """Add the irradiance of all environments at hits 0 to n - 1, see `direct`; return the number of shadow rays."""
    stride, together = ORDER * rays.number.shape[1], min(TOGETHER, room_in(rays.packets))
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for s in range(lights.kind.shape[0]):
        if not is_map(lights, s):
            continue
        for first in range(0, n, together):
            count = _sort_hits(hits, first, min(together, n - first), lights, s, rays)
            for i in range(0, count, LANES):
                wanted = lane_numbers() < np.int32(count - i)
                at = select(wanted, load(rays.number, stride + i), np.int32(0)) + np.int32(first)
                p, g, m = triple(hits.position, at), triple(hits.geometric, at), triple(hits.shading, at)
                e = gather(hits.offset, at)
                up = (e * g[0], e * g[1], e * g[2])
                sixteen = Sixteen(at, wanted, p, g, m, up, gather(hits.key, at))
                waiting, total = queue_hits(lights, s, sixteen, sight, rays, irradiance, waiting, total)
    trace_queue(sight, rays, waiting, irradiance)
    return total + waiting


@inlined
def _sort_hits(hits: Hits, first: int, n: int, lights: LightArrays, s: int, rays: Rays) -> int:
    """Sort hits `first` to first + n - 1 by the direction of map s that they draw; see `sort_rays`.

    Returns:
        number of those that reflect light, which come first.
    """
    to = RANK * rays.number.shape[1]
    for i in range(0, n, LANES):
        x, y, z = map_point(lights.maps, s, load(hits.key, first + i))
        cell = select(reflects_in_lanes(hits, first + i, first + n), cell_of(x, y, z), np.int32(CELLS))
        store(rays.number, to + i, cell)
    sort_rays(rays, (n + LANES - 1) // LANES * LANES)
    found: int = rays.start[CELLS - 1]
    return found
