"""Data sets for learning: tar files of WebDataset, and image folders of Hugging Face.

WebDataset has samples, pictures and JSON tables that share a name. Hugging Face has a folder of pictures per set, each
with `metadata.jsonl`; its library `datasets` reads a row per picture, with a column per key.
"""

import io
import json
import tarfile
from collections.abc import Sequence
from typing import Any

from framearray_cli.array.images import FOR_SCREENS
from framearray_cli.base.files import write_bytes

from .format import (
    Export,
    ExportedFrame,
    Format,
    Selection,
    camera_table,
    frame_table,
    index_table,
    source_tables,
    sources_at,
    write_json,
)

INDEX_FILE = "shards.json"
NO_SET = "all"  # in names of tar files, if pictures belong to no set


def write_shards(export: Export) -> None:
    """Move the pictures into tar files of their sets, and write `shards.json`: these files and their samples."""
    by_set: dict[str, list[ExportedFrame]] = {}
    for frame in export.selection.frames:
        by_set.setdefault(frame.part or NO_SET, []).append(frame)
    sets: dict[str, list[dict[str, object]]] = {name: [] for name in by_set}
    for name, frames in by_set.items():
        for number, first in enumerate(range(0, len(frames), export.per_shard)):
            some, file = frames[first : first + export.per_shard], f"{name}-{number:06d}.tar"
            with tarfile.open(export.folder / file, "x", format=tarfile.PAX_FORMAT) as shard:
                for frame in some:
                    _add_sample(shard, export, frame)
            sets[name].append({"file": file, "samples": len(some)})
    (export.folder / "images").rmdir()
    write_json(export.folder / INDEX_FILE, {"name": export.selection.manifest.name, "sets": sets})


def _add_sample(shard: tarfile.TarFile, export: Export, frame: ExportedFrame) -> None:
    """Move a picture, and add the table that describes it."""
    manifest, picture = export.selection.manifest, export.folder / export.files[frame.name]
    table = frame_table(manifest, frame) | camera_table(manifest, frame.c) | export.head
    text = f"{json.dumps(table)}\n".encode()
    for name, content in ((picture.name, picture.read_bytes()), (f"{frame.name}.json", text)):
        member = tarfile.TarInfo(name)  # time, owner and mode are constants: equal data, equal files
        member.size = len(content)
        shard.addfile(member, io.BytesIO(content))
    picture.unlink()


WEBDATASET = Format(mark=INDEX_FILE, write=write_shards)


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
