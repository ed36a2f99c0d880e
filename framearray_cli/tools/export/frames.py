"""Camera and light of an exported picture as JSON tables, which several formats share."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.files import write_bytes
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE

from .selection import ExportedFrame, axis_keys, plain_floats, rigid_pose, sources_at

_MODELS = {PERSPECTIVE: "OPENCV", ORTHOGRAPHIC: "ORTHOPHOTO", PANORAMA: "EQUIRECTANGULAR"}


def camera_model(manifest: Manifest, c: int) -> str:
    """Return what nerfstudio calls the type of camera c."""
    return _MODELS[manifest.cameras[c].type]


def focal_lengths(manifest: Manifest, c: int) -> dict[str, float]:
    """Return the focal lengths in pixels, and the horizontal angle that some readers take instead.

    nerfstudio's focal lengths of a panorama are half its width and its height: they make -1 to 1 of image positions,
    and -1/2 to 1/2. Those of an orthographic camera are pixels per scene unit.
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
    model = camera_model(manifest, c)
    named = {"camera_model": model} if manifest.cameras[c].type != PERSPECTIVE else {}
    return {
        **named,
        **image_size(manifest, c),
        **focal_lengths(manifest, c),
        "transform_matrix": pose(manifest, c),
    }


def pose(manifest: Manifest, c: int) -> list[list[float]]:
    """Return `world_from_camera` by rows.

    Raises:
        OutputError: it is no rigid motion.
    """
    return [plain_floats(row) for row in rigid_pose(manifest, c)]


def frame_table(manifest: Manifest, frame: ExportedFrame) -> dict[str, Any]:
    """Return pose and light: all sources, and `pl_pos` and `pl_intensity` where the only one is a point."""
    table: dict[str, Any] = {"transform_matrix": pose(manifest, frame.c)} | index_table(manifest, frame)
    sources = sources_at(manifest, frame.lights)
    if len(sources) == 1 and sources[0]["type"] == "point":
        table["pl_pos"] = plain_floats(sources[0]["position"])
        table["pl_intensity"] = plain_floats(sources[0]["intensity"])
    return table | {"sources": source_tables(manifest, frame)}


def index_table(manifest: Manifest, frame: ExportedFrame) -> dict[str, int]:
    """Return the indices of a picture: of its camera, and of its light along each axis."""
    return {"camera": frame.c} | dict(zip(axis_keys(manifest.axes).values(), frame.lights, strict=True))


def source_tables(manifest: Manifest, frame: ExportedFrame) -> list[dict[str, Any]]:
    """Return the sources of a picture as the manifest describes them, in values of JSON."""
    return [_source(source) for source in sources_at(manifest, frame.lights)]


def _source(source: Mapping[str, Any]) -> dict[str, Any]:
    def value_of(value: Any) -> Any:
        if isinstance(value, bool | str):
            return value
        return plain_floats(value) if isinstance(value, list | tuple) else float(value)

    return {key: value_of(value) for key, value in source.items()}


def write_json(file: Path, table: Any) -> None:
    """Write a file of JSON, for readers of both kinds."""
    write_bytes(file, f"{json.dumps(table, indent=2)}\n".encode())
