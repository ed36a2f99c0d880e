"""One light at a time: a folder of pictures per camera, and arrays of the lights.

Rows of `light_pos.npy`, `light_dir.npy` and `light_intensity.npy` are lights, in the coordinates of the scene. The
folder of a camera has the lights in the axes of its pictures, too, in the files that readers of photometric stereo
expect [Shi16]: `filenames.txt`, `light_directions.txt`, `light_intensities.txt`, `mask.png` and `Normal_gt.npy`.
"""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.images import read_layers, write_codes
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.base.arrays import Float64
from framearray_cli.base.files import write_bytes

from .frames import camera_table, frame_table, write_json
from .rti import middle, to_light
from .selection import ExportedFrame, Selection, rigid_pose, sources_at

POSITIONS_FILE, DIRECTIONS_FILE = "light_pos.npy", "light_dir.npy"
STRENGTHS = ("intensity", "irradiance")


def write_lights(folder: Path, selection: Selection, files: Mapping[str, str], *, exposure: float) -> None:
    """Write the arrays of lights, what belongs to each camera, and `transforms.json` or one file per set.

    Args:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.
        exposure: of the pictures, in stops.

    Raises:
        OutputError: the pose of a camera is no rigid motion, layers are damaged, or a file cannot be written.
    """
    manifest = selection.manifest
    sources = [_only_source(manifest, lights) for lights in selection.lights]
    directions = np.array([to_light(manifest, [source]) for source in sources])
    nowhere = (np.nan,) * 3  # a directional light has no position
    _write_array(folder / POSITIONS_FILE, np.array([source.get("position", nowhere) for source in sources], float))
    _write_array(folder / DIRECTIONS_FILE, directions)
    _write_array(folder / "light_intensity.npy", np.array([_strength(source) for source in sources], float))
    rows = {lights: k for k, lights in enumerate(selection.lights)}
    by_camera: dict[int, list[ExportedFrame]] = {c: [] for c in selection.cameras}
    by_set: dict[str, list[dict[str, Any]]] = {}
    for frame in selection.frames:
        by_camera[frame.c].append(frame)
        table = {"file_path": files[frame.name], "light_index": rows[frame.lights]}
        by_set.setdefault(frame.part, []).append(table | camera_table(manifest, frame.c) | frame_table(manifest, frame))
    for name, tables in by_set.items():
        head = {"exposure": exposure} if exposure else {}
        write_json(folder / f"transforms{f'_{name}' if name else ''}.json", head | {"frames": tables})
    irradiance = np.array([irradiance_at(middle(manifest), source) for source in sources])
    for c, frames in by_camera.items():
        own = [rows[frame.lights] for frame in frames]
        names = [Path(files[frame.name]).name for frame in frames]
        camera_from_world = rigid_pose(manifest, c)[:3, :3].T
        _write_camera(folder / selection.camera_name(c), names, directions[own] @ camera_from_world.T, irradiance[own])
        if manifest.layers:
            _write_truth(folder / selection.camera_name(c), manifest, c)


def irradiance_at(point: Float64, source: Mapping[str, Any]) -> Float64:
    """Return what a source gives a surface at a point that faces it, W/m2, RGB; in the middle of its cone."""
    if "irradiance" in source:
        return np.asarray(source["irradiance"], np.float64)
    away = float(np.sum((np.asarray(source["position"], np.float64) - point) ** 2))
    return np.asarray(source["intensity"], np.float64) / (away or 1.0)


def _only_source(manifest: Manifest, lights: tuple[int, ...]) -> dict[str, Any]:
    (source,) = sources_at(manifest, lights)  # checked before any picture is written
    return source


def _strength(source: Mapping[str, Any]) -> Sequence[float]:
    return next(source[key] for key in STRENGTHS if key in source)


def _write_camera(folder: Path, names: Sequence[str], directions: Float64, irradiance: Float64) -> None:
    """Write the lists of a camera; directions have x to the right, y up, z towards the camera."""
    write_bytes(folder / "filenames.txt", "".join(f"{name}\n" for name in names).encode())
    for name, rows in (("light_directions.txt", directions), ("light_intensities.txt", irradiance)):
        lines = (" ".join(f"{value:.9g}" for value in row) for row in rows.tolist())
        write_bytes(folder / name, "".join(f"{line}\n" for line in lines).encode())


def _write_truth(folder: Path, manifest: Manifest, c: int) -> None:
    """Write where surfaces are, and their normals in the axes of the picture, where the layers have them."""
    layers = read_layers(layers_path(manifest, c))
    if (depth := layers.get("depth.Z")) is not None:
        mask = np.where(depth > 0, 255, 0).astype(np.uint8)
        write_codes(folder / "mask.png", np.repeat(mask[..., None], 3, axis=-1))
    if all(f"normal.{axis}" in layers for axis in "XYZ"):
        normal = np.stack([layers[f"normal.{axis}"] for axis in "XYZ"], axis=-1)
        _write_array(folder / "Normal_gt.npy", (normal @ rigid_pose(manifest, c)[:3, :3]).astype(np.float32))


def _write_array(file: Path, values: Any) -> None:
    buffer = io.BytesIO()
    np.save(buffer, values)
    write_bytes(file, buffer.getvalue())
