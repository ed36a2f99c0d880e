"""The camera positions: poses, intrinsics, and the way from the scene to pixels and back.

Matrices act on column vectors and are named target_from_source. The world has the coordinates of the scene file. Camera
space is that of OpenGL, Blender and nerfstudio: x right, y up, the camera looks along -z. Matrices that end in `_cv`
have the camera space of OpenCV and COLMAP: x right, y down, the camera looks along +z.

Image positions are in pixels from the upper left corner of the picture: the first pixel's middle is (0.5, 0.5).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.units import counted

_CV = np.diag([1.0, -1.0, -1.0, 1.0])  # between both camera spaces


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """One camera position.

    Attributes:
        index: c.
        world_from_camera: (4, 4), a rigid motion.
        intrinsics: (3, 3), the matrix K of OpenCV: K (x, y, z) in its camera space is (u z, v z, z) in pixels.
        fov: vertical field of view, degrees.
        resolution: width and height, pixels.
    """

    index: int
    world_from_camera: NDArray[np.float64]
    intrinsics: NDArray[np.float64]
    fov: float
    resolution: tuple[int, int]

    @property
    def position(self) -> NDArray[np.float64]:
        """Where the eye is, (3,), world."""
        return self.world_from_camera[:3, 3].copy()

    @property
    def camera_from_world(self) -> NDArray[np.float64]:
        """(4, 4), the inverse of `world_from_camera`."""
        return np.asarray(np.linalg.inv(self.world_from_camera))

    @property
    def world_from_camera_cv(self) -> NDArray[np.float64]:
        """(4, 4), from the camera space of OpenCV."""
        return np.asarray(self.world_from_camera @ _CV)

    @property
    def camera_cv_from_world(self) -> NDArray[np.float64]:
        """(4, 4), to the camera space of OpenCV: the extrinsics of COLMAP."""
        return np.asarray(_CV @ self.camera_from_world)

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return image positions (..., 2) and depths (...) of world points (..., 3).

        A depth is along the optical axis, as in the layer `depth`. Behind the camera it is negative, and the position
        is NaN.
        """
        to_camera = self.camera_cv_from_world
        at = np.asarray(points, np.float64) @ to_camera[:3, :3].T + to_camera[:3, 3]
        depth = at[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = (at @ self.intrinsics.T)[..., :2] / depth[..., None]
        pixels[depth <= 0] = np.nan
        return pixels, depth

    def rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the rays through the middles of all pixels: origin and direction, (height, width, 3), world.

        Directions advance the depth by one: origin + depth * direction is the point that a pixel of the
        layer `depth` shows.
        """
        width, height = self.resolution
        middle = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        of_pixels = np.concatenate([middle, np.ones((height, width, 1))], axis=-1) @ np.linalg.inv(self.intrinsics).T
        directions = of_pixels @ self.world_from_camera_cv[:3, :3].T
        return np.broadcast_to(self.position, directions.shape).copy(), np.asarray(directions)

    def points(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Return the world points (height, width, 3) that pixels of a depth layer (height, width) show; NaN where the
        depth is 0, which stands for no surface.
        """
        far = np.asarray(depth, np.float64)
        origin, direction = self.rays()
        return np.asarray(np.where(far[..., None] > 0, origin + far[..., None] * direction, np.nan))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Cameras(Sequence[Camera]):
    """All camera positions in the order of the path; a sequence of `Camera`.

    Attributes:
        world_from_camera: (n, 4, 4), rigid motions.
        intrinsics: (n, 3, 3), as of `Camera`.
        fov: (n,), vertical, degrees.
        resolution: width and height of all pictures, pixels.
    """

    world_from_camera: NDArray[np.float64]
    intrinsics: NDArray[np.float64]
    fov: NDArray[np.float64]
    resolution: tuple[int, int]

    @classmethod
    def of(cls, manifest: Manifest) -> "Cameras":
        """Return the camera positions of a manifest."""
        return cls(
            world_from_camera=np.array([camera.matrix for camera in manifest.cameras]),
            intrinsics=np.array([_intrinsics(manifest, c) for c in range(manifest.n_cameras)]),
            fov=np.array([camera.fov for camera in manifest.cameras]),
            resolution=manifest.resolution,
        )

    @property
    def position(self) -> NDArray[np.float64]:
        """Where the eyes are, (n, 3), world."""
        return self.world_from_camera[:, :3, 3].copy()

    @property
    def world_from_camera_cv(self) -> NDArray[np.float64]:
        """(n, 4, 4), from the camera space of OpenCV."""
        return np.asarray(self.world_from_camera @ _CV)

    @property
    def camera_cv_from_world(self) -> NDArray[np.float64]:
        """(n, 4, 4), to the camera space of OpenCV: the extrinsics of COLMAP."""
        return np.asarray(np.linalg.inv(self.world_from_camera_cv))

    def __len__(self) -> int:
        return len(self.world_from_camera)

    @overload
    def __getitem__(self, index: int) -> Camera: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Camera, ...]: ...
    def __getitem__(self, index: int | slice) -> Camera | tuple[Camera, ...]:
        if isinstance(index, slice):
            return tuple(self[c] for c in range(*index.indices(len(self))))
        c = range(len(self))[index]
        return Camera(
            index=c,
            world_from_camera=self.world_from_camera[c],
            intrinsics=self.intrinsics[c],
            fov=float(self.fov[c]),
            resolution=self.resolution,
        )

    def __iter__(self) -> Iterator[Camera]:
        return (self[c] for c in range(len(self)))

    def __repr__(self) -> str:
        width, height = self.resolution
        return f"<Cameras: {counted(len(self), 'position')}, {width} x {height} pixels>"


def _intrinsics(manifest: Manifest, c: int) -> NDArray[np.float64]:
    width, height = manifest.resolution
    focal = 0.5 * height / math.tan(math.radians(manifest.cameras[c].fov) / 2)
    return np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
