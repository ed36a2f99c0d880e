"""Point, normals, reflectivity and opacity where a ray meets a triangle.

The functions take one triangle with barycentric numbers u and v, or sixteen in lanes.

`Surfaces` is `Scene` in the form that kernels read; an array of length 0 is a feature that the scene does not use.

Normal maps turn the shading normal in the tangent space of each triangle:

    m = x T + y w (N x T) + z N        (x, y, z) of the map, x and y times its scale

T and N are interpolated between corners and not normalised, as where such maps are baked [Mikkelsen08].
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Bytes, Corners, CornerUvs, Float32, Int32, Real, Rgb, Triple
from framearray_cli.base.colour import linear_from_srgb8
from framearray_cli.scene.files.model import BLACK, MIRROR, NEAREST, REPEAT, UV_SET, WRAP_V
from framearray_cli.scene.scene import Scene
from framearray_cli.scene.vectors import largest

from ..kernels.bundle import bundle
from ..kernels.kernel import inlined
from ..kernels.simd import doubles, floor, gather, integers, popcount, reals, select, sqrt
from .random import UNIT_24, mix

# Ray offsets: 16 units in the last place of the largest coordinate of the triangle. Of the rules tried, this is the
# only one without self-hits and leaks at every scale (docs/decisions/rays.md).
OFFSET_ULPS = 16.0
ULP = 2.0**-23
# Places per side of a triangle that are solid or a hole, where a surface covers a part of what is behind it.
SCREEN_BITS = 16
SCREEN = 1 << SCREEN_BITS
BELOW_ONE = np.float32(1 - 2.0**-24)
WRAP_MASK = (1 << WRAP_V) - 1  # the bits of a sampler along u
# Below this length, squared, a sum of unit vectors gives no direction.
NOTHING = np.float32(1e-12)


@bundle
class Surfaces(NamedTuple):
    """Arrays of `Scene` for kernels, and arrays derived from them once.

    Attributes:
        offset: (n,) height above the triangle at which rays that leave it start, scene units.
        linear: (256,) sRGB code value -> linear value.
        plain: (n_materials,) 1 if a material looks the same everywhere on its triangles.
        total: (n_materials, 3) diffuse and mirror reflectivity of a plain material together; 1 of others.
    """

    corners: Corners
    normals: Corners
    uvs: CornerUvs
    colours: Corners
    material: Int32
    reflectivity: Rgb
    specular: Rgb
    reflectivity_texture: Int32
    specular_texture: Int32
    alpha: Float32
    alpha_texture: Int32
    alpha_cutoff: Float32
    texels: Bytes
    textures: Int32
    samplers: Int32
    offset: Float32
    linear: Float32
    plain: Bytes
    total: Rgb


_NUMBERS, _REALS = np.empty(0, np.int32), np.empty(0, np.float32)
_TRIPLES, _CORNERS = np.empty((0, 3), np.float32), np.empty((0, 3, 3), np.float32)
NO_SURFACES = Surfaces(
    corners=_CORNERS, normals=_CORNERS, uvs=np.empty((0, 3, 2), np.float32), colours=_CORNERS, material=_NUMBERS,
    reflectivity=_TRIPLES, specular=_TRIPLES, reflectivity_texture=_NUMBERS, specular_texture=_NUMBERS, alpha=_REALS,
    alpha_texture=_NUMBERS, alpha_cutoff=_REALS, texels=np.empty((0, 4), np.uint8), textures=np.empty((0, 3), np.int32),
    samplers=_NUMBERS, offset=_REALS, linear=_REALS, plain=np.empty(0, np.uint8), total=_TRIPLES,
)  # fmt: skip


def surfaces(scene: Scene) -> Surfaces:
    """Gather the arrays of a scene that kernels read; they share memory with it."""
    arrays = {name: np.ascontiguousarray(getattr(scene, name)) for name in Surfaces._fields if hasattr(scene, name)}
    textured = (scene.reflectivity_texture >= 0) | (scene.specular_texture >= 0)
    plain = ~textured & (len(scene.colours) == 0)
    return Surfaces(
        **arrays,
        offset=(OFFSET_ULPS * ULP * largest(scene.corners.reshape(-1, 9))).astype(np.float32),
        linear=linear_from_srgb8(np.arange(256, dtype=np.uint8)),
        plain=plain.astype(np.uint8),
        total=np.where(plain[:, None], scene.reflectivity + scene.specular, np.float32(1.0)),
    )


def near_depth(s: Surfaces) -> float:
    """The depth at which eyes begin to see a scene: the largest ray offset, scene units.

    An eye exactly on a surface sees nothing of it, no matter to which side float32 rounds it.
    """
    return float(s.offset.max(initial=0.0))


@inlined
def _texel(s: Surfaces, texel: int, weight: Real) -> tuple[Real, Real, Real, Real]:
    """Linear red, green, blue, and alpha (0 to 255) of a texel, times a weight."""
    code, last = gather(s.texels.view(np.int32), texel), np.int32(255)
    return (
        weight * gather(s.linear, code & last),
        weight * gather(s.linear, (code >> np.int32(8)) & last),
        weight * gather(s.linear, (code >> np.int32(16)) & last),
        weight * reals((code >> np.int32(24)) & last),
    )


@inlined
def _texture_extent(s: Surfaces, texture: int) -> tuple[int, int, int]:
    """First texel, width and height of a texture."""
    at = texture * np.int32(3)
    return gather(s.textures, at), gather(s.textures, at + np.int32(1)), gather(s.textures, at + np.int32(2))


@inlined
def uv_row(s: Surfaces, texture: Any, triangle: int) -> int:
    """The row of `Surfaces.uvs` with the texture coordinates of a texture on a triangle."""
    if s.samplers.shape[0] > 0:
        triangle = triangle + (gather(s.samplers, texture) >> np.int32(UV_SET)) * np.int32(s.material.shape[0])
    return triangle


@inlined
def _continued(wrap: int, u: Real, extent: int) -> tuple[Real, int]:
    """The place in 0 to 1 that shows what a texture has at u, float64, and the step from beyond an edge to a texel."""
    inside = select(u > 0.0, u, 0.0)
    inside = select(inside < 1.0, inside, 1.0)
    pair = u - 2.0 * floor(0.5 * u)
    mirrored = select(pair > 1.0, 2.0 - pair, pair)
    repeats = wrap == np.int32(REPEAT)
    place = select(repeats, u - floor(u), select(wrap == np.int32(MIRROR), mirrored, inside))
    return place, select(repeats, extent, np.int32(1))


@inlined
def _kept(wrap: int, u: Real, extent: int) -> Real:
    """The share that a blended look-up has of a texture, and not of the black beyond its edges; 1 without black."""
    share = 0.5 + doubles(extent) * select(u < 0.5, u, 1.0 - u)
    share = select(share > 0.0, select(share < 1.0, share, 1.0), 0.0)
    return reals(select(wrap == np.int32(BLACK), share, 1.0))


@inlined
def texture_at(s: Surfaces, texture: int, u: Real, v: Real) -> tuple[Real, Real, Real, Real]:
    """Bilinear look-up: linear red, green, blue, and alpha; texel centres at half-integers, v upwards."""
    first, width, height = _texture_extent(s, texture)
    u, v, past_x, past_y = doubles(u), doubles(v), width, height
    x, y = u - floor(u), v - floor(v)
    if s.samplers.shape[0] > 0:
        code = gather(s.samplers, texture)
        x, past_x = _continued(code & np.int32(WRAP_MASK), u, width)
        y, past_y = _continued((code >> np.int32(WRAP_V)) & np.int32(WRAP_MASK), v, height)
    x = x * doubles(width) - 0.5
    y = (1.0 - y) * doubles(height) - 0.5
    finite = (x * x < 1e18) & (y * y < 1e18)  # the first texel, if a coordinate is not finite
    x, y = select(finite, x, 0.0), select(finite, y, 0.0)
    one, fx, fy = np.float32(1.0), reals(x - floor(x)), reals(y - floor(y))
    left, top = integers(floor(x)), integers(floor(y))  # -1 to the last
    right, bottom = left + np.int32(1), top + np.int32(1)
    left, top = select(left < np.int32(0), left + past_x, left), select(top < np.int32(0), top + past_y, top)
    right = select(right >= width, right - past_x, right)
    bottom = select(bottom >= height, bottom - past_y, bottom)
    upper, lower, ex = first + top * width, first + bottom * width, one - fx
    if s.samplers.shape[0] > 0:
        code, nothing = gather(s.samplers, texture), np.float32(0.0)
        nearest, half = (code & np.int32(NEAREST)) > np.int32(0), np.float32(0.5)
        fx = select(nearest, select(fx < half, nothing, one), fx)
        fy = select(nearest, select(fy < half, nothing, one), fy)
        kept_x = _kept(code & np.int32(WRAP_MASK), u, width)
        kept_y = _kept((code >> np.int32(WRAP_V)) & np.int32(WRAP_MASK), v, height)
        within = select((kept_x < half) | (kept_y < half), nothing, one)
        kept = select(nearest, within, kept_x * kept_y)
        ex, fx = kept * (one - fx), kept * fx
    r0, g0, b0, a0 = _texel(s, upper + left, ex * (one - fy))
    r1, g1, b1, a1 = _texel(s, upper + right, fx * (one - fy))
    r2, g2, b2, a2 = _texel(s, lower + left, ex * fy)
    r3, g3, b3, a3 = _texel(s, lower + right, fx * fy)
    return r0 + r1 + r2 + r3, g0 + g1 + g2 + g3, b0 + b1 + b2 + b3, (a0 + a1 + a2 + a3) * np.float32(1.0 / 255.0)


@inlined
def nearest_texel_at(s: Surfaces, texture: int, u: Real, v: Real) -> tuple[Real, Real, Real, Real]:
    """The texel that contains a place; equal to `texture_at` at the texel's centre."""
    first, width, height = _texture_extent(s, texture)
    x, y = u - floor(u), v - floor(v)
    if s.samplers.shape[0] > 0:
        code = gather(s.samplers, texture)
        x = reals(_continued(code & np.int32(WRAP_MASK), doubles(u), width)[0])
        y = reals(_continued((code >> np.int32(WRAP_V)) & np.int32(WRAP_MASK), doubles(v), height)[0])
        x, y = select(x < BELOW_ONE, x, BELOW_ONE), select(y < BELOW_ONE, y, BELOW_ONE)
    x, y = x * reals(width), y * reals(height)
    # a coordinate that rounds to the far border, or is not finite, belongs to the first texel of the next repetition
    x = select((x >= np.float32(0.0)) & (x < reals(width)), x, np.float32(0.0))
    y = select((y >= np.float32(0.0)) & (y < reals(height)), y, np.float32(0.0))
    row = height - np.int32(1) - integers(y)
    red, green, blue, alpha = _texel(s, first + row * width + integers(x), np.float32(1.0))
    if s.samplers.shape[0] > 0:
        code, nothing, half = gather(s.samplers, texture), np.float32(0.0), np.float32(0.5)
        dark = _kept(code & np.int32(WRAP_MASK), doubles(u), width) < half
        dark = dark | (_kept((code >> np.int32(WRAP_V)) & np.int32(WRAP_MASK), doubles(v), height) < half)
        red, green, blue = select(dark, nothing, red), select(dark, nothing, green), select(dark, nothing, blue)
        alpha = select(dark, nothing, alpha)
    return red, green, blue, alpha * np.float32(1.0 / 255.0)


