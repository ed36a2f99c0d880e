"""Archives of numpy (`.npz`) in the folder of the records, while an array is unfinished: its cells, and strips.

The radiosity cache of an array, its cells, is one file. The first run solves them; every other part, worker and later
run reads them from here. Checksums of the archive cover the numbers, so a damaged file counts as none.

Strips are rows of frames whose other rows are still to be rendered: a file per frame and strip, or slice of it, which
goes when the frame is finished.
"""

import json
import os
import re
import zipfile
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import with_room
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import whole_file

from .record import FOLDER, RecordedRun, record_file

FILE = "cells.npz"  # in the folder of the records
FACTS = "facts"  # the member that holds JSON
SHOWN = len("sha256:") + 12  # characters of a digest in messages
# Why the digests of two runs may differ.
CAUSES = (
    "processors of another kind round differently, another version of the program may build other cells, and the first "
    "line of a record may be damaged"
)
_STRIP = re.compile(r"\.?strip-\w+-(?P<c>\d+)-\d+-\d+\.npz(\..+)?")  # whole, or what a killed run left of it


def write_archive(path: Path, facts: Any, arrays: Iterable[tuple[str, NDArray[Any]]]) -> None:
    """Write a file, whole or not at all.

    Args:
        facts: what JSON can hold.
        arrays: by name, each written before the next one is made.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(FACTS, json.dumps(facts))
        for name, array in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        with suppress(OSError):  # they take space, and harm nothing
            path.unlink()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellTable:
    """The content of the file of cells.

    Attributes:
        key: of all that the cells depend on.
        digest: of the cells, as records have it.
        note: the difference of their light from path-traced light; empty if nothing was compared.
        accuracy: the same in figures, by name; empty without.
        numbers: by name.
    """

    key: str
    digest: str
    note: str
    accuracy: Mapping[str, Any]
    numbers: Mapping[str, NDArray[Any]]


def table_file(folder: Path) -> Path:
    """Return the file of the cells of an array, whether it exists or not."""
    return folder / FOLDER / FILE


def write_table(folder: Path, table: CellTable) -> None:
    """Write the file, whole or not at all; only one run at a time may, see `ArrayFolder.exclusive`.

    Raises:
        OutputError: it cannot be written.
    """
    _remove(_parts(folder))  # no other run writes now, so a killed run left them
    facts = {"cells": table.digest, "key": table.key, "note": table.note, "accuracy": dict(table.accuracy)}
    write_archive(table_file(folder), facts, table.numbers.items())


def read_table(folder: Path, key: str) -> CellTable | None:
    """Read the cells of an array; None if there are none, they have another key, or the file is damaged."""
    path = table_file(folder)
    if not os.path.isfile(path):
        return None
    try:
        with path.open("rb") as file, np.load(file) as found:
            facts = json.loads(found[FACTS])
            if facts["key"] != key:
                return None
            numbers = {name: _with_room(found[name]) for name in found.files if name != FACTS}
            digest, note, accuracy = str(facts["cells"]), str(facts["note"]), dict(facts["accuracy"])
    except (OSError, ValueError, TypeError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile):
        return None
    return CellTable(key=key, digest=digest, note=note, accuracy=accuracy, numbers=numbers)


def _with_room(array: NDArray[Any]) -> NDArray[Any]:
    room: NDArray[Any] = with_room(array.shape, array.dtype, fill=0)
    room[...] = array
    return room


def remove_table(folder: Path) -> None:
    """Remove the cells of an array that is finished, and what killed runs left of them."""
    _remove([table_file(folder), *_parts(folder)])


def _parts(folder: Path) -> list[Path]:
    return list((folder / FOLDER).glob(f".{FILE}.*.part"))


def mixed_cells(runs: Iterable[RecordedRun]) -> str:
    """Say that images of an array have light from different cells, and what to do; empty if they do not."""
    found = {run.cells: run for run in runs if run.rays}
    if len(found) < 2:
        return ""
    one, other = list(found.values())[:2]
    return (
        f"expected the same cells of all images, got {cells_text(one)}, {cells_text(other)}; {CAUSES}; {remedy(other)}"
    )


def cells_text(run: RecordedRun) -> str:
    """Return the digest of a run's cells, and whose it is."""
    return f"{short_digest(run.cells)} in {_record(run)} ({run.processor or 'unknown processor'})"


def short_digest(digest: str) -> str:
    """Return the beginning of a digest, "none" of one that is not known."""
    return digest[:SHOWN] or "none"


def remedy(run: RecordedRun) -> str:
    """Return how to have the images of a run rendered again, or all."""
    return f"remove {_record(run)} to render its images again, or render all of them again with --restart"


def _record(run: RecordedRun) -> str:
    return f"{FOLDER}/{record_file(Path(), run.cameras).name}"


def strip_file(folder: Path, key: str, c: int, rows: range) -> Path:
    """Return the file of some rows of camera c, whether it exists or not.

    Args:
        key: of all that the rows depend on, for a name of a file.
    """
    return folder / FOLDER / f"strip-{key}-{c}-{rows.start}-{rows.stop}.npz"


def strip_files(folder: Path) -> list[Path]:
    """Return all files of strips in the folder of an array."""
    return sorted((folder / FOLDER).glob("strip-*.npz"))


class StripFile:
    """A file of a strip that is read; errors remove it, so that the next run renders its rows again."""

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            OutputError: it is damaged or gone.
        """
        self._path = path
        with self._opened() as archive:
            self._names = frozenset(archive.namelist())
            self.facts: list[dict[str, Any]] = json.loads(archive.read(FACTS))

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._names

    def __getitem__(self, name: str) -> NDArray[Any]:
        """An array.

        Raises:
            OutputError: the file is damaged or gone.
        """
        with self._opened() as archive, archive.open(f"{name}.npy") as member:
            found: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
            return found

    @contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        try:
            with zipfile.ZipFile(self._path) as archive:
                yield archive
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            with suppress(OSError):
                os.unlink(self._path)
            problem = "is damaged, and was removed; run the same command again, which renders its rows again"
            raise OutputError(f"{self._path}: {problem}") from error


def remove_strips(folder: Path, cameras: Container[int], kept: Container[Path] = ()) -> None:
    """Remove the files of some cameras but those to keep, and what killed runs left of them."""
    for path in (*strip_files(folder), *(folder / FOLDER).glob(".strip-*.part")):
        name = _STRIP.fullmatch(path.name)
        if name and int(name["c"]) in cameras and path not in kept:
            _remove([path])
