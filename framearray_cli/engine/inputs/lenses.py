"""Cameras other than a perspective whose axis meets the middle of the picture: orthographic, panorama, shifted.

Formulas: `base/lens.py`. A row of `Cameras.lens` describes the lens of an eye, whatever the resolution; kernels of
other jobs are compiled without any of this. Functions take numbers or lanes.
"""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64, Real, Triple
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE, Lens

from ..kernels.kernel import inlined
from ..kernels.simd import doubles, reals, select, sqrt

# Columns: the kind, f_x / width, f_y / height, c_x / width, c_y / height.
KIND, ACROSS, DOWN, LEFT, TOP, COLUMNS = range(6)
OF_PERSPECTIVE, OF_ORTHOGRAPHIC, OF_PANORAMA = range(3)
_KINDS = {PERSPECTIVE: OF_PERSPECTIVE, ORTHOGRAPHIC: OF_ORTHOGRAPHIC, PANORAMA: OF_PANORAMA}
# Directions are parallel if their cosine is above this: float32 knows no better.
PARALLEL = np.float32(1.0 - 2.0**-22)
# A panorama's pixels at the poles: no density is beyond that of a ray this far from one, as a share of the distance.
POLE = 1e-6


def lens_row(lens: Lens, resolution: tuple[int, int]) -> list[float]:
    """The row of `Cameras.lens` of one eye."""
    if lens.type == PANORAMA:
        return [OF_PANORAMA, 0.0, 0.0, 0.5, 0.5]
    sides = (*resolution, *resolution)
    values = (*lens.focal(resolution), *lens.centre(resolution))
    return [_KINDS[lens.type], *(value / side for value, side in zip(values, sides, strict=True))]


@inlined
def _sine(w: Real) -> Real:
    """sin(pi w) for w from -1/2 to 1/2, by its series; the error is below 1e-13."""
    x = w * np.pi
    z = x * x
    series = 1.0 - z / 272.0
    series = 1.0 - z / 210.0 * series
    series = 1.0 - z / 156.0 * series
    series = 1.0 - z / 110.0 * series
    series = 1.0 - z / 72.0 * series
    series = 1.0 - z / 42.0 * series
    series = 1.0 - z / 20.0 * series
    return x * (1.0 - z / 6.0 * series)


@inlined
def sine_and_cosine(z: Real) -> tuple[Real, Real]:
    """sin(pi z) and cos(pi z) for z from -1 to 1."""
    size = select(z < 0.0, -z, z)
    folded = select(size > 0.5, 1.0 - size, size)
    return _sine(select(z < 0.0, -folded, folded)), _sine(0.5 - size)


@inlined
def angle_of(y: Real, x: Real) -> Real:
    """atan2(y, x) / pi, float64, from -1 to 1; 0 at (0, 0). The error is below 1e-13.

    The angle is halved three times, tan(a / 2) = t / (1 + sqrt(1 + t^2)), before its series is summed.
    """
    up, along = select(y < 0.0, -y, y), select(x < 0.0, -x, x)
    steep = up > along
    low, high = select(steep, along, up), select(steep, up, along)
    t = low / select(high > 0.0, high, 1.0)
    t = t / (1.0 + sqrt(1.0 + t * t))
    t = t / (1.0 + sqrt(1.0 + t * t))
    t = t / (1.0 + sqrt(1.0 + t * t))
    z = t * t
    series = 1.0 / 11.0 - z / 13.0
    series = 1.0 / 9.0 - z * series
    series = 1.0 / 7.0 - z * series
    series = 1.0 / 5.0 - z * series
    series = 1.0 / 3.0 - z * series
    angle = t * (1.0 - z * series) * (8.0 / np.pi)
    angle = select(steep, 0.5 - angle, angle)
    angle = select(x < 0.0, 1.0 - angle, angle)
    turned: Real = select(y < 0.0, -angle, angle)
    return turned


@inlined
def _combined(cams: Any, k: int, a: Real, b: Real, d: Real) -> Triple:
    """A right + b up + d forward of eye k."""
    r, u, f = cams.right, cams.up, cams.forward
    return (
        a * r[k, 0] + b * u[k, 0] + d * f[k, 0],
        a * r[k, 1] + b * u[k, 1] + d * f[k, 1],
        a * r[k, 2] + b * u[k, 2] + d * f[k, 2],
    )


