"""Adding the hits of many frames to pixels, one pass over them, until images are finished."""

from collections.abc import Iterable

import numpy as np

from .arrays import Addresses, Float32, Int32, Real, Rgb
from .compose import (
    INDIRECT,
    INVERSE_PI,
    MOST,
    OBSCURANCE,
    STEADY,
    WEIGHT,
    Band,
    Stored,
    begin,
    finish,
    normalise,
)
from .kernel import inlined, integer_at, kernel, prefetch, real_at
from .lanes import LANES, lanes_at, lanes_from, put_lanes
from .work import Placed, Records

# Columns of a list of sources: addresses of arrays, 0 for one that is empty.
START, ORDER, WEIGHTS, SCALE, REFLECTIVITY, W, CONSTANT, IRRADIANCE = range(8)
# How many hits ahead a source is fetched: memory answers in about the time that this many hits take to sum.
AHEAD = 8


def sources(parts: Iterable[tuple[Placed, Records, Float32, Float32]]) -> Addresses:
    """List hits for `accumulate`; whoever asks keeps the arrays while the list is in use.

    Args:
        parts: hits by pixel; what is known of them; (n_hits,) the weight of each, or (0,) where all weigh 1;
            (n_pixels,) a factor for all hits of a pixel, or (0,) where it is 1.

    Returns:
        (n, 8) addresses.
    """
    rows = []
    for placed, known, weight, scale in parts:
        arrays = (
            placed.start,
            placed.order,
            weight,
            scale,
            known.reflectivity,
            known.obscurance,
            known.constant,
            known.irradiance,
        )
        assert all(array.flags.c_contiguous for array in arrays)
        rows.append([array.ctypes.data if array.size else 0 for array in arrays])
    return np.array(rows, np.int64).reshape(-1, 8)


@inlined
def _add_light(band: Band, i: int, n: int, channels: int, n_lights: int) -> None:
    """Add the direct light of the n hits that wait to pixel i of the band; each sum is read and written once."""
    stride = band.direct.shape[2]
    for l in range(0, n_lights, LANES):
        at = 3 * i * stride + l
        red, green = lanes_at(band.direct, at), lanes_at(band.direct, at + stride)
        blue = lanes_at(band.direct, at + 2 * stride)
        for k in range(n):
            row = band.rows[k] + 4 * l
            if channels == 1:
                e = lanes_from(row)
                red = red + e * band.shares[k, 0]
                green = green + e * band.shares[k, 1]
                blue = blue + e * band.shares[k, 2]
            else:
                red = red + lanes_from(row) * band.shares[k, 0]
                green = green + lanes_from(row + 4 * n_lights) * band.shares[k, 1]
                blue = blue + lanes_from(row + 8 * n_lights) * band.shares[k, 2]
        put_lanes(band.direct, at, red)
        put_lanes(band.direct, at + stride, green)
        put_lanes(band.direct, at + 2 * stride, blue)


@inlined
def _fetch(source: Addresses, entry: int, last: int, row_bytes: int) -> None:
    """Ask for what is known of a hit that comes soon."""
    if entry < last:
        hit = integer_at(source[ORDER], entry)
        prefetch(source[REFLECTIVITY] + 12 * hit, 12)
        prefetch(source[W] + 12 * hit, 12)
        if source[CONSTANT] != 0:
            prefetch(source[CONSTANT] + 12 * hit, 12)
        prefetch(source[IRRADIANCE] + row_bytes * hit, row_bytes)


@inlined
def _add(sums: Float32, i: int, first: int, red: Real, green: Real, blue: Real) -> None:
    sums[i, first] += red
    sums[i, first + 1] += green
    sums[i, first + 2] += blue


