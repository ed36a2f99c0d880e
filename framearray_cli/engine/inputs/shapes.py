"""Shapes of lights: the light of a source at a point.

A further shape of panel has its name in `SHAPES` and its formulas here; kernels that trace rays need not know it.

A source with a size is a sphere or the disc of a sun. From P it fills a cone of directions about its centre; a hit
draws one point q of the unit sphere per source, and q turns into a direction of the cone at every light position: its
height along the cone's axis says how far from the axis, the rest of it to which side. So a hit sees each source
under the same random numbers at all light positions, without axes that could turn or jump.

A panel, a rectangle or disc, has the same radiance L everywhere and to all sides of its front. The irradiance of a
surface at P is the integral over its area of

    L cos(theta) cos(theta_l) / d^2

theta at the surface, theta_l at the panel, d between them. Points are spread nearly as the solid angle is that they are
seen under: over x, along the width, evenly by the angle under which P sees it [Kulla12], and for given x over y, along
the height, evenly by the solid angle, which is proportional to y / d. So no point is so near that its light is a speck.
The strength of a panel is L A, its intensity along the normal, so that far away it is a point of that intensity.
"""

import math
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Triple

from ..kernels.kernel import has_rows, inlined, outlined, step
from ..kernels.simd import integers, reals, row_at, select, sqrt
from .lights import DIRECTIONAL, DISC, PANEL_ROWS, RECT, LightArrays
from .maps import MASK, map_point, map_vector
from .profiles import POLAR, angle_of, profile_share, triple_of
from .random import SOURCES, disc, r2, random_word, sphere_point

# A point within this share of its size of a panel's plane gets no light from it: single precision knows no better.
FLATTEST = 1e-6

# Taylor series of sin(x) / x and cos(x), in x^2.
SINE = tuple(np.float32((-1) ** k / math.factorial(2 * k + 1)) for k in range(7))
COSINE = tuple(np.float32((-1) ** k / math.factorial(2 * k)) for k in range(7))


@inlined
def is_map(lights: LightArrays, s: int) -> bool:
    """Return True if source s is an environment."""
    return has_rows(lights.maps.tint) and lights.maps.grid[s, MASK] > 0


@inlined
def source_point(lights: LightArrays, key: np.uint64, s: int, plain: bool) -> Triple:
    """The point q of source s that the hit of a random key draws: on the unit sphere, of a panel, or of a map.

    Args:
        plain: see `is_plain`; such a source has no points.
    """
    if plain:
        nothing = reals(integers(key) & np.int32(0))
        return nothing, nothing, nothing
    return _shaped_point(lights, key, s)


@outlined
def _shaped_point(lights: LightArrays, key: np.uint64, s: int) -> Triple:
    """`source_point` of a source that has points."""
    if is_map(lights, s):
        return map_point(lights.maps, s, key)
    u, v = r2(random_word(key, SOURCES + s), 0)
    if lights.kind[s] >= RECT:
        return panel_point(lights.kind[s], u, v)
    return sphere_point(u, v)


@inlined
def is_plain(lights: LightArrays, s: int) -> bool:
    """Return True if source s is a point or a direction, without a size, cone, profile or map: loops ask once."""
    shaped = has_rows(lights.size) or has_rows(lights.cone) or has_rows(lights.profiles.frame) or is_map(lights, s)
    return not shaped and lights.kind[s] < RECT


@inlined
def vector_and_factor(
    lights: LightArrays, s: int, plain: bool, l: Any, p: Triple, g: Triple, m: Triple, q: Triple
) -> tuple[Real, Real, Real, Real]:
    """Vectors from points p to source s at one or more light positions, and the geometry factors of their irradiance.

    The irradiance is the factor times the strength: cos(theta) / d^2 for a point source, whose vector ends at the
    source, and cos(theta) for a directional one, whose vector has length 1. It is 0 where the source does not shine or
    lies behind either normal. Of a source with a size it is the estimate by one direction, see `_cone_sample`, of a map
    too, see `maps.py`; a spot's falls off towards its edge, and a lamp with a profile follows that. Of a panel it is
    the factor of one of its points, see `panel_sample`.

    Args:
        plain: see `is_plain`.
        l: a light position, or sixteen in a row.
        p, g, m: points, geometric and shading normals.
        q: see `source_point`.
    """
    if not plain:
        return _shaped(lights, s, l, p, g, m, q)
    n, directional = lights.lit.shape[1], lights.kind[s] == DIRECTIONAL
    x, y, z = _vector_to(directional, triple_of(lights.vector, np.int32(3 * s * n) + l, n), p)
    # cos(theta), and of a point source d cos(theta) / d^3
    factor = _cosine_in_front(x, y, z, g, m) * row_at(lights.lit, np.int32(s * n) + l)
    if not directional:
        square = x * x + y * y + z * z
        factor = factor / (square * sqrt(square))
    return x, y, z, factor