@inlined
def lens_ray(cams: Any, c: int, x: Real, y: Real) -> tuple[Triple, Triple]:
    """Origin and direction of the ray of eye c through image position (x, y), pixels.

    The direction is as long as one unit of depth.
    """
    lens, o = cams.lens, cams.position
    s, t = x / cams.width, y / cams.height
    if lens[c, KIND] == OF_PANORAMA:
        (sine, cosine), (up, level) = sine_and_cosine(2.0 * s - 1.0), sine_and_cosine(0.5 - t)
        a, b, d = reals(level * sine), reals(up), reals(level * cosine)
    else:
        a, b = reals((s - lens[c, LEFT]) / lens[c, ACROSS]), reals((lens[c, TOP] - t) / lens[c, DOWN])
        d = reals(0.0 * s + 1.0)
    if lens[c, KIND] == OF_ORTHOGRAPHIC:
        nothing = d - d
        ox, oy, oz = _combined(cams, c, a, b, nothing)
        return (o[c, 0] + ox, o[c, 1] + oy, o[c, 2] + oz), _combined(cams, c, nothing, nothing, d)
    dx, dy, dz = _combined(cams, c, a, b, d)
    nothing = dx - dx
    return (o[c, 0] + nothing, o[c, 1] + nothing, o[c, 2] + nothing), (dx, dy, dz)


@inlined
def lens_position(cams: Any, k: int, x: Real, y: Real, z: Real) -> tuple[Real, Real, Real]:
    """Image position (x, y) of eye k, float64, at which the vector (x, y, z) from the eye is seen, and its depth.

    The position is arbitrary where a perspective has the vector behind it.
    """
    lens, r, u, f = cams.lens, cams.right, cams.up, cams.forward
    across = doubles(x * r[k, 0] + y * r[k, 1] + z * r[k, 2])
    up = doubles(x * u[k, 0] + y * u[k, 1] + z * u[k, 2])
    along = doubles(x * f[k, 0] + y * f[k, 1] + z * f[k, 2])
    if lens[k, KIND] == OF_PANORAMA:
        level = across * across + along * along
        column = cams.width * (0.5 + 0.5 * angle_of(across, along))
        row = cams.height * (0.5 - angle_of(up, sqrt(level)))
        # rounding may put a direction on the far side of the last pixel; all directions lie in the picture
        column = select(column >= cams.width, column - cams.width, column)
        row = select(row >= cams.height, cams.height - 0.5, row)
        return column, row, sqrt(level + up * up)
    scale = 1.0 / select(along > 0.0, along, 1.0)
    if lens[k, KIND] == OF_ORTHOGRAPHIC:
        scale = 0.0 * along + 1.0
    column = cams.width * (lens[k, LEFT] + lens[k, ACROSS] * across * scale)
    row = cams.height * (lens[k, TOP] - lens[k, DOWN] * up * scale)
    return column, row, along


@inlined
def lens_density(cams: Any, k: int, facing: Real, row: Real, depth: Real) -> Real:
    """p_k of a point that eye k sees at a row of its picture.

    Args:
        facing: N . (O_k - P), and for an orthographic camera N . (-axis).
    """
    lens = cams.lens
    if lens[k, KIND] == OF_PANORAMA:
        # solid angle of a pixel: (2 pi / width) (pi / height) cos(latitude)
        _, level = sine_and_cosine(0.5 - row / cams.height)
        level = select(level > POLE, level, POLE)
        area: Real = cams.width * cams.height / (2.0 * np.pi * np.pi) / level
    else:
        area = lens[k, ACROSS] * lens[k, DOWN] * cams.width * cams.height + 0.0 * depth
    if lens[k, KIND] == OF_ORTHOGRAPHIC:
        return facing * area
    return facing * area / (depth * depth * depth)


def rows_of(lenses: "tuple[Lens, ...]", resolution: tuple[int, int]) -> Float64:
    """`Cameras.lens` of all eyes, (n_c, COLUMNS)."""
    return np.array([lens_row(lens, resolution) for lens in lenses], np.float64)