@inlined
def interpolate(corners: Float32, triangle: int, stride: int, axis: int, u: Real, v: Real, w: Real) -> Real:
    """One component of corner values, interpolated at barycentric (u, v), w = 1 - u - v."""
    at = triangle * np.int32(3 * stride) + np.int32(axis)
    a, b, c = gather(corners, at), gather(corners, at + np.int32(stride)), gather(corners, at + np.int32(2 * stride))
    return w * a + u * b + v * c


@inlined
def _multiply_texture(
    s: Surfaces, red: Real, green: Real, blue: Real, texture: int, triangle: int, u: Real, v: Real, blended: bool
) -> Triple:
    """A material's factor times its texture times the corner colour; `blended`: between texels."""
    w = np.float32(1.0) - u - v
    textured = texture >= np.int32(0)
    if popcount(textured) > 0:
        texture = select(textured, texture, np.int32(0))
        row = uv_row(s, texture, triangle)
        tu, tv = interpolate(s.uvs, row, 2, 0, u, v, w), interpolate(s.uvs, row, 2, 1, u, v, w)
        r, g, b, _ = texture_at(s, texture, tu, tv) if blended else nearest_texel_at(s, texture, tu, tv)
        red, green, blue = (
            select(textured, red * r, red),
            select(textured, green * g, green),
            select(textured, blue * b, blue),
        )
    if s.colours.shape[0] > 0:
        red = red * interpolate(s.colours, triangle, 3, 0, u, v, w)
        green = green * interpolate(s.colours, triangle, 3, 1, u, v, w)
        blue = blue * interpolate(s.colours, triangle, 3, 2, u, v, w)
    return red, green, blue


