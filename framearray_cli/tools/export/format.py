"""The frames of an export, the tables that describe them, and the parts of a format.

A new format is a module with a `Format`, and a line in `FORMATS`.
"""

import io
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.arrays import Bytes, Float64
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import write_bytes
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE

from ..axes import LightIndices
from .splits import SETS, Splits

# A matrix counts as rigid if its columns are orthonormal to within this; matrices written as float32 are.
RIGID = 1e-5
OPTION = "--group"
IMAGES = "images/"  # folder of the pictures of most formats
# Types of cameras, as nerfstudio calls them.
CAMERA_MODELS = {PERSPECTIVE: "OPENCV", ORTHOGRAPHIC: "ORTHOPHOTO", PANORAMA: "EQUIRECTANGULAR"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedFrame:
    """One picture of an export.

    Attributes:
        c: camera.
        lights: one index per light axis.
        name: of its file, without a suffix; names sort by camera, then by light.
        part: the set that it belongs to: "train", "val" or "test"; "" without sets.
        file: relative to the folder of the export; "" before it is written.
    """

    c: int
    lights: LightIndices
    name: str
    part: str = ""
    file: str = ""


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
        return [
            ExportedFrame(c=c, lights=lights, name=self._name(c, lights), part=part)
            for c, lights in product(self.cameras, self.lights)
            if (part := self.splits.of(c, lights) if self.splits else "") is not None
        ]

    def camera_name(self, c: int) -> str:
        """Name the files of a camera."""
        return f"c{c:0{max(4, len(str(self.manifest.n_cameras - 1)))}d}"

    def _name(self, c: int, lights: LightIndices) -> str:
        """Name a picture, without dots: for some readers the suffix begins at the first dot."""
        axes = self.manifest.axes
        names = axis_keys(axes).items()
        short = {axis: "l" if axis == MAIN_AXIS else name.removeprefix("light_") for axis, name in names}
        digits = (max(3, len(str(n - 1))) for n in axes.values())
        parts = [f"{short[axis]}{l:0{d}d}" for axis, l, d in zip(axes, lights, digits, strict=True)]
        return "_".join([self.camera_name(c), *parts])


def frames_by_set(every: Sequence[ExportedFrame]) -> dict[str, list[ExportedFrame]]:
    """Return the frames of all three sets, which some readers require; val and test replace each other."""
    frames = {name: [frame for frame in every if frame.part == name] for name in SETS}
    return frames | {"val": frames["val"] or frames["test"], "test": frames["test"] or frames["val"]}


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
    at = dict(zip(manifest.axes, lights, strict=True))
    return [
        source | ({"group": part.name} if manifest.groups else {})
        for part in manifest.parts
        for source in part.lights[at[part.axis]].sources
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


def only_group(manifest: Manifest, name: str | None) -> Manifest:
    """Return the manifest with the sources, the light axis and the ambient light of one group, and no background.

    Raises:
        JobError: the array has no such group.
    """
    if name is None:
        return manifest
    names = [group.name for group in manifest.groups]
    if name not in names:
        known = ", ".join(names) if names else "none, as the array has no groups"
        raise JobError(OPTION, [f"expected {known}, got {name!r}"])
    own = tuple(group for group in manifest.groups if group.name == name)
    sources = manifest.job.get("light", {}).get("sources") or []
    light = manifest.job.get("light", {}) | {"sources": [source for source in sources if source.get("group") == name]}
    return replace(
        manifest,
        groups=own,
        background_images="",
        background_ambient=(0.0, 0.0, 0.0),
        job=manifest.job | {"light": light},
    )


def group_hint(manifest: Manifest) -> str:
    """Return how to export one group where the array has several; "" where it has not."""
    names = [group.name for group in manifest.groups]
    return f"; {OPTION} {' or '.join(names)} exports the light of one group" if len(names) > 1 else ""


def focal_lengths(manifest: Manifest, c: int) -> dict[str, float]:
    """Return the focal lengths in pixels, and the horizontal angle for readers that prefer it.

    nerfstudio's focal lengths of a panorama are half its width and its height: they make -1 to 1 of image positions,
    and -1/2 to 1/2. An orthographic camera has pixels per scene unit instead.
    """
    lens, (width, height) = manifest.cameras[c].lens, manifest.resolution
    if lens.type == PANORAMA:
        return {"fl_x": width / 2, "fl_y": float(height)}
    f_x, f_y = lens.focal(manifest.resolution)
    found = {"fl_x": f_x, "fl_y": f_y}
    return found | ({"camera_angle_x": 2 * math.atan(0.5 * width / f_x)} if lens.type == PERSPECTIVE else {})


def centre(manifest: Manifest, c: int) -> dict[str, float]:
    """Return where the axis of camera c meets the picture, pixels."""
    x, y = manifest.cameras[c].lens.centre(manifest.resolution)
    return {"cx": x, "cy": y}


def image_size(manifest: Manifest, c: int) -> dict[str, Any]:
    """Return the size of the pictures, and where the axis of camera c meets them, pixels."""
    width, height = manifest.resolution
    return {"w": width, "h": height} | centre(manifest, c)


def camera_table(manifest: Manifest, c: int) -> dict[str, Any]:
    """Return everything about a camera: the size of its pictures, its lens and its pose; the model of other lenses."""
    kind = manifest.cameras[c].type
    table: dict[str, Any] = {"camera_model": CAMERA_MODELS[kind]} if kind != PERSPECTIVE else {}
    table |= image_size(manifest, c) | focal_lengths(manifest, c)
    return table | {"transform_matrix": rigid_pose(manifest, c).tolist()}


def frame_table(manifest: Manifest, frame: ExportedFrame) -> dict[str, Any]:
    """Return pose and light: all sources, and `pl_pos` and `pl_intensity` where the only one is a point."""
    table: dict[str, Any] = {"transform_matrix": rigid_pose(manifest, frame.c).tolist()} | index_table(manifest, frame)
    sources = source_tables(manifest, frame)
    if len(sources) == 1 and sources[0]["type"] == "point":
        table |= {"pl_pos": sources[0]["position"], "pl_intensity": sources[0]["intensity"]}
    return table | {"sources": sources}


def index_table(manifest: Manifest, frame: ExportedFrame) -> dict[str, int]:
    """Return the indices of a picture: of its camera, and of its light along each axis."""
    return {"camera": frame.c} | dict(zip(axis_keys(manifest.axes).values(), frame.lights, strict=True))


def source_tables(manifest: Manifest, frame: ExportedFrame) -> list[dict[str, Any]]:
    """Return the sources of a picture as the manifest describes them, in values of JSON."""
    sources = sources_at(manifest, frame.lights)
    return [{key: _in_json(value) for key, value in source.items()} for source in sources]


def _in_json(value: Any) -> Any:
    if isinstance(value, bool | str):
        return value
    return [float(number) for number in value] if isinstance(value, list | tuple) else float(value)


def write_json(file: Path, table: Any) -> None:
    """Write a file of JSON."""
    write_bytes(file, f"{json.dumps(table, indent=2)}\n".encode())


def write_lines(file: Path, lines: Iterable[str]) -> None:
    """Write a file of text."""
    write_bytes(file, "".join(f"{line}\n" for line in lines).encode())


def write_array(file: Path, values: NDArray[Any]) -> None:
    """Write a file of NumPy."""
    buffer = io.BytesIO()
    np.save(buffer, values)
    write_bytes(file, buffer.getvalue())


# The points that a camera sees: (n,) their indices, ascending; and (n, 2) where it sees them, pixels from the upper
# left corner; the first pixel's middle is (0.5, 0.5).
Observations: TypeAlias = tuple[NDArray[np.int64], Float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PointCloud:
    """Points, and the cameras that see them.

    Attributes:
        position: (n, 3), world.
        codes: (n, 3) sRGB.
        observations: by camera.
    """

    position: Float64
    codes: Bytes
    observations: Mapping[int, Observations]


NO_POINTS = PointCloud(position=np.empty((0, 3)), codes=np.empty((0, 3), np.uint8), observations={})


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """An export with all pictures in its folder; the writer of its format adds the rest.

    Attributes:
        folder: of the export.
        frames: of the selection, with their files.
        cloud: points of the scene, if the format has points and the array has layers.
        exposure: of the pictures, in stops.
    """

    folder: Path
    selection: Selection
    frames: Sequence[ExportedFrame]
    cloud: PointCloud | None = None
    exposure: float = 0.0

    @property
    def head(self) -> dict[str, float]:
        """The exposure as a table, empty without."""
        return {"exposure": self.exposure} if self.exposure else {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format.

    Attributes:
        mark: a file that every such export has: `--force` replaces no other folder.
        write: writes all that is not a picture. Raises OutputError if the pose of a camera is no rigid motion, layers
            are missing or damaged, or a file cannot be written.
        stem: the file of a picture, relative to the folder, without its suffix.
        all_lights: True if the default is every light position, not the middle one.
        points: True if the format has points and depths of the scene.
        splits: True if the format has sets.
        rule: default of `--split`.
        images: image formats that readers of the format accept; none: all.
        one_source: True if each picture needs one source of light.
        check: refuses cameras or lights that the format cannot describe.
    """

    mark: str
    write: Callable[[Export], None]
    stem: Callable[[ExportedFrame], str] = lambda frame: f"{IMAGES}{frame.name}"
    all_lights: bool = True
    points: bool = False
    splits: bool = True
    rule: str = ""
    images: tuple[str, ...] = ()
    one_source: bool = False
    check: Callable[[Selection], None] = lambda selection: None
