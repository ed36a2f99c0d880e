"""Shapes of lights: how a source lights a point, and the particles that it emits.

A further shape of light has its kind in `lights.py` and its formulas here; what traces rays need not know it.
"""

import numpy as np

from framearray_cli.base.arrays import Real, Triple

from ..kernels.kernel import inlined
from ..kernels.simd import select, sqrt
from .lights import DIRECTIONAL, LightArrays


@inlined
def vector_and_factor(
    lights: LightArrays, s: int, x: Real, y: Real, z: Real, p: Triple, g: Triple, m: Triple, lit: Real
) -> tuple[Real, Real, Real, Real]:
    """Vectors from points p to source s at one or more light positions, and the geometry factors of their irradiance.

    The irradiance is the factor times the strength: cos(theta) / d^2 for a point source, whose vector ends at the
    source, and cos(theta) for a directional one, whose vector has length 1. It is 0 where the source does not shine or
    lies behind either normal.

    Args:
        x, y, z: the source's position, or for a directional one the direction in which its light travels.
        p, g, m: points, geometric and shading normals.
        lit: 1 where the source shines, else 0.
    """
    kind, nothing, one = lights.kind[s], np.float32(0.0), np.float32(1.0)
    # the vector to the source: L - P, or against the light's direction
    sign, from_point = (-one, nothing) if kind == DIRECTIONAL else (one, one)
    x, y, z = sign * x - from_point * p[0], sign * y - from_point * p[1], sign * z - from_point * p[2]
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
def emitted_ray(
    lights: LightArrays, s: int, l: int, radius: Real, a: Real, b: Real
) -> tuple[Real, Real, Real, Real, Real, Real]:
    """Origin and unit direction of a particle that source s emits at light position l, by two random numbers.

    A directional source emits particles from a disc as wide as the scene, of that radius, in front of it.
    """
    ox, oy, oz = lights.vector[s, 0, l], lights.vector[s, 1, l], lights.vector[s, 2, l]
    if lights.kind[s] == DIRECTIONAL:
        dx, dy, dz = lights.vector[s, 0, l], lights.vector[s, 1, l], lights.vector[s, 2, l]
        x, y, z = _disc_point(dx, dy, dz, a, b)
        ox, oy, oz = radius * (x - 2.0 * dx), radius * (y - 2.0 * dy), radius * (z - 2.0 * dz)
    else:
        dx, dy, dz = sphere_direction(a, b)
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
