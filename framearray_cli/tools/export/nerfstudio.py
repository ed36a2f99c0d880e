"""`transforms.json` as nerfstudio reads it, with depth files and a point cloud."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.files import write_bytes
from framearray_cli.base.lens import PERSPECTIVE

from .frames import camera_model, centre, focal_lengths, frame_table, image_size, write_json
from .points import PointCloud, read_depth
from .selection import Selection, frames_by_set

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
    first = selection.cameras[0]
    lenses = {c: manifest.cameras[c].lens for c in selection.cameras}
    same_lens = all(lens == lenses[first] for lens in lenses.values())
    head: dict[str, Any] = {"camera_model": camera_model(manifest, first)} | image_size(manifest, first)
    if same_lens:
        head |= focal_lengths(manifest, first)
    if lenses[first].type == PERSPECTIVE:
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
            write_bytes(folder / POINTS_FILE, ply(cloud))
    frames = []
    for frame in selection.frames:
        table: dict[str, Any] = {"file_path": files[frame.name]}
        if frame.c in depths:
            table["depth_file_path"] = depths[frame.c]
        if not same_lens:
            table |= focal_lengths(manifest, frame.c)
            table |= centre(manifest, frame.c) if lenses[frame.c].shift != lenses[first].shift else {}
        frames.append(table | frame_table(manifest, frame))
    write_json(folder / TRANSFORMS_FILE, head | _sets(selection, files) | {"frames": frames})


def _sets(selection: Selection, files: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the lists of files by set; its parser wants all three as soon as there is one."""
    if selection.splits is None:
        return {}
    return {
        f"{name}_filenames": [files[frame.name] for frame in frames]
        for name, frames in frames_by_set(selection).items()
    }


def _write_depth(file: Path, manifest: Manifest, c: int) -> None:
    """Write the depth as .npy, as a 16-bit PNG ends at 65.535 in steps of 0.001; 0 where nothing is."""
    buffer = io.BytesIO()
    np.save(buffer, (read_depth(manifest, c) * np.float32(DEPTH_UNITS)).astype(np.float32))
    write_bytes(file, buffer.getvalue())


def ply(cloud: PointCloud, *, normals: bool = False) -> bytes:
    """Return points with colours as a binary PLY, in doubles, as a scene may lie far from its origin.

    Args:
        cloud: the points.
        normals: add normals of length 0, which Gaussian splatting expects and does not use.
    """
    numbers, codes = (*"xyz", *(("nx", "ny", "nz") if normals else ())), ("red", "green", "blue")
    rows = np.zeros(len(cloud.position), [(name, "<f8") for name in numbers] + [(name, "u1") for name in codes])
    for k, name in enumerate("xyz"):
        rows[name] = cloud.position[:, k]
    for k, name in enumerate(codes):
        rows[name] = cloud.codes[:, k]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property double {name}" for name in numbers]
    head += [f"property uchar {name}" for name in codes]
    return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes()
