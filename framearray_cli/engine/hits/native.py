"""Native hits of an eye c, additional ones for mirror pixels, and the rays that detect mirrors."""

from functools import cache
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Int32, Real, Rgb, Triple

from ..embree.packets import DIRECTION, ORIGIN, TFAR, Tracer, decode_hits, intersect
from ..inputs.cameras import Cameras, corner_of, eye_ray, mips_of
from ..inputs.mips import Mips, filtered, footprint
from ..inputs.random import OTHER_HALF, PIXEL, PIXEL_SAMPLE, r2, random_word, stream
from ..inputs.surfaces import Surfaces, interpolate, specular_at
from ..kernels.bundle import bundle
from ..kernels.kernel import has_rows, inlined, kernel
from ..kernels.simd import (
    LANES,
    doubles,
    floor,
    gather,
    integers,
    lane_numbers,
    load_row,
    popcount,
    put_triples,
    select,
    sqrt,
    store,
    store_row,
    triples_at,
)
from .aiming import aim_rays, keep_origins
from .hits import Hits, World, trace_hits


@bundle
class PixelSamples(NamedTuple):
    """The samples of some pixels.

    Attributes:
        seed: seed of the job.
        pixels: (n,) pixels of the image.
        per_pixel: number of samples per pixel.
        first: number of a pixel's first sample.
        halves: whether even and odd samples of a pixel are independent of each other.
    """

    seed: int
    pixels: Int32
    per_pixel: int
    first: int
    halves: bool = False


# Rows and columns of pixels in a tile.
TILE = 32


@cache
def pixel_order(width: int, height: int) -> Int32:
    """All pixels, ordered by 4 x 4 blocks within tiles, and tiles by rows.

    16 neighbours make a coherent packet, and a tile's triangles stay in the cache.
    """
    order = np.empty(width * height, np.int32)
    _write_order(width, height, order)
    return order


@kernel
def _write_order(width: int, height: int, order: Int32) -> None:
    """Write the pixels of `pixel_order`."""
    n = 0
    for ty in range(0, height, TILE):
        for tx in range(0, width, TILE):
            for by in range(ty, min(ty + TILE, height), 4):
                for bx in range(tx, min(tx + TILE, width), 4):
                    for y in range(by, min(by + 4, height)):
                        for x in range(bx, min(bx + 4, width)):
                            order[n] = y * width + x
                            n += 1


@inlined
def _lane_numbers_below(i: int, n: int) -> int:
    """The numbers i to i + 15, clamped to n - 1."""
    number = lane_numbers() + np.int32(i)
    kept: int = select(number < np.int32(n), number, np.int32(n - 1))
    return kept


@inlined
def _write_eye_rays(
    cams: Cameras, c: int, pixel: int, jx: Real, jy: Real, i: int, packets: Float32, hits: Hits
) -> None:
    """Write eye rays i to i + 15, through (jx, jy) within the boxes of pixels."""
    x, y = corner_of(cams, pixel)
    dx, dy, dz = eye_ray(cams, c, x + doubles(jx), y + doubles(jy))
    o = cams.position
    store_row(packets, i, ORIGIN, o[c, 0])
    store_row(packets, i, ORIGIN + 1, o[c, 1])
    store_row(packets, i, ORIGIN + 2, o[c, 2])
    store_row(packets, i, DIRECTION, dx)
    store_row(packets, i, DIRECTION + 1, dy)
    store_row(packets, i, DIRECTION + 2, dz)
    if has_rows(cams.lens):
        aim_rays(cams, c, x + doubles(jx), y + doubles(jy), i, packets)
    store_row(packets, i, TFAR, np.float32(np.inf))
    store(hits.pixel, i, pixel)


@inlined
def _write_sample_rays(
    cams: Cameras, c: int, samples: PixelSamples, pixel: int, sample: int, i: int, packets: Float32, hits: Hits
) -> None:
    """Write the eye rays of 16 samples, placed within their pixels by the golden ratio sequence.

    With `halves` even and odd samples follow two independent sequences.
    """
    key, number = stream(samples.seed, c, pixel, PIXEL_SAMPLE), sample
    random = random_word(key, PIXEL)
    odd = (sample & np.int32(1)) == np.int32(1)
    store(hits.half, i, select(odd, np.uint8(1), np.uint8(0)))
    if samples.halves:
        random, number = select(odd, random_word(key, OTHER_HALF), random), integers(sample >> np.int32(1))
    jx, jy = r2(random, number)
    _write_eye_rays(cams, c, pixel, jx, jy, i, packets, hits)
    store(hits.key, i, stream(samples.seed, c, pixel, sample))