@inlined
def reflectivity_at(s: Surfaces, triangle: int, u: Real, v: Real, blended: bool = True) -> Triple:
    """Diffuse reflectivity, RGB 0 to 1, at barycentric (u, v) of a triangle."""
    m = gather(s.material, triangle)
    at = m * np.int32(3)
    red, green = gather(s.reflectivity, at), gather(s.reflectivity, at + np.int32(1))
    blue = gather(s.reflectivity, at + np.int32(2))
    return _multiply_texture(s, red, green, blue, gather(s.reflectivity_texture, m), triangle, u, v, blended)


@inlined
def specular_at(s: Surfaces, triangle: int, u: Real, v: Real, blended: bool = True) -> Triple:
    """Mirror reflectivity, RGB 0 to 1, at barycentric (u, v) of a triangle."""
    m = gather(s.material, triangle)
    at, nothing = m * np.int32(3), np.float32(0.0)
    red, green = gather(s.specular, at), gather(s.specular, at + np.int32(1))
    blue = gather(s.specular, at + np.int32(2))
    if popcount((red > nothing) | (green > nothing) | (blue > nothing)) > 0:
        texture = gather(s.specular_texture, m)
        red, green, blue = _multiply_texture(s, red, green, blue, texture, triangle, u, v, blended)
    return red, green, blue


