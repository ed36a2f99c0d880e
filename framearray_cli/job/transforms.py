"""`transforms.json` of nerfstudio, instant-ngp, Blender-NeRF and NeRF's own scenes -> camera keys.

Keys of a frame stand before those of the file. A focal length counts more than an angle.
"""

import math
from collections.abc import Mapping
from typing import Any

from framearray_cli.base.arrays import is_number
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE

from .poses import EyeRows, eye_rows, lens_of, pose_key
from .rowfile import RowFileError

FRAMES = "frames"
_MODELS = {
    "PERSPECTIVE": PERSPECTIVE,
    "PINHOLE": PERSPECTIVE,
    "SIMPLE_PINHOLE": PERSPECTIVE,
    "SIMPLE_RADIAL": PERSPECTIVE,
    "RADIAL": PERSPECTIVE,
    "OPENCV": PERSPECTIVE,
    "FULL_OPENCV": PERSPECTIVE,
    "EQUIRECTANGULAR": PANORAMA,
    "ORTHOPHOTO": ORTHOGRAPHIC,
}
_DISTORTION = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
_REMEDY = "undistort the pictures first, or set it to 0"


def read_transforms(table: Mapping[str, Any], wanted: tuple[int, int] | None) -> EyeRows:
    """Read the frames of a `transforms.json`; of frames with the same number `camera`, as in our exports, the first.

    Args:
        wanted: resolution that the job gives, for a file that says angles only.

    Raises:
        RowFileError: the file has no poses, or cameras that a job has not.
    """
    frames = table[FRAMES]
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise RowFileError(f'expected a list of tables in "{FRAMES}", got {shown(frames)}')
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
        kinds.add(_kind(place, merged))
        size = _size(place, merged)
        sizes.add(size)
        if len(kinds) > 1 or len(sizes) > 1:
            raise RowFileError(f"{place}: expected cameras of one model and size, got {_several(kinds, sizes)}")
        lenses.append(_lens(place, merged, next(iter(kinds)), size or wanted))
    if not poses:
        return EyeRows(keys=[])
    return eye_rows(poses, lenses, kind=kinds.pop(), resolution=sizes.pop())


def _several(kinds: set[str], sizes: set[Any]) -> str:
    texts = [f"{size[0]} x {size[1]}" if size else "none" for size in sorted(sizes, key=str)]
    return " and ".join(sorted(kinds) if len(kinds) > 1 else texts)


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
    """Return width and height in pixels, if the file says both."""
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
    return lens_of(kind, size, (across or down or 1.0, down or across or 1.0), (x, y))


def _focal(place: str, table: Mapping[str, Any], axis: str, side: int) -> float | None:
    """Return the focal length along one axis, pixels, if the file says any."""
    if (focal := _number(place, table, f"fl_{axis}")) is not None:
        return focal
    angle = _number(place, table, f"camera_angle_{axis}")
    if angle is not None and angle >= math.pi:
        raise RowFileError(f"{place}: camera_angle_{axis}: expected radians below pi, got {angle:g}")
    return None if angle is None else 0.5 * side / math.tan(angle / 2)
