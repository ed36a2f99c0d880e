"""Gloss: the surface of glTF 2.0, a microfacet coat over a diffuse part [glTF, appendix B].

    f = (1 - F) (1 - metal) base / pi + F D V
    F = F0 + (1 - F0) x         x = (1 - v . h)^5, F0 between 0.04 and the base colour by metal [Schlick94]
    D = a^2 / (pi (a^2 + (1 - a^2) sin^2)^2)          sin: of the angle between m and h [Walter07]
    V = 1 / (2 (m . d root(v) + m . v root(d)))       root(w) = sqrt(a^2 + (1 - a^2) (m . w)^2) [Heitz14]

m is the shading normal, v the unit direction to the viewer, d that to the light, h the one halfway between them, and a
the square of the roughness. `lobe` is D V. Directions are drawn from the normals that the viewer sees [Dupuy23].

A clear coat of weight c is a second lobe, of what is no metal, with a roughness of its own
[KHR_materials_clearcoat]:

    (1 - c F(m . v)) f + c F D V                        F0 = 0.04

The functions take numbers, or lanes of numbers. `Glossy` has the gloss of all materials of a scene, and a table of the
share of even light that a lobe sends to a viewer.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Real, Triple
from framearray_cli.scene.scene import Scene

from ..kernels.bundle import bundle
from ..kernels.kernel import has_rows, inlined
from ..kernels.simd import gather, integers, reals, select, sqrt
from .random import disc
from .surfaces import NO_SURFACES, Surfaces, factors_at

# Roughness up to which metals are mirrors, and its square: no lobe is narrower.
MIRROR_ROUGHNESS = 0.1
NARROWEST = np.float32(MIRROR_ROUGHNESS**2)
DIELECTRIC = np.float32(0.04)  # F0 of what is no metal
# Interpolated normals may face away from the viewer: the cosine between them is at least this.
GRAZING = np.float32(1e-4)
# Columns of `Glossy.factor`, and of `Glossy.coat`.
ROUGHNESS, METALLIC = 0, 1
WEIGHT, COAT_ROUGHNESS = 0, 1
CODES = 1020  # steps of metal and coats in a `coat_code`
# The table of albedos: planes, and steps of roughness and of the root of m . v.
FACE_ON, EDGE, COAT = 0, 1, 2
STEPS = 32
# The least base colour of a glossy surface: what reflects nothing gets no light, and a black coat would not shine.
DARKEST = np.float32(1e-3)
# Indirect light in lobes up to the first alpha is found by rays, in those from the second on it counts as even.
NARROW, WIDE = 0.16, 0.25
_POINTS = 32  # of a side of the grid that lobes are integrated on


@inlined
def evaluate_lobe(alpha: Real, m: Triple, v: Triple, d: Triple) -> tuple[Real, Real]:
    """D V and Fresnel's x of light from d; D V is 0 where d points below the surface."""
    nothing, one, tiny = np.float32(0.0), np.float32(1.0), np.float32(1e-20)
    a2 = alpha * alpha
    hx, hy, hz = v[0] + d[0], v[1] + d[1], v[2] + d[2]
    square = hx * hx + hy * hy + hz * hz
    square = select(square > tiny, square, tiny)
    # sin^2 by the cross product: 1 - (m . h)^2 would lose the digits of a narrow lobe
    cx, cy, cz = m[1] * hz - m[2] * hy, m[2] * hx - m[0] * hz, m[0] * hy - m[1] * hx
    spread = a2 + (one - a2) * (cx * cx + cy * cy + cz * cz) / square
    nl = m[0] * d[0] + m[1] * d[1] + m[2] * d[2]
    nv = facing(m, v)
    above = nl > nothing
    nl = select(above, nl, one)
    shadowing = nl * _root(a2, nv) + nv * _root(a2, nl)
    lobe = a2 * np.float32(0.5 / np.pi) / (spread * spread * shadowing)
    # |v + d| is twice v . h
    return select(above, lobe, nothing), schlick(np.float32(0.5) * sqrt(square))


@inlined
def schlick(cosine: Real) -> Real:
    """Fresnel's x = (1 - v . h)^5 of v . h."""
    rest = np.float32(1.0) - cosine
    rest = select(rest > np.float32(0.0), rest, np.float32(0.0))
    square = rest * rest
    return square * square * rest


