"""Records of finished frames in the output folder: one line per frame whose files are all on disk, with checksums.

Lines are appended, so that each costs the same however long the record is. A resumed render reads them, checks that the
files are unchanged, and renders the rest. Each run writes a file of its own, named after its cameras
(`records/0-47.jsonl`), so that several may run side by side.
"""

import hashlib
import json
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from framearray_cli.base.arrays import is_number
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import line_digest, make_folder, reason, require_file

FOLDER = "records"
MOST = 10**6  # cameras, and light positions of all groups: more than any job has
_SEAL = re.compile(rb'\{"check":"([0-9a-f]{16})",')


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One frame under some light positions, finished.

    Attributes:
        c: camera.
        lights: the first light position, and the one past the last.
        files: name -> (size in bytes, checksum) of all its files.
        hits: mean hits per pixel.
        notes: messages for the user.
        errors: light position -> (mean square of the standard error, mean radiance).
        shares: of clipped and of black pixels, means of these images; None: not known.
    """

    c: int
    lights: tuple[int, int]
    files: Mapping[str, tuple[int, str]]
    hits: float = 0.0
    notes: tuple[str, ...] = ()
    errors: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    shares: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedRun:
    """One run of the program: its task, and its cost until its last entry.

    Attributes:
        cameras: range of those to render.
        processor: name of the machine's processor; kernels differ between processors.
        cells: digest of the cells that indirect light was read from; empty without.
        rays: number of rays traced, by kind.
        seconds: of wall time.
    """

    cameras: str
    processor: str
    cells: str = ""
    rays: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayRecords:
    """All records of one array; the last entry of a frame counts."""

    entries: tuple[Entry, ...] = ()
    runs: tuple[RecordedRun, ...] = ()

    def checksums(self) -> dict[str, tuple[int, str]]:
        """Return size and checksum of every finished file, by name."""
        return {name: known for entry in self.entries for name, known in entry.files.items()}


class RecordWriter:
    """Appends to a record; whole lines, from any thread."""

    def __init__(self, file: Path, fingerprint: str, run: RecordedRun) -> None:
        """Open the record, or create it, and note the run.

        Raises:
            OutputError: it cannot be written.
        """
        self._path, self._lock, self.fingerprint = file, threading.Lock(), fingerprint
        make_folder(file.parent)
        try:
            self._file = open(file, "ab", buffering=0)  # noqa: SIM115  # closed in __exit__
        except OSError as error:
            raise OutputError(f"{file}: cannot be written: {reason(error)}") from error
        self._torn = True  # the last line of an earlier run may be incomplete
        try:
            head = {"fingerprint": fingerprint, "cameras": run.cameras, "processor": run.processor}
            self._put(head | ({"cells": run.cells} if run.cells else {}))
        except BaseException:
            self._file.close()
            raise

    def add(self, entry: Entry, rays: Mapping[str, int], seconds: float) -> None:
        """Note that a frame is finished, and the cost of the run so far.

        Raises:
            OutputError: it cannot be written.
        """
        self._put(asdict(entry) | {"rays": dict(rays), "seconds": round(seconds, 3)})

    def _put(self, line: Mapping[str, Any]) -> None:
        text = seal(line) + b"\n"
        try:
            with self._lock:
                left = memoryview(b"\n" + text if self._torn else text)
                self._torn = True
                while left:  # a disk that becomes full writes a part
                    left = left[self._file.write(left) :]
                self._torn = False
                if not os.fstat(self._file.fileno()).st_nlink:
                    raise OutputError(f"{self._path}: was removed while it was written; what it said is rendered again")
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written: {reason(error)}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        with suppress(OSError):  # a disk that has gone
            self._file.close()


def record_file(folder: Path, cameras: str) -> Path:
    """Return the record of a run over some cameras, given as a range."""
    name = cameras if len(cameras) <= 60 else f"{cameras[:40]}-{hashlib.sha256(cameras.encode()).hexdigest()[:12]}"
    return folder / FOLDER / f"{name}.jsonl"


def record_files(folder: Path) -> list[Path]:
    """Return all records of a folder."""
    return sorted((folder / FOLDER).glob("*.jsonl"))


def read_records(folder: Path, fingerprint: str) -> ArrayRecords:
    """Read the entries of the array with this fingerprint; skip lines of other arrays, and torn ones.

    Raises:
        OutputError: a record cannot be read.
    """
    entries: dict[tuple[int, int, int], Entry] = {}
    runs: list[RecordedRun] = []
    for file in record_files(folder):
        current = False
        for line in _lines(file):
            if "fingerprint" in line:
                current = line["fingerprint"] == fingerprint
                if current:
                    about: dict[str, Any] = {key: str(line.get(key, "")) for key in ("cameras", "processor", "cells")}
                    runs.append(RecordedRun(**about))
            elif current and (entry := _entry(line)):
                entries[entry.c, *entry.lights] = entry
                runs[-1] = replace(runs[-1], **_run_costs(line))
    return ArrayRecords(entries=tuple(entries.values()), runs=tuple(runs))


def _lines(file: Path) -> Iterator[dict[str, Any]]:
    require_file(file, "; remove it")
    try:
        data = file.read_bytes()
    except OSError as error:
        raise OutputError(f"{file}: cannot be read: {reason(error)}") from error
    for line in data.splitlines():
        found = unseal(line)
        if found is not None:  # else torn or damaged: its frame is rendered again
            yield found


def seal(table: Mapping[str, Any]) -> bytes:
    """Return a line of a record: JSON that begins with a checksum of the rest."""
    body = json.dumps(table, separators=(",", ":")).encode()
    return b'{"check":"' + line_digest(body) + b'",' + body[1:]


def unseal(line: bytes) -> dict[str, Any] | None:
    """Return the table of a line that `seal` made; None if the line was changed."""
    match = _SEAL.match(line)
    if not match:
        return None
    body = b"{" + line[match.end() :]
    if line_digest(body) != match[1]:
        return None
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _entry(line: Mapping[str, Any]) -> Entry | None:
    """Read an entry; None if the line holds something else."""
    try:
        entry = Entry(
            c=int(line["c"]),
            lights=(int(line["lights"][0]), int(line["lights"][1])),
            files={str(name): (int(size), str(known)) for name, (size, known) in line["files"].items()},
            hits=float(line["hits"]),
            notes=tuple(str(note) for note in line.get("notes", ())),
            errors={int(l): (float(a), float(b)) for l, (a, b) in line.get("errors", {}).items()},
            shares=(float(line["shares"][0]), float(line["shares"][1])) if line.get("shares") else None,
        )
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError):
        return None
    first, end = entry.lights
    within = 0 <= entry.c < MOST and 0 <= first <= end <= MOST
    return entry if within and all(map(_is_plain, entry.files)) else None


def _is_plain(name: str) -> bool:
    """Return True if a name denotes a file in the folder itself, as the names of all images do."""
    return name not in ("", ".", "..") and not any(character in name for character in "/\\\0")


def _run_costs(line: Mapping[str, Any]) -> dict[str, Any]:
    """Read the cost of a run so far; leave out what no run would write."""
    rays, seconds = line.get("rays"), line.get("seconds")
    counts = isinstance(rays, dict) and all(isinstance(n, int) for n in rays.values())
    return ({"rays": rays} if counts else {}) | (
        {"seconds": float(seconds)} if isinstance(seconds, int | float) and is_number(seconds) else {}
    )
