"""The radiosity cache of an array, in one file next to the records while the array is unfinished.

The first run solves them; every other part, worker and later run reads them from here. The file begins with a sealed
line (see record.py), whose checksums cover the numbers behind it, so a damaged file counts as none.
"""

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import with_room
from framearray_cli.base.files import joint_digest, make_folder, whole_file

from .record import FOLDER, RecordedRun, record_file, seal, unseal

FILE = "cells.bin"  # in the folder of the records
MOST_HEAD = 1 << 16  # bytes of the first line
SHOWN = len("sha256:") + 12  # characters of a digest in messages
TYPES = ("<f4", "<f8", "<i4", "<i8")
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
    numbers = {name: np.ascontiguousarray(array) for name, array in table.numbers.items()}
    head = {
        "cells": table.digest,
        "key": table.key,
        "note": table.note,
        "accuracy": dict(table.accuracy),
        "numbers": [[name, array.dtype.str, array.shape] for name, array in numbers.items()],
        "digest": joint_digest(array.data.cast("B") for array in numbers.values() if array.size),
    }
    with whole_file(target) as part, part.open("wb") as file:
        file.write(seal(head) + b"\n")
        for array in numbers.values():
            array.tofile(file)


def read_table(folder: Path, key: str) -> CellTable | None:
    """Read the cells of an array; None if there are none, they have another key, or the file is damaged."""
    path = table_file(folder)
    if not os.path.isfile(path):
        return None
    try:
        with path.open("rb") as file:
            return _read(file, key)
    except (OSError, ValueError, TypeError, KeyError, OverflowError):
        return None


def _read(file: BufferedReader, key: str) -> CellTable | None:
    head = unseal(file.readline(MOST_HEAD).removesuffix(b"\n"))
    if head is None or head["key"] != key:
        return None
    kinds = [(str(name), str(kind), tuple(int(n) for n in shape)) for name, kind, shape in head["numbers"]]
    if any(kind not in TYPES or min(shape, default=0) < 0 for _, kind, shape in kinds):
        return None
    size = sum(np.dtype(kind).itemsize * int(np.prod(shape, dtype=object)) for _, kind, shape in kinds)
    if os.fstat(file.fileno()).st_size != file.tell() + size:
        return None
    numbers = {name: with_room(shape, kind, fill=0) for name, kind, shape in kinds}
    views = [array.data.cast("B") for array in numbers.values() if array.size]
    for view in views:
        if file.readinto(view) != len(view):
            return None
    if joint_digest(views) != head["digest"]:
        return None
    return CellTable(
        key=key, digest=str(head["cells"]), note=str(head["note"]), accuracy=dict(head["accuracy"]), numbers=numbers
    )


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
