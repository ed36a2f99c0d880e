"""Shapes of lights: how a source lights a point, and the particles that it emits.

A further shape of light has its kind in `lights.py` and its formulas here; what traces rays need not know it.

A source with a size is a sphere or the disc of a sun. From P it fills a cone of directions about its centre; a hit
draws one point q of the unit sphere per source, and q turns into a direction of the cone at every light position: its
height along the cone's axis says how far from the axis, the rest of it to which side. So a hit sees each source
under the same random numbers at all light positions, without axes that could turn or jump.
"""

import numpy as np

from framearray_cli.base.arrays import Real, Triple

from ..kernels.kernel import has_rows, inlined
from ..kernels.simd import gather, select, sqrt
from .lights import DIRECTIONAL, LightArrays
from .random import SOURCES, r2, random_word, sphere_point


@inlined
def source_point(key: np.uint64, s: int) -> Triple:
    """The point q of source s that the hit of a random key draws, on the unit sphere."""
    u, v = r2(random_word(key, SOURCES + s), 0)
    return sphere_point(u, v)


@inlined
def vector_and_factor(
    lights: LightArrays,
    s: int,
    x: Real,
    y: Real,
    z: Real,
    size: Real,
    p: Triple,
    g: Triple,
    m: Triple,
    q: Triple,
    lit: Real,
) -> tuple[Real, Real, Real, Real]:
    """Vectors from points p to source s at one or more light positions, and the geometry factors of their irradiance.

    The irradiance is the factor times the strength: cos(theta) / d^2 for a point source, whose vector ends at the
    source, and cos(theta) for a directional one, whose vector has length 1. It is 0 where the source does not shine or
    lies behind either normal. Of a source with a size it is the estimate by one direction, see `_cone_sample`.

    Args:
        x, y, z: the source's position, or for a directional one the direction in which its light travels.
        size: see `LightArrays`; not read where no source has a size.
        p, g, m: points, geometric and shading normals.
        q: see `source_point`; not read where no source has a size.
        lit: 1 where the source shines, else 0.
    """
    kind, nothing, one = lights.kind[s], np.float32(0.0), np.float32(1.0)
    # the vector to the source: L - P, or against the light's direction
    sign, from_point = (-one, nothing) if kind == DIRECTIONAL else (one, one)
    x, y, z = sign * x - from_point * p[0], sign * y - from_point * p[1], sign * z - from_point * p[2]
    if has_rows(lights.size):
        x, y, z, factor = _cone_sample(kind, x, y, z, size, q)
        cosine = x * m[0] + y * m[1] + z * m[2]
        in_front = (cosine > nothing) & (x * g[0] + y * g[1] + z * g[2] > nothing)
        return x, y, z, select(in_front, cosine * factor * lit, nothing)
    # cos(theta), not yet divided by d; the source counts in front of both normals
    cosine = x * m[0] + y * m[1] + z * m[2]
    in_front = (cosine > nothing) & (x * g[0] + y * g[1] + z * g[2] > nothing)
    factor = cosine * lit
    # a point source: d cos(theta) / d^3
    if kind != DIRECTIONAL:
        square = x * x + y * y + z * z
        factor = factor / (square * sqrt(square))
    return x, y, z, select(in_front, factor, nothing)


