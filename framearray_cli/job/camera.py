"""`[camera]`: the path of the camera, and its lens, for all frames or per key; files of camera positions.

CSV: the first row names the columns eye_x, eye_y, eye_z, target_x, target_y, target_z and, optionally, up_x, up_y,
up_z and the keys of the lens, in any order; one row per frame follows. JSON: a list with one `{"eye": [...], "target":
[...]}` per frame, optionally with `"up"` and the lens. `transforms.json` of nerfstudio, instant-ngp, Blender-NeRF and
NeRF's own scenes: poses, and lenses in pixels; keys of a frame override keys of the file, and a focal length overrides
an angle.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.arrays import is_number
from framearray_cli.base.forms.table import Float3, Place, Problems, Table, fail, fill, optional, refuse
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE, Lens, fov_of_focal, shift_of_centre

from .keys import MOST_EYES, KeyFrame, key_problems, keys_or_file
from .rowfile import AXES, RowFileError, csv_rows, load_json, read_text, refuse_frames, row_problems, tables_of
from .values import Direction, FileName, LensShift, Point, Size

PANORAMA_SIZE = (400, 200)
CameraType: TypeAlias = Literal["perspective", "orthographic", "panorama"]
LEAST_FOV, MOST_FOV = 1e-3, 179.9
LEAST_HEIGHT, MOST_HEIGHT = 1e-9, 1e15
LENS_KEYS = ("fov", "height", "shift", "pixel_aspect")
# The keys that cameras of each type have.
KEYS_OF_TYPE: Mapping[str, Sequence[str]] = {
    PERSPECTIVE: ("fov", "shift", "pixel_aspect"),
    ORTHOGRAPHIC: ("height", "shift", "pixel_aspect"),
    PANORAMA: (),
}
COLUMNS = {key: tuple(f"{key}_{axis}" for axis in AXES) for key in ("eye", "target", "up")}
COLUMNS |= {"shift": ("shift_x", "shift_y")}
SINGLE_COLUMNS = ("fov", "height", "pixel_aspect")
# A matrix counts as a pose if its columns are orthogonal and equally long to within this; files have few digits.
RIGID = 1e-3
# Shares of a picture below which the middle of a lens is the middle of the picture, and pixels are square.
ROUNDING = 1e-12
TRANSFORMS_FILE = "transforms.json"
FRAMES = "frames"
_PERSPECTIVES = ("PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
_MODELS = dict.fromkeys(_PERSPECTIVES, PERSPECTIVE) | {"EQUIRECTANGULAR": PANORAMA, "ORTHOPHOTO": ORTHOGRAPHIC}
_DISTORTION = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
_REMEDY = "undistort the pictures first, or set it to 0"
FieldOfView: TypeAlias = Annotated[float, Field(ge=LEAST_FOV, le=MOST_FOV)]
Height: TypeAlias = Annotated[float, Field(ge=LEAST_HEIGHT, le=MOST_HEIGHT)]
PixelAspect: TypeAlias = Annotated[float, Field(ge=0.01, le=100.0)]


class CameraKey(KeyFrame):
    """Camera position at one frame, optionally with its lens.

    Attributes:
        frame: Number of the camera position, counted from 0.
        eye: Position of the camera, in the coordinates of the scene file.
        target: Point in the middle of the picture, in the coordinates of the scene file.
        up: Upward direction in the picture. Given at every key or at none.
        fov: Vertical field of view, degrees. Given at every key or at none.
        height: Height of what an orthographic camera sees, scene units. Given at every key or at none.
        shift: Lens shift, as in `[camera]`. Given at every key or at none.
        pixel_aspect: Width of a pixel over its height. Given at every key or at none.
    """

    eye: Point
    target: Point
    up: Direction | None = optional("the scene's up axis")
    fov: FieldOfView | None = optional("the value of `[camera]`")
    height: Height | None = optional("the value of `[camera]`")
    shift: LensShift | None = optional("the value of `[camera]`")
    pixel_aspect: PixelAspect | None = optional("the value of `[camera]`")

    @field_validator("target")
    @classmethod
    def _differs_from_eye(cls, target: Float3, info: ValidationInfo) -> Float3:
        if target == info.data.get("eye"):
            fail([((), f"expected a point other than `eye`, got {shown(target)}, the same")])
        return target


class CameraTable(Table):
    """The path of the camera: one camera position per frame.

    Attributes:
        type: "orthographic": parallel rays, sizes do not depend on the distance. "panorama": 360 x 180 degrees,
            equirectangular; its middle looks at the target.
        resolution: Width and height of every image, pixels. A panorama is twice as wide as high.
        fov: Vertical field of view of a perspective, degrees.
        height: Height of what an orthographic camera sees, scene units; the width follows from the resolution.
        shift: Lens shift of the picture to the right and up, as a share of its longer side, as in Blender. [0, 0.2]
            shows more of a tower's top, and its edges stay vertical.
        pixel_aspect: Width of a pixel over its height.
        frames: Number of camera positions, N_c.
        file: File of camera positions, instead of `keys`: CSV, JSON or `transforms.json`.
        keys: Camera positions at some frames. The camera moves smoothly between keys, and rests before the first and
            after the last. One key: a fixed camera.
    """

    type: CameraType = "perspective"
    resolution: Size = optional("`[400, 300]`; `[400, 200]` of a panorama; or as in `file`", (400, 300))
    fov: FieldOfView = 60.0
    height: Height | None = optional("none")
    shift: LensShift | None = optional("`[0.0, 0.0]`")
    pixel_aspect: PixelAspect | None = optional("`1.0`")
    frames: int = optional("the last key's frame + 1, or the rows of `file`", 0, ge=1, le=MOST_EYES)
    file: FileName | None = optional("none")
    keys: tuple[CameraKey, ...] = optional(
        "the rows of `file`", (), {"minItems": 1}, strict=False, validate_default=True
    )

    @field_validator("keys")
    @classmethod
    def _consistent(cls, keys: tuple[CameraKey, ...], info: ValidationInfo) -> tuple[CameraKey, ...]:
        keys_or_file(keys, info)
        refuse(key_problems(keys, info.data.get("frames", 0), "up", "up", *LENS_KEYS))
        return keys

    def problems(self) -> Problems:
        """Check the lens, and the shape of a panorama."""
        yield from self._lens_problems(KEYS_OF_TYPE[self.type])
        width, height = self.resolution
        if self.type == PANORAMA and width != 2 * height and "resolution" in self.model_fields_set:
            wanted = f"twice as wide as high, [{2 * height}, {height}] or [{width}, {width // 2}]"
            yield ("resolution",), f"expected a panorama {wanted}, got [{width}, {height}]"

    @model_validator(mode="after")
    def _fill_in(self) -> "CameraTable":
        if self.type == PANORAMA and "resolution" not in self.model_fields_set:
            fill(self, "resolution", PANORAMA_SIZE)
        if "frames" not in self.model_fields_set and self.keys:
            fill(self, "frames", self.keys[-1].frame + 1)
        return self

    def _lens_problems(self, allowed: Sequence[str]) -> Problems:
        """Check that the table, or each of its keys, has the lens of its type."""
        given_at: list[Place] = []
        for name in LENS_KEYS:
            at = next((i for i, key in enumerate(self.keys) if getattr(key, name) is not None), None)
            given = name in self.model_fields_set and getattr(self, name) is not None
            places: list[Place] = [(name,)] if given else []
            places += [("keys", at, name)] if at is not None else []
            given_at += places
            if name not in allowed:
                owners = " and ".join(f'"{each}"' for each, names in KEYS_OF_TYPE.items() if name in names)
                text = f'expected none with type = "{self.type}"; it belongs to {owners}'
                yield from ((place, text) for place in places)
            elif len(places) > 1:
                yield (name,), f"expected either camera.{name} or {name} of every key, got both"
        if self.type == ORTHOGRAPHIC and not any(place[-1] == "height" for place in given_at) and self.keys:
            yield ("height",), "missing; give the height of what an orthographic camera sees, scene units"


@dataclass(frozen=True, slots=True, kw_only=True)
class EyeRows:
    """Camera positions of a file.

    Attributes:
        keys: tables of `CameraKey` without `frame`, for frames 0, 1, 2 and so on.
        places: the row of each key in the file, for messages; empty if a row has no name of its own.
        camera: keys of `[camera]` that the file gives, for all frames.
        resolution: width and height that its lenses are given for, pixels; None if the file has none.
        off_centre: True if lenses depend on the shape of the picture.
    """

    keys: list[dict[str, Any]]
    places: Sequence[str] = ()
    camera: dict[str, Any] = field(default_factory=dict)
    resolution: tuple[int, int] | None = None
    off_centre: bool = False


def read_eyes(path: Path, resolution: tuple[int, int] | None = None) -> EyeRows:
    """Read a file of camera positions as tables of keys for frames 0, 1, 2 and so on.

    Args:
        resolution: that the job gives, for files that have angles only.

    Raises:
        RowFileError: the file is missing, has another format, or has rows that are no camera positions.
    """
    found = _read(path, resolution)
    n = len(found.keys)
    if not 1 <= n <= MOST_EYES:
        raise RowFileError(f"expected 1 to {MOST_EYES} camera positions, got {n}")
    places = found.places or [f"camera {c}" for c in range(n)]
    rows = list(zip(places, found.keys, strict=True))
    if problems := row_problems(rows, CameraKey, ("up", *LENS_KEYS), {}):
        raise RowFileError(*problems)
    return found


def _read(path: Path, resolution: tuple[int, int] | None) -> EyeRows:
    """Read a file by its suffix."""
    if path.is_dir():
        remedy = f'; give the "{TRANSFORMS_FILE}" in it' if (path / TRANSFORMS_FILE).is_file() else ""
        raise RowFileError(f"expected a file, got a folder{remedy}")
    match path.suffix.lower():
        case ".csv":
            rows = csv_rows(read_text(path), COLUMNS, SINGLE_COLUMNS, (("eye",), ("target",)))
        case ".json":
            table = load_json(read_text(path))
            if isinstance(table, Mapping) and FRAMES in table:
                return read_transforms(table, resolution)
            tables = tables_of(table, 'expected a list of {"eye": [...], "target": [...]}, got something else')
            refuse_frames(tables)
            rows = [(f"entry {number}", row) for number, row in enumerate(tables, start=1)]
        case suffix:
            raise RowFileError(f'expected a file name that ends in .csv or .json, got "{suffix}"')
    return EyeRows(keys=[row for _, row in rows], places=[place for place, _ in rows])


def pose_key(place: str, matrix: object) -> dict[str, Any]:
    """Return eye, target and up of a pose: 4 x 4, or its upper 3 x 4, world from camera; the camera looks along -z.

    Raises:
        RowFileError: it is no matrix, or scales unevenly, shears or mirrors.
    """
    try:
        rows = np.array(matrix, np.float64)
    except (ValueError, TypeError):
        rows = np.empty(0)
    if rows.shape not in ((4, 4), (3, 4)) or not np.isfinite(rows).all():
        raise RowFileError(f"{place}: expected a matrix of 4 rows of 4 numbers, got {shown(matrix)}")
    axes, eye = rows[:3, :3], rows[:3, 3]
    largest = float(np.abs(axes).max())
    whole = axes / largest if largest > 0 else axes  # so that no square leaves the range of floats
    scale = float(np.linalg.norm(whole, axis=0).mean())
    turn = whole / scale if scale > 0 else whole
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID or np.linalg.det(turn) < 0:
        raise RowFileError(f"{place}: expected a rotation and a translation, got a matrix that shears or mirrors")
    away = max(1.0, float(np.abs(eye).max()))  # so far that a target keeps the digits of the direction
    return {"eye": eye.tolist(), "target": (eye - away * turn[:, 2]).tolist(), "up": turn[:, 1].tolist()}


def _eye_rows(
    poses: Sequence[dict[str, Any]],
    lenses: Sequence[dict[str, Any]],
    *,
    kind: str,
    resolution: tuple[int, int] | None,
) -> EyeRows:
    """Join poses and lenses; keys that all lenses have in common become keys of the camera."""
    camera: dict[str, Any] = {"type": kind, **({"resolution": list(resolution)} if resolution else {})}
    own: list[dict[str, Any]] = [{} for _ in poses]
    neutral = {"shift": list(Lens().shift), "pixel_aspect": Lens().pixel_aspect}
    off_centre = False
    for name in KEYS_OF_TYPE[kind]:
        values = [lens.get(name, neutral.get(name)) for lens in lenses]
        off_centre |= name == "shift" and any(value != neutral["shift"] for value in values)
        if all(value == values[0] for value in values):
            if values[0] != neutral.get(name):
                camera[name] = values[0]
        else:
            for key, value in zip(own, values, strict=True):
                key[name] = value
    keys = [{**pose, **lens} for pose, lens in zip(poses, own, strict=True)]
    return EyeRows(keys=keys, camera=camera, resolution=resolution, off_centre=off_centre)


def read_transforms(table: Mapping[str, Any], wanted: tuple[int, int] | None) -> EyeRows:
    """Read the frames of a `transforms.json`; of frames with the same number `camera`, as in our exports, the first.

    Args:
        wanted: resolution that the job gives, for a file with angles only.

    Raises:
        RowFileError: the file has no poses, or cameras that a job has not.
    """
    frames = tables_of(table[FRAMES], f'expected a list of tables in "{FRAMES}", got {shown(table[FRAMES])}')
    poses, lenses, kinds, sizes, seen = [], [], set(), set(), set()
    for number, frame in enumerate(frames):
        place, camera = f"{FRAMES}[{number}]", frame.get("camera")
        if isinstance(camera, int) and "transform_matrix" in frame:
            if camera in seen:
                continue
            seen.add(camera)
        if "transform_matrix" not in frame:
            raise RowFileError(f"{place}: transform_matrix: missing")
        poses.append(pose_key(f"{place}: transform_matrix", frame["transform_matrix"]))
        merged = {**table, **frame}
        kind, size = _kind(place, merged), _size(place, merged)
        kinds.add(kind)
        sizes.add(size)
        if len(kinds) > 1 or len(sizes) > 1:
            each = kinds if len(kinds) > 1 else [f"{size[0]} x {size[1]}" if size else "none" for size in sizes]
            raise RowFileError(f"{place}: expected cameras of one model and size, got {' and '.join(sorted(each))}")
        lenses.append(_lens(place, merged, kind, size or wanted))
    if not poses:
        return EyeRows(keys=[])
    return _eye_rows(poses, lenses, kind=kinds.pop(), resolution=sizes.pop())


def _kind(place: str, table: Mapping[str, Any]) -> str:
    """Return the type of a camera, which has no distortion."""
    model = table.get("camera_model", "PERSPECTIVE")
    if table.get("is_fisheye") is True:
        model = "OPENCV_FISHEYE"
    kind = _MODELS.get(model) if isinstance(model, str) else None
    if kind is None:
        names, remedy = ", ".join(_MODELS), "; undistort the pictures first" if "FISHEYE" in str(model) else ""
        raise RowFileError(f"{place}: camera_model: expected one of {names}, got {shown(model)}{remedy}")
    for name in _DISTORTION if kind == PERSPECTIVE else ():
        if table.get(name) not in (None, 0):
            raise RowFileError(f"{place}: {name}: expected no lens distortion, got {shown(table[name])}; {_REMEDY}")
    return kind


def _number(place: str, table: Mapping[str, Any], name: str, *, positive: bool = True) -> float | None:
    value = table.get(name)
    if value is None:
        return None
    if not is_number(value) or (positive and value <= 0):
        raise RowFileError(f"{place}: {name}: expected a {'positive ' * positive}number, got {shown(value)}")
    return float(value)


def _size(place: str, table: Mapping[str, Any]) -> tuple[int, int] | None:
    """Return width and height in pixels, if the file has both."""
    width, height = (_number(place, table, name) for name in ("w", "h"))
    if width is None or height is None:
        return None
    if width != int(width) or height != int(height):
        raise RowFileError(f"{place}: w, h: expected whole numbers, got {width:g} and {height:g}")
    return int(width), int(height)


def _lens(place: str, table: Mapping[str, Any], kind: str, size: tuple[int, int] | None) -> dict[str, Any]:
    """Return the lens keys of one frame."""
    if kind == PANORAMA:
        return {}
    if size is None:
        raise RowFileError(
            f"{place}: w, h: missing; give the size of the pictures that the lens belongs to as camera.resolution"
        )
    width, height = size
    across, down = (_focal(place, table, axis, side) for axis, side in (("x", width), ("y", height)))
    if across is None and down is None:
        raise RowFileError(f"{place}: fl_x: missing; expected fl_x or camera_angle_x, a focal length or an angle")
    centre = (_number(place, table, name, positive=False) for name in ("cx", "cy"))
    x, y = (side / 2 if value is None else value for value, side in zip(centre, size, strict=True))
    focal = across or down or 1.0, down or across or 1.0  # of an orthographic camera, pixels per scene unit
    aspect, shift = focal[1] / focal[0], shift_of_centre((x, y), size)
    view = {"height": height / focal[1]} if kind == ORTHOGRAPHIC else {"fov": fov_of_focal(focal[1], height)}
    shift = (0.0, 0.0) if max(abs(share) for share in shift) < ROUNDING else shift
    return {**view, "shift": list(shift), "pixel_aspect": 1.0 if abs(aspect - 1) < ROUNDING else aspect}


def _focal(place: str, table: Mapping[str, Any], axis: str, side: int) -> float | None:
    """Return the focal length along one axis, pixels, if the file has one."""
    if (focal := _number(place, table, f"fl_{axis}")) is not None:
        return focal
    angle = _number(place, table, f"camera_angle_{axis}")
    if angle is not None and angle >= math.pi:
        raise RowFileError(f"{place}: camera_angle_{axis}: expected radians below pi, got {angle:g}")
    return None if angle is None else 0.5 * side / math.tan(angle / 2)
