"""Smaller copies of textures, for surfaces far away [Williams83]: each half as wide and high as the one before.

Means are those of linear light. A side of an odd number of texels is divided into parts of equal size.
"""

from collections.abc import Collection, Sequence

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Int32
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear

MOST_LEVELS = 16  # of a texture 32768 texels wide
_AT_ONCE = 1 << 16  # numbers that are averaged together; few enough to stay in a cache


def add_mips(textures: Sequence[Bytes], wanted: Collection[int]) -> tuple[list[Bytes], Int32]:
    """Make the smaller copies of some textures.

    Args:
        textures: (height, width, 4) each, colours sRGB encoded, alpha linear.
        wanted: numbers of those that colour surfaces.

    Returns:
        The copies, whose texels follow those of all textures, in this order; and (n, MOST_LEVELS, 3) first texel, width
        and height of each copy of each texture. Level 0 is the texture; behind its last copy a texture repeats that.
    """
    first = sum(texture.shape[0] * texture.shape[1] for texture in textures)
    starts = np.cumsum([0, *(texture.shape[0] * texture.shape[1] for texture in textures)])
    levels = np.zeros((len(textures), MOST_LEVELS, 3), np.int32)
    copies: list[Bytes] = []
    for number, texture in enumerate(textures):
        levels[number] = starts[number], texture.shape[1], texture.shape[0]
        for level in range(1, MOST_LEVELS) if number in wanted else ():
            if texture.shape[:2] == (1, 1):
                break
            texture = halved(texture)
            levels[number, level:] = first, texture.shape[1], texture.shape[0]
            first += texture.shape[0] * texture.shape[1]
            copies.append(texture)
    return copies, levels


def halved(texture: Bytes) -> Bytes:
    """A texture (height, width, 4) with half as many texels along each side, at least 1."""
    means = np.concatenate([linear_from_srgb8(texture[..., :3]), texture[..., 3:].astype(np.float32)], axis=2)
    means = _half(_half(means).swapaxes(0, 1)).swapaxes(0, 1)
    return np.concatenate([srgb8_from_linear(means[..., :3]), np.rint(means[..., 3:]).astype(np.uint8)], axis=2)


def _half(values: Float32) -> Float32:
    """Means of n // 2 equal parts of the n rows, at least one."""
    n = len(values)
    m = n // 2
    if n == 1:
        return values
    if n == 2 * m:
        return np.asarray((values[0::2] + values[1::2]) * np.float32(0.5))
    # part k has three rows of texels, 2 k to 2 k + 2; the first and the last lie in it partly
    edges = np.arange(m + 1) * (n / m)
    found = np.empty((m, *values.shape[1:]), np.float32)
    rows_at_once = max(_AT_ONCE // values[0].size, 1)
    for begin in range(0, m, rows_at_once):
        k = np.arange(begin, min(begin + rows_at_once, m))
        rows = 2 * k[:, None] + np.arange(3)
        weights = np.minimum(rows + 1, edges[k + 1, None]) - np.maximum(rows, edges[k, None])
        weights /= weights.sum(axis=1, keepdims=True)
        found[k] = (weights[:, None, :] @ values[rows].reshape(len(k), 3, -1)).reshape(found[k].shape)
    return found