@kernel
def accumulate(band: Band, first_pixel: int, n: int, parts: Addresses, channels: int, n_lights: int) -> None:
    """Add hits to the sums of pixels first_pixel to first_pixel + n - 1, pixel by pixel, source by source.

    Args:
        parts: from `sources`.
        channels: of irradiance, 1 or 3.
        n_lights: of irradiance; 0: direct light is left out.
    """
    row_bytes, nothing = 4 * channels * n_lights, np.float32(0.0)
    for i in range(n):
        pixel, waiting = first_pixel + i, 0
        # the pixel's sums stay in registers
        weight = r_red = r_green = r_blue = w_red = w_green = w_blue = nothing
        rw_red = rw_green = rw_blue = c_red = c_green = c_blue = nothing
        for part in range(parts.shape[0]):
            source = parts[part]
            start, end = integer_at(source[START], pixel), integer_at(source[START], pixel + 1)
            last = integer_at(source[START], first_pixel + n)
            factor = real_at(source[SCALE], pixel) if source[SCALE] != 0 else np.float32(1.0)
            band.hits[i] += end - start
            for entry in range(start, end):
                _fetch(source, entry + AHEAD, last, row_bytes)
                hit = integer_at(source[ORDER], entry)
                w = factor * real_at(source[WEIGHTS], hit) if source[WEIGHTS] != 0 else factor
                weight += w
                if source[CONSTANT] != 0:
                    c_red += w * real_at(source[CONSTANT], 3 * hit)
                    c_green += w * real_at(source[CONSTANT], 3 * hit + 1)
                    c_blue += w * real_at(source[CONSTANT], 3 * hit + 2)
                red, green = w * real_at(source[REFLECTIVITY], 3 * hit), w * real_at(source[REFLECTIVITY], 3 * hit + 1)
                blue = w * real_at(source[REFLECTIVITY], 3 * hit + 2)
                if not (red > 0.0 or green > 0.0 or blue > 0.0):
                    continue
                r_red, r_green, r_blue = r_red + red, r_green + green, r_blue + blue
                o_red, o_green = real_at(source[W], 3 * hit), real_at(source[W], 3 * hit + 1)
                o_blue = real_at(source[W], 3 * hit + 2)
                rw_red, rw_green, rw_blue = rw_red + red * o_red, rw_green + green * o_green, rw_blue + blue * o_blue
                w_red, w_green, w_blue = w_red + w * o_red, w_green + w * o_green, w_blue + w * o_blue
                band.rows[waiting] = source[IRRADIANCE] + row_bytes * hit
                band.shares[waiting, 0] = red * INVERSE_PI
                band.shares[waiting, 1] = green * INVERSE_PI
                band.shares[waiting, 2] = blue * INVERSE_PI
                waiting += 1
                if waiting == MOST:
                    _add_light(band, i, waiting, channels, n_lights)
                    waiting = 0
        _add_light(band, i, waiting, channels, n_lights)
        band.rest[i, WEIGHT] += weight
        _add(band.rest, i, INDIRECT, rw_red, rw_green, rw_blue)
        _add(band.rest, i, STEADY, c_red, c_green, c_blue)
        _add(band.rest, i, OBSCURANCE, w_red, w_green, w_blue)
        _add(band.reflectivity, i, 0, r_red, r_green, r_blue)


@kernel
def compose_pixels(
    band: Band,
    first_pixel: int,
    n: int,
    hits: Addresses,
    mirrored: Addresses,
    channels: int,
    smooth: Float32,
    colour: Rgb,
    ambient: Rgb,
    lowest: Real,
    images: Stored,
    samples: Int32,
    maps: Float32,
) -> tuple[int, int, int, int]:
    """Compose pixels first_pixel to first_pixel + n - 1 of all images of a frame, a band at a time.

    Args:
        band: room for the sums of some pixels.
        hits, mirrored: from `sources`: what is averaged by weight, and what is added to that.
        channels: of irradiance, 1 or 3.
        smooth: (n_pixels, 3) R W that replaces the mean, or (0, 3).
        colour, ambient, lowest, images: see `finish`.
        samples: (n_pixels,) overwritten: hits of each pixel.
        maps: (n_pixels, 9) overwritten with means of W, R W and R, or (0, 9).

    Returns:
        as `finish`, for all bands together.
    """
    n_lights = images.shape[0]
    bad, bad_light, bad_pixel, beyond = 0, -1, -1, 0
    for first in range(first_pixel, first_pixel + n, band.hits.shape[0]):
        m = min(band.hits.shape[0], first_pixel + n - first)
        begin(band, m)
        accumulate(band, first, m, hits, channels, n_lights)
        normalise(band, m)
        for i in range(m):
            samples[first + i] = band.hits[i]
            for channel in range(3):
                if smooth.shape[0] > 0:
                    band.rest[i, INDIRECT + channel] = smooth[first + i, channel]
                if maps.shape[0] > 0:
                    maps[first + i, channel] = band.rest[i, OBSCURANCE + channel]
                    maps[first + i, 3 + channel] = band.rest[i, INDIRECT + channel]
                    maps[first + i, 6 + channel] = band.reflectivity[i, channel]
        if mirrored.shape[0] > 0:
            accumulate(band, first, m, mirrored, channels, n_lights)
        found, l, pixel, large = finish(band, first, m, colour, ambient, lowest, images)
        if bad == 0 and found > 0:
            bad_light, bad_pixel = l, pixel
        bad, beyond = bad + found, beyond + large
    return bad, bad_light, bad_pixel, beyond
