"""The radiosity cache of an array, in one file next to the records while the array is unfinished.

The first run solves them; every other part, worker and later run reads them from here. The file is an archive of numpy,
whose checksums cover the numbers, so a damaged file counts as none.
"""

import json
import os
import zipfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import with_room
from framearray_cli.base.files import make_folder, whole_file

from .record import FOLDER, RecordedRun, record_file

FILE = "cells.npz"  # in the folder of the records
HEAD = "head"  # the member that holds JSON
SHOWN = len("sha256:") + 12  # characters of a digest in messages
# Why the digests of two runs may differ.
CAUSES = (
    "processors of another kind round differently, another version of the program may build other cells, and the first "
    "line of a record may be damaged"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellTable:
    """The content of the file.

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
    target = table_file(folder)
    make_folder(target.parent)
    _remove_parts(folder)  # no other run writes now, so a killed run left them
    head = {"cells": table.digest, "key": table.key, "note": table.note, "accuracy": dict(table.accuracy)}
    text = np.frombuffer(json.dumps(head).encode(), np.uint8)
    with whole_file(target) as part, part.open("wb") as file:
        np.savez(file, **{HEAD: text}, **table.numbers)  # type: ignore[arg-type]  # names of arrays, and no options


def read_table(folder: Path, key: str) -> CellTable | None:
    """Read the cells of an array; None if there are none, they have another key, or the file is damaged."""
    path = table_file(folder)
    if not os.path.isfile(path):
        return None
    try:
        with path.open("rb") as file, np.load(file) as found:
            head = json.loads(found[HEAD].tobytes())
            if head["key"] != key:
                return None
            numbers = {name: _with_room(found[name]) for name in found.files if name != HEAD}
            digest, note, accuracy = str(head["cells"]), str(head["note"]), dict(head["accuracy"])
    except (OSError, ValueError, TypeError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile):
        return None
    return CellTable(key=key, digest=digest, note=note, accuracy=accuracy, numbers=numbers)


def _with_room(array: NDArray[Any]) -> NDArray[Any]:
    room: NDArray[Any] = with_room(array.shape, array.dtype, fill=0)
    room[...] = array
    return room


def remove_table(folder: Path) -> None:
    """Remove the cells of an array that is finished, and what killed runs left of them."""
    with suppress(OSError):  # it takes space, and harms nothing
        table_file(folder).unlink(missing_ok=True)
    _remove_parts(folder)


def _remove_parts(folder: Path) -> None:
    for part in (folder / FOLDER).glob(f".{FILE}.*.part"):
        with suppress(OSError):
            part.unlink()


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
