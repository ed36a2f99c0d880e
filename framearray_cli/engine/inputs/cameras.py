"""Eye rays through pixels, and their inverse, from points to pixels of an eye, for cameras of all types.

A pixel's filter is the box of the pixel. Pixel (0, 0) is the top left one; images are (height, width).

Kernels compute a perspective whose axis meets the middle of the picture. Other cameras (orthographic, panorama,
shifted) have a row of `Cameras.lens` for each eye, whatever the resolution, by the formulas of `base/lens.py`.
Functions of lenses take numbers or lanes.
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Directions, Float32, Float64, Points, Real, Triple
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE, Lens
from framearray_cli.scene.paths.paths import Eyes

from ..kernels.bundle import bundle
from ..kernels.kernel import inlined
from ..kernels.simd import doubles, floor, integers, reals, select, sqrt
from .mips import Mips
from .surfaces import OFFSET_ULPS, ULP

# Distance, in sizes of a scene, of the point that replaces an orthographic camera if only directions count.
FAR = 1e6
OUTSIDE = -1  # the "pixel" of a point that an eye does not see
# Columns: the kind, f_x / width, f_y / height, c_x / width, c_y / height.
KIND, ACROSS, DOWN, LEFT, TOP, COLUMNS = range(6)
OF_PERSPECTIVE, OF_ORTHOGRAPHIC, OF_PANORAMA = range(3)
_KINDS = {PERSPECTIVE: OF_PERSPECTIVE, ORTHOGRAPHIC: OF_ORTHOGRAPHIC, PANORAMA: OF_PANORAMA}
# Directions are parallel if their cosine is above this: float32 knows no better.
PARALLEL = np.float32(1.0 - 2.0**-22)
# Pixels of a panorama at the poles: no density is higher than at this distance from a pole, as a share of the depth.
POLE = 1e-6

NO_LENSES = np.empty((0, COLUMNS), np.float64)


@bundle
class Cameras(NamedTuple):
    """All eyes of a job for kernels.

    Attributes:
        position: (n_c, 3) centred like the scene.
        right, up, forward: (n_c, 3) unit axes of each eye.
        focal: focal length in pixels; of a panorama pixels per radian of height, of an orthographic camera per scene
            unit; of the first eye if eyes differ.
        width, height: resolution in pixels.
        near: depth along the optical axis at which an eye begins to see, scene units; see `near_depth`.
        lens: (n_c, COLUMNS) a row each, see `lens_row`; no rows if all eyes have the same perspective, whose
            axis meets the middle of the picture.
    """

    position: Points
    right: Directions
    up: Directions
    forward: Directions
    focal: float
    width: int
    height: int
    near: float
    lens: Float64 = NO_LENSES

    def at(self, span: slice) -> "Cameras":
        """Return some eyes."""
        names = ("position", "right", "up", "forward", "lens")
        found: Any = {name: np.ascontiguousarray(getattr(self, name)[span]) for name in names}
        return self._replace(**found)


def cameras(eyes: Eyes, resolution: tuple[int, int], centre: Float64, near: float = 0.0) -> Cameras:
    """Make the arrays of all eyes that kernels read: centred, then cast to float32."""
    world_from_camera = eyes.world_from_camera
    width, height = resolution
    first = eyes.lenses[0]
    plain = first.is_plain and all(lens == first for lens in eyes.lenses)
    focal = height / np.pi if first.type == PANORAMA else first.focal(resolution)[1]
    return Cameras(
        position=(world_from_camera[:, :3, 3] - centre).astype(np.float32),
        right=np.ascontiguousarray(world_from_camera[:, :3, 0], np.float32),
        up=np.ascontiguousarray(world_from_camera[:, :3, 1], np.float32),
        forward=np.ascontiguousarray(-world_from_camera[:, :3, 2], np.float32),
        focal=float(focal),
        width=width,
        height=height,
        near=near,
        lens=NO_LENSES if plain else rows_of(eyes.lenses, resolution),
    )


def resized(cams: Cameras, width: int, height: int) -> Cameras:
    """Return the same eyes with pictures of another size."""
    return cams._replace(width=width, height=height, focal=cams.focal * height / cams.height)


def is_orthographic(cams: Cameras, c: int) -> bool:
    """Return True if the rays of eye c are parallel."""
    return len(cams.lens) > 0 and bool(cams.lens[c, KIND] == OF_ORTHOGRAPHIC)


def depths_of(cams: Cameras, c: int, points: Points) -> Float32:
    """The depths of points (n, 3) from eye c: along its axis, and for a panorama their distances."""
    way = points - cams.position[c]
    if len(cams.lens) > 0 and cams.lens[c, KIND] == OF_PANORAMA:
        return np.asarray(np.linalg.norm(way, axis=1))
    return np.asarray(way @ cams.forward[c])


def viewpoint(cams: Cameras, c: int) -> Float32:
    """Return the position at which surfaces see eye c, (3,); an orthographic one so far off that ways are parallel.

    `Cameras.near` says how large the scene is.
    """
    position: Float32 = cams.position[c]
    if not is_orthographic(cams, c):
        return position
    size = cams.near / (OFFSET_ULPS * ULP) + float(np.abs(cams.position).max())
    return np.asarray(position - FAR * size * cams.forward[c], np.float32)


def picture_rays(cams: Cameras, c: int) -> tuple[Float32, Float32]:
    """Origins and unit directions of the rays through the middles of all pixels of eye c, (n_pixels, 3)."""
    x: Any = (np.arange(cams.width) + 0.5) / cams.width
    y: Any = (np.arange(cams.height) + 0.5) / cams.height
    if not len(cams.lens):
        x = (np.arange(cams.width) + 0.5 - 0.5 * cams.width) / cams.focal
        y = (0.5 * cams.height - np.arange(cams.height) - 0.5) / cams.focal
        rays: Any = cams.forward[c] + x[None, :, None] * cams.right[c] + y[:, None, None] * cams.up[c]
        origin = cams.position[c : c + 1]
    elif cams.lens[c, KIND] == OF_PANORAMA:
        around, lift = 2 * np.pi * (x[None, :, None] - 0.5), np.pi * (0.5 - y[:, None, None])
        level = np.sin(around) * cams.right[c] + np.cos(around) * cams.forward[c]
        rays, origin = np.cos(lift) * level + np.sin(lift) * cams.up[c], cams.position[c : c + 1]
    else:
        x, y = (x - cams.lens[c, LEFT]) / cams.lens[c, ACROSS], (cams.lens[c, TOP] - y) / cams.lens[c, DOWN]
        place = x[None, :, None] * cams.right[c] + y[:, None, None] * cams.up[c]
        if is_orthographic(cams, c):
            rays = np.broadcast_to(cams.forward[c], place.shape)
            origin = (cams.position[c] + place).reshape(-1, 3).astype(np.float32)
        else:
            rays, origin = place + cams.forward[c], cams.position[c : c + 1]
    rays = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3).astype(np.float32)
    return origin, rays


def pixel_width(cams: Cameras, c: int) -> float:
    """The widest that pixels of eye c are: radians, and of an orthographic camera scene units."""
    if not len(cams.lens):
        return 1 / cams.focal
    if cams.lens[c, KIND] == OF_PANORAMA:
        return max(2 * np.pi / cams.width, np.pi / cams.height)
    return 1 / float(min(cams.lens[c, ACROSS] * cams.width, cams.lens[c, DOWN] * cams.height))


def mips_of(cams: Cameras, c: int, mips: Mips) -> Mips:
    """Return the footprint of the rays of eye c; `mips` has it for `cams.focal`."""
    if not len(cams.lens) or cams.lens[c, KIND] == OF_PANORAMA:
        return mips
    spread = mips.spread * cams.focal / float(cams.lens[c, DOWN] * cams.height)
    return mips._replace(spread=0.0, side=spread) if is_orthographic(cams, c) else mips._replace(spread=spread)


@inlined
def eye_ray(cams: Cameras, c: int, x: Real, y: Real) -> Triple:
    """Direction from eye c through image position (x, y) in pixels; its component along the optical axis is 1."""
    a = reals((x - 0.5 * cams.width) / cams.focal)
    b = reals((0.5 * cams.height - y) / cams.focal)
    r, u, f = cams.right, cams.up, cams.forward
    return (
        a * r[c, 0] + b * u[c, 0] + f[c, 0],
        a * r[c, 1] + b * u[c, 1] + f[c, 1],
        a * r[c, 2] + b * u[c, 2] + f[c, 2],
    )


@inlined
def corner_of(cams: Cameras, pixel: int) -> tuple[float, float]:
    """Image position (x, y) of the top left corner of a pixel."""
    row = floor(doubles(pixel) / doubles(cams.width))
    return doubles(pixel) - row * cams.width, row


@inlined
def project(cams: Cameras, k: int, x: Real, y: Real, z: Real) -> tuple[float, float, Real]:
    """Image position (x, y) of eye k at which the vector (x, y, z) from the eye is seen, and its length along the axis.

    The position is arbitrary where the vector points behind the eye. Takes numbers or lanes.
    """
    r, u, f = cams.right, cams.up, cams.forward
    depth = x * f[k, 0] + y * f[k, 1] + z * f[k, 2]
    scale = cams.focal / doubles(select(depth > np.float32(0.0), depth, np.float32(1.0)))
    column = 0.5 * cams.width + scale * doubles(x * r[k, 0] + y * r[k, 1] + z * r[k, 2])
    row = 0.5 * cams.height - scale * doubles(x * u[k, 0] + y * u[k, 1] + z * u[k, 2])
    return column, row, depth


@inlined
def project_to_pixel(cams: Cameras, k: int, x: Real, y: Real, z: Real) -> tuple[int, Real]:
    """The pixel of eye k that sees the vector (x, y, z) from the eye, and the vector's length along the optical axis.

    The pixel is OUTSIDE where the vector points behind the eye or out of the image. Takes numbers or lanes.
    """
    column, row, depth = project(cams, k, x, y, z)
    ahead = depth > np.float32(0.0)
    inside = ahead & (column >= 0.0) & (column < cams.width) & (row >= 0.0) & (row < cams.height)
    column, row = select(inside, column, 0.0), select(inside, row, 0.0)
    pixel = integers(row) * np.int32(cams.width) + integers(column)
    return select(inside, pixel, np.int32(OUTSIDE)), depth


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
    return select(y < 0.0, -angle, angle)


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
