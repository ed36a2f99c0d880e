"""The cameras of another frame array, from its `manifest.toml` -> camera keys."""

from typing import Any

from framearray_cli.base.forms.toml import toml_table
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import PERSPECTIVE

from .lens import KEYS_OF_TYPE
from .poses import EyeRows, eye_rows, pose_key
from .rowfile import RowFileError


def read_manifest_eyes(text: str) -> EyeRows:
    """Read the cameras of a manifest.

    Raises:
        RowFileError: it is no manifest of an array.
    """
    try:
        table = toml_table(text)
    except ValueError as error:
        raise RowFileError(f"not valid TOML: {error}") from error
    cameras, size = table.get("cameras"), table.get("resolution")
    if not isinstance(cameras, list) or not all(isinstance(camera, dict) for camera in cameras):
        raise RowFileError("expected [[cameras]], as in the manifest of a frame array, found none")
    kinds = {camera.get("type", PERSPECTIVE) for camera in cameras if isinstance(camera.get("type", ""), str)}
    if len(kinds) != 1 or not kinds <= set(KEYS_OF_TYPE):
        raise RowFileError(f"cameras: expected cameras of one type of {', '.join(KEYS_OF_TYPE)}")
    kind = kinds.pop()
    poses: list[dict[str, Any]] = []
    for c, camera in enumerate(cameras):
        place = f"cameras[{c}].world_from_camera"
        if "world_from_camera" not in camera:
            raise RowFileError(f"{place}: missing")
        poses.append(pose_key(place, camera["world_from_camera"]))
    if not (isinstance(size, list) and len(size) == 2 and all(isinstance(side, int) and side > 0 for side in size)):
        raise RowFileError(f"resolution: expected 2 whole numbers, got {shown(size)}")
    lenses = [{name: camera[name] for name in KEYS_OF_TYPE[kind] if name in camera} for camera in cameras]
    return eye_rows(poses, lenses, kind=kind, resolution=(size[0], size[1]))
