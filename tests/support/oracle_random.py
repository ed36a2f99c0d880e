"""Random numbers of the slow twin: the definition of the program's, in other code.

One number is a function of (seed, c, pixel, sample, dimension):

    key      = mix(place ^ mix(seed + G)),  place = c 2^44 + pixel 2^16 + sample
    bits     = mix(key + dimension G)
    point i  = ((low half of bits, high half of bits) / 2^32 + i (1/g, 1/g^2)) mod 1,  g the plastic number

or, of n points, + i (1, a) / n with a next to n / golden ratio and coprime to n (`lattice`),
with mix the finaliser of SplitMix64 and G = 2^64 / golden ratio. Points keep 24 bits, what float32 holds below 1.
"""

from math import gcd, isqrt
from typing import Any

import numpy as np

PIXEL, HEMISPHERE = 0, 1  # dimensions
WHOLE_PIXEL = 65535  # the "sample" whose bits all samples of a pixel share
HOLE = 65534  # the sample of a pixel without other hits
GOLDEN = (isqrt(5 * 2**128) - 2**64) // 2
MASK = 2**64 - 1


def mix_one(z: int) -> int:
    """SplitMix64's finaliser in whole numbers of any size."""
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & MASK
    return z ^ z >> 31


def mix(numbers: Any) -> Any:
    """`mix_one` of every number of a list."""
    return [mix_one(z) for z in numbers]


def keys(seed: int, c: int, pixels: Any, samples: Any) -> Any:
    """The key of each (pixel, sample)."""
    camera = mix_one(seed + GOLDEN & MASK)
    return mix(((c << 44) + (int(p) << 16) + int(s)) ^ camera for p, s in zip(pixels, samples, strict=True))


def bits(key: Any, dimension: int) -> Any:
    """64 random bits of each key."""
    return mix(k + dimension * GOLDEN & MASK for k in key)


def sequence() -> tuple[int, int]:
    """Steps of the golden ratio sequence in units of 2^-32."""
    g = np.roots([1, 0, -1, -1])[0].real  # g^3 = g + 1
    return round(2**32 / g), round(2**32 / g**2)


def lattice(n: int) -> tuple[int, int]:
    """Steps of a lattice of n points, likewise."""
    golden = (1 + 5**0.5) / 2
    near = sorted(range(1, n + 1), key=lambda a: abs(a - n / golden))
    a = next(a for a in near if gcd(a, n) == 1)
    return round(2**32 / n), round(a * 2**32 / n)


def points(words: Any, indices: Any, steps: tuple[int, int]) -> Any:
    """(n, 2) point of each pair (bits, index), in [0, 1)."""
    halves = [(word & 0xFFFFFFFF, word >> 32) for word in words]
    whole = [
        [(half + int(i) * step) % 2**32 >> 8 for half, step in zip(pair, steps, strict=True)]
        for pair, i in zip(halves, indices, strict=True)
    ]
    return np.array(whole, np.float64).reshape(-1, 2) / 2**24


def disc(uv: Any) -> Any:
    """Shirley and Chiu's map of the square to the disc, (n, 2): squares become circles, diagonals stay diagonals."""
    a, b = 2 * uv[:, 0] - 1, 2 * uv[:, 1] - 1
    radius = np.where(abs(a) >= abs(b), a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(abs(a) >= abs(b), np.pi / 4 * b / a, np.pi / 2 - np.pi / 4 * a / b)
    angle = np.where(radius == 0, 0.0, angle)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def hemisphere(normal: Any, uv: Any) -> Any:
    """Cosine-distributed unit directions about unit normals, (n, 3): the disc, lifted (Malley).

    The frame is the one that turns z to the normal about an axis in the xy plane; for normals below that plane it
    turns -z, mirrored (Duff et al. 2017).
    """
    side = np.where(normal[:, 2] >= 0, 1.0, -1.0)
    xy = disc(uv)
    z = np.sqrt(np.maximum(0, 1 - (xy**2).sum(axis=1)))
    n_xy, n_z = normal[:, :2], abs(normal[:, 2])
    # the shortest turn of z to n moves a vector t of the xy plane to t - n (n.t) / (1 + n_z) - z (n.t)
    tangent = np.stack([xy[:, 0], xy[:, 1] * side], axis=1)
    along = (tangent * n_xy).sum(axis=1)
    flat = tangent - n_xy * (along / (1 + n_z))[:, None]
    return np.column_stack([flat + z[:, None] * n_xy, side * (z * n_z - along)])
