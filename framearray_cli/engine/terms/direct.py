"""Direct light E_direct[l] at hits: at most one shadow ray per hit, source and light position.

Notation of the kernels: P is a hit, s a source, l a light position. The irradiance of a source at P is its strength
times a geometry factor, cos(theta) / d^2 for a point source and cos(theta) for a directional one.

Three kinds of sources share the queue of shadow rays, and differ in their order. Meshes need one ray per hit, which
serves all light positions: the point that a hit draws on a mesh does not move, and neither do its occluders.
Environments need their hits sorted once by the direction that they draw, because neighbouring hits draw directions far
apart; as a map only turns, one order serves all light positions. All other sources take hits in their order.
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Triple

from ..embree.packets import DIRECTION, ORIGIN, TFAR, occlude, room_in
from ..hits.glass import dim_rays
from ..hits.hits import Hits, lift, ray_origin, reflects, reflects_in_lanes, triple
from ..hits.rays import FROM, NO_RAYS, ORDER, RANK, REACH, TO, Rays
from ..inputs.emitters import Emitters, emitted_colour, kept_point
from ..inputs.lights import DIRECTIONAL, MESH, LightArrays
from ..inputs.maps import map_point, map_share, map_texel
from ..inputs.panes import Sight
from ..inputs.shapes import is_map, is_plain, source_point, vector_and_factor
from ..kernels.kernel import has_rows, index, inlined, kernel, step
from ..kernels.simd import (
    LANES,
    append,
    bits,
    ctz,
    gather,
    lane_numbers,
    load,
    load_row,
    popcount,
    select,
    store,
    store_row,
    triples_at,
)
from .obscurance import BINS, bin_of, sort_rays

# A shadow ray ends at this fraction of the distance to the light: a surface that the light lies on must not hide it.
FAR_END = np.float32(1.0 - 1e-4)
TOGETHER = 2048  # hits; batches hold multiples of it, so that their size does not decide which rays share a packet
# With at most this many light positions a step takes sixteen hits, even those that lie apart.
FEW_LIGHTS = 8


@inlined
def _shines(kind: Int32, strength: Float32, s: int) -> bool:
    """Return True if source s is a mesh that shines at any light position."""
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


@step
def add_emitters(
    hits: Hits, n: int, span: Int32, kind: Int32, strength: Float32, emitters: Emitters, sight: Sight, rays: Rays,
    irradiance: Float32,
) -> int:  # fmt: skip
    """Add the irradiance of all meshes that shine at hits 0 to n - 1; hits that reflect nothing get none.

    Args:
        span, kind, strength: of `LightArrays`.
        rays: scratch; the kernel traces as many rays together as it holds.
        irradiance: (n, channels, n_lights).

    Returns:
        number of shadow rays.
    """
    if not has_rows(emitters.span):
        return 0
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
        for s in range(int(span[0]), int(span[1])):
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


class Sixteen(NamedTuple):
    """Sixteen hits in lanes.

    Attributes:
        at: their numbers.
        wanted: True for hits to light.
        p, g, m: points, geometric and shading normals.
        up: vectors from the points to the origins of rays.
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
    plain, mapped = is_plain(lights, s), is_map(lights, s)
    q = source_point(lights, key, s, plain)
    texel = map_texel(lights.maps, s, key)
    for l in range(n_lights):
        # make room for sixteen rays
        if waiting > capacity - LANES:
            trace_queue(sight, rays, waiting, irradiance)
            total, waiting = total + waiting, 0
        # cos(theta) / d^2 of source s at light position l
        x, y, z, factor = vector_and_factor(lights, s, plain, l, p, g, m, q)
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
            value = factor * lights.strength[s, channel, l]
            if mapped:
                value = value * map_share(lights.maps, s, np.int32(l), texel, factor, channel)
            append(traced, value, rays.value, channel * rays.value.shape[1] + waiting)
        waiting += popcount(traced)
    return waiting, total


@step
def add_maps(hits: Hits, n: int, lights: LightArrays, sight: Sight, rays: Rays, irradiance: Float32) -> int:
    """Add the irradiance of all environments at hits 0 to n - 1, see `direct`; return the number of shadow rays."""
    if not has_rows(lights.maps.tint):
        return 0
    stride, together = ORDER * rays.number.shape[1], min(TOGETHER, room_in(rays.packets))
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for s in range(int(lights.span[0]), int(lights.span[1])):
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
        cell = select(reflects_in_lanes(hits, first + i, first + n), bin_of(x, y, z), np.int32(BINS))
        store(rays.number, to + i, cell)
    sort_rays(rays, (n + LANES - 1) // LANES * LANES)
    return rays.start[BINS - 1]


@inlined
def _geometry_of_lights(hits: Hits, i: int, lights: LightArrays, s: int, l: int) -> tuple[Real, Real, Real, Real]:
    """Vector from hit i to source s at light positions l to l + 15, and the geometry factors of their irradiance.

    See `vector_and_factor`.
    """
    n_lights = lights.lit.shape[1]
    p, g, m = triple(hits.position, i), triple(hits.geometric, i), triple(hits.shading, i)
    same = lane_numbers() * np.int32(0) + np.int32(i)  # q in lanes, rounded as for sixteen hits
    plain = is_plain(lights, s)
    q = source_point(lights, gather(hits.key, same), s, plain)
    x, y, z, factor = vector_and_factor(lights, s, plain, lane_numbers() + np.int32(l), p, g, m, q)
    return x, y, z, select(lane_numbers() < np.int32(n_lights - l), factor, np.float32(0.0))


class _RayStart(NamedTuple):
    """Start of the shadow rays of a hit.

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
    """Append rays to the light positions from l to l + 15 that may reach the hit; return the length of the queue.

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
        value = factor * load(lights.strength, (s * channels + channel) * n_lights + l)
        if is_map(lights, s):
            value = value * map_share(lights.maps, s, lane_numbers() + np.int32(l), start.texel, factor, channel)
        append(reached, value, rays.value, channel * rays.value.shape[1] + waiting)
    return waiting + popcount(reached)


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
        for s in range(int(lights.span[0]), int(lights.span[1])):
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
        for s in range(int(lights.span[0]), int(lights.span[1])):
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
        neighbours: True if sixteen hits in a row lie close together, as native hits do. Their rays to one light
            position stay closer together than the rays of one hit to sixteen positions, and take half the time.

    Returns:
        number of shadow rays.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        for channel in range(channels):
            for l in range(n_lights):
                irradiance[i, channel, l] = 0.0
    span, kind, strength = lights.span, lights.kind, lights.strength
    total: int = add_emitters(hits, n, span, kind, strength, lights.emitters, sight, rays, irradiance)
    if neighbours or n_lights <= FEW_LIGHTS:
        return total + _direct_by_hits(hits, n, lights, sight, rays, irradiance)
    return total + _direct_by_lights(hits, n, lights, sight, rays, irradiance)
