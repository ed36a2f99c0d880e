"""`transforms.json` as nerfstudio's parser of that name reads it, with depth files and a cloud of points."""

import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.files import write_bytes

from ..places import plain_names
from .points import Cloud, read_depth
from .selection import ExportedFrame, Selection, focal_length, numbers, rigid_pose, sources_at

FILE = MARK = "transforms.json"
POINTS = "points.ply"
# nerfstudio multiplies depths by its `depth_unit_scale_factor`, 0.001 unless it is told otherwise.
DEPTH_UNITS = 1000.0


def write_transforms(
    folder: Path, selection: Selection, files: Mapping[str, str], *, cloud: Cloud | None, exposure: float
) -> None:
    """Write `transforms.json`, the depth of each camera and the points.

    Args:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.
        cloud: None where the array has no layers; then there is no depth either.
        exposure: stops that the pictures were brightened by.

    Raises:
        OutputError: a camera is no rigid motion, layers are missing or damaged, or a file cannot be written.
    """
    manifest = selection.manifest
    width, height = manifest.resolution
    focals = {c: focal_length(manifest, c) for c in selection.cameras}
    one = len(set(focals.values())) == 1
    head: dict[str, Any] = {"camera_model": "OPENCV", "w": width, "h": height, "cx": width / 2, "cy": height / 2}
    if one:
        head |= _lens(manifest, focals[selection.cameras[0]])
    head |= dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    if exposure:
        head["exposure"] = exposure
    depths = {}
    if cloud is not None:
        depths = {c: f"depths/{selection.camera_name(c)}.npy" for c in selection.cameras}
        for c, name in depths.items():
            _write_depth(folder / name, manifest, c)
        if len(cloud.position):
            head["ply_file_path"] = POINTS
            write_bytes(folder / POINTS, _ply(cloud))
    frames = []
    for frame in selection.frames:
        table: dict[str, Any] = {"file_path": files[frame.name]}
        if frame.c in depths:
            table["depth_file_path"] = depths[frame.c]
        if not one:
            table |= _lens(manifest, focals[frame.c])
        frames.append(table | _frame(manifest, frame))
    text = json.dumps(head | {"frames": frames}, indent=2)
    write_bytes(folder / FILE, f"{text}\n".encode())


def _lens(manifest: Manifest, focal: float) -> dict[str, float]:
    """Focal length in pixels, and the horizontal angle that some readers take instead."""
    return {"fl_x": focal, "fl_y": focal, "camera_angle_x": 2 * math.atan(0.5 * manifest.resolution[0] / focal)}


def _frame(manifest: Manifest, frame: ExportedFrame) -> dict[str, Any]:
    """Pose and light. `pl_pos`, `pl_intensity` are there where exactly one source shines, and that is a point."""
    table: dict[str, Any] = {
        "transform_matrix": [numbers(row) for row in rigid_pose(manifest, frame.c)],
        "camera": frame.c,
    }
    table |= dict(zip(plain_names(manifest.axes).values(), frame.place, strict=True))
    sources = sources_at(manifest, frame.place)
    if len(sources) == 1 and sources[0]["type"] == "point":
        table["pl_pos"] = numbers(sources[0]["position"])
        table["pl_intensity"] = numbers(sources[0]["intensity"])
    return table


def _write_depth(file: Path, manifest: Manifest, c: int) -> None:
    """A .npy rather than a 16-bit PNG, which holds whole thousandths up to 65.535 alone; 0 where nothing is."""
    buffer = io.BytesIO()
    np.save(buffer, (read_depth(manifest, c) * np.float32(DEPTH_UNITS)).astype(np.float32))
    write_bytes(file, buffer.getbuffer())


def _ply(cloud: Cloud) -> bytes:
    """Points with colours as a binary PLY; doubles, for a scene far from its origin."""
    kind = [(name, "<f8") for name in "xyz"] + [(name, "u1") for name in ("red", "green", "blue")]
    rows = np.empty(len(cloud.position), kind)
    for k, name in enumerate("xyz"):
        rows[name] = cloud.position[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        rows[name] = cloud.codes[:, k]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property double {name}" for name in "xyz"]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes()
