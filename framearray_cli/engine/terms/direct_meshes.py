"""Direct light of surfaces that shine: one shadow ray per hit and mesh, which serves all light positions.

The point that a hit draws does not move, and neither does what hides it: under each light position the same light
arrives, times the strength of the mesh.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real

from ..embree.packets import DIRECTION, ORIGIN, TFAR, occlude, room_in
from ..hits.glass import dim_rays
from ..hits.hits import Hits, reflects_in_lanes
from ..hits.rays import FROM, NO_RAYS, TO, Rays
from ..inputs.emitters import Emitters, emitted_colour, kept_point
from ..inputs.lights import MESH
from ..inputs.panes import Sight
from ..kernels.kernel import index, inlined, optional_step, step
from ..kernels.simd import (
    LANES,
    append,
    bits,
    ctz,
    lane_numbers,
    load,
    load_row,
    popcount,
    store_row,
    triples_at,
)

# A shadow ray ends at this fraction of the distance to the light: a surface that the light lies on must not hide it.
FAR_END = np.float32(1.0 - 1e-4)


@inlined
def _shines(kind: Int32, strength: Float32, s: int) -> bool:
    """Whether source s is a mesh that shines at any light position."""
    if kind[s] != MESH:
        return False
    for channel in range(strength.shape[1]):
        for l in range(strength.shape[2]):
            if strength[s, channel, l] > 0.0:
                return True
    return False


@inlined
def write_packet(rays: Rays, first: int, reach: Real) -> None:
    """Write queued rays first to first + 15 into packets, with their length or lengths."""
    room = rays.row.shape[1]
    for axis in range(3):
        store_row(rays.packets, first, ORIGIN + axis, load(rays.row, (FROM + axis) * room + first))
        store_row(rays.packets, first, DIRECTION + axis, load(rays.row, (TO + axis) * room + first))
    store_row(rays.packets, first, TFAR, reach)


@step
def _trace_meshes(sight: Sight, rays: Rays, n: int, strength: Float32, irradiance: Float32) -> None:
    """Trace the n queued shadow rays, and add the light of those that nothing blocks, at all light positions."""
    for first in range(0, n, LANES):
        write_packet(rays, first, FAR_END)
    occlude(sight.tracer, rays.packets, n, True)
    dim_rays(sight.panes, rays, n, FAR_END)
    n_sources, channels, n_lights = strength.shape
    for first in range(0, n, LANES):
        arrived = bits(~(load_row(rays.packets, first, TFAR) < np.float32(0.0)))
        while arrived != 0:
            ray = first + ctz(arrived)
            arrived &= arrived - 1
            place = rays.place[index(ray)]
            hit, s = place // n_sources, place % n_sources
            for channel in range(channels):
                carried = rays.value[channel, index(ray)]
                for l in range(n_lights):
                    irradiance[index(hit), channel, l] += carried * strength[index(s), channel, l]


@optional_step("emitters.span")
def add_emitters(
    hits: Hits, n: int, kind: Int32, strength: Float32, emitters: Emitters, sight: Sight, rays: Rays,
    irradiance: Float32,
) -> int:  # fmt: skip
    """Add the irradiance of all meshes that shine at hits 0 to n - 1; hits that reflect nothing get none.

    Args:
        kind, strength: of `LightArrays`.
        rays: scratch; the kernel traces as many rays together as it holds.
        irradiance: (n, channels, n_lights).

    Returns:
        number of shadow rays.
    """
    capacity, row, room, n_sources = room_in(rays.packets), rays.row, rays.row.shape[1], kind.shape[0]
    channels = strength.shape[1]
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for i in range(0, n, LANES):
        # points P, their normals, and the offset from P to where rays start
        at, wanted = lane_numbers() + np.int32(i), reflects_in_lanes(hits, i, n)
        p, g, m = triples_at(hits.position, i), triples_at(hits.geometric, i), triples_at(hits.shading, i)
        e, key = load(hits.offset, i), load(hits.key, i)
        up = (e * g[0], e * g[1], e * g[2])
        for s in range(n_sources):
            if not _shines(kind, strength, s):
                continue
            if waiting > capacity - LANES:
                _trace_meshes(sight, rays, waiting, strength, irradiance)
                total, waiting = total + waiting, 0
            # the points y that the hits keep
            kept, to, factor = kept_point(emitters, key, s, p, g, m)
            traced = wanted & (factor > np.float32(0.0))
            if bits(traced) == 0:
                continue
            # rays to them
            for axis in range(3):
                append(traced, p[axis] + up[axis], row, (FROM + axis) * room + waiting)
                append(traced, to[axis] - up[axis], row, (TO + axis) * room + waiting)
            append(traced, at * np.int32(n_sources) + np.int32(s), rays.place, waiting)
            # and the light that they carry per strength
            if channels == 1:
                append(traced, factor, rays.value, waiting)
            else:
                colour = emitted_colour(emitters, kept)
                for channel in range(3):
                    append(traced, factor * colour[channel], rays.value, channel * rays.value.shape[1] + waiting)
            waiting += popcount(traced)
    _trace_meshes(sight, rays, waiting, strength, irradiance)
    return total + waiting
