"""Reflectance imaging: the pictures of each camera with an `.lp` file, which says where the light is in each of them.

An `.lp` has the number of pictures, then a row per picture: its file, and the unit direction from the object to the
light, in the axes of the picture: x to the right, y up, z towards the camera. `lights.json` has the same lights in the
coordinates of the scene.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import write_bytes

from .onegroup import group_hint
from .selection import Selection, plain_floats, rigid_pose, sources_at

LIGHTS_FILE = "lights.json"


def check_lights(selection: Selection, file: str) -> None:
    """Check that one source lights each picture.

    Args:
        file: that has one direction per picture, for messages.

    Raises:
        OutputError: several do, which the file cannot say, or none.
    """
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


def write_lights(folder: Path, selection: Selection, files: Mapping[str, str]) -> None:
    """Write an `.lp` per camera beside the pictures, and `lights.json`.

    Args:
        folder: of the export.
        files: name of a frame -> its file in `images/`.

    Raises:
        OutputError: the pose of a camera is no rigid motion, or a file cannot be written.
    """
    manifest = selection.manifest
    for c in selection.cameras:
        camera_from_world = rigid_pose(manifest, c)[:3, :3].T
        rows = [
            (files[frame.name], camera_from_world @ to_light(manifest, sources_at(manifest, frame.lights)))
            for frame in selection.frames
            if frame.c == c
        ]
        lines = [" ".join([name, *(f"{value:.9f}" for value in direction)]) for name, direction in rows]
        text = "\n".join([str(len(lines)), *lines, ""])
        write_bytes(folder / "images" / f"{selection.camera_name(c)}.lp", text.encode())
    table = [
        {key: plain_floats(source[key])}
        for lights in selection.lights
        for source in sources_at(manifest, lights)
        if (key := _vector_key(source))
    ]
    write_bytes(folder / LIGHTS_FILE, f"{json.dumps(table, indent=2)}\n".encode())


def to_light(manifest: Manifest, sources: list[dict[str, Any]]) -> Float64:
    """Return the unit direction to the one source of a picture, (3,), in the scene.

    That to a point begins in the middle of the lights, see `middle`.
    """
    (source,) = [source for source in sources if _vector_key(source)]
    if "direction" in source:
        vector = -np.asarray(source["direction"], np.float64)
    else:
        vector = np.asarray(source["position"], np.float64) - middle(manifest)
    length = np.linalg.norm(vector)
    return np.asarray(vector / length) if length else np.array([0.0, 0.0, 1.0])


def middle(manifest: Manifest) -> Float64:
    """Return the middle of the lights, (3,).

    That is the target of a dome or the centre of positions from a file, as the job has it; else the point that the
    first camera key looks at.
    """
    sources = manifest.job.get("light", {}).get("sources") or [{}]
    own = sources[0].get("target" if sources[0].get("type") == "dome" else "center") if len(sources) == 1 else None
    keys = manifest.job.get("camera", {}).get("keys") or [{}]
    return np.asarray(own or keys[0].get("target") or (0.0, 0.0, 0.0), np.float64)


def _vector_key(source: Mapping[str, Any]) -> str:
    """Return the key that says where a source is; "" if it has none."""
    return next((key for key in ("position", "direction") if key in source), "")