@inlined
def facing(m: Triple, v: Triple) -> Real:
    """The cosine m . v, at least GRAZING."""
    nv = m[0] * v[0] + m[1] * v[1] + m[2] * v[2]
    return select(nv > GRAZING, nv, GRAZING)


@inlined
def _root(a2: Real, cosine: Real) -> Real:
    """The root in Smith's shadowing, of the cosine of v or d."""
    return sqrt(a2 + (np.float32(1.0) - a2) * cosine * cosine)


@inlined
def lobe_density(alpha: Real, m: Triple, v: Triple, d: Triple) -> Real:
    """The density, per steradian, with which `sample_lobe` draws the direction d: D / (2 (m . v + root(v)))."""
    one, tiny = np.float32(1.0), np.float32(1e-20)
    a2, nv = alpha * alpha, facing(m, v)
    hx, hy, hz = v[0] + d[0], v[1] + d[1], v[2] + d[2]
    square = hx * hx + hy * hy + hz * hz
    square = select(square > tiny, square, tiny)
    cx, cy, cz = m[1] * hz - m[2] * hy, m[2] * hx - m[0] * hz, m[0] * hy - m[1] * hx
    spread = a2 + (one - a2) * (cx * cx + cy * cy + cz * cz) / square
    return a2 * np.float32(0.5 / np.pi) / (spread * spread * (nv + _root(a2, nv)))


@inlined
def sample_lobe(alpha: Real, m: Triple, v: Triple, u1: Real, u2: Real) -> tuple[Triple, Real, Real]:
    """Draw the direction d of light that a microfacet seen by the viewer reflects [Dupuy23].

    Args:
        u1, u2: uniform in [0, 1).

    Returns:
        d, unit; lobe (m . d) / density, which is at most 1, and 0 where d points below the surface; Fresnel's x.
    """
    nothing, one, two = np.float32(0.0), np.float32(1.0), np.float32(2.0)
    # axes t and s across m [Duff17], and v in them
    sign = select(m[2] >= nothing, one, -one)
    a = -one / (sign + m[2])
    b = m[0] * m[1] * a
    tx, ty, tz = one + sign * m[0] * m[0] * a, sign * b, -sign * m[0]
    sx, sy, sz = b, sign + m[1] * m[1] * a, -m[1]
    vx, vy = v[0] * tx + v[1] * ty + v[2] * tz, v[0] * sx + v[1] * sy + v[2] * sz
    vz = facing(m, v)
    # stretch v so that the microfacets become a hemisphere; draw a point of the cap that v reflects into
    wx, wy, wz = alpha * vx, alpha * vy, vz
    scale = one / sqrt(wx * wx + wy * wy + wz * wz)
    wx, wy, wz = scale * wx, scale * wy, scale * wz
    x, y = disc(u1, u2)
    z = one - (x * x + y * y) * (one + wz)
    aside = (one + wz) * (one + z)
    aside = sqrt(select(aside > nothing, aside, nothing))
    # the microfacet's normal h, stretched back
    hx, hy, hz = alpha * (x * aside + wx), alpha * (y * aside + wy), z + wz
    hz = select(hz > nothing, hz, nothing)
    scale = one / sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = scale * hx, scale * hy, scale * hz
    cosine = vx * hx + vy * hy + vz * hz
    dx, dy, dz = two * cosine * hx - vx, two * cosine * hy - vy, two * cosine * hz - vz
    # shadowing of d, given that v sees the microfacet
    a2, above = alpha * alpha, dz > nothing
    nl = select(above, dz, one)
    root = _root(a2, vz)
    weight = select(above, nl * (vz + root) / (nl * root + vz * _root(a2, nl)), nothing)
    direction = (
        dx * tx + dy * sx + dz * m[0],
        dx * ty + dy * sy + dz * m[1],
        dx * tz + dy * sz + dz * m[2],
    )
    return direction, weight, schlick(cosine)


