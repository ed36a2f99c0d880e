"""Shadow rays of sixteen hits to one source: from factors to a queue, from the queue to packets."""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Triple

from ..embree.packets import TFAR, occlude, room_in
from ..hits.glass import dim_rays
from ..hits.rays import FROM, REACH, TO, Rays
from ..inputs.lights import DIRECTIONAL, LightArrays
from ..inputs.maps import map_share, map_texel
from ..inputs.panes import Sight
from ..inputs.shapes import source_at, source_point, vector_and_factor
from ..kernels.kernel import index, inlined, step
from ..kernels.simd import LANES, append, bits, ctz, load, load_row, popcount, store
from .direct_meshes import FAR_END, write_packet


class Sixteen(NamedTuple):
    """Sixteen hits in lanes.

    Attributes:
        at: their numbers.
        wanted: whether they are to be lit.
        p, g, m: points, geometric and shading normals.
        up: vectors from the points to where rays start.
        key: random keys.
    """

    at: Any
    wanted: Any
    p: Triple
    g: Triple
    m: Triple
    up: Triple
    key: Any


@step
def trace_queue(sight: Sight, rays: Rays, n: int, irradiance: Float32) -> None:
    """Trace the n queued shadow rays and add the irradiance of those that nothing blocks, dimmed by panes."""
    room = rays.row.shape[1]
    # rays into packets
    for first in range(0, n, LANES):
        write_packet(rays, first, load(rays.row, REACH * room + first))
    occlude(sight.tracer, rays.packets, n, True)
    dim_rays(sight.panes, rays, n, np.float32(0.0))
    # add to E_direct what rays carry that nothing blocks; idle lanes count as blocked
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    flat = irradiance.reshape(irradiance.size)
    for first in range(0, n, LANES):
        arrived = bits(~(load_row(rays.packets, first, TFAR) < np.float32(0.0)))
        while arrived != 0:
            ray = first + ctz(arrived)
            arrived &= arrived - 1
            place = rays.place[index(ray)]
            for channel in range(channels):
                flat[index(place + channel * n_lights)] += rays.value[channel, index(ray)]


@inlined
def queue_hits(
    lights: LightArrays,
    s: int,
    hits: Sixteen,
    sight: Sight,
    rays: Rays,
    irradiance: Float32,
    waiting: int,
    total: int,
) -> tuple[int, int]:
    """Queue the shadow rays of sixteen hits to source s at all light positions, and trace the queue where it is full.

    Args:
        waiting: number of rays in the queue.
        total: number of rays traced.

    Returns:
        the same numbers now.
    """
    channels, n_lights, room, row = irradiance.shape[1], irradiance.shape[2], rays.row.shape[1], rays.row
    at, wanted, p, g, m, up, key = hits
    capacity = room_in(rays.packets)
    q = source_point(lights, key, s)
    texel = map_texel(lights.maps, s, key)
    for l in range(n_lights):
        # make room for sixteen rays
        if waiting > capacity - LANES:
            trace_queue(sight, rays, waiting, irradiance)
            total, waiting = total + waiting, 0
        # cos(theta) / d^2 of source s at light position l
        x, y, z, factor = vector_and_factor(lights, s, source_at(lights, s, l), p, g, m, q)
        # queue the rays of hits that the source may reach
        traced = wanted & (factor > np.float32(0.0))
        if bits(traced) == 0:
            continue
        to, from_point = (x, y, z), np.float32(0.0 if lights.kind[s] == DIRECTIONAL else 1.0)
        for axis in range(3):
            append(traced, p[axis] + up[axis], row, (FROM + axis) * room + waiting)
            append(traced, to[axis] - from_point * up[axis], row, (TO + axis) * room + waiting)
        store(row, REACH * room + waiting, np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END)
        # with the irradiance that each carries
        append(traced, at * np.int32(channels * n_lights) + np.int32(l), rays.place, waiting)
        for channel in range(channels):
            tint = map_share(lights.maps, s, texel, factor, channel)
            value = factor * lights.strength[s, channel, l] * tint
            append(traced, value, rays.value, channel * rays.value.shape[1] + waiting)
        waiting += popcount(traced)
    return waiting, total
