"""Composing one frame: hits of 2 N_r + 1 eyes and mirror paths become N_l images [FA eq. 2].

    image[l] = (direct[l] + I_A[l] R W + constant) weighed over all hits + the same over reflected hits / n_native

A band of pixels is summed in arrays that stay in the cache: one `begin`, one `accumulate` an eye of the window, one
`normalise`, one `accumulate` of the frame's reflected hits, one `finish`. Sums happen in this fixed order, so that
images do not depend on the number of threads.
"""

from typing import NamedTuple

import numpy as np

from .arrays import Float32, Images, Int32, Rgb
from .kernel import kernel

INVERSE_PI = np.float32(1.0 / np.pi)


class Band(NamedTuple):
    """Sums over the pixels of a band.

    Attributes:
        direct: (n_pixels, 3, n_lights) sum of w R / pi E[l], in units of the lights' colour.
        rest: (n_pixels, 10) sums of w, w R W (3), w constant (3), w W (3).
        reflectivity: (n_pixels, 3) sum of w R.
        hits: (n_pixels,) number of hits.
    """

    direct: Float32
    rest: Float32
    reflectivity: Rgb
    hits: Int32


WEIGHT, INDIRECT, STEADY, OBSCURANCE = 0, 1, 4, 7


def empty_band(n_pixels: int, n_lights: int) -> Band:
    """Room for the sums of n_pixels pixels."""
    return Band(
        direct=np.empty((n_pixels, 3, n_lights), np.float32),
        rest=np.empty((n_pixels, 10), np.float32),
        reflectivity=np.empty((n_pixels, 3), np.float32),
        hits=np.empty(n_pixels, np.int32),
    )


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
def accumulate(
    band: Band,
    first_pixel: int,
    n: int,
    start: Int32,
    order: Int32,
    weight: Float32,
    scale: Float32,
    reflectivity: Rgb,
    obscurance: Rgb,
    constant: Rgb,
    irradiance: Float32,
) -> None:
    """Add hits to the sums of pixels first_pixel to first_pixel + n - 1.

    Args:
        start, order: from `sort_by_pixel`.
        weight: (n_hits,) weight of each hit, or (0,) where all weigh 1.
        scale: (n_pixels,) a factor for all hits of a pixel, or (0,) where it is 1.
        reflectivity, obscurance, constant: (n_hits, 3); constant is (0, 3) where the scene has none.
        irradiance: (n_hits, 1 or 3, n_lights).
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        pixel = first_pixel + i
        rest, mean_reflectivity = band.rest[i], band.reflectivity[i]
        for entry in range(start[pixel], start[pixel + 1]):
            hit = order[entry]
            w = weight[hit] if weight.shape[0] > 0 else np.float32(1.0)
            if scale.shape[0] > 0:
                w *= scale[pixel]
            band.hits[i] += 1
            rest[WEIGHT] += w
            if constant.shape[0] > 0:
                for channel in range(3):
                    rest[STEADY + channel] += w * constant[hit, channel]
            for channel in range(3):
                r = w * reflectivity[hit, channel]
                if r == 0.0:
                    continue
                mean_reflectivity[channel] += r
                rest[INDIRECT + channel] += r * obscurance[hit, channel]
                rest[OBSCURANCE + channel] += w * obscurance[hit, channel]
                r *= INVERSE_PI
                e, direct = irradiance[hit, channel if channels == 3 else 0], band.direct[i, channel]
                for l in range(n_lights):
                    direct[l] += r * e[l]


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
def finish(band: Band, first_pixel: int, n: int, colour: Rgb, ambient: Rgb, images: Images) -> tuple[int, int, int]:
    """Write the pixels of a band into all images of the frame.

    Args:
        colour: (n_lights, 3) what the direct sums are in units of.
        ambient: (n_lights, 3) I_A, radiance.
        images: (n_lights, n_pixels of the image, 3), written.

    Returns:
        number of values that were not finite or below zero, written as 0; light index and pixel of the first.
    """
    bad, bad_light, bad_pixel = 0, -1, -1
    for i in range(n):
        rest = band.rest[i]
        for l in range(images.shape[0]):
            for channel in range(3):
                value = (
                    colour[l, channel] * band.direct[i, channel, l]
                    + ambient[l, channel] * rest[INDIRECT + channel]
                    + rest[STEADY + channel]
                )
                if not (value >= 0.0 and value < np.inf):
                    if bad == 0:
                        bad_light, bad_pixel = l, first_pixel + i
                    bad += 1
                    value = np.float32(0.0)
                images[l, first_pixel + i, channel] = value
    return bad, bad_light, bad_pixel
