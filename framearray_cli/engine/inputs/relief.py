"""Normal maps: the shading normal that a texture says, in the tangent space of each triangle.

    m = x T + y w (N x T) + z N        (x, y, z) of the map, x and y times its scale

T and N are interpolated between corners and not normalised, as where such maps are baked [Mikkelsen08].
"""

from typing import NamedTuple, cast

import numpy as np

from framearray_cli.base.arrays import CornerUvs, Float32, Int32, Real, Triple
from framearray_cli.scene.scene import Scene

from ..kernels.kernel import inlined
from ..kernels.simd import gather, select, sqrt
from .surfaces import Surfaces, interpolate, texture_at

# Below this length, squared, a sum of unit vectors gives no direction.
NOTHING = np.float32(1e-12)


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


FLAT = cast(Relief, ())


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
    lies in the plane of the triangle: that depends on the side only, not on where the viewer stands, so that all eyes
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
