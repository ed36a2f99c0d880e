"""What was finished, in the output folder: a line for each frame whose files are all on disk, with their checksums.

Lines are appended, so that one costs the same however many there are. A render that is started again reads them, looks
whether the files are still what they were, and goes on with the rest. Each run of some part of the camera path writes
into a file of its own (`records/0000-0047.jsonl`), so that parts may run side by side.
"""

import hashlib
import json
import os
import re
import stat
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from framearray_cli.base.arrays import is_number
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import make_folder, reason, require_file
from framearray_cli.base.hashing import digest, line_digest

FOLDER = "records"
MOST = 10**6  # cameras, and light positions of all groups: more than any job has
_SEAL = re.compile(rb'\{"check":"([0-9a-f]{16})",')


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One frame under some light positions, finished.

    Attributes:
        c: camera.
        lights: the first light position, and the one after the last.
        files: name -> size in bytes and checksum, of all files that belong to it.
        hits: mean hits a pixel.
        notes: what the user should know of it.
        errors: light position -> mean square of the standard error and mean radiance; see `standarderror.summed_up`.
    """

    c: int
    lights: tuple[int, int]
    files: Mapping[str, tuple[int, str]]
    hits: float = 0.0
    notes: tuple[str, ...] = ()
    errors: Mapping[int, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedRun:
    """One run of the program: what it was to do, and what it took until its last entry.

    Attributes:
        cameras: those that it was to render, see ranges.py.
        processor: name of the machine's processor; kernels differ from one to the other.
        rays: by kind, all that were traced.
        seconds: of wall time.
    """

    cameras: str
    processor: str
    rays: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayRecords:
    """What all records of a folder say of one array; of a frame that was finished twice, the last entry counts."""

    entries: tuple[Entry, ...] = ()
    runs: tuple[RecordedRun, ...] = ()

    def checksums(self) -> dict[str, tuple[int, str]]:
        """Size and checksum of every file that was finished."""
        return {name: known for entry in self.entries for name, known in entry.files.items()}


class RecordWriter:
    """Appends to a record; lines appear whole, from any thread."""

    def __init__(self, file: Path, fingerprint: str, run: RecordedRun) -> None:
        """Open the record, or begin it.

        Raises:
            OutputError: it cannot be written.
        """
        self._path, self._lock, self.fingerprint = file, threading.Lock(), fingerprint
        make_folder(file.parent)
        try:
            self._file = open(file, "ab", buffering=0)  # noqa: SIM115  # closed in __exit__
        except OSError as error:
            raise OutputError(f"{file}: cannot be written: {reason(error)}") from error
        self._torn = True  # a line of an earlier run may have been cut short
        try:
            self._put({"fingerprint": fingerprint, "cameras": run.cameras, "processor": run.processor})
        except BaseException:
            self._file.close()
            raise

    def add(self, entry: Entry, rays: Mapping[str, int], seconds: float) -> None:
        """Note that a frame is finished, and what the run took so far.

        Raises:
            OutputError: it cannot be written.
        """
        line: dict[str, Any] = {
            "c": entry.c,
            "lights": entry.lights,
            "files": entry.files,
            "hits": entry.hits,
            "rays": dict(rays),
            "seconds": round(seconds, 3),
        }
        if entry.notes:
            line["notes"] = entry.notes
        if entry.errors:
            line["errors"] = {str(l): error for l, error in entry.errors.items()}
        self._put(line)

    def _put(self, line: Mapping[str, Any]) -> None:
        text = sealed(line) + b"\n"
        try:
            with self._lock:
                left = memoryview(b"\n" + text if self._torn else text)
                self._torn = True
                while left:  # a disk that becomes full takes a part
                    left = left[self._file.write(left) :]
                self._torn = False
                if not os.fstat(self._file.fileno()).st_nlink:
                    raise OutputError(f"{self._path}: was removed while it was written; what it said is rendered again")
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written: {reason(error)}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):  # a disk that has gone
            self._file.close()


def record_file(folder: Path, cameras: str) -> Path:
    """The record of a part of the camera path."""
    name = cameras if len(cameras) <= 60 else f"{cameras[:40]}-{hashlib.sha256(cameras.encode()).hexdigest()[:12]}"
    return folder / FOLDER / f"{name}.jsonl"


def record_files(folder: Path) -> list[Path]:
    """All records of a folder."""
    return sorted((folder / FOLDER).glob("*.jsonl"))


def read_records(folder: Path, fingerprint: str) -> ArrayRecords:
    """What was finished of the array with this fingerprint; lines of other arrays, and torn ones, do not count.

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
                    cameras, processor = (str(line.get(key, "")) for key in ("cameras", "processor"))
                    runs.append(RecordedRun(cameras=cameras, processor=processor))
            elif current and (entry := _entry(line)):
                entries[entry.c, *entry.lights] = entry
                runs[-1] = replace(runs[-1], **_taken(line))
    return ArrayRecords(entries=tuple(entries.values()), runs=tuple(runs))


