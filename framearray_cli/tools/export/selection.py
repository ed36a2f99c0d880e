"""What is handed over: which cameras under which light, as a list of frames, and what is known of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import OutputError

from ..places import LightPlace, plain_names

# A matrix counts as rigid where its columns are unit and at right angles to within this; written as float32 they are.
RIGID = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedFrame:
    """One picture that is handed over.

    Attributes:
        c: camera.
        place: of the light, one index for each axis.
        name: of its file, without a suffix; names sort by camera, then by place.
    """

    c: int
    place: LightPlace
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Cameras and light places; every camera comes under every place."""

    manifest: Manifest
    cameras: tuple[int, ...]
    places: tuple[LightPlace, ...]

    @property
    def frames(self) -> list[ExportedFrame]:
        """All frames, place by place for each camera."""
        name = self._name
        return [ExportedFrame(c=c, place=place, name=name(c, place)) for c in self.cameras for place in self.places]

    def camera_name(self, c: int) -> str:
        """Name of a camera's files."""
        return f"c{c:0{max(4, len(str(self.manifest.n_cameras - 1)))}d}"

    def _name(self, c: int, place: LightPlace) -> str:
        """Without dots: some readers take all behind the first dot for the suffix."""
        axes = self.manifest.axes
        names = plain_names(axes).items()
        short = {axis: "l" if axis == MAIN_AXIS else name.removeprefix("light_") for axis, name in names}
        digits = (max(3, len(str(n - 1))) for n in axes.values())
        parts = [f"{short[axis]}{l:0{d}d}" for axis, l, d in zip(axes, place, digits, strict=True)]
        return "_".join([self.camera_name(c), *parts])


def sources_at(manifest: Manifest, place: LightPlace) -> list[dict[str, Any]]:
    """All sources that shine at a light place."""
    if not manifest.groups:
        return list(manifest.lights[place[0]].sources)
    at = dict(zip(manifest.axes, place, strict=True))
    return [source for group in manifest.groups for source in group.lights[at[group.axis]].sources]


def focal_length(manifest: Manifest, c: int) -> float:
    """Of camera c, pixels; pixels are square, and the optical axis meets the middle of the image."""
    return 0.5 * manifest.resolution[1] / math.tan(math.radians(manifest.cameras[c].fov) / 2)


def rigid_pose(manifest: Manifest, c: int) -> Float64:
    """`world_from_camera` of camera c, (4, 4).

    Raises:
        OutputError: it scales or mirrors, which no format here can hold.
    """
    matrix = manifest.cameras[c].matrix
    turn = matrix[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID or np.linalg.det(turn) < 0 or tuple(matrix[3]) != (0, 0, 0, 1):
        raise OutputError(f"{manifest.directory}: cameras[{c}].world_from_camera: expected a rigid motion")
    return matrix


def numbers(values: Sequence[float] | Float64) -> list[float]:
    """Plain floats, which are written so that they read back exactly."""
    return [float(value) for value in values]
