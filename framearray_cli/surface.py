"""What a ray finds where it meets a triangle: point, normals, reflectivity, opacity.

`Surfaces` is `Scene` as kernels take it; an array of length 0 stands for a feature that the scene does not use.
"""

import math
from typing import NamedTuple

import numpy as np

from .arrays import Bytes, Corners, CornerUvs, Float32, Int32, Real, Rgb, Triple
from .kernel import inlined
from .scene import Scene

# Ray offsets: 16 units in the last place of the largest coordinate of the triangle. Of the rules tried it alone had
# no self-hits and no leaks at every scale (docs/decisions/ray-offsets.md).
OFFSET_ULPS = 16.0
ULP = 2.0**-23


class Surfaces(NamedTuple):
    """Arrays of `Scene` for kernels, plus what is derived from them once.

    Attributes:
        offset: (n,) how far a ray that leaves a triangle starts above it, scene units.
        linear: (256,) sRGB code value -> linear value.
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
    offset: Float32
    linear: Float32


def surfaces(scene: Scene) -> Surfaces:
    """Gather what kernels read of a scene; shares memory with it."""
    largest = np.abs(scene.corners).max(axis=(1, 2), initial=0.0)
    code = np.arange(256) / 255.0
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    arrays = {name: getattr(scene, name) for name in Surfaces._fields[:-2]}
    arrays["offset"] = (OFFSET_ULPS * ULP * largest).astype(np.float32)
    return Surfaces(**arrays, linear=linear.astype(np.float32))


@inlined
def texture_at(s: Surfaces, texture: int, u: Real, v: Real) -> tuple[Real, Real, Real, Real]:
    """Bilinear, repeating look-up: linear red, green, blue, and alpha; texel centres at half-integers, v upwards."""
    first, width, height = s.textures[texture, 0], s.textures[texture, 1], s.textures[texture, 2]
    x = (u - math.floor(u)) * width - 0.5
    y = (1.0 - (v - math.floor(v))) * height - 0.5
    if not (abs(x) < 1e9 and abs(y) < 1e9):  # a non-finite coordinate has no texel; the first stands in
        x = y = 0.0
    column, row = int(math.floor(x)), int(math.floor(y))
    fx, fy = x - column, y - row
    red = green = blue = alpha = 0.0
    for j in range(2):
        for i in range(2):
            weight = (fx if i else 1.0 - fx) * (fy if j else 1.0 - fy)
            texel = first + ((row + j) % height) * width + (column + i) % width
            red += weight * s.linear[s.texels[texel, 0]]
            green += weight * s.linear[s.texels[texel, 1]]
            blue += weight * s.linear[s.texels[texel, 2]]
            alpha += weight * s.texels[texel, 3]
    return red, green, blue, alpha / 255.0


@inlined
def _texture_coordinates(s: Surfaces, triangle: int, u: Real, v: Real) -> tuple[Real, Real]:
    w = 1.0 - u - v
    uv = s.uvs
    return (
        w * uv[triangle, 0, 0] + u * uv[triangle, 1, 0] + v * uv[triangle, 2, 0],
        w * uv[triangle, 0, 1] + u * uv[triangle, 1, 1] + v * uv[triangle, 2, 1],
    )


@inlined
def _tinted(s: Surfaces, red: Real, green: Real, blue: Real, texture: int, triangle: int, u: Real, v: Real) -> Triple:
    """A material's factor times texture and corner colour."""
    if texture >= 0:
        tu, tv = _texture_coordinates(s, triangle, u, v)
        r, g, b, _ = texture_at(s, texture, tu, tv)
        red, green, blue = red * np.float32(r), green * np.float32(g), blue * np.float32(b)
    if s.colours.shape[0] > 0:
        w, k = np.float32(1.0) - u - v, s.colours
        red *= w * k[triangle, 0, 0] + u * k[triangle, 1, 0] + v * k[triangle, 2, 0]
        green *= w * k[triangle, 0, 1] + u * k[triangle, 1, 1] + v * k[triangle, 2, 1]
        blue *= w * k[triangle, 0, 2] + u * k[triangle, 1, 2] + v * k[triangle, 2, 2]
    return red, green, blue


