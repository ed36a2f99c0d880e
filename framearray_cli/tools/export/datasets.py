"""Image folders of Hugging Face: a folder of pictures per set, each with `metadata.jsonl`.

The library `datasets` reads a row per picture, with a column per key.
"""

import json
from typing import Any

from framearray_cli.array.images import FOR_SCREENS

from .format import Export, Format, camera_table, index_table, source_tables, sources_at, write_lines

TRAIN_FILE = "train/metadata.jsonl"
FOLDERS = {"train": "train", "": "train", "val": "validation", "test": "test"}  # names that the library knows


def write_metadata(export: Export) -> None:
    """Write `metadata.jsonl` of each set; see `Format.write`."""
    manifest = export.selection.manifest
    found = (source for lights in export.selection.lights for source in sources_at(manifest, lights))
    keys = list(dict.fromkeys(key for source in found for key in source))  # a column of tables has them in every row
    rows: dict[str, list[dict[str, Any]]] = {}
    for frame in export.frames:
        place = FOLDERS[frame.part]
        row: dict[str, Any] = {"file_name": frame.file.removeprefix(f"{place}/")}
        row |= index_table(manifest, frame) | camera_table(manifest, frame.c)
        row["sources"] = [dict.fromkeys(keys) | source for source in source_tables(manifest, frame)]
        rows.setdefault(place, []).append(row | export.head)
    columns = dict.fromkeys(column for own in rows.values() for row in own for column in row)  # of lenses of all types
    for place, own in rows.items():
        write_lines(export.folder / place / "metadata.jsonl", (json.dumps(columns | row) for row in own))


HUGGING_FACE = Format(
    mark=TRAIN_FILE,
    write=write_metadata,
    images=FOR_SCREENS,
    stem=lambda frame: f"{FOLDERS[frame.part]}/{frame.name}",
)
