"""A Cinema database, specification D ("Dietrich"): a folder NAME.cdb with `data.csv`, one row a picture.

The first row names the columns; those that name files come last and begin with FILE. A cell may be empty; all others
of a column are of one type.
"""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from framearray_cli.base.files import write_bytes

from ..places import plain_names
from .selection import ExportedFrame, Selection, rigid_pose, sources_at

FILE = MARK = "data.csv"
SUFFIX = ".cdb"


def write_table(folder: Path, selection: Selection, files: Mapping[str, str]) -> None:
    """Write `data.csv`.

    Args:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.

    Raises:
        OutputError: a camera is no rigid motion, or the file cannot be written.
    """
    rows = [_row(selection, frame) | {"FILE": files[frame.name]} for frame in selection.frames]
    columns = [column for column in dict.fromkeys(name for row in rows for name in row) if column != "FILE"]
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, [*columns, "FILE"], restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_bytes(folder / FILE, buffer.getvalue().encode())


def _row(selection: Selection, frame: ExportedFrame) -> dict[str, Any]:
    """Parameters of one picture; whole numbers are indices, all others floats."""
    manifest = selection.manifest
    pose = rigid_pose(manifest, frame.c)
    row: dict[str, Any] = {"camera": frame.c}
    names = plain_names(manifest.axes)
    row |= {names[axis]: l for axis, l in zip(manifest.axes, frame.place, strict=True)}
    row |= _vector("eye", pose[:3, 3]) | _vector("view", -pose[:3, 2]) | {"fov": float(manifest.cameras[frame.c].fov)}
    sources = sources_at(manifest, frame.place)
    for k, source in enumerate(sources):
        name = "source" if len(sources) == 1 else f"source{k}"
        row[f"{name}_type"] = source["type"]
        for key in ("position", "direction", "intensity", "irradiance"):
            if key in source:
                row |= _vector(f"{name}_{key}", source[key], "xyz" if key in ("position", "direction") else "rgb")
    return row


def _vector(name: str, values: Any, letters: str = "xyz") -> dict[str, float]:
    return {f"{name}_{letter}": float(value) for letter, value in zip(letters, values, strict=True)}