@inlined
def total_at(s: Surfaces, triangle: int, u: Real, v: Real) -> Triple:
    """Diffuse plus mirror reflectivity of the nearest texel, for averages over many places.

    Blending between texels would cost three times as much without changing the average.
    """
    red, green, blue = reflectivity_at(s, triangle, u, v, False)
    s_red, s_green, s_blue = specular_at(s, triangle, u, v, False)
    return red + s_red, green + s_green, blue + s_blue


@inlined
def factors_at(s: Surfaces, texture: int, triangle: int, u: Real, v: Real) -> tuple[Real, Real, Real, Real]:
    """Red, green, blue and alpha of a texture at barycentric (u, v) of a triangle; 1 without one (-1)."""
    one, textured = np.float32(1.0), texture >= np.int32(0)
    red = green = blue = alpha = u * np.float32(0.0) + one
    if popcount(textured) > 0:
        w, texture = one - u - v, select(textured, texture, np.int32(0))
        row = uv_row(s, texture, triangle)
        tu, tv = interpolate(s.uvs, row, 2, 0, u, v, w), interpolate(s.uvs, row, 2, 1, u, v, w)
        r, g, b, a = texture_at(s, texture, tu, tv)
        red, green, blue = select(textured, r, red), select(textured, g, green), select(textured, b, blue)
        alpha = select(textured, a, alpha)
    return red, green, blue, alpha


@inlined
def is_cut_out(s: Surfaces, triangle: int, u: Real, v: Real) -> bool:
    """Return True if the alpha mask of a triangle removes the point (u, v)."""
    m = s.material[triangle]
    alpha = s.alpha[m]
    if s.alpha_texture[m] >= 0:
        w, row = np.float32(1.0) - u - v, uv_row(s, s.alpha_texture[m], triangle)
        tu, tv = interpolate(s.uvs, row, 2, 0, u, v, w), interpolate(s.uvs, row, 2, 1, u, v, w)
        alpha *= texture_at(s, s.alpha_texture[m], tu, tv)[3]
    cutoff = s.alpha_cutoff[m]
    if cutoff < 0.0:
        cutoff = _screen(triangle, u, v)
    return bool(alpha < cutoff)