def _lines(file: Path) -> Iterator[dict[str, Any]]:
    require_file(file, "; remove it")
    try:
        data = file.read_bytes()
    except OSError as error:
        raise OutputError(f"{file}: cannot be read: {reason(error)}") from error
    for line in data.splitlines():
        found = unsealed(line)
        if found is not None:  # else torn, or damaged: what it tells of is made again
            yield found


def sealed(table: Mapping[str, Any]) -> bytes:
    """A line of a record: JSON that begins with a checksum of all the rest."""
    body = json.dumps(table, separators=(",", ":")).encode()
    return b'{"check":"' + line_digest(body) + b'",' + body[1:]


def unsealed(line: bytes) -> dict[str, Any] | None:
    """What `sealed` made a line of; None where the line is not what it was."""
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
    """An entry, unless the line holds something else."""
    try:
        entry = Entry(
            c=int(line["c"]),
            lights=(int(line["lights"][0]), int(line["lights"][1])),
            files={str(name): (int(size), str(known)) for name, (size, known) in line["files"].items()},
            hits=float(line["hits"]),
            notes=tuple(str(note) for note in line.get("notes", ())),
            errors={int(l): (float(a), float(b)) for l, (a, b) in line.get("errors", {}).items()},
        )
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError):
        return None
    first, end = entry.lights
    within = 0 <= entry.c < MOST and 0 <= first <= end <= MOST
    return entry if within and all(map(_is_plain, entry.files)) else None


def _is_plain(name: str) -> bool:
    """Whether a name leads to a file in the folder itself, as those of all images do."""
    return name not in ("", ".", "..") and not any(character in name for character in "/\\\0")


def _taken(line: Mapping[str, Any]) -> dict[str, Any]:
    """What a run says that it took; nothing where that is not what a run writes."""
    rays, seconds = line.get("rays"), line.get("seconds")
    counts = isinstance(rays, dict) and all(isinstance(n, int) for n in rays.values())
    return ({"rays": rays} if counts else {}) | (
        {"seconds": float(seconds)} if isinstance(seconds, int | float) and is_number(seconds) else {}
    )


def damaged(folder: Path, checksums: Mapping[str, tuple[int, str]], names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Files that are not what they were when they were finished, with what is wrong; in the order of `names`."""
    for name in names:
        path, (size, known) = folder / name, checksums[name]
        try:
            found = path.stat()
            if not stat.S_ISREG(found.st_mode):  # a device or a pipe may have no end
                yield name, "is no file"
            elif found.st_size != size:
                yield name, f"expected {size:,} bytes, found {found.st_size:,}"
            elif digest(path)[1] != known:
                yield name, "its bytes have changed"
        except FileNotFoundError:
            yield name, "missing"
        except OSError as error:
            yield name, f"cannot be read: {reason(error)}"
