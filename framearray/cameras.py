"""The camera positions: poses, intrinsics, and the way from the scene to pixels and back.

Matrices act on column vectors and are named target_from_source. The world has the coordinates of the scene file. Camera
space, as in OpenGL, Blender and nerfstudio, has x right, y up, the camera looks along -z. Matrices that end in `_cv`
have the camera space of OpenCV and COLMAP: x right, y down, the camera looks along +z.

Image positions are in pixels from the upper left corner of the picture: the first pixel's middle is (0.5, 0.5).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.places import CAMERA_AXIS, outside_problem
from framearray_cli.base.lens import PANORAMA, PERSPECTIVE, Lens
from framearray_cli.base.units import counted

_CV = np.diag([1.0, -1.0, -1.0, 1.0])  # between both camera spaces


def check_index(value: float, n: int, axis: str, *, whole: bool = False) -> float:
    """Check a position along an axis of n, where negative ones count from the end.

    Args:
        axis: its name: "camera", "light" or another light axis.
        whole: expect an index.

    Raises:
        TypeError: it is no number.
        IndexError: the axis has no such position.
    """
    number = isinstance(value, int | np.integer if whole else int | float | np.number) and not isinstance(value, bool)
    if not number or not isfinite(value):
        raise TypeError(f"{axis}: expected {'a whole number' if whole else 'a number'}, got {value!r}")
    found = value + n if value < 0 else value
    if not 0 <= found <= n - 1:
        raise IndexError(f"{axis}: {outside_problem(value, n, axis)}")
    return float(found)


def index_of(value: int, n: int, axis: str) -> int:
    """Return the index of a position along an axis of n; see `check_index`."""
    return int(check_index(value, n, axis, whole=True))


class Poses:
    """Poses of a camera position, or of several along a first axis."""

    __slots__ = ()
    world_from_camera: NDArray[np.float64]

    @property
    def position(self) -> NDArray[np.float64]:
        """Position of the eye, (3,), world."""
        return self.world_from_camera[..., :3, 3].copy()

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera(Poses):
    """One camera position.

    Attributes:
        index: c.
        world_from_camera: (4, 4), a rigid motion.
        intrinsics: (3, 3), the matrix K of OpenCV: K (x, y, z) in its camera space is (u z, v z, z) in pixels. Of an
            orthographic camera K (x, y, 1) is (u, v, 1); of a panorama K is NaN.
        fov: vertical field of view, degrees; NaN of cameras that are no perspectives.
        resolution: width and height, pixels.
        lens: its type, "perspective", "orthographic" or "panorama", and all that belongs to it.
    """

    index: int
    world_from_camera: NDArray[np.float64]
    intrinsics: NDArray[np.float64]
    fov: float
    resolution: tuple[int, int]
    lens: Lens

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return image positions (..., 2) and depths (...) of world points (..., 3).

        A depth is along the optical axis, and of a panorama the distance, as in the layer `depth`. Behind the camera
        it is negative, and the position is NaN.
        """
        to_camera = self.camera_from_world
        at = np.asarray(points, np.float64) @ to_camera[:3, :3].T + to_camera[:3, 3]
        pixels, depth = self.lens.project(self.resolution, at.reshape(-1, 3))
        pixels[depth <= 0] = np.nan
        return pixels.reshape(*at.shape[:-1], 2), depth.reshape(at.shape[:-1])

    def rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the rays through the middles of all pixels: origin and direction, (height, width, 3), world.

        Directions advance the depth by one: origin + depth * direction is the point that a pixel of the
        layer `depth` shows.
        """
        width, height = self.resolution
        middle = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        turn = self.world_from_camera[:3, :3].T
        origins, directions = (
            (array @ turn).reshape(height, width, 3) for array in self.lens.rays(self.resolution, middle.reshape(-1, 2))
        )
        return origins + self.position, directions

    def points(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Return the world points (height, width, 3) that pixels of a depth layer (height, width) show; NaN where the
        depth is 0, which stands for no surface.
        """
        far = np.asarray(depth, np.float64)
        origin, direction = self.rays()
        return np.asarray(np.where(far[..., None] > 0, origin + far[..., None] * direction, np.nan))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Cameras(Poses, Sequence[Camera]):
    """All camera positions in the order of the path; a sequence of `Camera`.

    Attributes:
        world_from_camera: (n, 4, 4), rigid motions.
        intrinsics: (n, 3, 3), as of `Camera`.
        fov: (n,), vertical, degrees; NaN of cameras that are no perspectives.
        resolution: width and height of all pictures, pixels.
        lenses: n, as of `Camera`.
    """

    world_from_camera: NDArray[np.float64]
    intrinsics: NDArray[np.float64]
    fov: NDArray[np.float64]
    resolution: tuple[int, int]
    lenses: tuple[Lens, ...]

    @classmethod
    def of(cls, manifest: Manifest) -> "Cameras":
        """Return the camera positions of a manifest."""
        lenses = tuple(camera.lens for camera in manifest.cameras)
        return cls(
            world_from_camera=np.array([camera.matrix for camera in manifest.cameras]),
            intrinsics=np.array([_intrinsics(lens, manifest.resolution) for lens in lenses]),
            fov=np.array([lens.fov if lens.type == PERSPECTIVE else np.nan for lens in lenses]),
            resolution=manifest.resolution,
            lenses=lenses,
        )

    def __len__(self) -> int:
        return len(self.world_from_camera)

    @overload
    def __getitem__(self, index: int) -> Camera: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Camera, ...]: ...
    def __getitem__(self, index: int | slice) -> Camera | tuple[Camera, ...]:
        if isinstance(index, slice):
            return tuple(self[c] for c in range(*index.indices(len(self))))
        c = index_of(index, len(self), CAMERA_AXIS)
        return Camera(
            index=c,
            world_from_camera=self.world_from_camera[c],
            intrinsics=self.intrinsics[c],
            fov=float(self.fov[c]),
            resolution=self.resolution,
            lens=self.lenses[c],
        )

    def __repr__(self) -> str:
        width, height = self.resolution
        return f"<Cameras: {counted(len(self), 'position')}, {width} x {height} pixels>"


def _intrinsics(lens: Lens, resolution: tuple[int, int]) -> NDArray[np.float64]:
    if lens.type == PANORAMA:
        return np.full((3, 3), np.nan)
    (f_x, f_y), (c_x, c_y) = lens.focal(resolution), lens.centre(resolution)
    return np.array([[f_x, 0.0, c_x], [0.0, f_y, c_y], [0.0, 0.0, 1.0]])