@inlined
def reflectivity_at(s: Surfaces, triangle: int, u: Real, v: Real) -> Triple:
    """Diffuse reflectivity, RGB 0 to 1, at barycentric (u, v) of a triangle."""
    m = s.material[triangle]
    red, green, blue = s.reflectivity[m, 0], s.reflectivity[m, 1], s.reflectivity[m, 2]
    return _tinted(s, red, green, blue, s.reflectivity_texture[m], triangle, u, v)


@inlined
def specular_at(s: Surfaces, triangle: int, u: Real, v: Real) -> Triple:
    """Mirror reflectivity, RGB 0 to 1, at barycentric (u, v) of a triangle."""
    m = s.material[triangle]
    red, green, blue = s.specular[m, 0], s.specular[m, 1], s.specular[m, 2]
    if red > 0.0 or green > 0.0 or blue > 0.0:
        red, green, blue = _tinted(s, red, green, blue, s.specular_texture[m], triangle, u, v)
    return red, green, blue


@inlined
def is_cut_out(s: Surfaces, triangle: int, u: Real, v: Real) -> bool:
    """Whether the alpha mask of a triangle removes the point (u, v)."""
    m = s.material[triangle]
    alpha = s.alpha[m]
    if s.alpha_texture[m] >= 0:
        tu, tv = _texture_coordinates(s, triangle, u, v)
        alpha *= texture_at(s, s.alpha_texture[m], tu, tv)[3]
    return bool(alpha < s.alpha_cutoff[m])


@inlined
def position_at(s: Surfaces, triangle: int, u: Real, v: Real) -> Triple:
    """The point itself, from the corners: nearer to the triangle than origin + t * direction is."""
    p, u64, v64 = s.corners, np.float64(u), np.float64(v)
    w64 = 1.0 - u64 - v64
    return (
        np.float32(w64 * p[triangle, 0, 0] + u64 * p[triangle, 1, 0] + v64 * p[triangle, 2, 0]),
        np.float32(w64 * p[triangle, 0, 1] + u64 * p[triangle, 1, 1] + v64 * p[triangle, 2, 1]),
        np.float32(w64 * p[triangle, 0, 2] + u64 * p[triangle, 1, 2] + v64 * p[triangle, 2, 2]),
    )


@inlined
def geometric_normal(s: Surfaces, triangle: int, dx: Real, dy: Real, dz: Real) -> Triple:
    """Unit normal of the triangle, on the side that a ray of direction (dx, dy, dz) comes from.

    In float64: the cross product of edges of 1e-12 would underflow in float32.
    """
    p = s.corners
    ax, ay, az = np.float64(p[triangle, 0, 0]), np.float64(p[triangle, 0, 1]), np.float64(p[triangle, 0, 2])
    e1x, e1y, e1z = p[triangle, 1, 0] - ax, p[triangle, 1, 1] - ay, p[triangle, 1, 2] - az
    e2x, e2y, e2z = p[triangle, 2, 0] - ax, p[triangle, 2, 1] - ay, p[triangle, 2, 2] - az
    nx, ny, nz = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    if nx * dx + ny * dy + nz * dz > 0.0:
        scale = -scale
    return np.float32(nx * scale), np.float32(ny * scale), np.float32(nz * scale)


@inlined
def shading_normal(s: Surfaces, triangle: int, u: Real, v: Real, gx: Real, gy: Real, gz: Real) -> Triple:
    """Interpolated unit normal on the side of the geometric normal (gx, gy, gz), or that one where there is none."""
    if s.normals.shape[0] == 0:
        return gx, gy, gz
    w, k = np.float32(1.0) - u - v, s.normals
    x = w * k[triangle, 0, 0] + u * k[triangle, 1, 0] + v * k[triangle, 2, 0]
    y = w * k[triangle, 0, 1] + u * k[triangle, 1, 1] + v * k[triangle, 2, 1]
    z = w * k[triangle, 0, 2] + u * k[triangle, 1, 2] + v * k[triangle, 2, 2]
    square = x * x + y * y + z * z
    if square < 1e-12:  # corner normals that cancel give no direction
        return gx, gy, gz
    scale = np.float32(1.0) / np.sqrt(square)
    if x * gx + y * gy + z * gz < 0.0:
        scale = -scale
    return x * scale, y * scale, z * scale
