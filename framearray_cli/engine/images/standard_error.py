"""How far an image is from what it would be with endless samples, told from the image itself.

The hits of a pixel are kept apart in two halves with weights W_A and W_B, sampled independently of each other: the
samples of every frame take turns, or whole frames do where a frame has few samples a pixel. With a and b the means
of the halves, the image is I = (W_A a + W_B b) / (W_A + W_B), and

    D = (a - b) sqrt(W_A W_B) / (W_A + W_B)

has mean 0 and the variance of I, since that of a mean goes with one over its weight. D is signed, so images that are
added, each with a factor, have a D that is the sum of theirs with the same factors. D^2 tells a variance by one
degree of freedom a pixel, so it is averaged over a neighbourhood, weighed by hits: neighbours have the same variance
a hit, not the same number of hits.
"""

import math
from collections.abc import Mapping

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64, Int32

RADIUS = 2  # of the neighbourhood, pixels: 25 values tell a standard error to 14 %


def half_factors(weights: Float64 | Int32) -> Float32:
    """Factors of the hits of both halves in D.

    Args:
        weights: (2, n_pixels) sums over the halves of each pixel.

    Returns:
        (2, n_pixels), of the hits of the first half above 0, of those of the second below; 0 where a half is empty.
    """
    first, second = np.asarray(weights, np.float64)
    both = (first > 0) & (second > 0)
    ratio = np.sqrt(np.divide(second, first, out=np.ones_like(first), where=both))
    total = np.where(both, first + second, np.inf)
    return np.stack([ratio / total, -1.0 / (ratio * total)]).astype(np.float32)


def fill_unknown(differences: Float32, known: Flags, hits: Int32) -> None:
    """Give pixels of which one half has no hits the D of the nearest other pixel, for their own number of hits.

    Args:
        differences: (n_images, height, width, 3) D, changed.
        known: (height, width) pixels with hits of both halves; where there are none, D stays as it is.
        hits: (height, width) number of hits.
    """
    if known.all() or not known.any():
        return
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(~known, return_distances=False, return_indices=True)[:, ~known]
    fewer = np.sqrt(hits[rows, columns] / np.maximum(hits[~known], 1)).astype(np.float32)
    differences[:, ~known] = differences[:, rows, columns] * fewer[:, None]


def standard_error(difference: Float32, hits: Float32 | Int32, radius: int = RADIUS) -> Float32:
    """Standard error of every pixel of an image, from its D or that of images that were added.

    Args:
        difference: (height, width, 3) D.
        hits: (height, width) number of hits of each pixel.
        radius: of the square neighbourhood that D^2 is averaged over, pixels.

    Returns:
        (height, width, 3), in the unit of the image.
    """
    from scipy.ndimage import uniform_filter

    n = np.maximum(np.asarray(hits, np.float32), 1)[..., None]
    size = 2 * radius + 1
    # a power of 2 keeps every bit, and the squares of what is very bright from overflowing
    scale = np.float32(2.0 ** max(math.frexp(float(np.abs(difference).max(initial=0.0)))[1] - 1, 0))
    scaled = difference / scale
    variance = uniform_filter(n * scaled * scaled, size=(size, size, 0), mode="nearest") / n
    error: Float32 = np.sqrt(np.maximum(variance, 0.0, dtype=np.float32)) * scale
    return error


def square_mean(error: Float32) -> float:
    """Mean square of a standard error over the pixels and channels of an image."""
    return float(np.mean(np.square(error, dtype=np.float64)))


def summed_up(errors: Mapping[tuple[int, int], tuple[float, float]]) -> dict[str, float | int]:
    """What a manifest says of the errors of an array.

    Args:
        errors: (camera, light) -> mean square of the standard error and mean radiance of an image.

    Returns:
        `rms`: root of the mean square over all images, radiance; `relative`: that over the mean radiance, 0 where all
        is black; `largest`: the largest of an image, with its `camera` and `light`.
    """
    squares = {image: square for image, (square, _) in errors.items()}
    rms = float(np.sqrt(np.mean(list(squares.values()))))
    radiance = float(np.mean([mean for _, mean in errors.values()]))
    camera, light = max(sorted(squares), key=lambda image: squares[image])
    return {
        "rms": rms,
        "relative": rms / radiance if radiance > 0 else 0.0,
        "largest": float(np.sqrt(squares[camera, light])),
        "camera": camera,
        "light": light,
    }
