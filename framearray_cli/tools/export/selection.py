"""What is exported: which cameras under which light positions, as a list of frames, and the data of each frame."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import OutputError

from ..axes import LightIndices
from .splits import SETS, Splits

# A matrix counts as rigid if its columns are orthonormal to within this; matrices written as float32 are.
RIGID = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedFrame:
    """One picture of an export.

    Attributes:
        c: camera.
        lights: one index per light axis.
        name: of its file, without a suffix; names sort by camera, then by light.
        part: the set that it belongs to: "train", "val" or "test"; "" without sets.
    """

    c: int
    lights: LightIndices
    name: str
    part: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Cameras and light positions; every camera comes with every light position, but for what `splits` leaves out."""

    manifest: Manifest
    cameras: tuple[int, ...]
    lights: tuple[LightIndices, ...]
    splits: Splits | None = None

    @property
    def frames(self) -> list[ExportedFrame]:
        """All frames, camera by camera."""
        found = []
        for c, lights in product(self.cameras, self.lights):
            part = self.splits.of(c, lights) if self.splits else ""
            if part is not None:
                found.append(ExportedFrame(c=c, lights=lights, name=self._name(c, lights), part=part))
        return found

    def camera_name(self, c: int) -> str:
        """Name the files of a camera."""
        return f"c{c:0{max(4, len(str(self.manifest.n_cameras - 1)))}d}"

    def _name(self, c: int, lights: LightIndices) -> str:
        """Name a picture, without dots: some readers take all behind the first dot for the suffix."""
        axes = self.manifest.axes
        names = axis_keys(axes).items()
        short = {axis: "l" if axis == MAIN_AXIS else name.removeprefix("light_") for axis, name in names}
        digits = (max(3, len(str(n - 1))) for n in axes.values())
        parts = [f"{short[axis]}{l:0{d}d}" for axis, l, d in zip(axes, lights, digits, strict=True)]
        return "_".join([self.camera_name(c), *parts])


def frames_by_set(selection: Selection) -> dict[str, list[ExportedFrame]]:
    """Return the frames of all three sets, which some readers insist on; val and test stand in for each other."""
    frames: dict[str, list[ExportedFrame]] = {name: [] for name in SETS}
    for frame in selection.frames:
        frames[frame.part].append(frame)
    frames["val"] = frames["val"] or frames["test"]
    frames["test"] = frames["test"] or frames["val"]
    return frames


def axis_keys(axes: Mapping[str, int]) -> dict[str, str]:
    """Map axes to keys of letters, digits and _, all different: "light" for the main one, "light_..." for others."""
    keys: dict[str, str] = {}
    for axis in axes:
        key = MAIN_AXIS if axis == MAIN_AXIS else f"light_{re.sub(r'[^0-9A-Za-z]+', '_', axis).strip('_')}"
        while key in keys.values():
            key += "_"
        keys[axis] = key
    return keys


def sources_at(manifest: Manifest, lights: LightIndices) -> list[dict[str, Any]]:
    """List all sources that shine at a light position, with the `group` of each where the array has groups."""
    if not manifest.groups:
        return list(manifest.lights[lights[0]].sources)
    at = dict(zip(manifest.axes, lights, strict=True))
    return [
        source | {"group": group.name} for group in manifest.groups for source in group.lights[at[group.axis]].sources
    ]


def rigid_pose(manifest: Manifest, c: int) -> Float64:
    """Return `world_from_camera` of camera c, (4, 4).

    Raises:
        OutputError: it scales or mirrors, which no format here can hold.
    """
    matrix = manifest.cameras[c].matrix
    turn = matrix[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID or np.linalg.det(turn) < 0 or tuple(matrix[3]) != (0, 0, 0, 1):
        raise OutputError(f"{manifest.directory}: cameras[{c}].world_from_camera: expected a rigid motion")
    return matrix


def plain_floats(values: Sequence[float] | Float64) -> list[float]:
    """Convert to plain floats, whose text reads back exactly."""
    return [float(value) for value in values]
