"""Gloss: the surface of glTF 2.0, a microfacet coat over a diffuse part [glTF, appendix B].

    f = (1 - F) (1 - metal) base / pi + F D V
    F = F0 + (1 - F0) x         x = (1 - v . h)^5, F0 between 0.04 and the base colour by metal [Schlick94]
    D = a^2 / (pi (a^2 + (1 - a^2) sin^2)^2)          sin: of the angle between m and h [Walter07]
    V = 1 / (2 (m . d root(v) + m . v root(d)))       root(w) = sqrt(a^2 + (1 - a^2) (m . w)^2) [Heitz14]

m is the shading normal, v the unit direction to the viewer, d that to the light, h the one halfway between them, and a
the square of the roughness. `lobe` is D V. Directions are drawn from the normals that the viewer sees [Dupuy23].

The functions take numbers, or lanes of numbers.
"""

import numpy as np

from framearray_cli.base.arrays import Real, Triple

from ..kernels.kernel import inlined
from ..kernels.simd import select, sqrt
from .random import disc

# Roughness up to which metals are mirrors, and its square: no lobe is narrower.
MIRROR_ROUGHNESS = 0.1
NARROWEST = np.float32(MIRROR_ROUGHNESS**2)
DIELECTRIC = np.float32(0.04)  # F0 of what is no metal
# Interpolated normals may face away from the viewer: the cosine between them is at least this.
GRAZING = np.float32(1e-4)


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
    x: Real = square * square * rest
    return x


@inlined
def facing(m: Triple, v: Triple) -> Real:
    """The cosine m . v, at least GRAZING."""
    nv = m[0] * v[0] + m[1] * v[1] + m[2] * v[2]
    found: Real = select(nv > GRAZING, nv, GRAZING)
    return found


@inlined
def _root(a2: Real, cosine: Real) -> Real:
    """The root in Smith's shadowing, of the cosine of v or d."""
    found: Real = sqrt(a2 + (np.float32(1.0) - a2) * cosine * cosine)
    return found


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
    density: Real = a2 * np.float32(0.5 / np.pi) / (spread * spread * (nv + _root(a2, nv)))
    return density


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
    beside = (one + wz) * (one + z)
    beside = sqrt(select(beside > nothing, beside, nothing))
    # the microfacet's normal h, stretched back
    hx, hy, hz = alpha * (x * beside + wx), alpha * (y * beside + wy), z + wz
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
