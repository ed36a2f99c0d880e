"""The slow twin of weights by area: one pixel at a time, in float64, by the definition in `engine/images/area.py`."""

from collections.abc import Iterator
from typing import Any

import numpy as np

PARTS, RING, CELLS = 16, 4, 8
SPREAD, LARGEST_RATIO, LEAST_SHARE, SMALLEST_FACTOR = 0.06, 2.5, 1 / 32, 1e-18


def area_weights(column: Any, row: Any, balance: Any, size: tuple[int, int]) -> Iterator[tuple[int, Any, Any]]:
    """For each pixel of a frame with hits: the pixel, the hits in and around it that count, and their weights.

    Args:
        column, row: (n,) of the part of the frame that each hit lies in; each pixel has 16 x 16 parts.
        balance: (n,) balance weight of each hit.
    """
    width, height = size
    for pixel in range(width * height):
        x, y = column - pixel % width * PARTS, row - pixel // width * PARTS
        own = (x >= 0) & (x < PARTS) & (y >= 0) & (y < PARTS)
        near = np.flatnonzero((x >= -RING) & (x < PARTS + RING) & (y >= -RING) & (y < PARTS + RING))
        if not own.any():
            continue
        b = balance[near]
        if b.max() <= LARGEST_RATIO * b.min():
            weight = (cell_factors(y[near])[:, :, None] * cell_factors(x[near])[:, None, :]) * b[:, None, None]
            weight = (weight / weight.sum(axis=0)).mean(axis=(1, 2))
            kept = weight >= LEAST_SHARE * weight.mean()
            near, weight = near[kept], weight[kept]
        else:
            near = np.flatnonzero(own)
            weight = balance[near]
        yield pixel, near, weight / weight.sum()


def cell_factors(part: Any) -> Any:
    """exp(-d^2 / (2 s^2)) along one axis, for parts (n,) and all cells, (n, CELLS)."""
    distance = (part[:, None] + 0.5) / PARTS - (np.arange(CELLS) + 0.5) / CELLS
    return np.maximum(np.exp(-(distance**2) / (2 * SPREAD**2)), SMALLEST_FACTOR)
