"""WebDataset: tar files of samples. A sample is a picture and a JSON table that share a name."""

import io
import json
import tarfile
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from .frames import camera_table, frame_table, write_json
from .selection import ExportedFrame, Selection

INDEX_FILE = "shards.json"
NO_SET = "all"  # in names of shards, where pictures belong to no set
PER_SHARD = 1000


class ShardWriter:
    """Moves pictures into the tar file of their set, and begins a new one after a number of samples.

    A context manager that closes the files. What the system refuses is an OSError: the folder of the export says where.
    """

    def __init__(self, folder: Path, selection: Selection, exposure: float, per_shard: int) -> None:
        """Write no file yet.

        Args:
            folder: of the export.
            selection: what is exported.
            exposure: of the pictures, in stops.
            per_shard: samples of each tar file but the last of a set.
        """
        self._folder, self._manifest, self._per_shard = folder, selection.manifest, per_shard
        self._more: dict[str, Any] = {"exposure": exposure} if exposure else {}
        self._files = ExitStack()
        self._open: dict[str, tarfile.TarFile] = {}
        self._counts: dict[str, list[int]] = {}  # of samples, per tar file of each set

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._files.close()

    def add(self, frame: ExportedFrame, picture: Path) -> None:
        """Move a picture, and add the table that describes it."""
        part = frame.part or NO_SET
        counts = self._counts.setdefault(part, [])
        if not counts or counts[-1] == self._per_shard:
            counts.append(0)
            self._begin(part, len(counts) - 1)
        table = frame_table(self._manifest, frame) | camera_table(self._manifest, frame.c) | self._more
        text = f"{json.dumps(table)}\n".encode()
        for name, content in ((picture.name, picture.read_bytes()), (f"{frame.name}.json", text)):
            member = tarfile.TarInfo(name)  # time, owner and mode are constants: equal data, equal files
            member.size = len(content)
            self._open[part].addfile(member, io.BytesIO(content))
        picture.unlink()
        counts[-1] += 1

    def write_index(self) -> None:
        """Write `shards.json`: the tar files of each set, with the number of their samples."""
        sets = {
            part: [{"file": shard_name(part, k), "samples": n} for k, n in enumerate(counts)]
            for part, counts in self._counts.items()
        }
        write_json(self._folder / INDEX_FILE, {"name": self._manifest.name, "sets": sets})

    def _begin(self, part: str, number: int) -> None:
        if part in self._open:
            self._open[part].close()
        place = self._folder / shard_name(part, number)
        file = tarfile.open(place, "x", format=tarfile.PAX_FORMAT)  # noqa: SIM115  # the stack closes it
        self._open[part] = self._files.enter_context(file)


def shard_name(part: str, number: int) -> str:
    """Name a tar file."""
    return f"{part}-{number:06d}.tar"
