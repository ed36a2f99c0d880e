"""Hits: the surface points that terms are estimated at, and the eye rays that find them.

A batch of hits is a few thousand points in arrays that stay in the cache while every term is computed from them.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from .arrays import Bytes, Directions, Float32, Int32, Keys, Points, Real, Rgb, Triple
from .camera import Cameras, eye_ray
from .embree.packets import (
    DIRECTION,
    GEOMETRY,
    MISS,
    TRIANGLE,
    Tracer,
    U,
    V,
    hit_triangle,
    intersect,
    scene_triangle,
    set_ray,
)
from .kernel import inlined, kernel
from .lanes import LANES, choose, gather, lane_numbers, lanes_at, put_lanes, root, scatter
from .sampling import PIXEL, PIXEL_SAMPLE, r2, stream, word
from .surface import (
    Surfaces,
    geometric_normal,
    position_at,
    reflectivity_at,
    shading_normal,
    specular_at,
)

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
    )


@inlined
def reflects(hits: Hits, i: int) -> bool:
    """Whether hit i is on a surface that reflects diffusely; elsewhere no light needs to be known."""
    r = hits.reflectivity
    return bool(hits.kind[i] == SURFACE and (r[i, 0] > 0.0 or r[i, 1] > 0.0 or r[i, 2] > 0.0))


@inlined
def ray_origin(hits: Hits, i: int) -> Triple:
    """Where rays that leave hit i start: above the triangle, on the viewer's side."""
    p, g, e = hits.position, hits.geometric, hits.offset[i]
    return p[i, 0] + e * g[i, 0], p[i, 1] + e * g[i, 1], p[i, 2] + e * g[i, 2]


@inlined
def triple(array: Float32, i: int) -> Triple:
    """Row i of an (n, 3) array, or rows of it for lanes."""
    at = i * np.int32(3)
    return gather(array, at), gather(array, at + np.int32(1)), gather(array, at + np.int32(2))


@inlined
def _put(array: Float32, i: int, x: Real, y: Real, z: Real) -> None:
    """Write rows i to i + 15 of an (n, 3) array."""
    at = (lane_numbers() + np.int32(i)) * np.int32(3)
    scatter(array, at, x)
    scatter(array, at + np.int32(1), y)
    scatter(array, at + np.int32(2), z)


@kernel
def record_hits(surfaces: Surfaces, tracer: Tracer, packets: Float32, n: int, mirrors: bool, hits: Hits) -> None:
    """Turn traced rays 0 to n - 1 into hits; key and pixel are left alone."""
    packet, bits = packets.shape[1] * LANES, packets.view(np.int32)
    for i in range(0, n, LANES):
        at = (i >> 4) * packet
        dx, dy = lanes_at(packets, at + DIRECTION * LANES), lanes_at(packets, at + (DIRECTION + 1) * LANES)
        dz = lanes_at(packets, at + (DIRECTION + 2) * LANES)
        triangle = lanes_at(bits, at + TRIANGLE * LANES)
        missed = triangle < np.int32(0)
        triangle = choose(missed, 0, scene_triangle(tracer, triangle, lanes_at(bits, at + GEOMETRY * LANES)))
        u, v = lanes_at(packets, at + U * LANES), lanes_at(packets, at + V * LANES)
        u, v = choose(missed, 0.0, u), choose(missed, 0.0, v)
        # all is read before anything is written: the compiler then reads what is needed twice only once
        x, y, z = position_at(surfaces, triangle, u, v)
        length = root(dx * dx + dy * dy + dz * dz)
        gx, gy, gz = geometric_normal(surfaces, triangle, dx, dy, dz)
        nx, ny, nz = shading_normal(surfaces, triangle, u, v, gx, gy, gz)
        red, green, blue = reflectivity_at(surfaces, triangle, u, v)
        offset = gather(surfaces.offset, triangle)
        if mirrors:
            s_red, s_green, s_blue = specular_at(surfaces, triangle, u, v)
            _put(
                hits.specular, i, choose(missed, 0.0, s_red), choose(missed, 0.0, s_green), choose(missed, 0.0, s_blue)
            )
        _put(hits.incoming, i, dx, dy, dz)
        x, y, z = choose(missed, dx / length, x), choose(missed, dy / length, y), choose(missed, dz / length, z)
        _put(hits.position, i, x, y, z)
        _put(hits.geometric, i, gx, gy, gz)
        _put(hits.shading, i, nx, ny, nz)
        put_lanes(hits.offset, i, offset)
        _put(hits.reflectivity, i, choose(missed, 0.0, red), choose(missed, 0.0, green), choose(missed, 0.0, blue))
        for ray in range(i, i + LANES):
            hits.kind[ray] = ESCAPED if bits[i >> 4, TRIANGLE, ray & 15] == MISS else SURFACE


