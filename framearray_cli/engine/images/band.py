"""The sums of a band of pixels, and how they become N_l images [FA eq. 2].

    image[l] = sum(w (R / pi E[l] + I_A[l] R W + B)) / sum(w)       over native and outer hits
             + sum(t (R / pi E[l] + I_A[l] R W + B)) / n_native     over reflected hits

B is light-independent radiance, t the tint of mirrors. The sums of a band stay in the cache: `accumulate` over the hits
of all eyes of the window, `accumulate` over the frame's reflected hits, `finish`. This order is fixed, so that images
do not depend on the number of threads.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Addresses, Float32, Images, Int32, Real, Rgb

from ..hits.row import INDIRECT, LIGHT_INDEPENDENT
from ..kernels.bundle import allocated, bundle
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import (
    LANES,
    bits,
    compress,
    gather,
    lane_numbers,
    load,
    popcount,
    product,
    select,
    store,
    store_columns,
    stored,
)

# Images as they are stored: float32, or the bits of halves; (n_lights, n_pixels, 3).
Stored: TypeAlias = Float32 | NDArray[np.uint16]

INVERSE_PI = np.float32(1.0 / np.pi)
HALF_MAX = np.float32(65504.0)  # the largest half


@bundle
class Band(NamedTuple):
    """The sums of the pixels of a band, and a queue of lit hits of one pixel.

    Attributes:
        direct: (n_pixels, 3, n_lights or more, a multiple of LANES) sum of w R / pi E[l], in units of the lights'
            colour.
        sums: (n_pixels, LANES) sums of w row, see `hits/row.py`.
        hits: (n_pixels,) number of hits.
        places: (HITS_AT_ONCE + 2,) address of the irradiance of a hit, of its indirect light from cells, or of the
            strength of what shines there.
        shares: (HITS_AT_ONCE + 2, 3) w R / pi of a hit, times its colour c for indirect light; w and the texture of
            what shines.
        lit: (HITS_AT_ONCE + 2,) LIT of a hit.
        strength: (n_sources,) addresses of the strengths of all sources, (channels, n_lights) each, for hits that send
            out light themselves; (0,) where nothing shines.
        room: (10, LANES) scratch of `add_gloss`.
    """

    direct: Float32
    sums: Float32
    hits: Int32
    places: Addresses
    shares: Float32
    lit: Addresses
    strength: Addresses
    room: Float32


@bundle
class Finish(NamedTuple):
    """Factors that turn sums into radiance.

    Attributes:
        colour: (3, n_lights) the unit of direct sums, with room behind.
        ambient: (3, n_lights) I_A[l], radiance, with room behind.
        light_independent_from: the first plane whose images include B.
        lowest: the least valid value: 0, or minus infinity for differences.
    """

    colour: Rgb
    ambient: Rgb
    light_independent_from: int
    lowest: Real


# Number of lit hits whose direct light is summed together, and two more, as a hit may have light of three kinds.
HITS_AT_ONCE = 64
NOTHING_SHINES: Addresses = np.empty(0, np.int64)


def empty_band(n_pixels: int, n_lights: int, strength: Addresses = NOTHING_SHINES) -> Band:
    """Allocate the sums of n_pixels pixels."""
    queue, direct = HITS_AT_ONCE + 2, (n_pixels, 3, -(-n_lights // LANES) * LANES)
    return allocated(
        Band, direct=direct, sums=(n_pixels, LANES), hits=n_pixels, places=queue, shares=(queue, 3), lit=queue,
        strength=strength, room=(10, LANES),
    )  # fmt: skip


def as_stored(images: Images) -> Stored:
    """Images as `finish` takes them; shares memory."""
    return np.asarray(images.view(np.uint16)) if images.dtype == np.float16 else np.asarray(images, np.float32)


@kernel
def finish(band: Band, first_pixel: int, n: int, how: Finish, images: Stored) -> tuple[int, int, int, int]:
    """Write the n pixels of a band into all images of the frame; overwrites the band's direct sums.

    Args:
        images: (n_lights, n_pixels of the image, 3), overwritten from pixel `first_pixel` on: float32, or uint16 for
            the bits of halves, with values beyond the largest half cut to it.

    Returns:
        number of values that were not finite or below `how.lowest`, written as 0; light index and pixel of the first;
        number of values beyond the largest half.
    """
    # --- loop state ---
    n_lights, sums = images.shape[0], band.direct  # sums: direct light, and then radiance
    bad, bad_light, bad_pixel = 0, -1, -1  # invalid values; light position and pixel of the first
    beyond = 0  # values beyond the largest half

    for block in range(0, n, LANES):
        # 1. Radiance of some pixels. Blacken and count invalid values; they are rare.
        m = min(LANES, n - block)
        for i in range(block, block + m):
            for channel in range(3):
                wrong, large = _radiance(band, i, channel, n_lights, how)
                beyond += large
                for l in range(n_lights if wrong else 0):
                    if not (sums[i, channel, l] >= how.lowest and abs(sums[i, channel, l]) < np.inf):
                        sums[i, channel, l] = 0.0
                        if bad == 0:
                            bad_light, bad_pixel = l, first_pixel + i
                        bad += 1

        # 2. From all lights of a pixel to all pixels of a light.
        _write_columns(sums, 3 * block, 3 * m, images, 3 * first_pixel)
    return bad, bad_light, bad_pixel, beyond


@inlined
def _radiance(band: Band, i: int, channel: int, n_lights: int, how: Finish) -> tuple[bool, int]:
    """Make radiance of the direct sums of a channel of pixel i: colour[l] sum(w R / pi E[l]) + I_A[l] R W, and B.

    Returns:
        whether any value is invalid, and the number of values beyond the largest half.
    """
    # --- loop state ---
    wrong = 0  # bits of lanes with invalid values
    large = 0  # values beyond the largest half
    nothing, most = np.float32(0.0), np.float32(np.inf)
    indirect, light_independent = band.sums[i, INDIRECT + channel], band.sums[i, LIGHT_INDEPENDENT + channel]
    for l in range(0, n_lights, LANES):
        at, of_light = (3 * i + channel) * band.direct.shape[2] + l, channel * n_lights + l
        rest = select(lane_numbers() < np.int32(how.light_independent_from - l), nothing, light_independent)
        value = product(load(how.colour, of_light), load(band.direct, at)) + product(
            load(how.ambient, of_light), indirect
        )
        value = value + rest
        store(band.direct, at, value)
        size = select(value < nothing, -value, value)
        counts = lane_numbers() < np.int32(n_lights - l)
        wrong |= bits(counts & ~((value >= how.lowest) & (size < most)))
        large += popcount(counts & (size > HALF_MAX) & (size < most))
    return wrong != 0, large


@inlined
def _write_columns(sums: Float32, first: int, n: int, images: Stored, first_value: int) -> None:
    """Write rows first to first + n - 1 of the band, values (pixel, channel), into the images of all lights.

    Args:
        sums: (n_pixels, 3, n_lights or more).
        images: (n_lights, n_pixels, 3), overwritten; row 0 of the band is value `first_value`.
    """
    n_lights, length, stride = images.shape[0], images.shape[1] * images.shape[2], sums.shape[2]
    for row in range(first, first + n, LANES):
        if row + LANES <= first + n:
            for l in range(0, n_lights, LANES):
                to = l * length + first_value + row
                store_columns(sums, row * stride + l, stride, n_lights - l, images, to, length)
            continue
        # the last rows of all
        lane = lane_numbers()
        counts = lane < np.int32(first + n - row)
        for l in range(n_lights):
            place = select(counts, lane, np.int32(0)) * np.int32(stride) + np.int32(row * stride + l)
            compress(counts, stored(images, gather(sums, place)), images, l * length + first_value + row)
