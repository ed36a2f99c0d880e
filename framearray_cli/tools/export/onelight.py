"""One light at a time: reflectance imaging (RTI), and folders for photometric stereo (OLAT).

An `.lp` of RTI has the number of pictures, then a row per picture: its file, and the unit direction from the object to
the light, in the axes of the picture: x to the right, y up, z towards the camera. `lights.json` has the same lights in
the coordinates of the scene.

OLAT has a folder of pictures per camera. Rows of `light_pos.npy`, `light_dir.npy` and `light_intensity.npy` are lights,
in the coordinates of the scene. The folder of a camera has the lights in the axes of its pictures, too, in the files
that readers of photometric stereo expect [Shi16]: `filenames.txt`, `light_directions.txt`, `light_intensities.txt`,
`mask.png` and `Normal_gt.npy`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.images import read_layers, write_codes
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import OutputError

from .format import (
    IMAGES,
    Export,
    ExportedFrame,
    Format,
    Selection,
    camera_table,
    frame_table,
    group_hint,
    rigid_pose,
    sources_at,
    write_array,
    write_json,
    write_lines,
)

LIGHTS_FILE = "lights.json"
POSITIONS_FILE, DIRECTIONS_FILE = "light_pos.npy", "light_dir.npy"
STRENGTHS = ("intensity", "irradiance")


def _check_lights(selection: Selection, file: str) -> None:
    """Check that one source lights each picture; messages name the file that has one direction per picture."""
    manifest = selection.manifest
    for lights in selection.lights:
        found = sources_at(manifest, lights)
        if len(found) == 1 and not _vector_key(found[0]):
            raise OutputError(
                f"{manifest.directory}: expected a source with a position or a direction, as {file} has one direction "
                f"per picture, got type {found[0]['type']!r}"
            )
        if len(found) != 1:
            raise OutputError(
                f"{manifest.directory}: expected one source per picture, as {file} has one direction per picture, got "
                f"{len(found)} at light position {', '.join(map(str, lights))}{group_hint(manifest)}"
            )


def write_rti(export: Export) -> None:
    """Write an `.lp` per camera next to the pictures, and `lights.json`; see `Format.write`."""
    selection, manifest = export.selection, export.selection.manifest
    sources = {lights: sources_at(manifest, lights)[0] for lights in selection.lights}  # the only one of each
    for c in selection.cameras:
        camera_from_world = rigid_pose(manifest, c)[:3, :3].T
        lines = []
        for frame in export.frames:
            if frame.c == c:
                direction = camera_from_world @ to_light(manifest, sources[frame.lights])
                lines.append(" ".join([frame.file.removeprefix(IMAGES), *(f"{value:.9f}" for value in direction)]))
        write_lines(export.folder / "images" / f"{selection.camera_name(c)}.lp", [str(len(lines)), *lines])
    table = [{(key := _vector_key(source)): list(map(float, source[key]))} for source in sources.values()]
    write_json(export.folder / LIGHTS_FILE, table)


def to_light(manifest: Manifest, source: Mapping[str, Any]) -> Float64:
    """Return the unit direction to a source, (3,), in the scene; to a point it begins at `middle`."""
    if "direction" in source:
        vector = -np.asarray(source["direction"], np.float64)
    else:
        vector = np.asarray(source["position"], np.float64) - middle(manifest)
    length = np.linalg.norm(vector)
    return np.asarray(vector / length) if length else np.array([0.0, 0.0, 1.0])


def middle(manifest: Manifest) -> Float64:
    """Return the middle of the lights, (3,).

    It is the target of a dome or the centre of positions from a file, as in the job; else the target of the first
    camera key.
    """
    sources = manifest.job.get("light", {}).get("sources") or [{}]
    own = sources[0].get("target" if sources[0].get("type") == "dome" else "center") if len(sources) == 1 else None
    keys = manifest.job.get("camera", {}).get("keys") or [{}]
    return np.asarray(own or keys[0].get("target") or (0.0, 0.0, 0.0), np.float64)


def _vector_key(source: Mapping[str, Any]) -> str:
    """Return the key of a source's position or direction; "" if it has neither."""
    return next((key for key in ("position", "direction") if key in source), "")


