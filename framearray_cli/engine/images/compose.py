"""Adding the hits of many frames to pixels, one pass over them, until images are finished."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from framearray_cli.base.arrays import Addresses, Float32, Float64, Int32, Real

from ..frames.records import (
    BY_SAMPLE,
    HALF,
    INDIRECT,
    LIT,
    OBSCURANCE,
    REFLECTIVITY,
    WEIGHT,
    HitRecords,
    Placed,
    lit_bit,
)
from ..kernels.kernel import inlined, integer_at, kernel, prefetch, real_at
from ..kernels.simd import LANES, lane_numbers, lanes_from, load, reals, store
from .band import INVERSE_PI, MOST, Band, Finish, Stored, finish

# Columns of a list of sources: addresses of arrays, 0 for one that is empty; and what these hold.
START, ORDER, WEIGHTS, SCALE, ODD_SCALE, ROW, IRRADIANCE = range(7)
_TYPES = (np.int32, np.int32, np.float32, np.float32, np.float32, np.float32, np.float32)
_NOTHING = np.empty(0, np.float32)
# How many hits ahead the light of a hit is fetched, and twice as many its row: memory answers in about the time that
# this many hits take to sum.
AHEAD = 8
ROW_BYTES = 4 * LANES


class HitSource(NamedTuple):
    """Hits that are summed.

    Attributes:
        placed: hits by pixel.
        known: what is known of them.
        weight: (n_hits,) of each, or (0,) where all weigh 1.
        scale: (n_pixels,) a factor for all hits of a pixel, or (0,) where it is 1.
        odd_scale: (n_pixels,) that of the second half of the samples, or (0,) where it is the same.
    """

    placed: Placed
    known: HitRecords
    weight: Float32 = _NOTHING
    scale: Float32 = _NOTHING
    odd_scale: Float32 = _NOTHING


class SourceList:
    """Hits of several sources, as `accumulate` takes them; keeps the arrays that it points into.

    Attributes:
        addresses: (n, 7) of the arrays of each source; they count as long as the list lives.
    """

    def __init__(self, parts: Iterable[HitSource]) -> None:
        """List sources.

        Raises:
            ValueError: an array is not contiguous, or holds something else than kernels read.
        """
        self._kept = [
            (p.placed.start, p.placed.order, p.weight, p.scale, p.odd_scale, p.known.row, p.known.irradiance)
            for p in parts
        ]
        rows = [[_address(*of_column) for of_column in zip(arrays, _TYPES, strict=True)] for arrays in self._kept]
        self.addresses: Addresses = np.array(rows, np.int64).reshape(-1, len(_TYPES))


def _address(array: NDArray[Any], dtype: DTypeLike) -> int:
    if array.dtype != dtype:
        raise ValueError(f"expected an array of {np.dtype(dtype)}, got one of {array.dtype}")
    if not array.flags.c_contiguous:
        raise ValueError(f"expected a contiguous array, got one of shape {array.shape} with strides {array.strides}")
    return array.ctypes.data if array.size else 0


@inlined
def _add_light(band: Band, i: int, n: int, channels: int, n_lights: int, fresh: bool) -> None:
    """Add the direct light of the n hits that wait to pixel i of the band; each sum is read and written once."""
    stride, any_lit = band.direct.shape[2], 0
    for k in range(n):
        any_lit |= band.lit[k]
    for l in range(0, n_lights, LANES):
        at, bit = 3 * i * stride + l, lit_bit(n_lights, l)
        red = green = blue = reals(lane_numbers()) * np.float32(0.0)
        for k in range(n if (any_lit >> bit) & 1 else 0):
            if (band.lit[k] >> bit) & 1 == 0:
                continue
            place = band.places[k] + 4 * l
            if channels == 1:
                e = lanes_from(place)
                red = red + e * band.shares[k, 0]
                green = green + e * band.shares[k, 1]
                blue = blue + e * band.shares[k, 2]
            else:
                red = red + lanes_from(place) * band.shares[k, 0]
                green = green + lanes_from(place + 4 * n_lights) * band.shares[k, 1]
                blue = blue + lanes_from(place + 8 * n_lights) * band.shares[k, 2]
        if not fresh:  # only now: what a single hit adds to the sum of a million would be lost in its last digits
            red, green = red + load(band.direct, at), green + load(band.direct, at + stride)
            blue = blue + load(band.direct, at + 2 * stride)
        store(band.direct, at, red)
        store(band.direct, at + stride, green)
        store(band.direct, at + 2 * stride, blue)


@inlined
def _fetch(source: Addresses, entry: int, last: int, channels: int, n_lights: int) -> None:
    """Ask for the row of a hit that comes soon, and for the light of an earlier one, which its row tells of."""
    if entry + 2 * AHEAD < last:
        prefetch(source[ROW] + ROW_BYTES * integer_at(source[ORDER], entry + 2 * AHEAD), 1)
    if entry + AHEAD < last:
        hit = integer_at(source[ORDER], entry + AHEAD)
        lit = int(real_at(source[ROW], LANES * hit + LIT))
        for l in range(0, n_lights if lit != 0 else 0, LANES):
            if (lit >> lit_bit(n_lights, l)) & 1:
                for channel in range(channels):
                    prefetch(source[IRRADIANCE] + 4 * (n_lights * (channels * hit + channel) + l), ROW_BYTES)


@kernel
def accumulate(
    band: Band, first_pixel: int, n: int, parts: Addresses, channels: int, n_lights: int, mean: bool
) -> None:
    """Sum the hits of pixels first_pixel to first_pixel + n - 1, pixel by pixel, source by source.

    Args:
        parts: of a `SourceList`.
        channels: of irradiance, 1 or 3.
        n_lights: of irradiance; 0: direct light is left out.
        mean: the sums become means over the weights, zero in a pixel without hits; else they are added to what the
            band holds.
    """
    for i in range(n):
        pixel, n_hits, waiting, fresh = first_pixel + i, 0, 0, mean
        total = reals(lane_numbers()) * np.float32(0.0)  # the sum of the rows stays in a register
        for part in range(parts.shape[0]):
            source = parts[part]
            start, end = integer_at(source[START], pixel), integer_at(source[START], pixel + 1)
            last = integer_at(source[START], first_pixel + n)
            even = real_at(source[SCALE], pixel) if source[SCALE] != 0 else np.float32(1.0)
            odd = real_at(source[ODD_SCALE], pixel) if source[ODD_SCALE] != 0 else even
            n_hits += end - start
            for entry in range(start, end):
                _fetch(source, entry, last, channels, n_lights)
                hit = integer_at(source[ORDER], entry)
                row = source[ROW] + ROW_BYTES * hit
                w = odd if real_at(row, HALF) > 0.0 else even
                if source[WEIGHTS] != 0:
                    w *= real_at(source[WEIGHTS], hit)
                total = total + lanes_from(row) * w
                lit = int(real_at(row, LIT))
                if lit == 0 or n_lights == 0:
                    continue
                if waiting == MOST:
                    _add_light(band, i, waiting, channels, n_lights, fresh)
                    waiting, fresh = 0, False
                band.places[waiting], band.lit[waiting] = source[IRRADIANCE] + 4 * channels * n_lights * hit, lit
                for channel in range(3):
                    band.shares[waiting, channel] = w * INVERSE_PI * real_at(row, REFLECTIVITY + channel)
                waiting += 1
        if mean:
            store(band.sums, LANES * i, total)
            weight = band.sums[i, WEIGHT]
            inverse = np.float32(1.0) / weight if weight > 0.0 else np.float32(0.0)
            store(band.sums, LANES * i, total * inverse)
            band.hits[i] = n_hits
            _scale(band, i, waiting, n_lights, fresh, inverse)
        else:
            store(band.sums, LANES * i, load(band.sums, LANES * i) + total)
        _add_light(band, i, waiting, channels, n_lights, fresh)


@inlined
def _scale(band: Band, i: int, n: int, n_lights: int, fresh: bool, factor: Real) -> None:
    """Multiply what waits for pixel i of the band, and what is summed already."""
    for k in range(n):
        for channel in range(3):
            band.shares[k, channel] *= factor
    if not fresh:
        for channel in range(3):
            for l in range(n_lights):
                band.direct[i, channel, l] *= factor


class Summands(NamedTuple):
    """The hits that a frame shows.

    Attributes:
        hits, mirrored: of a `SourceList` each: what is averaged by weight, and what is added to that.
        channels: of irradiance, 1 or 3.
        smooth: (n_pixels, 3) R W that replaces the mean, or (0, 3).
    """

    hits: Addresses
    mirrored: Addresses
    channels: int
    smooth: Float32


class Pixels(NamedTuple):
    """What composing writes of a frame.

    Attributes:
        images: (n_lights, n_pixels, 3), see `finish`.
        samples: (n_pixels,) hits of each pixel.
        maps: (n_pixels, 9) means of W, R W and R, or (0, 9).
    """

    images: Stored
    samples: Int32
    maps: Float32


@kernel
def compose_pixels(
    band: Band, first_pixel: int, n: int, summands: Summands, how: Finish, out: Pixels
) -> tuple[int, int, int, int]:
    """Compose pixels first_pixel to first_pixel + n - 1 of all images of a frame, a band at a time.

    Args:
        band: room for the sums of some pixels.
        out: overwritten there.

    Returns:
        as `finish`, for all bands together.
    """
    hits, mirrored, channels, smooth = summands
    images, samples, maps = out
    n_lights = images.shape[0]
    bad, bad_light, bad_pixel, beyond = 0, -1, -1, 0
    for first in range(first_pixel, first_pixel + n, band.hits.shape[0]):
        m = min(band.hits.shape[0], first_pixel + n - first)
        accumulate(band, first, m, hits, channels, n_lights, True)
        for i in range(m):
            samples[first + i] = band.hits[i]
            for channel in range(3):
                if smooth.shape[0] > 0:
                    band.sums[i, INDIRECT + channel] = smooth[first + i, channel]
                if maps.shape[0] > 0:
                    maps[first + i, channel] = band.sums[i, OBSCURANCE + channel]
                    maps[first + i, 3 + channel] = band.sums[i, INDIRECT + channel]
                    maps[first + i, 6 + channel] = band.sums[i, REFLECTIVITY + channel]
        if mirrored.shape[0] > 0:
            accumulate(band, first, m, mirrored, channels, n_lights, False)
        found, l, pixel, large = finish(band, first, m, how, images)
        if bad == 0 and found > 0:
            bad_light, bad_pixel = l, pixel
        bad, beyond = bad + found, beyond + large
    return bad, bad_light, bad_pixel, beyond


@kernel
def weigh_halves(parts: Addresses, half: Int32, first_pixel: int, n: int, weights: Float64) -> None:
    """Sum the weights of the hits of both halves in pixels first_pixel to first_pixel + n - 1.

    Args:
        parts: of a `SourceList`.
        half: (n_parts,) the half that all hits of a part belong to, or BY_SAMPLE.
        weights: (2, n_pixels) overwritten there.
    """
    for pixel in range(first_pixel, first_pixel + n):
        weights[0, pixel] = weights[1, pixel] = 0.0
        for part in range(parts.shape[0]):
            source, own = parts[part], half[part]
            for entry in range(integer_at(source[START], pixel), integer_at(source[START], pixel + 1)):
                hit = integer_at(source[ORDER], entry)
                if half[part] == BY_SAMPLE:
                    own = int(real_at(source[ROW] + ROW_BYTES * hit, HALF))
                weights[own, pixel] += real_at(source[WEIGHTS], hit) if source[WEIGHTS] != 0 else np.float32(1.0)


@kernel
def compose_differences(
    band: Band, first_pixel: int, n: int, parts: Addresses, channels: int, how: Finish, images: Float32
) -> None:
    """Compose sums of hits, each with its factor, as images, a band at a time; see `standarderror.py`.

    Args:
        band: room for the sums of some pixels.
        parts: of a `SourceList`, with factors.
        channels: of irradiance, 1 or 3.
        how: `lowest` is minus infinity, as differences have both signs.
        images: (n_lights, n_pixels, 3) overwritten in pixels first_pixel to first_pixel + n - 1.
    """
    for first in range(first_pixel, first_pixel + n, band.hits.shape[0]):
        m = min(band.hits.shape[0], first_pixel + n - first)
        for i in range(m):
            for column in range(band.sums.shape[1]):
                band.sums[i, column] = 0.0
            for channel in range(3):
                for l in range(band.direct.shape[2]):
                    band.direct[i, channel, l] = 0.0
        accumulate(band, first, m, parts, channels, images.shape[0], False)
        finish(band, first, m, how, images)
