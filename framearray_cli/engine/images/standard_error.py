"""The standard error of an image, estimated from two halves of its own hits.

The hits of a pixel belong to one of two halves with weights W_A and W_B, sampled independently. The samples of every
frame alternate between the halves; with few samples per pixel whole frames do. With a and b the means of the halves,
the image is I = (W_A a + W_B b) / (W_A + W_B), and

    D = (a - b) sqrt(W_A W_B) / (W_A + W_B)

has mean 0 and the variance of I, since the variance of a mean is proportional to one over its weight. D is signed: a
sum of images, each times a factor, has the sum of their D times the same factors. D^2 estimates the variance with one
degree of freedom per pixel, so we average it over a neighbourhood, weighed by hits: neighbours have the same variance
per hit, not the same number of hits.
"""

import math
from collections.abc import Mapping

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64, Int32

RADIUS = 2  # of the neighbourhood, pixels: 25 values estimate a standard error to within 14 %


def half_factors(weights: Float64 | Int32) -> Float32:
    """The factors of the hits of both halves in D.

    Args:
        weights: (2, n_pixels) W_A and W_B.

    Returns:
        (2, n_pixels), positive for the first half and negative for the second; 0 where a half is empty.
    """
    first, second = np.asarray(weights, np.float64)
    both = (first > 0) & (second > 0)
    ratio = np.sqrt(np.divide(second, first, out=np.ones_like(first), where=both))
    total = np.where(both, first + second, np.inf)
    return np.stack([ratio / total, -1.0 / (ratio * total)]).astype(np.float32)


def fill_unknown(differences: Float32, known: Flags, hits: Int32) -> None:
    """Fill pixels where a half has no hits: D of the nearest pixel that has both, rescaled to the number of hits.

    Args:
        differences: (n_images, height, width, 3) D, changed.
        known: (height, width) pixels with hits of both halves; if there are none at all, D stays as it is.
        hits: (height, width) number of hits.
    """
    if known.all() or not known.any():
        return
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(~known, return_distances=False, return_indices=True)[:, ~known]
    fewer = np.sqrt(hits[rows, columns] / np.maximum(hits[~known], 1)).astype(np.float32)
    differences[:, ~known] = differences[:, rows, columns] * fewer[:, None]


def standard_error(difference: Float32, hits: Float32 | Int32, radius: int = RADIUS) -> Float32:
    """The standard error of every pixel of an image, or of a sum of images.

    Args:
        difference: (height, width, 3) D.
        hits: (height, width) number of hits of each pixel.
        radius: of the square neighbourhood over which D^2 is averaged, pixels.

    Returns:
        (height, width, 3), in the unit of the image.
    """
    from scipy.ndimage import uniform_filter

    n = np.maximum(np.asarray(hits, np.float32), 1)[..., None]
    size = 2 * radius + 1
    # scaling by a power of 2 is exact, and keeps the squares of very bright values from overflowing
    scale = np.float32(2.0 ** max(math.frexp(float(np.abs(difference).max(initial=0.0)))[1] - 1, 0))
    scaled = difference / scale
    variance = uniform_filter(n * scaled * scaled, size=(size, size, 0), mode="nearest") / n
    return np.sqrt(np.maximum(variance, 0.0, dtype=np.float32)) * scale


def square_mean(error: Float32) -> float:
    """Mean square of a standard error over the pixels and channels of an image."""
    return float(np.mean(np.square(error, dtype=np.float64)))


def error_summary(errors: Mapping[tuple[int, int], tuple[float, float]]) -> dict[str, float | int]:
    """The summary of the errors of an array for its manifest.

    Args:
        errors: (camera, light) -> mean square of the standard error and mean radiance of an image.

    Returns:
        `rms`: root of the mean square over all images, radiance; `relative`: `rms` over the mean radiance, 0 if all is
        black; `largest`: the largest root mean square of an image, with its `camera` and `light`.
    """
    images = sorted(errors)  # sums are the same in whatever order images were written
    squares = {image: errors[image][0] for image in images}
    rms = float(np.sqrt(np.mean(list(squares.values()))))
    radiance = float(np.mean([errors[image][1] for image in images]))
    camera, light = max(images, key=lambda image: squares[image])
    return {
        "rms": rms,
        "relative": rms / radiance if radiance > 0 else 0.0,
        "largest": float(np.sqrt(squares[camera, light])),
        "camera": camera,
        "light": light,
    }