@inlined
def _screen(triangle: int, u: Real, v: Real) -> Real:
    """A number in [0, 1) of the place (u, v) of a triangle: the share alpha of its places is solid, the rest is holes.

    It belongs to the place and not to the ray, so that all rays find the same surface, and with it all eyes.
    """
    places, nothing = np.float32(SCREEN), np.float32(0.0)
    row, column = np.uint32(max(u, nothing) * places), np.uint32(max(v, nothing) * places)
    at = np.uint64(row) + (np.uint64(column) << np.uint64(SCREEN_BITS))
    at += np.uint64(np.uint32(triangle)) << np.uint64(2 * SCREEN_BITS)
    return np.float32(mix(mix(at)) >> np.uint64(40)) * UNIT_24


@inlined
def position_at(s: Surfaces, triangle: int, u: Real, v: Real) -> Triple:
    """The point, interpolated between the corners: closer to the triangle than origin + t * direction."""
    u64, v64 = doubles(u), doubles(v)
    w64 = 1.0 - u64 - v64
    return (
        reals(_interpolate_point(s.corners, triangle, 0, u64, v64, w64)),
        reals(_interpolate_point(s.corners, triangle, 1, u64, v64, w64)),
        reals(_interpolate_point(s.corners, triangle, 2, u64, v64, w64)),
    )


@inlined
def _interpolate_point(corners: Corners, triangle: int, axis: int, u: Real, v: Real, w: Real) -> Real:
    at = triangle * np.int32(9) + np.int32(axis)
    a, b, c = gather(corners, at), gather(corners, at + np.int32(3)), gather(corners, at + np.int32(6))
    return w * doubles(a) + u * doubles(b) + v * doubles(c)


@inlined
def geometric_normal(s: Surfaces, triangle: int, dx: Real, dy: Real, dz: Real) -> Triple:
    """Unit normal of the triangle, on the side that a ray of direction (dx, dy, dz) comes from.

    In float64: the cross product of edges of 1e-12 would underflow in float32.
    """
    p, at = s.corners, triangle * np.int32(9)
    ax, ay = doubles(gather(p, at)), doubles(gather(p, at + np.int32(1)))
    az = doubles(gather(p, at + np.int32(2)))
    e1x, e1y = doubles(gather(p, at + np.int32(3))) - ax, doubles(gather(p, at + np.int32(4))) - ay
    e1z, e2x = doubles(gather(p, at + np.int32(5))) - az, doubles(gather(p, at + np.int32(6))) - ax
    e2y, e2z = doubles(gather(p, at + np.int32(7))) - ay, doubles(gather(p, at + np.int32(8))) - az
    nx, ny, nz = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
    scale = 1.0 / sqrt(nx * nx + ny * ny + nz * nz)
    away = nx * doubles(dx) + ny * doubles(dy) + nz * doubles(dz) > 0.0
    scale = select(away, -scale, scale)
    return reals(nx * scale), reals(ny * scale), reals(nz * scale)


@inlined
def shading_normal(s: Surfaces, triangle: int, u: Real, v: Real, gx: Real, gy: Real, gz: Real) -> Triple:
    """Interpolated unit normal on the side of the geometric normal (gx, gy, gz), or (gx, gy, gz) if there is none."""
    if s.normals.shape[0] == 0:
        return gx, gy, gz
    w, k = np.float32(1.0) - u - v, s.normals
    x, y = interpolate(k, triangle, 3, 0, u, v, w), interpolate(k, triangle, 3, 1, u, v, w)
    z = interpolate(k, triangle, 3, 2, u, v, w)
    square = x * x + y * y + z * z
    none = square < np.float32(1e-12)  # corner normals that cancel give no direction
    scale = np.float32(1.0) / sqrt(select(none, np.float32(1.0), square))
    scale = select(x * gx + y * gy + z * gz < np.float32(0.0), -scale, scale)
    return select(none, gx, x * scale), select(none, gy, y * scale), select(none, gz, z * scale)