def write_olat(export: Export) -> None:
    """Write the arrays of lights, the files of each camera, and `transforms.json` or one file per set.

    See `Format.write`.
    """
    selection, folder, manifest = export.selection, export.folder, export.selection.manifest
    sources = [sources_at(manifest, lights)[0] for lights in selection.lights]  # the only one of each
    directions = np.array([to_light(manifest, source) for source in sources])
    strengths = [next(source[key] for key in STRENGTHS if key in source) for source in sources]
    nowhere = (np.nan,) * 3  # a directional light has no position
    write_array(folder / POSITIONS_FILE, np.array([source.get("position", nowhere) for source in sources], float))
    write_array(folder / DIRECTIONS_FILE, directions)
    write_array(folder / "light_intensity.npy", np.array(strengths, float))
    rows = {lights: k for k, lights in enumerate(selection.lights)}
    by_camera: dict[int, list[ExportedFrame]] = {c: [] for c in selection.cameras}
    by_set: dict[str, list[dict[str, Any]]] = {}
    for frame in export.frames:
        by_camera[frame.c].append(frame)
        table = {"file_path": frame.file, "light_index": rows[frame.lights]}
        by_set.setdefault(frame.part, []).append(table | camera_table(manifest, frame.c) | frame_table(manifest, frame))
    for name, tables in by_set.items():
        write_json(folder / f"transforms{f'_{name}' if name else ''}.json", export.head | {"frames": tables})
    irradiance = np.array([irradiance_at(middle(manifest), source) for source in sources])
    for c, frames in by_camera.items():
        place, own = folder / selection.camera_name(c), [rows[frame.lights] for frame in frames]
        write_lines(place / "filenames.txt", [Path(frame.file).name for frame in frames])
        towards = directions[own] @ rigid_pose(manifest, c)[:3, :3]
        for name, values in (("light_directions.txt", towards), ("light_intensities.txt", irradiance[own])):
            write_lines(place / name, (" ".join(f"{value:.9g}" for value in row) for row in values.tolist()))
        if manifest.layers:
            _write_truth(place, manifest, c)


def irradiance_at(point: Float64, source: Mapping[str, Any]) -> Float64:
    """Return the irradiance of a surface at a point that faces a source, W/m2, RGB; in the middle of its cone."""
    if "irradiance" in source:
        return np.asarray(source["irradiance"], np.float64)
    away = float(np.sum((np.asarray(source["position"], np.float64) - point) ** 2))
    return np.asarray(source["intensity"], np.float64) / (away or 1.0)


def _write_truth(folder: Path, manifest: Manifest, c: int) -> None:
    """Write the mask of surfaces, and normals in the axes of the picture, if the layers have them."""
    layers = read_layers(layers_path(manifest, c))
    if (depth := layers.get("depth.Z")) is not None:
        mask = np.where(depth > 0, 255, 0).astype(np.uint8)
        write_codes(folder / "mask.png", np.repeat(mask[..., None], 3, axis=-1))
    if all(f"normal.{axis}" in layers for axis in "XYZ"):
        normal = np.stack([layers[f"normal.{axis}"] for axis in "XYZ"], axis=-1)
        write_array(folder / "Normal_gt.npy", (normal @ rigid_pose(manifest, c)[:3, :3]).astype(np.float32))


RTI = Format(
    mark=LIGHTS_FILE, write=write_rti, splits=False, one_source=True,
    check=lambda selection: _check_lights(selection, "an .lp"),
)  # fmt: skip
OLAT = Format(
    mark=POSITIONS_FILE, write=write_olat, one_source=True,
    stem=lambda frame: frame.name.replace("_", "/", 1),  # a folder per camera
    check=lambda selection: _check_lights(selection, DIRECTIONS_FILE),
)  # fmt: skip