@nb.njit(cache=True)
def pixel_order(width: int, height: int) -> Int32:
    """All pixels, in 4 x 4 blocks within 32 x 32 tiles.

    16 neighbours make a coherent packet, and a tile's triangles stay in the cache.
    """
    order = np.empty(width * height, np.int32)
    n = 0
    for ty in range(0, height, 32):
        for tx in range(0, width, 32):
            for by in range(ty, min(ty + 32, height), 4):
                for bx in range(tx, min(tx + 32, width), 4):
                    for y in range(by, min(by + 4, height)):
                        for x in range(bx, min(bx + 4, width)):
                            order[n] = y * width + x
                            n += 1
    return order


@inlined
def _shoot(cams: Cameras, c: int, pixel: int, jx: Real, jy: Real, i: int, packets: Float32, hits: Hits) -> None:
    """Write eye ray i, through (jx, jy) within the box of a pixel."""
    dx, dy, dz = eye_ray(cams, c, pixel % cams.width + jx, pixel // cams.width + jy)
    o = cams.position
    set_ray(packets, i, o[c, 0], o[c, 1], o[c, 2], dx, dy, dz, np.float32(np.inf))
    hits.pixel[i] = pixel


@inlined
def _shoot_sample(
    cams: Cameras, c: int, seed: int, pixel: int, sample: int, i: int, packets: Float32, hits: Hits
) -> None:
    """Write the eye ray of one sample; the samples of a pixel are spread by the golden ratio sequence."""
    jx, jy = r2(word(stream(seed, c, pixel, PIXEL_SAMPLE), PIXEL), sample)
    _shoot(cams, c, pixel, jx, jy, i, packets, hits)
    hits.key[i] = stream(seed, c, pixel, sample)


@kernel
def native_hits(
    cams: Cameras,
    c: int,
    seed: int,
    pixels: Int32,
    per_pixel: int,
    first_sample: int,
    first: int,
    n: int,
    surfaces: Surfaces,
    tracer: Tracer,
    mirrors: bool,
    packets: Float32,
    hits: Hits,
) -> None:
    """Find native hits first to first + n - 1 of eye c, `per_pixel` in each of `pixels`.

    They are numbered by groups of 16 pixels, within a group by sample, then by pixel.
    """
    n_pixels = pixels.shape[0]
    for i in range(n):
        group, rest = divmod(first + i, 16 * per_pixel)
        members = min(16, n_pixels - 16 * group)
        sample, member = divmod(rest, members)
        _shoot_sample(cams, c, seed, pixels[16 * group + member], first_sample + sample, i, packets, hits)
    intersect(tracer, packets, n, True)
    record_hits(surfaces, tracer, packets, n, mirrors, hits)


@kernel
def extra_hits(
    cams: Cameras,
    c: int,
    seed: int,
    pixels: Int32,
    first_sample: int,
    per_pixel: int,
    first: int,
    n: int,
    surfaces: Surfaces,
    tracer: Tracer,
    packets: Float32,
    hits: Hits,
) -> None:
    """Find hits first to first + n - 1 of those that mirror pixels have beyond the others, `per_pixel` each."""
    for i in range(n):
        at, sample = divmod(first + i, per_pixel)
        _shoot_sample(cams, c, seed, pixels[at], first_sample + sample, i, packets, hits)
    intersect(tracer, packets, n, True)
    record_hits(surfaces, tracer, packets, n, True, hits)


@kernel
def pilot_hits(
    cams: Cameras,
    c: int,
    order: Int32,
    first: int,
    n: int,
    surfaces: Surfaces,
    tracer: Tracer,
    packets: Float32,
    hits: Hits,
) -> None:
    """Look through the centres of pixels order[first : first + n] for mirrors; of the hits only `specular` is known.

    What they show decides how many samples a pixel gets; no sample's place depends on them, so that is unbiased.
    """
    for i in range(n):
        _shoot(cams, c, order[first + i], 0.5, 0.5, i, packets, hits)
    intersect(tracer, packets, n, True)
    for i in range(n):
        triangle = hit_triangle(tracer, packets, i)
        for channel in range(3):
            hits.specular[i, channel] = 0.0
        if triangle != MISS:
            red, green, blue = specular_at(surfaces, triangle, packets[i >> 4, U, i & 15], packets[i >> 4, V, i & 15])
            hits.specular[i, 0], hits.specular[i, 1], hits.specular[i, 2] = red, green, blue
