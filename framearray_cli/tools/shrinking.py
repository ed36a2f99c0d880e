"""Smaller images: means over areas of linear light."""

import numpy as np

from framearray_cli.base.arrays import Float32, Image


def area_mean(image: Image, width: int, height: int) -> Image:
    """Shrink a linear image: each new pixel is the mean over its area, which may cut pixels.

    Args:
        image: (h, w, 3).
        width, height: pixels, at most those of the image.

    Returns:
        (height, width, 3) float32.
    """
    rows, columns = _shares(image.shape[0], height), _shares(image.shape[1], width)
    narrow = np.einsum("xw,hwk->hxk", columns, image, optimize=True)
    return np.asarray(np.einsum("yh,hxk->yxk", rows, narrow, optimize=True), np.float32)


def _shares(n: int, m: int) -> Float32:
    """Return the share (m, n) that each of n pixels has in each of m; rows sum to 1."""
    edges = np.arange(m + 1) * (n / m)
    low, high = np.arange(n)[None, :], np.arange(1, n + 1)[None, :]
    overlap = np.minimum(high, edges[1:, None]) - np.maximum(low, edges[:-1, None])
    return np.asarray(np.maximum(overlap, 0) * (m / n), np.float32)