@inlined
def _vector_to(directional: bool, place: Triple, p: Triple) -> Triple:
    """The vector from P to the source, L - P, or against the light's direction."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    sign, from_point = (-one, nothing) if directional else (one, one)
    return sign * place[0] - from_point * p[0], sign * place[1] - from_point * p[1], sign * place[2] - from_point * p[2]


@outlined
def _shaped(
    lights: LightArrays, s: int, l: Any, p: Triple, g: Triple, m: Triple, q: Triple
) -> tuple[Real, Real, Real, Real]:
    """`vector_and_factor` of a source with a size, cone, profile or map, or of a panel."""
    kind, n, one = lights.kind[s], lights.lit.shape[1], np.float32(1.0)
    place, directional = triple_of(lights.vector, np.int32(3 * s * n) + l, n), kind == DIRECTIONAL
    x, y, z = _vector_to(directional, place, p)
    share: Any = select(x == x, one, one)
    if is_map(lights, s):
        x, y, z = map_vector(lights.maps, place, q)
    elif kind >= RECT:
        x, y, z, share = panel_sample(lights, s, l, x, y, z, q)
    else:
        if has_rows(lights.size):
            x, y, z, share = _cone_sample(kind, x, y, z, row_at(lights.size, np.int32(s * n) + l), q)
        elif not directional:
            square = x * x + y * y + z * z
            share = one / (square * sqrt(square))
        if has_rows(lights.cone):
            share = share * spot_share(lights.cone, np.int32(5 * s * n) + l, n, x, y, z)
        if has_rows(lights.profiles.frame) and lights.profiles.grid[s, POLAR] > 0:
            share = share * profile_share(lights.profiles, s, l, n, x, y, z)
    return x, y, z, _cosine_in_front(x, y, z, g, m) * share * row_at(lights.lit, np.int32(s * n) + l)


@inlined
def _cosine_in_front(x: Real, y: Real, z: Real, g: Triple, m: Triple) -> Real:
    """The scalar product of a vector with normal m; 0 behind either normal."""
    nothing = np.float32(0.0)
    cosine = x * m[0] + y * m[1] + z * m[2]
    in_front = (cosine > nothing) & (x * g[0] + y * g[1] + z * g[2] > nothing)
    return select(in_front, cosine, nothing)


@inlined
def spot_share(cone: Float32, at: Any, n: int, x: Real, y: Real, z: Real) -> Real:
    """The share of a spot's intensity that it sends against a vector (x, y, z) to it [KHR_lights_punctual].

    It is (a c + b)^2 with c the cosine of the angle from the axis: 1 within the inner cone, and 0 beyond the outer one.

    Args:
        cone: see `LightArrays`, from `at` on; its rows are n numbers long.
    """
    nothing, one = np.float32(0.0), np.float32(1.0)
    ax, ay, az = triple_of(cone, at, n)
    a, b = row_at(cone, at + np.int32(3 * n)), row_at(cone, at + np.int32(4 * n))
    cosine = -(x * ax + y * ay + z * az) / sqrt(x * x + y * y + z * z)
    share = a * cosine + b
    share = select(share > nothing, share, nothing)
    share = select(share < one, share, one)
    return share * share


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
    # the direction: 1 - cos is uniform in 0 to 1 - c, the side is the side of q next to w
    height = q[0] * wx + q[1] * wy + q[2] * wz
    h = sine2 / (one + c) * select(height > -one, one + height, nothing) / two
    sine_h = h * (two - h)
    vx, vy, vz = q[0] - height * wx, q[1] - height * wy, q[2] - height * wz
    aside = vx * vx + vy * vy + vz * vz
    scale = sqrt(sine_h / select(aside > tiny, aside, tiny))
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
def panel_point(kind: int, u: Real, v: Real) -> Triple:
    """The point of a panel that two random numbers choose, in units of its half axes; the third number is 0."""
    one, two, nothing = np.float32(1.0), np.float32(2.0), np.float32(0.0) * u
    if kind == DISC:
        x, y = disc(u, v)
        return x, y, nothing
    return two * u - one, two * v - one, nothing


@step
def panel_sample(
    lights: LightArrays, s: int, l: Any, x: Real, y: Real, z: Real, q: Triple
) -> tuple[Real, Real, Real, Real]:
    """The vector from P to a point of a panel, and the factor of its irradiance, over the vector's length.

    The factor is the estimate without cos(theta); it is 0 where the panel shows no bright side.

    Args:
        s: a rectangle or disc; l: as for `vector_and_factor`.
        x, y, z: vector from P to the panel's middle.
        q: see `panel_point`.
    """
    nothing, one, two, tiny = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(1e-30)
    # no branch among lanes: compilers would fuse products and sums here and not there, for one grouping of hits only
    disc_only = one if lights.kind[s] == DISC else nothing
    panel, n, at = lights.panel, lights.lit.shape[1], np.int32(PANEL_ROWS * s * lights.lit.shape[1]) + l
    ax, ay, az = triple_of(panel, at, n)
    bx, by, bz = triple_of(panel, at + np.int32(3 * n), n)
    nx, ny, nz = triple_of(panel, at + np.int32(6 * n), n)
    back, wide, high = triple_of(panel, at + np.int32(9 * n), n)
    # the panel from P: its middle, and the height of P above its plane
    cx, cy = (x * ax + y * ay + z * az) / wide, (x * bx + y * by + z * bz) / high
    height = -(x * nx + y * ny + z * nz)
    side = select(height > nothing, one, -back)
    h = select(height > nothing, height, -height)
    least = np.float32(FLATTEST) * (wide + high)
    side, h = select(h > least, side, nothing), select(h > least, h, least)
    # x along the width: even by the angle at the distance e of the strip that the panel lies in
    aside = select(cy > nothing, cy, -cy) - high
    e2 = h * h + select(aside > nothing, aside * aside, nothing)
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
    return a + s * (b + s * (c + s * (d + s * (e + s * (f + s * g)))))
