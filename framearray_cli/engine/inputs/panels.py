"""Rectangles and discs: the point of a panel that a hit draws.

A panel has the same radiance L everywhere and to all sides of its front. The irradiance of a surface at P is the
integral over its area of

    L cos(theta) cos(theta_l) / d^2

theta at the surface, theta_l at the panel, d between them. Points are spread nearly as the solid angle is that they are
seen under: over x, along the width, evenly by the angle under which P sees it [Kulla12], and for given x over y, along
the height, evenly by the solid angle, which is proportional to y / d. So no point is so near that its light is a speck.
The strength of a panel is L A, its intensity along the normal, so that far away it is a point of that intensity.
"""

import math
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Real, Triple

from ..kernels.kernel import inlined
from ..kernels.simd import gather, load, select, sqrt
from .lights import DISC, PANEL_ROWS, LightArrays
from .profiles import angle_of
from .random import disc

# A point within this share of its size of a panel's plane gets no light from it: single precision knows no better.
FLATTEST = 1e-6

# Taylor series of sin(x) / x and cos(x), in x^2.
SINE = tuple(np.float32((-1) ** k / math.factorial(2 * k + 1)) for k in range(7))
COSINE = tuple(np.float32((-1) ** k / math.factorial(2 * k)) for k in range(7))

PanelAt = tuple[Real, Real, Real, Real, Real, Real, Real, Real, Real, Real, Real, Real]


@inlined
def panel_at(lights: LightArrays, s: int, l: int) -> PanelAt:
    """The rows of source s at light position l; see `LightArrays.panel`."""
    n, at = lights.lit.shape[1], PANEL_ROWS * s * lights.lit.shape[1] + l
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
        gather(lights.panel, at + 10 * n),
        gather(lights.panel, at + 11 * n),
    )


@inlined
def panel_in_lanes(lights: LightArrays, s: int, l: int) -> PanelAt:
    """The rows of source s at light positions l to l + 15."""
    n, at = lights.lit.shape[1], PANEL_ROWS * s * lights.lit.shape[1] + l
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
        load(lights.panel, at + 10 * n),
        load(lights.panel, at + 11 * n),
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
def panel_sample(kind: int, panel: PanelAt, x: Real, y: Real, z: Real, q: Triple) -> tuple[Real, Real, Real, Real]:
    """The vector from P to a point of a panel, and the factor of its irradiance, over the vector's length.

    The factor is the estimate without cos(theta); it is 0 where the panel shows no bright side.

    Args:
        kind: RECT or DISC.
        x, y, z: vector from P to the panel's middle.
        q: see `panel_point`.
    """
    nothing, one, two, tiny = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(1e-30)
    # no branch among lanes: compilers would fuse products and sums here and not there, for one grouping of hits only
    disc_only = one if kind == DISC else nothing
    ax, ay, az, bx, by, bz, nx, ny, nz, back, wide, high = panel
    # the panel from P: its middle, and the height of P above its plane
    cx, cy = (x * ax + y * ay + z * az) / wide, (x * bx + y * by + z * bz) / high
    height = -(x * nx + y * ny + z * nz)
    side = select(height > nothing, one, -back)
    h = select(height > nothing, height, -height)
    least = np.float32(FLATTEST) * (wide + high)
    side, h = select(h > least, side, nothing), select(h > least, h, least)
    # x along the width: even by the angle at the distance e of the strip that the panel lies in
    beside = select(cy > nothing, cy, -cy) - high
    beside = select(beside > nothing, beside, nothing)
    e2 = h * h + beside * beside
    e, x0 = sqrt(e2), cx - wide
    whole = angle_of(two * wide * e, e2 + x0 * (cx + wide))
    sine, cosine = sine_and_cosine(whole * (q[0] + one) / two)
    px = e * (x0 * cosine + e * sine) / (e * cosine - x0 * sine)
    u = (px - cx) / wide
    u = select(u > -one, u, -one)
    u = select(u < one, u, one)
    px = cx + u * wide
    # the heights y0 to y1 of the panel at x, and the chord on which v was drawn; 1 of a rectangle
    rest = one - disc_only * u * u
    reach = sqrt(select(rest > nothing, rest, nothing))
    drawn = (one - disc_only * q[0]) * (one + disc_only * q[0])
    chord = sqrt(select(drawn > tiny, drawn, tiny))
    v = q[1] / chord
    y0, y1 = cy - reach * high, cy + reach * high
    # y: even in y / d, which rises by `rise` from y0 to y1
    d2 = px * px + h * h
    r0, r1 = sqrt(d2 + y0 * y0), sqrt(d2 + y1 * y1)
    one_side = y0 * y1 > nothing
    sum_of = select(one_side, y1 * r0 + y0 * r1, one)
    rise = select(one_side, d2 * np.float32(4.0) * reach * high * cy / (sum_of * r0 * r1), y1 / r1 - y0 / r0)
    h0, step = y0 / r0, rise * (v + one) / two
    level = d2 / (r0 * r0) - step * (two * h0 + step)
    py = sqrt(d2) * (h0 + step) / sqrt(select(level > tiny, level, tiny))
    py = select(py > y0, py, y0)
    py = select(py < y1, py, y1)
    w = (py - cy) / high
    density = np.float32(4.0) * chord * wide * high * sqrt(d2 + py * py)
    factor = side * whole * rise * h * (px * px + e2) / (e * d2 * density)
    return x + u * ax + w * bx, y + u * ay + w * by, z + u * az + w * bz, factor


@inlined
def sine_and_cosine(angle: Real) -> tuple[Real, Real]:
    """Sine and cosine of an angle from 0 to pi, by the series of its half, to 6e-8."""
    half, one, two = np.float32(0.5) * angle, np.float32(1.0), np.float32(2.0)
    s = half * half
    sine = half * _series(s, SINE)
    cosine = _series(s, COSINE)
    return two * sine * cosine, one - two * sine * sine


@inlined
def _series(s: Real, terms: Any) -> Real:
    """A polynomial of seven terms."""
    a, b, c, d, e, f, g = terms
    found: Real = a + s * (b + s * (c + s * (d + s * (e + s * (f + s * g)))))
    return found
