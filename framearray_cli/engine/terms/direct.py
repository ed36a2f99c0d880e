"""Direct light: the irradiance of every light position at a hit, one shadow ray a hit a source a light position."""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Triple

from ..embree.packets import DIRECTION, ORIGIN, TFAR, Tracer, occlude
from ..hits.hits import Hits, lift, ray_origin, reflecting, reflects, triple
from ..hits.rays import Rays
from ..inputs.lights import DIRECTIONAL, LightArrays
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, bits, compress, ctz, lane_numbers, load, popcount, select, sqrt, store, triples_at

# A shadow ray ends this share of its length before the light, so that a light on a surface is not hidden by it.
FAR_END = np.float32(1.0 - 1e-4)
# Rows of queued rays: origin, vector to the light, how far along it.
FROM, TO, REACH = 0, 3, 6
ALL = (1 << LANES) - 1
# Up to so many light positions, sixteen hits are worked on at a time instead of sixteen positions.
FEW = 8


@inlined
def _facing(
    kind: int, x: Real, y: Real, z: Real, p: Triple, g: Triple, m: Triple, lit: Real
) -> tuple[Real, Real, Real, Real]:
    """Vectors from points p to a source, given where it is or where it shines to, and geometry factors; see `_look`."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    sign, from_point = (-one, nothing) if kind == DIRECTIONAL else (one, one)
    x, y, z = sign * x - from_point * p[0], sign * y - from_point * p[1], sign * z - from_point * p[2]
    cosine = x * m[0] + y * m[1] + z * m[2]
    in_front = (cosine > nothing) & (x * g[0] + y * g[1] + z * g[2] > nothing)
    factor = cosine * lit
    if kind != DIRECTIONAL:
        square = x * x + y * y + z * z
        factor = factor / (square * sqrt(square))
    return x, y, z, select(in_front, factor, nothing)


@inlined
def _look(hits: Hits, i: int, lights: LightArrays, s: int, l: int) -> tuple[Real, Real, Real, Real]:
    """Vector from hit i to source s at light positions l to l + 15, and the geometry factors of their irradiance.

    The factor is cos(theta) / d^2 for a point source, whose vector ends at the source, and cos(theta) for a
    directional one, whose vector has length 1. It is 0 where the source does not shine, is behind either normal, or
    is exactly at the hit.
    """
    n_lights = lights.lit.shape[1]
    at = 3 * s * n_lights + l
    x, y = load(lights.vector, at), load(lights.vector, at + n_lights)
    z, lit = load(lights.vector, at + 2 * n_lights), load(lights.lit, s * n_lights + l)
    p, g, m = triple(hits.position, i), triple(hits.geometric, i), triple(hits.shading, i)
    x, y, z, factor = _facing(lights.kind[s], x, y, z, p, g, m, lit)
    return x, y, z, select(lane_numbers() < np.int32(n_lights - l), factor, np.float32(0.0))


@inlined
def look(hits: Hits, i: int, lights: LightArrays, s: int, row: Float32, value: Float32) -> None:
    """Write vectors (rows TO of `row`) and geometry factors (row 0 of `value`) of all light positions."""
    for l in range(0, lights.lit.shape[1], LANES):
        x, y, z, factor = _look(hits, i, lights, s, l)
        store(row, TO * row.shape[1] + l, x)
        store(row, (TO + 1) * row.shape[1] + l, y)
        store(row, (TO + 2) * row.shape[1] + l, z)
        store(value, l, factor)


class _Start(NamedTuple):
    """Where shadow rays of a hit start.

    Attributes:
        origin: the point.
        up: vector from the hit to it.
        place: of the hit's first value in the flat array of irradiances.
    """

    origin: Triple
    up: Triple
    place: int


@inlined
def _queue(
    lights: LightArrays, s: int, l: int, to: Triple, factor: Real, start: _Start, rays: Rays, waiting: int
) -> None:
    """Append rays to light positions l to l + 15; what comes next replaces those that do not count.

    They start a little above the hit; those to a point aim at it from there, else they would end as far beyond it, and
    a wall that it is on would hide it.

    Args:
        to: vectors from the hit to the source; `factor`: geometry factors; see `_look`.
    """
    (x, y, z), origin, up = to, start.origin, start.up
    channels = lights.strength.shape[1]
    if lights.kind[s] != DIRECTIONAL:
        x, y, z = x - up[0], y - up[1], z - up[2]
    n_lights, room, row = lights.lit.shape[1], rays.row.shape[1], rays.row
    store(row, FROM * room + waiting, origin[0])
    store(row, (FROM + 1) * room + waiting, origin[1])
    store(row, (FROM + 2) * room + waiting, origin[2])
    store(row, TO * room + waiting, x)
    store(row, (TO + 1) * room + waiting, y)
    store(row, (TO + 2) * room + waiting, z)
    store(row, REACH * room + waiting, np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END)
    store(rays.place, waiting, lane_numbers() + np.int32(start.place + l))
    for channel in range(channels):
        strength = load(lights.strength, (s * channels + channel) * n_lights + l)
        store(rays.value, channel * rays.value.shape[1] + waiting, factor * strength)


@kernel
def _settle(tracer: Tracer, rays: Rays, n: int, irradiance: Float32) -> None:
    """Trace the queued shadow rays and add what is not blocked."""
    room, packet = rays.row.shape[1], rays.packets.shape[1] * LANES
    for first in range(0, n, LANES):
        at = (first >> 4) * packet
        for axis in range(3):
            store(rays.packets, at + (ORIGIN + axis) * LANES, load(rays.row, (FROM + axis) * room + first))
            store(rays.packets, at + (DIRECTION + axis) * LANES, load(rays.row, (TO + axis) * room + first))
        store(rays.packets, at + TFAR * LANES, load(rays.row, REACH * room + first))
    occlude(tracer, rays.packets, n, True)
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    flat = irradiance.reshape(irradiance.size)
    for channel in range(channels):
        for first in range(0, n, LANES):
            blocked = load(rays.packets, (first >> 4) * packet + TFAR * LANES) < np.float32(0.0)
            at = channel * rays.value.shape[1] + first
            store(rays.value, at, select(blocked, np.float32(0.0), load(rays.value, at)))
        for ray in range(n):
            flat[rays.place[ray] + channel * n_lights] += rays.value[channel, ray]


@inlined
def _of_few(hits: Hits, n: int, lights: LightArrays, tracer: Tracer, rays: Rays, irradiance: Float32) -> int:
    """`direct`, sixteen hits at a time."""
    channels, n_lights, room, row = irradiance.shape[1], irradiance.shape[2], rays.row.shape[1], rays.row
    capacity = rays.packets.shape[0] * LANES
    waiting = total = 0
    for i in range(0, n, LANES):
        at, wanted = lane_numbers() + np.int32(i), reflecting(hits, i, n)
        p, g, m = triples_at(hits.position, i), triples_at(hits.geometric, i), triples_at(hits.shading, i)
        e = load(hits.offset, i)
        up = (e * g[0], e * g[1], e * g[2])
        for s in range(lights.kind.shape[0]):
            for l in range(n_lights):
                if waiting > capacity - LANES:
                    _settle(tracer, rays, waiting, irradiance)
                    total, waiting = total + waiting, 0
                a, lit = lights.vector, lights.lit[s, l]
                x, y, z, factor = _facing(lights.kind[s], a[s, 0, l], a[s, 1, l], a[s, 2, l], p, g, m, lit)
                traced = wanted & (factor > np.float32(0.0))
                to, from_point = (x, y, z), np.float32(0.0 if lights.kind[s] == DIRECTIONAL else 1.0)
                for axis in range(3):
                    compress(traced, p[axis] + up[axis], row, (FROM + axis) * room + waiting)
                    compress(traced, to[axis] - from_point * up[axis], row, (TO + axis) * room + waiting)
                store(row, REACH * room + waiting, np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END)
                compress(traced, at * np.int32(channels * n_lights) + np.int32(l), rays.place, waiting)
                for channel in range(channels):
                    strength = lights.strength[s, channel, l]
                    compress(traced, factor * strength, rays.value, channel * rays.value.shape[1] + waiting)
                waiting += popcount(traced)
    _settle(tracer, rays, waiting, irradiance)
    return total + waiting


@inlined
def _of_many(hits: Hits, n: int, lights: LightArrays, tracer: Tracer, rays: Rays, irradiance: Float32) -> int:
    """`direct`, sixteen light positions at a time."""
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    capacity = rays.packets.shape[0] * LANES
    waiting = total = 0
    for i in range(n):
        if not reflects(hits, i):
            continue
        start = _Start(ray_origin(hits, i), lift(hits, i), i * channels * n_lights)
        for s in range(lights.kind.shape[0]):
            for l in range(0, n_lights, LANES):
                x, y, z, factor = _look(hits, i, lights, s, l)
                lit = bits(factor > np.float32(0.0))
                while lit != 0:
                    if waiting > capacity - LANES:
                        _settle(tracer, rays, waiting, irradiance)
                        total, waiting = total + waiting, 0
                    if lit == ALL:
                        _queue(lights, s, l, (x, y, z), factor, start, rays, waiting)
                        waiting, lit = waiting + LANES, 0
                        continue
                    skipped = ctz(lit)  # one run of positions after another
                    m = ctz(~(lit >> skipped))
                    if skipped > 0:
                        x, y, z, factor = _look(hits, i, lights, s, l + skipped)
                    _queue(lights, s, l + skipped, (x, y, z), factor, start, rays, waiting)
                    waiting += m
                    lit &= ~(((1 << m) - 1) << skipped)
    _settle(tracer, rays, waiting, irradiance)
    return total + waiting


@kernel
def direct(hits: Hits, n: int, lights: LightArrays, tracer: Tracer, rays: Rays, irradiance: Float32) -> int:
    """Compute the irradiance of each light position at hits 0 to n - 1.

    A source counts where it is in front of both normals; else no ray is spent. Hits that reflect nothing get 0.

    Args:
        rays: room for rays; as many as fit are traced together.
        irradiance: (n, channels, n_lights), overwritten; in units of `lights.colour`.
    Returns:
        number of shadow rays.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        for channel in range(channels):
            for l in range(n_lights):
                irradiance[i, channel, l] = 0.0
    if n_lights <= FEW:
        return _of_few(hits, n, lights, tracer, rays, irradiance)
    return _of_many(hits, n, lights, tracer, rays, irradiance)
