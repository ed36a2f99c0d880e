"""Distances of images from path-traced ones, of which the noise of the latter is no part."""

from collections.abc import Mapping

import numpy as np

from bench.core.results import Table
from framearray_cli.base.arrays import Float64, Image

from .traced import Truth

BLOCK = 4  # pixels along an edge of the squares whose means are compared


def means(image: Image) -> Float64:
    """Means over squares of BLOCK x BLOCK pixels; borders that fill no square are left out."""
    h, w = (size // BLOCK for size in image.shape[:2])
    squares = image[: h * BLOCK, : w * BLOCK].astype(np.float64).reshape(h, BLOCK, w, BLOCK, -1)
    found: Float64 = squares.mean(axis=(1, 3))
    return found


def rmse(image: Float64, halves: tuple[Float64, Float64]) -> float:
    """Root mean square error against the mean of two halves.

    The errors against both are multiplied, not squared: their noise is independent, so the mean of the product has
    none of it. A mean below zero, which chance can give where there is little to find, counts as 0.
    """
    return float(np.sqrt(max(((image - halves[0]) * (image - halves[1])).mean(), 0.0)))


def distance(image: Image, direct: Image, truth: Truth) -> Table:
    """How far an image, and its indirect light, are from the truth.

    Args:
        image: all light, radiance, (h, w, 3).
        direct: the same without indirect light.
    Returns:
        all: RMSE of BLOCK x BLOCK means over their root mean square; mean: of all light over that of the truth;
        indirect: RMSE per pixel over the mean indirect light, and `indirect_mean`, its mean over that of the truth.
    """
    halves = means(truth.total[0]), means(truth.total[1])
    level = float(np.sqrt((halves[0] * halves[1]).mean()))
    indirect = (image - direct).astype(np.float64)
    right = truth.indirect.astype(np.float64)
    return {
        "all": rmse(means(image), halves) / level,
        "mean": float(image.mean(dtype=np.float64) / truth.total.mean(dtype=np.float64)),
        "indirect": rmse(indirect, (right[0], right[1])) / float(right.mean()),
        "indirect_mean": float(indirect.mean() / right.mean()),
    }


def noise(truth: Truth) -> Mapping[str, float]:
    """What is left of noise in the mean of both halves: over the same levels as `distance` has."""
    a, b = means(truth.total[0]), means(truth.total[1])
    right = truth.indirect.astype(np.float64)
    return {
        "all": float(np.sqrt(((a - b) ** 2).mean()) / 2 / np.sqrt((a * b).mean())),
        "indirect": float(np.sqrt(((right[0] - right[1]) ** 2).mean()) / 2 / right.mean()),
    }