@inlined
def _cone_sample(kind: int, x: Real, y: Real, z: Real, size: Real, q: Triple) -> tuple[Real, Real, Real, Real]:
    """The vector from P to the point of a sphere or sun that q chooses, and the factor of its irradiance.

    The directions of a source whose rim is seen at the angle alpha from its centre are uniform in the cone, so that
    with c = cos(alpha) the factor times the vector's cosine is 2 cos(theta) / (1 + c), over d^2 for a sphere: its
    radiance I / (pi r^2), or E / (pi sin^2(alpha)) of a sun, times the cone's solid angle 2 pi (1 - c).

    Args:
        x, y, z: vector from P to the source's centre, of length 1 for a sun.

    Returns:
        the vector, which ends on the sphere or has length 1, and the factor, over the vector's length: a surface's
        irradiance is its product with the normal's scalar product with the vector. It is 0 inside a sphere.
    """
    nothing, one, two, tiny = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(1e-30)
    # the cone's axis w, d, and sin^2(alpha)
    square = x * x + y * y + z * z
    d = sqrt(select(square > tiny, square, tiny))
    wx, wy, wz = x / d, y / d, z / d
    sun = one if kind == DIRECTIONAL else nothing
    sine2 = size / (sun + (one - sun) * d * d)
    rest = one - sine2
    c = sqrt(select(rest > nothing, rest, nothing))
    # the direction: 1 - cos is uniform in 0 to 1 - c, the side is that of q beside w
    height = q[0] * wx + q[1] * wy + q[2] * wz
    h = sine2 / (one + c) * select(height > -one, one + height, nothing) / two
    sine_h = h * (two - h)
    vx, vy, vz = q[0] - height * wx, q[1] - height * wy, q[2] - height * wz
    beside = vx * vx + vy * vy + vz * vz
    scale = sqrt(sine_h / select(beside > tiny, beside, tiny))
    along = one - h
    x, y, z = along * wx + scale * vx, along * wy + scale * vy, along * wz + scale * vz
    factor = two / (one + c)
    # a sphere: to its near side
    if kind != DIRECTIONAL:
        half2 = size - d * d * sine_h
        reach = d * along - sqrt(select(half2 > nothing, half2, nothing))
        x, y, z = reach * x, reach * y, reach * z
        factor = select(rest > nothing, factor / (d * d * reach), nothing)
    return x, y, z, factor


@inlined
def emitted_ray(
    lights: LightArrays, s: int, l: int, radius: Real, a: Real, b: Real
) -> tuple[Real, Real, Real, Real, Real, Real]:
    """Origin and unit direction of a particle that source s emits at light position l, by two random numbers.

    A directional source emits particles from a disc as wide as the scene, of that radius, in front of it; a sphere
    emits them along its normals.
    """
    ox, oy, oz = lights.vector[s, 0, l], lights.vector[s, 1, l], lights.vector[s, 2, l]
    if lights.kind[s] == DIRECTIONAL:
        dx, dy, dz = lights.vector[s, 0, l], lights.vector[s, 1, l], lights.vector[s, 2, l]
        x, y, z = _disc_point(dx, dy, dz, a, b)
        ox, oy, oz = radius * (x - 2.0 * dx), radius * (y - 2.0 * dy), radius * (z - 2.0 * dz)
    else:
        dx, dy, dz = sphere_direction(a, b)
        if has_rows(lights.size):
            r = np.sqrt(gather(lights.size, s * lights.lit.shape[1] + l))
            ox, oy, oz = ox + r * dx, oy + r * dy, oz + r * dz
    return ox, oy, oz, dx, dy, dz


def emitted_power(lights: LightArrays, s: int, radius: float) -> float:
    """Power that source s emits into the scene, in units of its strength: through the disc, or in all directions.

    Args:
        radius: of the scene.
    """
    return float(np.pi * radius**2 if lights.kind[s] == DIRECTIONAL else 4 * np.pi)


@inlined
def sphere_direction(a: Real, b: Real) -> Triple:
    """Uniform unit direction."""
    z = 1.0 - 2.0 * b
    r, angle = np.sqrt(np.maximum(0.0, 1.0 - z * z)), 2.0 * np.pi * a
    return r * np.cos(angle), r * np.sin(angle), z


@inlined
def _disc_point(x: Real, y: Real, z: Real, a: Real, b: Real) -> Triple:
    """Uniform point of the unit disc normal to the unit vector (x, y, z)."""
    sx, sy = (0.0, 1.0) if x * x > 0.25 else (1.0, 0.0)
    ux, uy, uz = -z * sy, z * sx, x * sy - y * sx
    wx, wy, wz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    scale, angle = np.sqrt(b / (ux * ux + uy * uy + uz * uz)), 2.0 * np.pi * a
    p, q = scale * np.cos(angle), scale * np.sin(angle)
    return p * ux + q * wx, p * uy + q * wy, p * uz + q * wz
