"""Random numbers keyed by (seed, camera, pixel, sample, dimension), and the maps from them to directions.

A number depends only on its key, never on order: images are the same for any number of threads and any split of the
job. The light position is not part of the key, so that all lights share hits and directions and movies do not flicker.

The maps take numbers or lanes of numbers.
"""

import math

import numpy as np

from framearray_cli.base.arrays import Real, Triple

from ..kernels.kernel import inlined
from ..kernels.simd import integers, reals, select, sqrt, words

# Dimensions: one stream per purpose.
PIXEL, HEMISPHERE, CHOICE, OTHER_HALF, CELLS, AROUND = 0, 1, 2, 4, 5, 6
LOBE, FOLLOWED = 7, 8
CONTINUED = 16  # and what follows: streams of the points that rays 0, 1, ... of a hit meet
MIRRORED = 1 << 17  # likewise: what rays 0, 1, ... of a hit choose at mirrors
SOURCES = 1 << 20  # and what follows: streams of the points of sources 0, 1, ...
EMITTERS = 1 << 21  # likewise: of the triangles of meshes that shine
PIXEL_SAMPLE = (1 << 16) - 1  # sample index, used by no hit, of numbers that all samples of a pixel share
HOLE_SAMPLE = (1 << 16) - 2  # sample index of the hit of a pixel that no other hit reaches

# The two-dimensional golden ratio sequence (Roberts 2018): multiples of (1/g, 1/g^2), g = 1.3247..., in units of 2^-32.
R2_X = np.uint32(3242174889)
R2_Y = np.uint32(2447445414)

UNIT_24 = np.float32(2.0**-24)


@inlined
def mix(z: np.uint64) -> np.uint64:
    """SplitMix64's finaliser: a bijection of 64 bits that leaves no visible structure."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@inlined
def stream(seed: int, c: int, pixel: int, sample: int) -> np.uint64:
    """The 64-bit key of one sample: c below 2^20, pixel below 2^28, sample below 2^16."""
    place = words(pixel) * np.uint64(1 << 16) + words(sample) + words(c) * np.uint64(1 << 44)
    return mix(place ^ mix(np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15)))


@inlined
def random_word(key: np.uint64, dimension: int) -> np.uint64:
    """64 random bits: dimension `dimension` of a stream."""
    return mix(key + np.uint64(dimension) * np.uint64(0x9E3779B97F4A7C15))


@inlined
def lattice_point(bits: np.uint64, i: int, step_x: int | np.uint32, step_y: int | np.uint32) -> tuple[Real, Real]:
    """Point i of a lattice, shifted by the random bits: uniform in [0, 1)^2; steps in units of 2^-32."""
    x = integers(bits) + integers(i) * np.int32(np.uint32(step_x))
    y = integers(bits >> np.uint64(32)) + integers(i) * np.int32(np.uint32(step_y))
    most = np.int32(0xFFFFFF)  # 24 bits: what float32 holds below 1
    return reals((x >> np.int32(8)) & most) * UNIT_24, reals((y >> np.int32(8)) & most) * UNIT_24


@inlined
def r2(bits: np.uint64, i: int) -> tuple[Real, Real]:
    """Point i of the golden ratio sequence, shifted by the random bits; evenly spread for any number of points."""
    return lattice_point(bits, i, R2_X, R2_Y)


def lattice_steps(n: int) -> tuple[int, int]:
    """Steps of a lattice of n points for `lattice_point`, spread more evenly than n of the golden ratio sequence.

    Point i is (i / n, a i / n) mod 1, with a next to n / golden ratio and coprime to n (a Korobov lattice). The
    variance of a mean over 5 points is about half of the variance over 5 points of the sequence.
    """
    wanted = n / ((1 + math.sqrt(5)) / 2)
    a = min((a for a in range(1, n + 1) if math.gcd(a, n) == 1), key=lambda a: abs(a - wanted))
    return round(2**32 / n) % 2**32, round(a * 2**32 / n) % 2**32


@inlined
def disc(u: Real, v: Real) -> tuple[Real, Real]:
    """Uniform point of the unit disc by Shirley and Chiu's concentric map.

    Its angles stay within pi/4, so short series suffice for cosine and sine.
    """
    one = np.float32(1.0)
    a, b = np.float32(2.0) * u - one, np.float32(2.0) * v - one
    steep = b * b > a * a
    radius, other = select(steep, b, a), select(steep, a, b)
    angle = np.float32(np.pi / 4) * other / select(radius * radius > np.float32(0.0), radius, one)
    square = angle * angle
    # Taylor series of cosine and sine; the first terms left out are below 3e-8 for angles up to pi/4
    cosine = one + square * (
        np.float32(-1 / 2)
        + square * (np.float32(1 / 24) + square * (np.float32(-1 / 720) + square * np.float32(1 / 40320)))
    )
    sine = angle * (
        one + square * (np.float32(-1 / 6) + square * (np.float32(1 / 120) + square * np.float32(-1 / 5040)))
    )
    return radius * select(steep, sine, cosine), radius * select(steep, cosine, sine)


@inlined
def sphere_point(u: Real, v: Real) -> Triple:
    """Uniform point of the unit sphere: the disc's point, area for area."""
    one, two = np.float32(1.0), np.float32(2.0)
    x, y = disc(u, v)
    square = x * x + y * y
    height = one - square
    scale = two * sqrt(select(height > np.float32(0.0), height, np.float32(0.0)))
    return scale * x, scale * y, one - two * square


@inlined
def cosine_direction(nx: Real, ny: Real, nz: Real, u: Real, v: Real) -> Triple:
    """Unit direction about the unit normal n with density cos(theta) / pi; the frame is Duff et al.'s (2017)."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    x, y = disc(u, v)
    height = one - x * x - y * y
    z = sqrt(select(height > nothing, height, nothing))
    sign = select(nz >= nothing, one, -one)
    a = -one / (sign + nz)
    b = nx * ny * a
    return (
        x * (one + sign * nx * nx * a) + y * b + z * nx,
        x * sign * b + y * (sign + ny * ny * a) + z * ny,
        z * nz - x * sign * nx - y * ny,
    )


@inlined
def above(x: Real, y: Real, z: Real, gx: Real, gy: Real, gz: Real) -> Triple:
    """The direction (x, y, z), mirrored into the half-space of the normal g if it points below the surface.

    Interpolated normals tilt the hemisphere; a ray below the triangle would only meet the triangle itself.
    """
    height = x * gx + y * gy + z * gz
    twice = select(height < np.float32(0.0), np.float32(2.0) * height, np.float32(0.0))
    return x - twice * gx, y - twice * gy, z - twice * gz
