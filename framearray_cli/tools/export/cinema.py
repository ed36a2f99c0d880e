"""A Cinema database, specification D ("Dietrich"): a folder NAME.cdb with `data.csv`, one row per picture.

The first row names the columns. Columns of file names come last, and their names begin with FILE. A cell may be empty;
the other cells of a column have one type.
"""

import csv
import io
from typing import Any

from framearray_cli.base.files import write_bytes
from framearray_cli.base.lens import ORTHOGRAPHIC, PERSPECTIVE, Lens

from .format import Export, ExportedFrame, Format, Selection, index_table, rigid_pose, sources_at

TABLE_FILE = "data.csv"
STRENGTHS = ("intensity", "irradiance", "radiance")
NUMBERS = ("radius", "angle", "inner", "outer", "width", "height", "rotation")


def write_table(export: Export) -> None:
    """Write `data.csv`; see `Format.write`."""
    frames = export.selection.frames
    rows = [_row(export.selection, frame) | {"FILE": export.files[frame.name]} for frame in frames]
    columns = [column for column in dict.fromkeys(name for row in rows for name in row) if column != "FILE"]
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, [*columns, "FILE"], restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_bytes(export.folder / TABLE_FILE, buffer.getvalue().encode())


def _row(selection: Selection, frame: ExportedFrame) -> dict[str, Any]:
    """Return the parameters of one picture: indices are integers, all other numbers floats."""
    manifest = selection.manifest
    pose = rigid_pose(manifest, frame.c)
    row: dict[str, Any] = {**index_table(manifest, frame)}
    row |= _vector("eye", pose[:3, 3]) | _vector("view", -pose[:3, 2]) | _lens(manifest.cameras[frame.c].lens)
    row |= {"set": frame.part} if frame.part else {}
    sources = sources_at(manifest, frame.lights)
    for k, source in enumerate(sources):
        name = "source" if len(sources) == 1 else f"source{k}"
        row[f"{name}_type"] = source["type"]
        row |= {f"{name}_{key}": str(source[key]) for key in ("group", "material", "file", "ies") if key in source}
        for key in ("position", "direction", "across", "up", *STRENGTHS):
            if key in source:
                row |= _vector(f"{name}_{key}", source[key], "rgb" if key in STRENGTHS else "xyz")
        row |= {f"{name}_{key}": float(source[key]) for key in NUMBERS if key in source}
        row |= {f"{name}_time": str(source["time"])} if "time" in source else {}
    return row


def _lens(lens: Lens) -> dict[str, Any]:
    """Return the columns of a plain perspective, and those that differ for other lenses."""
    row: dict[str, Any] = {"fov": float(lens.fov)} if lens.type == PERSPECTIVE else {"projection": lens.type}
    row |= {"height": float(lens.height)} if lens.type == ORTHOGRAPHIC else {}
    row |= _vector("shift", lens.shift, "xy") if lens.shift != (0.0, 0.0) else {}
    return row | ({"pixel_aspect": float(lens.pixel_aspect)} if lens.pixel_aspect != 1.0 else {})


def _vector(name: str, values: Any, letters: str = "xyz") -> dict[str, float]:
    return {f"{name}_{letter}": float(value) for letter, value in zip(letters, values, strict=True)}


CINEMA = Format(mark=TABLE_FILE, write=write_table, suffix=".cdb")