def native_hits(
    cams: Cameras,
    c: int,
    samples: PixelSamples,
    first: int,
    n: int,
    world: World,
    mirrors: bool,
    packets: Float32,
    hits: Hits,
) -> None:
    """Find native hits first to first + n - 1 of eye c.

    Hits are numbered by groups of 16 pixels, within a group by sample, then by pixel.

    Args:
        mirrors: whether the scene has mirrors; otherwise the hits' `specular` is not written.
    """
    _write_native_rays(cams, c, samples, first, n, packets, hits)
    _trace_eye_rays(cams, c, world, packets, n, mirrors=mirrors, hits=hits)


def _trace_eye_rays(
    cams: Cameras, c: int, world: World, packets: Float32, n: int, *, mirrors: bool, hits: Hits
) -> None:
    """Trace rays of eye c from the depth at which eyes begin to see, and turn them into hits."""
    trace_hits(world, packets, n, coherent=True, near=cams.near, mirrors=mirrors, hits=hits)
    keep_origins(cams, c, world, packets, n, hits)
    if len(world.mips.levels):
        blur_textures(mips_of(cams, c, world.mips), world.tracer, packets, n, mirrors, hits)


@kernel
def _write_native_rays(
    cams: Cameras, c: int, samples: PixelSamples, first: int, n: int, packets: Float32, hits: Hits
) -> None:
    """Write the eye rays of `native_hits`."""
    # in float64: a frame may have more hits than an int32 counts, and the quotients of such numbers are exact
    n_pixels, of_group = np.float64(samples.pixels.shape[0]), np.float64(16 * samples.per_pixel)
    for i in range(0, n, LANES):
        # number = 16 per_pixel group + members sample + index of the pixel; the last group may have fewer members
        number = doubles(_lane_numbers_below(i, n)) + np.float64(first)
        group = floor(number / of_group)
        rest, left = number - group * of_group, n_pixels - group * 16.0
        members = select(left < 16.0, left, 16.0)
        sample = floor(rest / members)
        pixel = gather(samples.pixels, integers(group * 16.0 + rest - sample * members))
        _write_sample_rays(cams, c, samples, pixel, integers(sample) + np.int32(samples.first), i, packets, hits)


def extra_hits(
    cams: Cameras, c: int, samples: PixelSamples, first: int, n: int, world: World, packets: Float32, hits: Hits
) -> None:
    """Find the additional native hits of mirror pixels of eye c: numbers first to first + n - 1.

    Hits are numbered by pixel, within a pixel by sample.
    """
    _write_extra_rays(cams, c, samples, first, n, packets, hits)
    _trace_eye_rays(cams, c, world, packets, n, mirrors=True, hits=hits)


@kernel
def _write_extra_rays(
    cams: Cameras, c: int, samples: PixelSamples, first: int, n: int, packets: Float32, hits: Hits
) -> None:
    """Write the eye rays of `extra_hits`."""
    for i in range(0, n, LANES):
        number = doubles(_lane_numbers_below(i, n)) + np.float64(first)
        at = floor(number / np.float64(samples.per_pixel))
        sample = integers(number - at * np.float64(samples.per_pixel)) + np.int32(samples.first)
        _write_sample_rays(cams, c, samples, gather(samples.pixels, integers(at)), sample, i, packets, hits)


def flag_mirrors(
    cams: Cameras, c: int, order: Int32, first: int, n: int, world: World, packets: Float32, hits: Hits, flags: Bytes
) -> None:
    """Flag mirrors seen through the centres of pixels order[first : first + n], and their neighbours.

    The result decides how many samples a pixel gets. No sample's place depends on it, so the image stays unbiased.

    Args:
        packets, hits: scratch.
        flags: (n_pixels,) set to 1 where a mirror may be seen.
    """
    _pilot_hits(cams, c, order, first, n, world.surfaces, world.eyes, packets, hits)
    _flag_neighbours(hits, n, cams.width, cams.height, flags)


