"""`transforms.json` as nerfstudio reads it, with depth files and a point cloud."""

import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.files import write_bytes

from .points import PointCloud, read_depth
from .selection import ExportedFrame, Selection, axis_keys, focal_length, plain_floats, rigid_pose, sources_at

TRANSFORMS_FILE = "transforms.json"
POINTS_FILE = "points.ply"
# nerfstudio multiplies depths by its `depth_unit_scale_factor`, 0.001 by default.
DEPTH_UNITS = 1000.0


def write_transforms(
    folder: Path, selection: Selection, files: Mapping[str, str], *, cloud: PointCloud | None, exposure: float
) -> None:
    """Write `transforms.json`, a depth file per camera, and the point cloud.

    Args:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.
        cloud: None if the array has no layers; no depth files are written then.
        exposure: of the pictures, in stops.

    Raises:
        OutputError: the pose of a camera is no rigid motion, layers are missing or damaged, or the system refuses
            to write.
    """
    manifest = selection.manifest
    width, height = manifest.resolution
    focals = {c: focal_length(manifest, c) for c in selection.cameras}
    same_lens = len(set(focals.values())) == 1
    head: dict[str, Any] = {"camera_model": "OPENCV", "w": width, "h": height, "cx": width / 2, "cy": height / 2}
    if same_lens:
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
            head["ply_file_path"] = POINTS_FILE
            write_bytes(folder / POINTS_FILE, _ply(cloud))
    frames = []
    for frame in selection.frames:
        table: dict[str, Any] = {"file_path": files[frame.name]}
        if frame.c in depths:
            table["depth_file_path"] = depths[frame.c]
        if not same_lens:
            table |= _lens(manifest, focals[frame.c])
        frames.append(table | _frame(manifest, frame))
    text = json.dumps(head | {"frames": frames}, indent=2)
    write_bytes(folder / TRANSFORMS_FILE, f"{text}\n".encode())


def _lens(manifest: Manifest, focal: float) -> dict[str, float]:
    """Return the focal length in pixels, and the horizontal angle that some readers take instead."""
    return {"fl_x": focal, "fl_y": focal, "camera_angle_x": 2 * math.atan(0.5 * manifest.resolution[0] / focal)}


def _frame(manifest: Manifest, frame: ExportedFrame) -> dict[str, Any]:
    """Return pose and light: all sources, and `pl_pos` and `pl_intensity` where the only one is a point."""
    table: dict[str, Any] = {
        "transform_matrix": [plain_floats(row) for row in rigid_pose(manifest, frame.c)],
        "camera": frame.c,
    }
    table |= dict(zip(axis_keys(manifest.axes).values(), frame.lights, strict=True))
    sources = sources_at(manifest, frame.lights)
    if len(sources) == 1 and sources[0]["type"] == "point":
        table["pl_pos"] = plain_floats(sources[0]["position"])
        table["pl_intensity"] = plain_floats(sources[0]["intensity"])
    return table | {"sources": [_source(source) for source in sources]}


def _source(source: Mapping[str, Any]) -> dict[str, Any]:
    """Return a source as the manifest describes it, in values of JSON."""

    def value_of(value: Any) -> Any:
        if isinstance(value, bool | str):
            return value
        return plain_floats(value) if isinstance(value, list | tuple) else float(value)

    return {key: value_of(value) for key, value in source.items()}


def _write_depth(file: Path, manifest: Manifest, c: int) -> None:
    """Write the depth as .npy, as a 16-bit PNG ends at 65.535 in steps of 0.001; 0 where nothing is."""
    buffer = io.BytesIO()
    np.save(buffer, (read_depth(manifest, c) * np.float32(DEPTH_UNITS)).astype(np.float32))
    write_bytes(file, buffer.getbuffer())


def _ply(cloud: PointCloud) -> bytes:
    """Return points with colours as a binary PLY, in doubles, as a scene may lie far from its origin."""
    row_type = [(name, "<f8") for name in "xyz"] + [(name, "u1") for name in ("red", "green", "blue")]
    rows = np.empty(len(cloud.position), row_type)
    for k, name in enumerate("xyz"):
        rows[name] = cloud.position[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        rows[name] = cloud.codes[:, k]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property double {name}" for name in "xyz"]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes()
