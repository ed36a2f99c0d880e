"""Going on where a render stopped: what of an array is on disk and whole, and what is left to render."""

from collections.abc import Callable, Container, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from .record import ArrayRecords, Entry, damaged, read_records


@dataclass(frozen=True, slots=True, kw_only=True)
class OnDisk:
    """What lies in an output folder.

    Attributes:
        records: of what is whole.
        damaged: names of files that were finished and are missing or changed, with what is wrong.
    """

    records: ArrayRecords
    damaged: tuple[tuple[str, str], ...] = ()

    @property
    def images(self) -> int:
        """Images that are on disk."""
        return sum(len(lights) for lights in _lights_by_camera(self.records).values())

    def missing(self, cameras: Sequence[int], lights: range) -> list[int]:
        """The cameras, in rising order, of which an image under some light positions is missing."""
        done = _lights_by_camera(self.records)
        return [c for c in cameras if not set(lights) <= done.get(c, set())]


def _lights_by_camera(records: ArrayRecords) -> dict[int, set[int]]:
    done: dict[int, set[int]] = {}
    for entry in records.entries:
        done.setdefault(entry.c, set()).update(range(*entry.lights))
    return done


def scan_output(
    folder: Path,
    fingerprint: str,
    threads: int = 1,
    cameras: Container[int] | None = None,
    scanning: Callable[[int], None] = lambda files: None,
) -> OnDisk:
    """Read all records of an array, and the files that they name: those that are not what they were do not count.

    Args:
        cameras: whose files are read; what records say of others is believed. None: of all.
        scanning: called with the number of files before they are read.

    Raises:
        OutputError: a record cannot be read.
    """
    records = read_records(folder, fingerprint)
    checksums = records.checksums()

    read = [entry for entry in records.entries if cameras is None or entry.c in cameras]
    if files := sum(len(entry.files) for entry in read):
        scanning(files)

    def wrong(entry: Entry) -> list[tuple[str, str]]:
        return list(damaged(folder, checksums, entry.files))

    with ThreadPoolExecutor(threads, thread_name_prefix="verify") as pool:
        found = list(pool.map(wrong, read))
    bad = {id(entry) for entry, problems in zip(read, found, strict=True) if problems}
    whole = tuple(entry for entry in records.entries if id(entry) not in bad)
    return OnDisk(
        records=replace(records, entries=whole), damaged=tuple(problem for problems in found for problem in problems)
    )