@kernel
def _pilot_hits(
    cams: Cameras, c: int, order: Int32, first: int, n: int, surfaces: Surfaces, tracer: Tracer, packets: Float32,
    hits: Hits,
) -> None:  # fmt: skip
    """Write `pixel` and `specular` of hits through the centres of pixels order[first : first + n]."""
    for i in range(0, n, LANES):
        _write_eye_rays(cams, c, gather(order, _lane_numbers_below(i, n) + np.int32(first)), 0.5, 0.5, i, packets, hits)
    intersect(tracer, packets, n, True, cams.near)
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        red, green, blue = specular_at(surfaces, triangle, u, v)
        put_triples(hits.specular, i, select(missed, 0.0, red), select(missed, 0.0, green), select(missed, 0.0, blue))


@kernel
def _flag_neighbours(hits: Hits, n: int, width: int, height: int, flags: Bytes) -> None:
    """Flag the pixels of mirror hits and their neighbours, because a mirror's edge may pass next to the pilot ray."""
    for i in range(n):
        s = hits.specular[i]
        if s[0] > 0.0 or s[1] > 0.0 or s[2] > 0.0:
            x, y = hits.pixel[i] % width, hits.pixel[i] // width
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    flags[v * width + u] = 1


class _Seen(NamedTuple):
    """Surfaces that sixteen eye rays met.

    Attributes:
        missed: whether they met nothing.
        triangle, material: numbers; u, v: barycentric.
        direction: unit direction of the rays; normal: geometric, on their side.
        side: width of the square that a ray stands for, at the triangle.
    """

    missed: bool
    triangle: int
    material: int
    u: Real
    v: Real
    direction: Triple
    normal: Triple
    side: Real


@kernel
def blur_textures(mips: Mips, tracer: Tracer, packets: Float32, n: int, mirrors: bool, hits: Hits) -> None:
    """Overwrite the reflectivity of hits 0 to n - 1 of eye rays where textures are minified.

    Args:
        packets: the traced rays of the hits.
        mirrors: whether to overwrite `specular`, too.
    """
    s, spread, start = mips.surfaces, np.float32(mips.spread), np.float32(mips.side)
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        material = gather(s.material, triangle)
        x, y = load_row(packets, i, DIRECTION), load_row(packets, i, DIRECTION + 1)
        z = load_row(packets, i, DIRECTION + 2)
        length = np.float32(1.0) / sqrt(x * x + y * y + z * z)
        side = spread * select(missed, np.float32(0.0), load_row(packets, i, TFAR)) + start
        normal = triples_at(hits.geometric, i)
        seen = _Seen(missed, triangle, material, u, v, (x * length, y * length, z * length), normal, side)
        _blur(mips, s.reflectivity, s.reflectivity_texture, seen, i, hits.reflectivity)
        if mirrors:
            _blur(mips, s.specular, s.specular_texture, seen, i, hits.specular)


@inlined
def _blur(mips: Mips, factors: Rgb, textures: Int32, seen: _Seen, i: int, found: Rgb) -> None:
    """`blur_textures` of hits i to i + 15, for the diffuse or the mirror part."""
    texture = gather(textures, seen.material)
    textured = ~seen.missed & (texture >= np.int32(0))
    if popcount(textured) > 0:
        texture = select(textured, texture, np.int32(0))
        f = footprint(mips, texture, seen.triangle, seen.u, seen.v, seen.direction, seen.normal, seen.side)
        blurred = textured & (f.width * f.taps > np.float32(1.0))
        if popcount(blurred) > 0:
            colour = _colour(mips, seen, filtered(mips, texture, f))
            at, (red, green, blue) = seen.material * np.int32(3), triples_at(found, i)
            put_triples(
                found,
                i,
                select(blurred, gather(factors, at) * colour[0], red),
                select(blurred, gather(factors, at + np.int32(1)) * colour[1], green),
                select(blurred, gather(factors, at + np.int32(2)) * colour[2], blue),
            )


@inlined
def _colour(mips: Mips, seen: _Seen, texture: Triple) -> Triple:
    """The texture times the corner colours."""
    s, u, v, w = mips.surfaces, seen.u, seen.v, np.float32(1.0) - seen.u - seen.v
    red, green, blue = texture
    if s.colours.shape[0] > 0:
        red = red * interpolate(s.colours, seen.triangle, 3, 0, u, v, w)
        green = green * interpolate(s.colours, seen.triangle, 3, 1, u, v, w)
        blue = blue * interpolate(s.colours, seen.triangle, 3, 2, u, v, w)
    return red, green, blue
