"""Rectangles and discs: the point of a panel that a hit draws, and the particles that it emits.

A panel has the same radiance L everywhere and to all sides of its front. The irradiance of a surface is on average

    L A cos(theta) cos(theta_l) / d^2

over points spread evenly over its area A: theta at the surface, theta_l at the panel, d between them. The strength of a
panel is L A, its intensity along the normal, so that one that is far away is a point of that intensity.
"""

import numpy as np

from framearray_cli.base.arrays import Real, Triple

from ..kernels.kernel import inlined
from ..kernels.simd import gather, load, select
from .lights import DISC, LightArrays
from .random import cosine_direction, disc

# Particles start at this share of the half axes in front of a panel, so that none meets a wall that the panel lies on.
AHEAD = 1e-4

PanelAt = tuple[Real, Real, Real, Real, Real, Real, Real, Real, Real, Real]


@inlined
def panel_at(lights: LightArrays, s: int, l: int) -> PanelAt:
    """The rows of source s at light position l; see `LightArrays.panel`."""
    n, at = lights.lit.shape[1], 10 * s * lights.lit.shape[1] + l
    return (
        gather(lights.panel, at),
        gather(lights.panel, at + n),
        gather(lights.panel, at + 2 * n),
        gather(lights.panel, at + 3 * n),
        gather(lights.panel, at + 4 * n),
        gather(lights.panel, at + 5 * n),
        gather(lights.panel, at + 6 * n),
        gather(lights.panel, at + 7 * n),
        gather(lights.panel, at + 8 * n),
        gather(lights.panel, at + 9 * n),
    )


@inlined
def panel_in_lanes(lights: LightArrays, s: int, l: int) -> PanelAt:
    """The rows of source s at light positions l to l + 15."""
    n, at = lights.lit.shape[1], 10 * s * lights.lit.shape[1] + l
    return (
        load(lights.panel, at),
        load(lights.panel, at + n),
        load(lights.panel, at + 2 * n),
        load(lights.panel, at + 3 * n),
        load(lights.panel, at + 4 * n),
        load(lights.panel, at + 5 * n),
        load(lights.panel, at + 6 * n),
        load(lights.panel, at + 7 * n),
        load(lights.panel, at + 8 * n),
        load(lights.panel, at + 9 * n),
    )


@inlined
def panel_point(kind: int, u: Real, v: Real) -> Triple:
    """The point of a panel that two random numbers choose, in units of its half axes; the third number is 0."""
    one, two, nothing = np.float32(1.0), np.float32(2.0), np.float32(0.0) * u
    if kind == DISC:
        x, y = disc(u, v)
        return x, y, nothing
    return two * u - one, two * v - one, nothing


@inlined
def panel_sample(panel: PanelAt, x: Real, y: Real, z: Real, q: Triple) -> tuple[Real, Real, Real, Real]:
    """The vector from P to the point q of a panel, and cos(theta_l) / d^3: 0 where the panel shows no bright side.

    Args:
        x, y, z: vector from P to the panel's middle.
    """
    ax, ay, az, bx, by, bz, nx, ny, nz, back = panel
    x, y, z = x + q[0] * ax + q[1] * bx, y + q[0] * ay + q[1] * by, z + q[0] * az + q[1] * bz
    square = x * x + y * y + z * z
    # d cos(theta_l) in front of the panel; behind it, that of the back
    height = -(x * nx + y * ny + z * nz)
    behind = back * height
    inverse = np.float32(1.0) / square
    return x, y, z, select(height > behind, height, behind) * inverse * inverse


@inlined
def panel_ray(
    lights: LightArrays, s: int, l: int, a: Real, b: Real, c: Real, d: Real
) -> tuple[Real, Real, Real, Real, Real, Real]:
    """Origin and unit direction of a particle of a panel: from a point by a and b, by the cosine of its direction."""
    ax, ay, az, bx, by, bz, nx, ny, nz, back = panel_at(lights, s, l)
    x, y, _ = panel_point(lights.kind[s], np.float32(a), np.float32(b))
    ahead = np.float32(AHEAD) * np.sqrt(ax * ax + ay * ay + az * az + bx * bx + by * by + bz * bz)
    # both sides shine: the first half of the numbers c is for the back
    if back < np.float32(0.0):
        if c < np.float32(0.5):
            nx, ny, nz = -nx, -ny, -nz
        else:
            c = c - np.float32(0.5)
        c = np.float32(2.0) * c
    ox = lights.vector[s, 0, l] + x * ax + y * bx + ahead * nx
    oy = lights.vector[s, 1, l] + x * ay + y * by + ahead * ny
    oz = lights.vector[s, 2, l] + x * az + y * bz + ahead * nz
    dx, dy, dz = cosine_direction(nx, ny, nz, c, d)
    return ox, oy, oz, dx, dy, dz