@bundle
class Relief(NamedTuple):
    """The normal maps of a scene; `FLAT` where there are none.

    Attributes:
        tangents: (n, 3, 4) per corner T and w, see `Scene`.
        uvs: (n, 3, 2) texture coordinates of the maps.
        texture: (m,) map of each material, or -1.
        scale: (m,).
        surfaces: of the scene; its `linear` turns a code value into a number from -1 to 1.
    """

    tangents: Float32
    uvs: CornerUvs
    texture: Int32
    scale: Float32
    surfaces: Surfaces


FLAT = Relief(np.empty((0, 3, 4), np.float32), np.empty((0, 3, 2), np.float32), _NUMBERS, _REALS, NO_SURFACES)


def relief(scene: Scene, surfaces: Surfaces) -> Relief:
    """Gather the normal maps of a scene, whose surfaces are gathered already, as kernels take them."""
    if not len(scene.tangents):
        return FLAT
    codes = np.linspace(-1.0, 1.0, 256, dtype=np.float32)
    return Relief(
        tangents=np.ascontiguousarray(scene.tangents),
        uvs=np.ascontiguousarray(scene.normal_uvs),
        texture=scene.normal_texture,
        scale=scene.normal_scale,
        surfaces=surfaces._replace(linear=codes),
    )


@inlined
def mapped_normal(r: Relief, triangle: int, texture: int, u: Real, v: Real, g: Triple, m: Triple) -> Triple:
    """The unit normal by a map, at barycentric (u, v) of a triangle, in lanes; m where the map gives none.

    It is on the side of the geometric normal g. Where the map points below the triangle, the normal is bent up until it
    lies in the plane of the triangle: that depends on the side only, not on the place of the viewer, so that all eyes
    see the same light there.

    Args:
        texture: number of a map.
        g, m: geometric and interpolated unit normals, on the viewer's side.
    """
    nothing, one = np.float32(0.0), np.float32(1.0)
    w, s = one - u - v, r.surfaces
    material = gather(s.material, triangle)
    x, y, z, _ = texture_at(
        s, texture, interpolate(r.uvs, triangle, 2, 0, u, v, w), interpolate(r.uvs, triangle, 2, 1, u, v, w)
    )
    scale = gather(r.scale, material)
    x, y = x * scale, y * scale
    # T and N, interpolated; w of the first corner, as all corners of a triangle have the same
    tx, ty = interpolate(r.tangents, triangle, 4, 0, u, v, w), interpolate(r.tangents, triangle, 4, 1, u, v, w)
    tz = interpolate(r.tangents, triangle, 4, 2, u, v, w)
    y = y * gather(r.tangents, triangle * np.int32(12) + np.int32(3))
    nx, ny = interpolate(s.normals, triangle, 3, 0, u, v, w), interpolate(s.normals, triangle, 3, 1, u, v, w)
    nz = interpolate(s.normals, triangle, 3, 2, u, v, w)
    # their sum, on the side of m
    kx = x * tx + y * (ny * tz - nz * ty) + z * nx
    ky = x * ty + y * (nz * tx - nx * tz) + z * ny
    kz = x * tz + y * (nx * ty - ny * tx) + z * nz
    square = kx * kx + ky * ky + kz * kz
    valid = (tx * tx + ty * ty + tz * tz > NOTHING) & (square > NOTHING)
    length = one / sqrt(select(valid, square, one))
    length = select(nx * m[0] + ny * m[1] + nz * m[2] < nothing, -length, length)
    kx, ky, kz = kx * length, ky * length, kz * length
    # up to the plane of the triangle
    height = kx * g[0] + ky * g[1] + kz * g[2]
    lift = select(height < nothing, -height, nothing)
    kx, ky, kz = kx + lift * g[0], ky + lift * g[1], kz + lift * g[2]
    square = kx * kx + ky * ky + kz * kz
    valid = valid & (square > NOTHING)
    length = one / sqrt(select(valid, square, one))
    return select(valid, kx * length, m[0]), select(valid, ky * length, m[1]), select(valid, kz * length, m[2])
