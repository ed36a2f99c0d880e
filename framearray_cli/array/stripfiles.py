"""Files of strips: rows of frames whose other rows are still to be rendered, in the folder of the records.

They are archives of numpy (`.npz`), one per frame and strip, or slice of it, and go when the frame is finished.
"""

import json
import os
import re
import zipfile
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import whole_file

from .record import FOLDER

FACTS = "facts"  # the member that holds JSON
_NAME = re.compile(r"\.?strip-\w+-(?P<c>\d+)-\d+-\d+\.npz(\..+)?")  # whole, or what a killed run left of it


def strip_file(folder: Path, key: str, c: int, rows: range) -> Path:
    """Return the file of some rows of camera c, whether it exists or not.

    Args:
        key: of all that the rows depend on, for a name of a file.
    """
    return folder / FOLDER / f"strip-{key}-{c}-{rows.start}-{rows.stop}.npz"


def strip_files(folder: Path) -> list[Path]:
    """Return all files of strips in the folder of an array."""
    return sorted((folder / FOLDER).glob("strip-*.npz"))


def write_strip(path: Path, facts: Sequence[Mapping[str, Any]], arrays: Iterable[tuple[str, NDArray[Any]]]) -> None:
    """Write a file, whole or not at all.

    Args:
        arrays: by name, each written before the next one is made.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(FACTS, json.dumps(facts))
        for name, array in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)


class StripFile:
    """A file that is read; errors remove it, so that the next run renders its rows again."""

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
    for pattern in ("strip-*.npz", ".strip-*.part"):
        for path in (folder / FOLDER).glob(pattern):
            name = _NAME.fullmatch(path.name)
            if name and int(name["c"]) in cameras and path not in kept:
                with suppress(OSError):  # they take space, and harm nothing
                    path.unlink()
