"""Means of textures over the footprints of eye rays, from smaller copies of the textures.

The footprint of an eye ray is a square of the image, `spread` wide at depth 1. On a surface it is a rectangle: as wide
as the square across the slant, and longer by 1 / cos along it. A hit reads the copy of a texture [Williams83] with
texels as wide as the rectangle, blended with the next; along the rectangle, up to `MOST_TAPS` times side by side
[McCormack99].
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Triple
from framearray_cli.scene.files.model import NEAREST
from framearray_cli.scene.scene import MOST_LEVELS, Scene

from ..kernels.bundle import bundle
from ..kernels.kernel import inlined
from ..kernels.simd import gather, integers, popcount, reals, select, sqrt
from .surfaces import NO_SURFACES, Surfaces, interpolate, texture_at, uv_row

MOST_TAPS = 8  # places of a texture that a hit reads, at most; longer rectangles get a smaller copy
LEAST_COSINE = np.float32(1e-3)  # of a surface seen from its edge


@bundle
class Mips(NamedTuple):
    """Textures with their smaller copies; `SHARP` where none is wanted.

    Attributes:
        levels: (n_textures MOST_LEVELS, 3) first texel, width and height of each copy of each texture.
        surfaces: of the scene, with `levels` as its textures.
        spread: width of the square of a ray at depth 1, scene units; side: what it is wide already at depth 0.
    """

    levels: Int32
    surfaces: Surfaces
    spread: float
    side: float = 0.0


SHARP = Mips(np.empty((0, 3), np.int32), NO_SURFACES, 0.0)


def mips(scene: Scene, surfaces: Surfaces, spread: float) -> Mips:
    """Gather the copies of textures of a scene, whose surfaces are gathered already, as kernels take them."""
    if not len(scene.levels):
        return SHARP
    levels = np.ascontiguousarray(scene.levels.reshape(-1, 3))
    samplers = np.repeat(surfaces.samplers & ~np.int32(NEAREST), MOST_LEVELS)
    return Mips(levels=levels, surfaces=surfaces._replace(textures=levels, samplers=samplers), spread=spread)


class Footprint(NamedTuple):
    """Footprints of rays on triangles, in lanes: the long side of a rectangle in texture coordinates, and its taps.

    Attributes:
        u, v: of the texture, in its middle; du, dv: from one end to the other.
        taps: number of places to read.
        width: of the texels that fit, in texels of the texture; 1 or less needs no smaller copy.
    """

    u: Real
    v: Real
    du: Real
    dv: Real
    taps: Real
    width: Real


@inlined
def footprint(m: Mips, texture: int, triangle: int, u: Real, v: Real, d: Triple, g: Triple, side: Real) -> Footprint:
    """The footprints of rays on triangles.

    Args:
        texture: a number, in lanes.
        u, v: barycentric.
        d: unit directions of the rays; g: unit normals on their side.
        side: width of the footprint of a ray, at the triangle.
    """
    nothing, one, s = np.float32(0.0), np.float32(1.0), m.surfaces
    w, at = one - u - v, texture * np.int32(3 * MOST_LEVELS)
    # edges e and f of the triangle in units of the square's side, and along them texture coordinates
    scale = one / select(side > nothing, side, one)
    ex = scale * _edge(s.corners, triangle, 3, 1, 0)
    ey = scale * _edge(s.corners, triangle, 3, 1, 1)
    ez = scale * _edge(s.corners, triangle, 3, 1, 2)
    fx = scale * _edge(s.corners, triangle, 3, 2, 0)
    fy = scale * _edge(s.corners, triangle, 3, 2, 1)
    fz = scale * _edge(s.corners, triangle, 3, 2, 2)
    row = uv_row(s, texture * np.int32(MOST_LEVELS), triangle)
    eu, ev = _edge(s.uvs, row, 2, 1, 0), _edge(s.uvs, row, 2, 1, 1)
    fu, fv = _edge(s.uvs, row, 2, 2, 0), _edge(s.uvs, row, 2, 2, 1)
    ee, ef, ff = ex * ex + ey * ey + ez * ez, ex * fx + ey * fy + ez * fz, fx * fx + fy * fy + fz * fz
    area = ee * ff - ef * ef
    scale = select(area > nothing, one / select(area > nothing, area, one), nothing)
    # across the slant: a unit vector a of the triangle's plane, upright to d; along it: b
    ax, ay, az = g[1] * d[2] - g[2] * d[1], g[2] * d[0] - g[0] * d[2], g[0] * d[1] - g[1] * d[0]
    sine = ax * ax + ay * ay + az * az
    slanted = sine > np.float32(1e-8)  # else any direction will do: e
    length = one / sqrt(select(slanted, sine, ee))
    ax, ay, az = select(slanted, ax, ex) * length, select(slanted, ay, ey) * length, select(slanted, az, ez) * length
    bx, by, bz = g[1] * az - g[2] * ay, g[2] * ax - g[0] * az, g[0] * ay - g[1] * ax
    cosine = -(d[0] * g[0] + d[1] * g[1] + d[2] * g[2])
    cosine = select(cosine > LEAST_COSINE, cosine, LEAST_COSINE)
    # both sides in texture coordinates: a = i e + j f
    ae, af = (ax * ex + ay * ey + az * ez) * scale, (ax * fx + ay * fy + az * fz) * scale
    i, j = ae * ff - af * ef, af * ee - ae * ef
    au, av = i * eu + j * fu, i * ev + j * fv
    be, bf = (bx * ex + by * ey + bz * ez) * scale, (bx * fx + by * fy + bz * fz) * scale
    i, j = (be * ff - bf * ef) / cosine, (bf * ee - be * ef) / cosine
    bu, bv = i * eu + j * fu, i * ev + j * fv
    # their lengths in texels
    columns, rows = reals(gather(m.levels, at + np.int32(1))), reals(gather(m.levels, at + np.int32(2)))
    a = sqrt(au * au * columns * columns + av * av * rows * rows)
    b = sqrt(bu * bu * columns * columns + bv * bv * rows * rows)
    longer = b > a
    longest, shortest = select(longer, b, a), select(longer, a, b)
    shortest = select(shortest > one, shortest, one)
    taps = reals(integers(longest / shortest + np.float32(0.999)))
    taps = select(taps > one, taps, one)
    taps = select(taps < np.float32(MOST_TAPS), taps, np.float32(MOST_TAPS))
    width = longest / taps
    return Footprint(
        u=interpolate(s.uvs, row, 2, 0, u, v, w),
        v=interpolate(s.uvs, row, 2, 1, u, v, w),
        du=select(longer, bu, au),
        dv=select(longer, bv, av),
        taps=taps,
        width=select(width > one, width, one),
    )


@inlined
def _edge(corners: Float32, triangle: int, stride: int, to: int, axis: int) -> Real:
    """A component of the vector from the first corner of a triangle to another one."""
    at = triangle * np.int32(3 * stride) + np.int32(axis)
    return gather(corners, at + np.int32(to * stride)) - gather(corners, at)


@inlined
def filtered(m: Mips, texture: int, f: Footprint) -> Triple:
    """The mean of a texture over footprints, linear RGB, in lanes."""
    one, two = np.float32(1.0), np.float32(2.0)
    # the copy whose texels are narrower, and the share of the next one
    level: Any = texture * np.int32(MOST_LEVELS)
    width = f.width
    for _ in range(MOST_LEVELS - 1):
        level = select(width >= two, level + np.int32(1), level)
        width = select(width >= two, width / two, width)
    share = width - one
    share = select(share < one, share, one)
    following = select(
        level + np.int32(1) < (texture + np.int32(1)) * np.int32(MOST_LEVELS), level + np.int32(1), level
    )
    red = green = blue = f.u * np.float32(0.0)
    for tap in range(MOST_TAPS):
        reads = f.taps > np.float32(tap)
        if popcount(reads) == 0:
            break
        along = (np.float32(tap) + np.float32(0.5)) / f.taps - np.float32(0.5)
        u, v = f.u + along * f.du, f.v + along * f.dv
        r0, g0, b0, _ = texture_at(m.surfaces, level, u, v)
        r1, g1, b1, _ = texture_at(m.surfaces, following, u, v)
        weight = select(reads, one / f.taps, np.float32(0.0))
        red = red + weight * (r0 + share * (r1 - r0))
        green = green + weight * (g0 + share * (g1 - g0))
        blue = blue + weight * (b0 + share * (b1 - b0))
    return red, green, blue
