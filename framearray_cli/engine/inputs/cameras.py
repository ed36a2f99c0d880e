"""Eye rays through pixels, and their inverse, from points to pixels of an eye.

A pixel's filter is the box of the pixel. Pixel (0, 0) is the top left one; images are (height, width).
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Directions, Float64, Points, Real, Triple
from framearray_cli.scene.paths.paths import Eyes

from ..kernels.kernel import inlined
from ..kernels.simd import doubles, floor, integers, reals, select

OUTSIDE = -1  # the "pixel" of a point that an eye does not see


class Cameras(NamedTuple):
    """All eyes of a job for kernels.

    Attributes:
        position: (n_c, 3) centred like the scene.
        right, up, forward: (n_c, 3) unit axes of each eye.
        focal: focal length in pixels.
        width, height: resolution in pixels.
        near: depth along the optical axis at which an eye begins to see, scene units; see `near_depth`.
    """

    position: Points
    right: Directions
    up: Directions
    forward: Directions
    focal: float
    width: int
    height: int
    near: float


def cameras(eyes: Eyes, resolution: tuple[int, int], centre: Float64, near: float = 0.0) -> Cameras:
    """Make the arrays of all eyes that kernels read: centred, then cast to float32."""
    world_from_camera = eyes.world_from_camera
    width, height = resolution
    return Cameras(
        position=(world_from_camera[:, :3, 3] - centre).astype(np.float32),
        right=np.ascontiguousarray(world_from_camera[:, :3, 0], np.float32),
        up=np.ascontiguousarray(world_from_camera[:, :3, 1], np.float32),
        forward=np.ascontiguousarray(-world_from_camera[:, :3, 2], np.float32),
        focal=float(0.5 * height / np.tan(np.radians(eyes.fov_deg) / 2)),
        width=width,
        height=height,
        near=near,
    )


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
