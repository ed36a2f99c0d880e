"""Composing one frame: hits of 2 N_r + 1 eyes and mirror paths become N_l images [FA eq. 2].

    image[l] = (direct[l] + I_A[l] R W + constant) weighed over all hits + the same over reflected hits / n_native

A band of pixels is summed in arrays that stay in the cache: `accumulate` over the hits of all eyes of the
window, `accumulate` for the frame's reflected hits, `finish`. Sums happen in this fixed order, so that images do not
depend on the number of threads.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Addresses, Float32, Images, Int32, Real, Rgb, with_room

from ..frames.records import INDIRECT, LIGHT_INDEPENDENT
from ..kernels.kernel import kernel
from ..kernels.simd import LANES, compress, gather, lane_numbers, store, stored

# Images as they are stored: float32, or the bits of halves; (n_lights, n_pixels, 3).
Stored: TypeAlias = Float32 | NDArray[np.uint16]

INVERSE_PI = np.float32(1.0 / np.pi)
HALF_MAX = np.float32(65504.0)  # the largest half


class Band(NamedTuple):
    """Sums over the pixels of a band, and room for the hits of one pixel.

    Attributes:
        direct: (n_pixels, 3, n_lights or more, a multiple of LANES) sum of w R / pi E[l], in units of the lights'
            colour.
        sums: (n_pixels, LANES) weighed sums of rows of hits, see `HitRecords`.
        hits: (n_pixels,) number of hits.
        places: (MOST,) where the irradiance of a hit stands: an address.
        shares: (MOST, 3) w R / pi of a hit.
        lit: (MOST,) which of its light is not zero: see `HitRecords`.
    """

    direct: Float32
    sums: Float32
    hits: Int32
    places: Addresses
    shares: Float32
    lit: Addresses


class Finish(NamedTuple):
    """How sums become radiance.

    Attributes:
        colour: (3, n_lights) what direct sums are in units of.
        ambient: (3, n_lights) I_A, radiance.
        light_independent_from: the first light position whose images hold what is the same under every light.
        lowest: the least value that is right: 0, or minus infinity where estimates may be negative.
    """

    colour: Rgb
    ambient: Rgb
    light_independent_from: int
    lowest: Real


# Hits of a pixel that are summed at once.
MOST = 64


def empty_band(n_pixels: int, n_lights: int) -> Band:
    """Room for the sums of n_pixels pixels."""
    return Band(
        direct=with_room((n_pixels, 3, -(-n_lights // LANES) * LANES), np.float32),
        sums=with_room((n_pixels, LANES), np.float32),
        hits=np.empty(n_pixels, np.int32),
        places=np.empty(MOST, np.int64),
        shares=np.empty((MOST, 3), np.float32),
        lit=np.empty(MOST, np.int64),
    )


def as_stored(images: Images) -> Stored:
    """Images as `finish` takes them; shares memory."""
    return np.asarray(images.view(np.uint16)) if images.dtype == np.float16 else np.asarray(images, np.float32)


@kernel
def finish(band: Band, first_pixel: int, n: int, how: Finish, images: Stored) -> tuple[int, int, int, int]:
    """Write the pixels of a band into all images of the frame; the band's direct sums are used up.

    Args:
        images: (n_lights, n_pixels of the image, 3), written: float32, or uint16 for the bits of halves, what lies
            beyond the largest half cut to that.

    Returns:
        number of values that were not finite or below `how.lowest`, written as 0; light index and pixel of the first;
        number of values beyond the largest half.
    """
    colour, ambient, light_independent_from, lowest = how
    bad, bad_light, bad_pixel, beyond = 0, -1, -1, 0
    n_lights, sums = images.shape[0], band.direct
    for i in range(n):
        for channel in range(3):
            indirect, steady = band.sums[i, INDIRECT + channel], band.sums[i, LIGHT_INDEPENDENT + channel]
            wrong = large = 0
            for part in range(2):
                first, end, rest = (
                    (0, light_independent_from, np.float32(0.0))
                    if part == 0
                    else (light_independent_from, n_lights, steady)
                )
                for l in range(first, end):
                    value = colour[channel, l] * sums[i, channel, l] + ambient[channel, l] * indirect + rest
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
                store(images, l * row + first + block, values)
            else:
                compress(lane_numbers() < np.int32(n - block), values, images, l * row + first + block)
