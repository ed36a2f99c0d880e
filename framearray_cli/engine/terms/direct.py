"""Direct light E_direct[l] at hits: at most one shadow ray per hit, source and light position.

Notation of the kernels: P is a hit, s a source, l a light position. The irradiance of a source at P is its strength
times a geometry factor, cos(theta) / d^2 for a point source and cos(theta) for a directional one.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Triple

from ..embree.packets import room_in
from ..hits.hits import Hits, lift, ray_origin, reflects, reflects_in_lanes, triple
from ..hits.rays import FROM, NO_RAYS, REACH, TO, Rays
from ..inputs.lights import DIRECTIONAL, MESH, LightArrays
from ..inputs.maps import map_share, map_texel
from ..inputs.panes import Sight
from ..inputs.shapes import source_in_lanes, source_point, vector_and_factor
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import (
    LANES,
    append,
    gather,
    lane_numbers,
    load,
    popcount,
    select,
    store,
    triples_at,
)
from .direct_maps import add_maps, is_map
from .direct_meshes import FAR_END, add_emitters
from .direct_queue import Sixteen, queue_hits, trace_queue

# With at most this many light positions a step takes sixteen hits, even those that lie apart.
FEW_LIGHTS = 8


@inlined
def _geometry_of_lights(hits: Hits, i: int, lights: LightArrays, s: int, l: int) -> tuple[Real, Real, Real, Real]:
    """Vector from hit i to source s at light positions l to l + 15, and the geometry factors of their irradiance.

    See `vector_and_factor`.
    """
    n_lights = lights.lit.shape[1]
    p, g, m = triple(hits.position, i), triple(hits.geometric, i), triple(hits.shading, i)
    same = lane_numbers() * np.int32(0) + np.int32(i)  # q in lanes, which round as those of sixteen hits do
    q = source_point(lights, gather(hits.key, same), s)
    x, y, z, factor = vector_and_factor(lights, s, source_in_lanes(lights, s, l), p, g, m, q)
    return x, y, z, select(lane_numbers() < np.int32(n_lights - l), factor, np.float32(0.0))


class _RayStart(NamedTuple):
    """Where the shadow rays of a hit start.

    Attributes:
        origin: the point, slightly above the hit.
        up: vector from the hit to that point.
        first_value: index of the hit's first value in the flat array of irradiances.
        texel: of the source's map, if it has one.
    """

    origin: Triple
    up: Triple
    first_value: int
    texel: int


@inlined
def _queue(
    lights: LightArrays, s: int, l: int, to: Triple, factor: Real, start: _RayStart, rays: Rays, waiting: int
) -> int:
    """Append rays to those of light positions l to l + 15 that may reach the hit; return the length of the queue.

    Rays start slightly above the hit. A ray to a point source aims from there too: otherwise it would end that far
    beyond the source, and a wall that the source lies on would hide it.

    Args:
        to: vectors from the hit to the source, with their geometry factors `factor`; see `_geometry_of_lights`.
        start: where the rays start.
        waiting: number of rays in the queue.
    """
    channels, n_lights = lights.strength.shape[1], lights.lit.shape[1]
    row, room = rays.row, rays.row.shape[1]
    (x, y, z), origin, up = to, start.origin, start.up
    reached = factor > np.float32(0.0)
    # from the start of the ray to the source
    if lights.kind[s] != DIRECTIONAL:
        x, y, z = x - up[0], y - up[1], z - up[2]
    # the ray
    store(row, FROM * room + waiting, origin[0])
    store(row, (FROM + 1) * room + waiting, origin[1])
    store(row, (FROM + 2) * room + waiting, origin[2])
    append(reached, x, row, TO * room + waiting)
    append(reached, y, row, (TO + 1) * room + waiting)
    append(reached, z, row, (TO + 2) * room + waiting)
    store(row, REACH * room + waiting, np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END)
    # the irradiance that it carries if nothing blocks it, and where that is added
    append(reached, lane_numbers() + np.int32(start.first_value + l), rays.place, waiting)
    for channel in range(channels):
        strength = load(lights.strength, (s * channels + channel) * n_lights + l)
        tint = map_share(lights.maps, s, start.texel, factor, channel)
        append(reached, factor * strength * tint, rays.value, channel * rays.value.shape[1] + waiting)
    found: int = waiting + popcount(reached)
    return found


@inlined
def _direct_by_hits(hits: Hits, n: int, lights: LightArrays, sight: Sight, rays: Rays, irradiance: Float32) -> int:
    """`direct` for hits that lie close together, or few light positions: sixteen hits per step."""
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for i in range(0, n, LANES):
        # points P, their normals, and the offset from P to where rays start
        at, wanted = lane_numbers() + np.int32(i), reflects_in_lanes(hits, i, n)
        p, g, m = triples_at(hits.position, i), triples_at(hits.geometric, i), triples_at(hits.shading, i)
        e = load(hits.offset, i)
        up = (e * g[0], e * g[1], e * g[2])
        key = load(hits.key, i)
        sixteen = Sixteen(at, wanted, p, g, m, up, key)
        for s in range(lights.kind.shape[0]):
            if lights.kind[s] == MESH or is_map(lights, s):
                continue
            waiting, total = queue_hits(lights, s, sixteen, sight, rays, irradiance, waiting, total)
    trace_queue(sight, rays, waiting, irradiance)
    of_maps: int = add_maps(hits, n, lights, sight, rays, irradiance)
    return total + waiting + of_maps


@inlined
def _direct_by_lights(hits: Hits, n: int, lights: LightArrays, sight: Sight, rays: Rays, irradiance: Float32) -> int:
    """`direct` for hits that lie apart: sixteen light positions per step."""
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    capacity = room_in(rays.packets)
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for i in range(n):
        if not reflects(hits, i):
            continue
        for s in range(lights.kind.shape[0]):
            if lights.kind[s] == MESH:
                continue
            texel = map_texel(lights.maps, s, hits.key[i])
            start = _RayStart(ray_origin(hits, i), lift(hits, i), i * channels * n_lights, texel)
            for l in range(0, n_lights, LANES):
                # make room for sixteen rays
                if waiting > capacity - LANES:
                    trace_queue(sight, rays, waiting, irradiance)
                    total, waiting = total + waiting, 0
                # cos(theta) / d^2 of positions l to l + 15
                x, y, z, factor = _geometry_of_lights(hits, i, lights, s, l)
                waiting = _queue(lights, s, l, (x, y, z), factor, start, rays, waiting)
    trace_queue(sight, rays, waiting, irradiance)
    return total + waiting


@kernel
def direct(
    hits: Hits, n: int, lights: LightArrays, sight: Sight, rays: Rays, irradiance: Float32, neighbours: bool
) -> int:
    """Compute the irradiance E_direct of each light position at hits 0 to n - 1.

    A source counts only in front of both normals; behind one it costs no ray. Hits that reflect nothing get 0.

    Args:
        rays: scratch; the kernel traces as many rays together as it holds.
        irradiance: (n, channels, n_lights), overwritten; in units of `lights.colour`.
        neighbours: whether sixteen hits in a row lie close together, as native hits do. Their rays to one light
            position stay closer than those of one hit to sixteen positions, and take half the time.

    Returns:
        number of shadow rays.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        for channel in range(channels):
            for l in range(n_lights):
                irradiance[i, channel, l] = 0.0
    total: int = add_emitters(hits, n, lights.kind, lights.strength, lights.emitters, sight, rays, irradiance)
    if neighbours or n_lights <= FEW_LIGHTS:
        return total + _direct_by_hits(hits, n, lights, sight, rays, irradiance)
    return total + _direct_by_lights(hits, n, lights, sight, rays, irradiance)
