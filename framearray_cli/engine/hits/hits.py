"""Hits: the surface points that terms are estimated at, and what traced rays tell of them.

A batch of hits is a few thousand points in arrays that stay in the cache while every term is computed from them.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Bytes, Directions, Float32, Int32, Keys, Points, Real, Rgb, Triple

from ..embree.packets import DIRECTION, GEOMETRY, TRIANGLE, Tracer, U, V, scene_triangle
from ..inputs.surfaces import Surfaces, geometric_normal, position_at, reflectivity_at, shading_normal, specular_at
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, gather, lane_numbers, load, put_triples, select, sqrt, store, triples_at

ESCAPED, SURFACE = 0, 1


class Hits(NamedTuple):
    """Room for n hits.

    Attributes:
        kind: (n,) SURFACE, or ESCAPED for a ray that left the scene.
        position: (n, 3) the point, centred; for an escaped ray its unit direction.
        geometric: (n, 3) unit normal of the triangle, on the viewer's side: offsets, reprojection, sides.
        shading: (n, 3) unit interpolated normal on that same side: direct light, hemisphere, mirror.
        offset: (n,) how far rays start above the triangle.
        reflectivity, specular: (n, 3) diffuse and mirror part; specular is left alone in scenes without mirrors.
        incoming: (n, 3) direction of the ray that found the hit, not normalised.
        key: (n,) random stream.
        pixel: (n,) the pixel of the eye that found the hit.
        half: (n,) which half of its pixel's samples a hit belongs to, 0 or 1.
    """

    kind: Bytes
    position: Points
    geometric: Directions
    shading: Directions
    offset: Float32
    reflectivity: Rgb
    specular: Rgb
    incoming: Float32
    key: Keys
    pixel: Int32
    half: Bytes


class World(NamedTuple):
    """What rays meet: the surfaces of a scene, and how to trace rays through it."""

    surfaces: Surfaces
    tracer: Tracer


def empty_hits(n: int) -> Hits:
    """Room for n hits; contents are arbitrary.

    Behind each array there is room to the end of a packet of rays: hits are written a packet at a time.
    """
    whole = -(-n // LANES) * LANES

    def vectors() -> Float32:
        return np.empty((whole, 3), np.float32)[:n]

    return Hits(
        kind=np.empty(whole, np.uint8)[:n],
        position=vectors(),
        geometric=vectors(),
        shading=vectors(),
        offset=np.empty(whole, np.float32)[:n],
        reflectivity=vectors(),
        specular=vectors(),
        incoming=vectors(),
        key=np.empty(whole, np.uint64)[:n],
        pixel=np.empty(whole, np.int32)[:n],
        half=np.empty(whole, np.uint8)[:n],
    )


@inlined
def reflects(hits: Hits, i: int) -> bool:
    """Whether hit i is on a surface that reflects diffusely; elsewhere no light needs to be known."""
    r = hits.reflectivity
    return bool(hits.kind[i] == SURFACE and (r[i, 0] > 0.0 or r[i, 1] > 0.0 or r[i, 2] > 0.0))


@inlined
def reflecting(hits: Hits, i: int, n: int) -> bool:
    """`reflects` of hits i to i + 15, of which those from n on do not count."""
    red, green, blue = triples_at(hits.reflectivity, i)
    of_any = (red > np.float32(0.0)) | (green > np.float32(0.0)) | (blue > np.float32(0.0))
    surface = load(hits.kind, i) == np.uint8(SURFACE)
    wanted: bool = surface & of_any & (lane_numbers() < np.int32(n - i))
    return wanted


@inlined
def lift(hits: Hits, i: int) -> Triple:
    """From hit i to where rays that leave it start: above the triangle, on the viewer's side."""
    g, e = hits.geometric, hits.offset[i]
    return e * g[i, 0], e * g[i, 1], e * g[i, 2]


@inlined
def ray_origin(hits: Hits, i: int) -> Triple:
    """Where rays that leave hit i start."""
    p, (x, y, z) = hits.position, lift(hits, i)
    return p[i, 0] + x, p[i, 1] + y, p[i, 2] + z


@inlined
def triple(array: Float32, i: int) -> Triple:
    """Row i of an (n, 3) array, or rows of it for lanes."""
    at = i * np.int32(3)
    return gather(array, at), gather(array, at + np.int32(1)), gather(array, at + np.int32(2))


@inlined
def decode_hits(tracer: Tracer, packets: Float32, i: int) -> tuple[bool, int, Real, Real]:
    """Whether rays i to i + 15 met nothing, and the triangles and places (u, v) that they met, else 0."""
    bits, at = packets.view(np.int32), (i >> 4) * packets.shape[1] * LANES
    triangle = load(bits, at + TRIANGLE * LANES)
    missed = triangle < np.int32(0)
    triangle = select(missed, 0, scene_triangle(tracer, triangle, load(bits, at + GEOMETRY * LANES)))
    u, v = load(packets, at + U * LANES), load(packets, at + V * LANES)
    return missed, triangle, select(missed, 0.0, u), select(missed, 0.0, v)


@kernel
def record_hits(world: World, packets: Float32, n: int, mirrors: bool, hits: Hits) -> None:
    """Turn traced rays 0 to n - 1 into hits; key and pixel are left alone."""
    surfaces, tracer = world
    packet = packets.shape[1] * LANES
    for i in range(0, n, LANES):
        at = (i >> 4) * packet
        dx, dy = load(packets, at + DIRECTION * LANES), load(packets, at + (DIRECTION + 1) * LANES)
        dz = load(packets, at + (DIRECTION + 2) * LANES)
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        # all is read before anything is written: the compiler then reads what is needed twice only once
        x, y, z = position_at(surfaces, triangle, u, v)
        length = sqrt(dx * dx + dy * dy + dz * dz)
        gx, gy, gz = geometric_normal(surfaces, triangle, dx, dy, dz)
        nx, ny, nz = shading_normal(surfaces, triangle, u, v, gx, gy, gz)
        red, green, blue = reflectivity_at(surfaces, triangle, u, v)
        offset = gather(surfaces.offset, triangle)
        if mirrors:
            s_red, s_green, s_blue = specular_at(surfaces, triangle, u, v)
            put_triples(
                hits.specular, i, select(missed, 0.0, s_red), select(missed, 0.0, s_green), select(missed, 0.0, s_blue)
            )
        put_triples(hits.incoming, i, dx, dy, dz)
        x, y, z = select(missed, dx / length, x), select(missed, dy / length, y), select(missed, dz / length, z)
        put_triples(hits.position, i, x, y, z)
        put_triples(hits.geometric, i, gx, gy, gz)
        put_triples(hits.shading, i, nx, ny, nz)
        store(hits.offset, i, offset)
        put_triples(
            hits.reflectivity, i, select(missed, 0.0, red), select(missed, 0.0, green), select(missed, 0.0, blue)
        )
        store(hits.kind, i, select(missed, np.uint8(ESCAPED), np.uint8(SURFACE)))
