"""Looks whether every file of a frame array is there and what it was when it was finished: `framearray verify`."""

import os
from collections.abc import Callable, Container, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from framearray_cli.base.errors import OutputError

from .images.images import read_image, read_layers
from .manifest import Manifest, array_files
from .manifest_toml import read_manifest
from .record import ArrayRecords, Entry, damaged, read_records

NEVER = "was never finished"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """What was found.

    Attributes:
        files: of the whole array.
        wrong: names of files that are missing, damaged or were never finished, with what is wrong.
        unknown: files that are whole images but of which no checksum is known.
    """

    manifest: Manifest
    files: int
    wrong: tuple[tuple[str, str], ...]
    unknown: int


def verify(out: Path, threads: int, progress: Callable[[int, int], None]) -> Verified:
    """Read every file of an array.

    Args:
        out: output folder of a render, or its manifest.
        progress: told files done and files in all.

    Raises:
        OutputError: the manifest or a record cannot be read.
    """
    manifest = read_manifest(out)
    checksums = read_records(manifest.directory, manifest.fingerprint).checksums()
    names = [file.relative_to(manifest.directory).as_posix() for file in array_files(manifest)]

    def look(name: str) -> list[tuple[str, str]]:
        if name in checksums:
            return list(damaged(manifest.directory, checksums, [name]))
        return list(_without_checksum(manifest, name))

    wrong: list[tuple[str, str]] = []
    with ThreadPoolExecutor(threads, thread_name_prefix="verify") as pool:
        for done, found in enumerate(pool.map(look, names), start=1):
            wrong += found
            progress(done, len(names))
    unknown = len(set(names) - set(checksums)) - sum(1 for name, _ in wrong if name not in checksums)
    return Verified(manifest=manifest, files=len(names), wrong=tuple(wrong), unknown=unknown)


def _without_checksum(manifest: Manifest, name: str) -> Iterator[tuple[str, str]]:
    """A file that no record tells of: whether it is an image of the right size, at least."""
    path = manifest.directory / name
    if not os.path.isfile(path):
        yield name, NEVER
        return
    try:
        layers = bool(manifest.layers) and ".layers." in name
        shape = next(iter(read_layers(path).values())).shape if layers else read_image(path).shape[:2]
    except OutputError as error:
        yield name, str(error).removeprefix(f"{path}: ")
        return
    width, height = manifest.resolution
    if shape != (height, width):
        yield name, f"expected {width} x {height} pixels, found {shape[1]} x {shape[0]}"


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