@bundle
class Glossy(NamedTuple):
    """Gloss of all materials.

    Attributes:
        factor: (n_materials, 2) roughness, 0 of materials without gloss, and metal; no rows where no surface is
            glossy.
        coat: (n_materials, 2) weight and roughness of clear coats; no rows where no surface has one.
        texture: (n_materials,) texture whose green and blue multiply the factors, and whose red and alpha multiply the
            coat, or -1.
        surfaces: of the scene, with textures as plain numbers.
        albedo: (3, STEPS, STEPS) see `albedo_table`.
    """

    factor: Float32
    coat: Float32
    texture: Int32
    surfaces: Surfaces
    albedo: Float32


_NO_FACTORS = np.empty((0, 2), np.float32)
NO_GLOSS = Glossy(_NO_FACTORS, _NO_FACTORS, np.empty(0, np.int32), NO_SURFACES, np.empty((0, STEPS, STEPS), np.float32))


def glossy(scene: Scene, surfaces: Surfaces, glowing: Int32) -> Glossy:
    """Gather the gloss of a scene.

    Args:
        glowing: materials that are seen shining without being sources, whose gloss is left out.
    """
    if not scene.is_glossy:
        return NO_GLOSS
    numbers = surfaces._replace(linear=np.arange(256, dtype=np.float32) / np.float32(255))
    factor = np.stack([scene.roughness, scene.metallic], axis=1)
    factor[glowing, ROUGHNESS] = 0.0
    coat = np.stack([scene.coat, scene.coat_roughness], axis=1) if scene.coat.any() else _NO_FACTORS
    return Glossy(np.ascontiguousarray(factor, np.float32), coat, scene.gloss_texture, numbers, albedo_table())


@inlined
def gloss_at(of: Glossy, triangle: int, u: Real, v: Real) -> tuple[Real, Real, Real, Real]:
    """The lobe at barycentric (u, v) of a triangle, and its coat.

    Returns:
        alpha, the squared roughness, 0 without gloss; metal; weight and roughness of the coat.
    """
    nothing, sharpest = np.float32(0.0), np.float32(MIRROR_ROUGHNESS)
    material = gather(of.surfaces.material, triangle)
    at = material * np.int32(2)
    factor, metal = gather(of.factor, at + np.int32(ROUGHNESS)), gather(of.factor, at + np.int32(METALLIC))
    red, green, blue, opacity = factors_at(of.surfaces, gather(of.texture, material), triangle, u, v)
    roughness = factor * green
    roughness = select(roughness > sharpest, roughness, sharpest)
    weight = rough = roughness * nothing
    if has_rows(of.coat):
        weight, rough = gather(of.coat, at + np.int32(WEIGHT)) * red, gather(of.coat, at + np.int32(COAT_ROUGHNESS))
        rough = rough * opacity
        rough = select(rough > sharpest, rough, sharpest)
        weight = select(factor > nothing, weight, nothing)
    return select(factor > nothing, roughness * roughness, nothing), metal * blue, weight, rough


@inlined
def coat_code(metal: Real, weight: Real, roughness: Real) -> int:
    """Metal and a coat as a number below 0, which is the bits of no metal without coat; exact for codes of texels."""
    half, one, two = np.float32(0.5), np.float32(CODES), np.float32(2 * CODES)
    return ~(int(metal * one + half) | int(weight * one + half) << 10 | int(roughness * two + half) << 20)


@inlined
def coat_of(code: int) -> tuple[Real, Real, Real]:
    """Metal, and weight and roughness of the coat, of a `coat_code`."""
    one, two = np.float32(CODES), np.float32(2 * CODES)
    return np.float32(~code & 1023) / one, np.float32(~code >> 10 & 1023) / one, np.float32(~code >> 20) / two


@inlined
def coat_share(weight: Real, m: Triple, v: Triple) -> Real:
    """Share of light that a coat leaves to the surface under it: 1 - c F(m . v)."""
    one = np.float32(1.0)
    return one - weight * (DIELECTRIC + (one - DIELECTRIC) * schlick(facing(m, v)))


