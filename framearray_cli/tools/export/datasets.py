"""Image folders of Hugging Face: a folder of pictures per set, each with `metadata.jsonl`.

The library `datasets` reads a row per picture, with a column per key.
"""

import json
from collections.abc import Sequence
from typing import Any

from framearray_cli.array.images import FOR_SCREENS
from framearray_cli.base.files import write_bytes

from .format import (
    Export,
    Format,
    Selection,
    camera_table,
    index_table,
    source_tables,
    sources_at,
)

TRAIN_FILE = "train/metadata.jsonl"
FOLDERS = {"train": "train", "": "train", "val": "validation", "test": "test"}  # names that the library knows


def write_metadata(export: Export) -> None:
    """Write `metadata.jsonl` of each set; see `Format.write`."""
    selection, folder, manifest = export.selection, export.folder, export.selection.manifest
    keys = _source_keys(selection)
    rows: dict[str, list[dict[str, Any]]] = {}
    for frame in selection.frames:
        place = FOLDERS[frame.part]
        row: dict[str, Any] = {"file_name": export.files[frame.name].removeprefix(f"{place}/")}
        row |= index_table(manifest, frame) | camera_table(manifest, frame.c)
        row["sources"] = [dict.fromkeys(keys) | source for source in source_tables(manifest, frame)]
        rows.setdefault(place, []).append(row | export.head)
    columns = dict.fromkeys(column for own in rows.values() for row in own for column in row)  # of lenses of all types
    for place, own in rows.items():
        lines = (f"{json.dumps(columns | row)}\n" for row in own)
        write_bytes(folder / place / "metadata.jsonl", "".join(lines).encode())


def _source_keys(selection: Selection) -> Sequence[str]:
    """List the keys of all sources: a column of tables has the same keys in every row."""
    found = (source for lights in selection.lights for source in sources_at(selection.manifest, lights))
    return list(dict.fromkeys(key for source in found for key in source))


HUGGING_FACE = Format(
    mark=TRAIN_FILE,
    write=write_metadata,
    images=FOR_SCREENS,
    stem=lambda selection, frame: f"{FOLDERS[frame.part]}/{frame.name}",
)
