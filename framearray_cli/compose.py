"""Composing one frame: hits of 2 N_r + 1 eyes and mirror paths become N_l images [FA eq. 2].

    image[l] = (direct[l] + I_A[l] R W + constant) weighed over all hits + the same over reflected hits / n_native

A band of pixels is summed in arrays that stay in the cache: `begin`, `accumulate` for the hits of all eyes of the
window, `normalise`, `accumulate` for the frame's reflected hits, `finish`. Sums happen in this fixed order, so that
images do not depend on the number of threads.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .arrays import Addresses, Float32, Images, Int32, Real, Rgb
from .kernel import kernel
from .lanes import LANES, compress, gather, lane_numbers, put_lanes, stored

# Images as they are stored: float32, or the bits of halves; (n_lights, n_pixels, 3).
Stored: TypeAlias = Float32 | NDArray[np.uint16]

INVERSE_PI = np.float32(1.0 / np.pi)
HALF_MAX = np.float32(65504.0)  # the largest half


class Band(NamedTuple):
    """Sums over the pixels of a band, and room for the hits of one pixel.

    Attributes:
        direct: (n_pixels, 3, n_lights or more, a multiple of LANES) sum of w R / pi E[l], in units of the lights'
            colour.
        rest: (n_pixels, 10) sums of w, w R W (3), w constant (3), w W (3).
        reflectivity: (n_pixels, 3) sum of w R.
        hits: (n_pixels,) number of hits.
        rows: (MOST,) where the irradiance of a hit stands: an address.
        shares: (MOST, 3) w R / pi of a hit.
    """

    direct: Float32
    rest: Float32
    reflectivity: Rgb
    hits: Int32
    rows: Addresses
    shares: Float32


WEIGHT, INDIRECT, STEADY, OBSCURANCE = 0, 1, 4, 7
# Hits of a pixel that are summed at once.
MOST = 64


def empty_band(n_pixels: int, n_lights: int) -> Band:
    """Room for the sums of n_pixels pixels."""
    return Band(
        direct=np.empty((n_pixels, 3, -(-n_lights // LANES) * LANES), np.float32),
        rest=np.empty((n_pixels, 10), np.float32),
        reflectivity=np.empty((n_pixels, 3), np.float32),
        hits=np.empty(n_pixels, np.int32),
        rows=np.empty(MOST, np.int64),
        shares=np.empty((MOST, 3), np.float32),
    )


def as_stored(images: Images) -> Stored:
    """Images as `finish` takes them; shares memory."""
    return np.asarray(images.view(np.uint16)) if images.dtype == np.float16 else np.asarray(images, np.float32)


@kernel
def begin(band: Band, n: int) -> None:
    """Set the sums of pixels 0 to n - 1 of a band to zero."""
    for i in range(n):
        band.hits[i] = 0
        for value in range(band.rest.shape[1]):
            band.rest[i, value] = 0.0
        for channel in range(3):
            band.reflectivity[i, channel] = 0.0
            for l in range(band.direct.shape[2]):
                band.direct[i, channel, l] = 0.0


@kernel
def normalise(band: Band, n: int) -> None:
    """Turn sums into means over the weights; a pixel without hits stays zero."""
    for i in range(n):
        total = band.rest[i, WEIGHT]
        if total <= 0.0:
            continue
        inverse = np.float32(1.0) / total
        for channel in range(3):
            direct = band.direct[i, channel]
            for l in range(direct.shape[0]):
                direct[l] *= inverse
            band.reflectivity[i, channel] *= inverse
        for value in range(1, 10):
            band.rest[i, value] *= inverse


@kernel
def finish(
    band: Band, first_pixel: int, n: int, colour: Rgb, ambient: Rgb, lowest: Real, images: Stored
) -> tuple[int, int, int, int]:
    """Write the pixels of a band into all images of the frame; the band's direct sums are used up.

    Args:
        colour: (3, n_lights) what the direct sums are in units of.
        ambient: (3, n_lights) I_A, radiance.
        lowest: the least value that is right: 0, or minus infinity where estimates may be negative.
        images: (n_lights, n_pixels of the image, 3), written: float32, or uint16 for the bits of halves, what lies
            beyond the largest half cut to that.

    Returns:
        number of values that were not finite or below `lowest`, written as 0; light index and pixel of the first;
        number of values beyond the largest half.
    """
    bad, bad_light, bad_pixel, beyond = 0, -1, -1, 0
    n_lights, sums = images.shape[0], band.direct
    for i in range(n):
        for channel in range(3):
            indirect, steady = band.rest[i, INDIRECT + channel], band.rest[i, STEADY + channel]
            wrong = large = 0
            for l in range(n_lights):
                value = colour[channel, l] * sums[i, channel, l] + ambient[channel, l] * indirect + steady
                wrong += not (value >= lowest and abs(value) < np.inf)
                large += HALF_MAX < abs(value) < np.inf
                sums[i, channel, l] = value
            beyond += large
            for l in range(n_lights if wrong else 0):
                if not (sums[i, channel, l] >= lowest and abs(sums[i, channel, l]) < np.inf):
                    sums[i, channel, l] = 0.0
                    if bad == 0:
                        bad_light, bad_pixel = l, first_pixel + i
                    bad += 1
    transpose(sums, 3 * n, images, 3 * first_pixel)
    return bad, bad_light, bad_pixel, beyond


@kernel
def transpose(sums: Float32, n: int, images: Stored, first: int) -> None:
    """Write the first n values of each light, light by light: sums has all lights of a value, images all values of one.

    Args:
        sums: (n_pixels, 3, n_lights or more).
        images: (n_lights, n_pixels, 3); written from value `first` on.
    """
    n_lights, row, stride = images.shape[0], images.shape[1] * images.shape[2], sums.shape[2]
    step = lane_numbers() * np.int32(stride)
    for block in range(0, n, LANES):
        for l in range(n_lights):
            values = stored(images, gather(sums, step + np.int32(block * stride + l)))
            if block + LANES <= n:
                put_lanes(images, l * row + first + block, values)
            else:
                compress(lane_numbers() < np.int32(n - block), values, images, l * row + first + block)