@inlined
def followed_share(alpha: Real) -> Real:
    """The share of the indirect light in a lobe that rays find; the rest counts as even light."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    share = (np.float32(WIDE) - alpha) * np.float32(1 / (WIDE - NARROW))
    share = select(share > nothing, share, nothing)
    return select(share < one, share, one)


@cache
def albedo_table() -> Float32:
    """(3, STEPS, STEPS): integrals of lobe (m . d) (1 - x) and lobe (m . d) x over all d, and of x (m . d) / pi.

    Over roughness, from 0.1 to 1, and the root of m . v, from 0 to 1; the last depends on m . v only. With f0 a coat
    sends f0 FACE_ON + EDGE of even light of 1 to the viewer, and lets 1 - f0 - (1 - f0) COAT of it through.
    """
    table = np.empty((3, STEPS, STEPS), np.float32)
    mu = np.maximum(np.linspace(0.0, 1.0, STEPS) ** 2, 1e-4)[:, None]
    step = (np.arange(_POINTS) + 0.5) / _POINTS
    radius, azimuth = (grid.ravel()[None] for grid in np.meshgrid(step, np.pi * step))
    for row, roughness in enumerate(np.linspace(MIRROR_ROUGHNESS, 1.0, STEPS)):
        weight, x = _lobe(roughness**2, mu, radius, azimuth)
        table[FACE_ON, row], table[EDGE, row] = (weight * (1 - x)).mean(axis=1), (weight * x).mean(axis=1)
    # cosine-distributed directions; |v + d|^2 = 2 + 2 v . d is four times (v . h)^2
    sine, cosine = np.sqrt(radius), np.sqrt(1 - radius)
    vd = sine * np.cos(azimuth) * np.sqrt(1 - mu * mu) + cosine * mu
    table[COAT] = ((1 - np.sqrt(np.clip((1 + vd) / 2, 0, 1))) ** 5).mean(axis=1)
    return table


def _lobe(alpha: float, mu: Float64, p: Float64, azimuth: Float64) -> tuple[Float64, Float64]:
    """Weights and Fresnel's x of directions drawn for a viewer at the cosine mu, as `sample_lobe` draws them.

    Args:
        p: squared distances from the middle of a disc, even in 0 to 1, at `azimuth`.
    """
    across = np.sqrt(1 - mu * mu)
    scale = 1 / np.sqrt((alpha * across) ** 2 + mu**2)
    wx, wz = alpha * across * scale, mu * scale
    z = 1 - p * (1 + wz)
    aside = np.sqrt(np.maximum(1 - z * z, 0))
    hx, hy, hz = alpha * (aside * np.cos(azimuth) + wx), alpha * aside * np.sin(azimuth), np.maximum(z + wz, 0)
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    vh = (across * hx + mu * hz) / length
    nl = 2 * vh * hz / length - mu
    root_v, root_l = (np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2) for cosine in (mu, nl))
    weight = np.where(nl > 0, nl * (mu + root_v) / (nl * root_v + mu * root_l), 0.0)
    return weight, (1 - np.clip(vh, 0, 1)) ** 5


@inlined
def albedo_at(table: Float32, alpha: Real, cosine: Real) -> tuple[Real, Real, Real]:
    """FACE_ON, EDGE and COAT of a lobe and the cosine m . v, bilinear in the table."""
    last, one = np.float32(STEPS - 1), np.float32(1.0)
    row = (sqrt(alpha) - np.float32(MIRROR_ROUGHNESS)) * np.float32((STEPS - 1) / (1 - MIRROR_ROUGHNESS))
    column = sqrt(cosine) * last
    row, column = select(row < last, row, last), select(column < last, column, last)
    row = select(row > np.float32(0.0), row, np.float32(0.0))
    i, k = integers(row), integers(column)
    i, k = (
        select(i < np.int32(STEPS - 2), i, np.int32(STEPS - 2)),
        select(k < np.int32(STEPS - 2), k, np.int32(STEPS - 2)),
    )
    a, b = row - reals(i), column - reals(k)
    at = i * np.int32(STEPS) + k
    return (
        _between(table, at + np.int32(FACE_ON * STEPS * STEPS), a, b, one),
        _between(table, at + np.int32(EDGE * STEPS * STEPS), a, b, one),
        _between(table, at + np.int32(COAT * STEPS * STEPS), a, b, one),
    )


@inlined
def _between(table: Float32, at: int, a: Real, b: Real, one: Real) -> Real:
    """The bilinear mean of four neighbours in a table."""
    upper = (one - b) * gather(table, at) + b * gather(table, at + np.int32(1))
    lower = (one - b) * gather(table, at + np.int32(STEPS)) + b * gather(table, at + np.int32(STEPS + 1))
    return (one - a) * upper + a * lower
