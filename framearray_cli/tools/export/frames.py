"""Camera and light of an exported picture as JSON tables, which several formats share."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.files import write_bytes

from .selection import ExportedFrame, axis_keys, focal_length, plain_floats, rigid_pose, sources_at


def lens(manifest: Manifest, focal: float) -> dict[str, float]:
    """Return the focal length in pixels, and the horizontal angle that some readers take instead."""
    return {"fl_x": focal, "fl_y": focal, "camera_angle_x": 2 * math.atan(0.5 * manifest.resolution[0] / focal)}


def image_size(manifest: Manifest) -> dict[str, Any]:
    """Return the size of the pictures, and where the optical axis meets them, pixels."""
    width, height = manifest.resolution
    return {"w": width, "h": height, "cx": width / 2, "cy": height / 2}


def camera_table(manifest: Manifest, c: int) -> dict[str, Any]:
    """Return everything about a camera: the size of its pictures, its lens and its pose."""
    return {**image_size(manifest), **lens(manifest, focal_length(manifest, c)), "transform_matrix": pose(manifest, c)}


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
