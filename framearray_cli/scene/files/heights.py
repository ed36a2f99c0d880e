"""Height maps -> normal maps, and how to tell one from the other: MTL files name both by the same key."""

import numpy as np

from framearray_cli.base.arrays import Bytes, Float64

LONG = 0.15  # how far the length of a vector of a normal map may be from 1, by compression and scaling
SHARE = 0.75  # of the texels of a normal map, at least, are vectors of length 1 that point up
GREY = 0.05  # how far blue may be from red, in the mean, in a height map: light greys have a length near 1, too


def holds_normals(texels: Bytes) -> bool:
    """Whether an image (height, width, 4) holds unit vectors that point up, and not heights."""
    red, green, blue = (texels[..., k].astype(np.float64) / 127.5 - 1 for k in range(3))
    if abs(blue - red).mean() < GREY:
        return False
    length = np.sqrt(red * red + green * green + blue * blue)
    return bool(((abs(length - 1) < LONG) & (blue > 0)).mean() >= SHARE)


def normals_of_heights(texels: Bytes) -> Bytes:
    """The normal map of a height map, both (height, width, 4), row 0 on top; the image repeats.

    A height is the mean of red, green and blue, from 0 to 1, and 1 is as high as a texel is wide.
    """
    height: Float64 = texels[..., :3].mean(axis=2) / 255
    along_u = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) / 2
    along_v = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) / 2
    normal = np.stack([-along_u, -along_v, np.ones_like(height)], axis=2)
    normal /= np.sqrt((normal * normal).sum(axis=2, keepdims=True))
    codes = np.rint((normal + 1) * 127.5).astype(np.uint8)
    return np.concatenate([codes, np.full_like(codes[..., :1], 255)], axis=2)
