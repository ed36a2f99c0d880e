"""WebDataset: tar files of samples. A sample is a picture and a JSON table that share a name."""

import io
import json
import tarfile

from .format import Export, Format
from .selection import ExportedFrame, camera_table, frame_table, write_json

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
