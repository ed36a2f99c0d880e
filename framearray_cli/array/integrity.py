"""The files of a frame array on disk: which of them exist, and which agree with the checksums in the records.

A render that was stopped, or that still runs, leaves an array unfinished. Images get their names once they are whole,
so an existing file can be read unless it was damaged later. `framearray verify` compares every file of the array with
its checksum, a render only the files of the cameras that it completes.
"""

import os
import stat
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import digest, reason
from framearray_cli.base.threads import TaskPool
from framearray_cli.base.units import agree, counted

from .celltable import mixed_cells
from .images import read_image, read_layers
from .manifest import Manifest, array_files, camera_files
from .manifest_toml import read_manifest
from .places import brief_frames_text
from .record import ArrayRecords, Entry, read_records

REMEDY = "`framearray render JOB` goes on with the rest"
NEVER_FINISHED = "was never finished"


@dataclass(frozen=True, slots=True, kw_only=True)
class PresentFiles:
    """The files of an array that exist.

    Attributes:
        names: relative to the folder, "/" between folders.
    """

    manifest: Manifest
    names: frozenset[str]

    def has(self, files: Iterable[Path]) -> bool:
        """Return whether all of some files of the array exist."""
        folder = self.manifest.directory
        return all(file.relative_to(folder).as_posix() in self.names for file in files)

    def count(self) -> int:
        """Return the number of files of the array that exist."""
        manifest = self.manifest
        return sum(name in self.names for c in range(manifest.n_cameras) for name in camera_files(manifest, c))

    def incomplete(self) -> list[int]:
        """Return the cameras that lack a file."""
        manifest = self.manifest
        return [c for c in range(manifest.n_cameras) if not self.names.issuperset(camera_files(manifest, c))]


def list_present(manifest: Manifest) -> PresentFiles:
    """List the files of an array that exist, at the cost of reading its folders, without a look at each file.

    Raises:
        OutputError: a folder cannot be read.
    """
    found: set[str] = set()
    for folder in {name.rpartition("/")[0] for name in camera_files(manifest, 0)}:
        try:
            with os.scandir(manifest.directory / folder) as entries:
                found.update(f"{folder}/{entry.name}" if folder else entry.name for entry in entries)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise OutputError(f"{manifest.directory / folder}: cannot be read: {reason(error)}") from error
    return PresentFiles(manifest=manifest, names=frozenset(found))


def missing_text(cameras: Collection[int], n: int) -> str:
    """Word which camera positions lack images, and the remedy: "12 of 32 camera positions lack images: 20-31; ..."."""
    some = f"{len(cameras):,} of {counted(n, 'camera position')} {agree(len(cameras), 'lacks', 'lack')} images"
    return f"{some}: {brief_frames_text(cameras)}; {REMEDY}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """The result of `verify`.

    Attributes:
        files: number of files of the whole array.
        wrong: (name, problem) of each file that is missing, damaged or was never finished.
        unknown: number of whole images without a known checksum.
        mixed_cells: what is wrong where images have light from different cells; else empty.
    """

    manifest: Manifest
    files: int
    wrong: tuple[tuple[str, str], ...]
    unknown: int
    mixed_cells: str = ""

    @property
    def whole(self) -> bool:
        """True if every file is there and unchanged, and all belong together."""
        return not self.wrong and not self.mixed_cells

    @property
    def damaged(self) -> tuple[tuple[str, str], ...]:
        """(name, problem) of each file that was whole once."""
        return tuple((name, problem) for name, problem in self.wrong if problem != NEVER_FINISHED)

    def unfinished(self) -> dict[int, int]:
        """Return the number of files that were never finished, by camera, for cameras that lack any."""
        lacking = {name for name, problem in self.wrong if problem == NEVER_FINISHED}
        counts = (
            (c, sum(name in lacking for name in camera_files(self.manifest, c))) for c in range(self.manifest.n_cameras)
        )
        return {c: count for c, count in counts if count} if lacking else {}


def verify(out: Path, threads: int, progress: Callable[[int, int], None]) -> Verification:
    """Read every file of an array.

    Args:
        out: output folder of a render, or its manifest.
        progress: called with the numbers of files read so far and of all files.

    Raises:
        OutputError: the manifest or a record cannot be read.
    """
    manifest = read_manifest(out)
    records = read_records(manifest.directory, manifest.fingerprint)
    checksums = records.checksums()
    names = [file.relative_to(manifest.directory).as_posix() for file in array_files(manifest)]

    def check(name: str) -> list[tuple[str, str]]:
        if name in checksums:
            return list(find_damage(manifest.directory, checksums, [name]))
        return list(_check_without_checksum(manifest, name))

    wrong: list[tuple[str, str]] = []
    with TaskPool(threads, thread_name_prefix="verify") as pool:
        for done, found in enumerate(pool.map(check, names), start=1):
            wrong += found
            progress(done, len(names))
    unknown = len(set(names) - set(checksums)) - sum(1 for name, _ in wrong if name not in checksums)
    mixed = mixed_cells(records.runs)
    return Verification(manifest=manifest, files=len(names), wrong=tuple(wrong), unknown=unknown, mixed_cells=mixed)


def find_damage(
    folder: Path, checksums: Mapping[str, tuple[int, str]], names: Iterable[str]
) -> Iterator[tuple[str, str]]:
    """Yield (name, problem) of each file that has changed since it was finished, in the order of `names`."""
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


def _check_without_checksum(manifest: Manifest, name: str) -> Iterator[tuple[str, str]]:
    """Yield the problem of a file that no record lists, if it is no image of the right size."""
    path = manifest.directory / name
    if not os.path.isfile(path):
        yield name, NEVER_FINISHED
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
    """The part of a frame array that lies in the output folder.

    Attributes:
        records: entries whose files are all whole.
        damaged: (name, problem) of each file that was finished and is missing or has changed.
    """

    records: ArrayRecords
    damaged: tuple[tuple[str, str], ...] = ()

    @property
    def images(self) -> int:
        """Number of whole images."""
        return sum(len(lights) for lights in _lights_by_camera(self.records).values())

    def missing(self, cameras: Sequence[int], lights: range) -> list[int]:
        """Cameras, in the given order, that lack an image at one of the light positions."""
        done = _lights_by_camera(self.records)
        return [c for c in cameras if not set(lights) <= done.get(c, set())]

    def missing_images(self, cameras: Sequence[int], n_lights: int) -> int:
        """Number of images that some cameras lack."""
        done = _lights_by_camera(self.records)
        return sum(n_lights - len(done.get(c, ())) for c in cameras)


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
    """Read all records of an array and compare the files that they list; damaged files do not count.

    Args:
        cameras: compare only the files of these, and trust the records of all others; None: compare all.
        scanning: called with the number of files before the first is read.

    Raises:
        OutputError: a record cannot be read.
    """
    records = read_records(folder, fingerprint)
    checksums = records.checksums()

    read = [entry for entry in records.entries if cameras is None or entry.c in cameras]
    if files := sum(len(entry.files) for entry in read):
        scanning(files)

    def problems(entry: Entry) -> list[tuple[str, str]]:
        return list(find_damage(folder, checksums, entry.files))

    with TaskPool(threads, thread_name_prefix="verify") as pool:
        found = list(pool.map(problems, read))
    bad = {id(entry) for entry, wrong in zip(read, found, strict=True) if wrong}
    whole = tuple(entry for entry in records.entries if id(entry) not in bad)
    return OnDisk(
        records=replace(records, entries=whole), damaged=tuple(problem for wrong in found for problem in wrong)
    )
