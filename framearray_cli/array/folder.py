"""The output folder of one frame array: claimed, locked and emptied, so that its files never mix with another's.

Several runs may render into it at once if their cameras differ. Each run holds a lock of its own, `records/0-47.lock`,
which the system releases however the run ends. A guard, held for milliseconds, ensures that only one run at a time
reads the locks or writes the manifest.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from framearray_cli import __version__
from framearray_cli.base.errors import BusyError, OutputError
from framearray_cli.base.files import make_folder, reason
from framearray_cli.base.forms.schema import toml_key
from framearray_cli.base.platform import free_inodes
from framearray_cli.base.units import counted

from .celltable import table_file
from .manifest import FILE_NAME, MAIN_AXIS, SENSORS, Manifest, array_files
from .manifest_toml import read_manifest, write_manifest
from .places import parse_places
from .record import FOLDER, MOST, record_file, record_files
from .stripfiles import strip_files

# Number of differences that a message lists, and the longest text of two values.
MOST_REPORTED, LONGEST_SHOWN = 4, 60
# Seconds that a run waits for the guard.
PATIENCE = 60.0
FREE = ("render", "sensors")  # tables of a job that no image depends on
LOSSLESS = ("none", "rle", "zip", "zips", "piz")  # kinds of compression: each file names its own, and holds all pixels

# Keys that files depend on only if another key of their table has one of these values.
NEEDS: dict[tuple[str, str], tuple[str, Collection[object]]] = {
    ("output", "compression"): ("format", ("exr",)),
    ("output", "half"): ("format", ("exr",)),
    ("output", "quality"): ("format", ("jpg",)),
    ("output", "exposure"): ("format", ("png", "jpg")),
    ("output", "fps"): ("format", ()),  # files hold it, but no pixel depends on it
    ("obscurance", "tau"): ("falloff", ("exponential",)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """All that determines the bytes of an array's files.

    Attributes:
        name: of the job.
        fingerprint: of all that pixels depend on.
        scene: fingerprint of only the scene.
        job: the job as a plain table.
    """

    name: str
    fingerprint: str
    scene: str
    job: dict[str, Any]


def check_folder(folder: Path, new: Identity, *, restart: bool) -> Manifest | None:
    """Return the array in a folder, if any, after checking that it may be completed or removed.

    Raises:
        OutputError: another array lies there, or its manifest cannot be read.
    """
    old = read_array(folder)
    if old is not None and not restart and (changed := differences(old, new)):
        raise OutputError(f"{folder}: {conflict_text(old, changed)}")
    return old


def claim_folder(folder: Path, new: Identity, *, restart: bool) -> int:
    """Prepare a folder for a frame array; remove the array that lies there if asked.

    Args:
        restart: remove the array in the folder first: the files that its manifest lists, and no others.

    Returns:
        Number of files removed.

    Raises:
        OutputError: another array lies there, its manifest cannot be read, or the folder cannot be written to.
    """
    old = check_folder(folder, new, restart=restart)
    make_folder(folder)
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
        return remove_array(old) if old is not None and restart else 0
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written to: {reason(error)}") from error


def read_array(folder: Path) -> Manifest | None:
    """Read the manifest in a folder; None if there is none.

    Raises:
        OutputError: it cannot be read.
    """
    try:
        os.stat(folder / FILE_NAME)  # unlike Path.exists from Python 3.14 on, it says what is wrong with a name
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise OutputError(f"{folder}: cannot be read: {reason(error)}") from error
    try:
        return read_manifest(folder)
    except OutputError as error:
        known = str(error).split(";")[0]
        raise OutputError(f"{known}; remove that file, or choose another folder with --output") from error


def differences(old: Manifest, new: Identity) -> list[str]:
    """List why a job would not produce the images that a manifest lists; empty if it would.

    The paths of job and scene, the machine that renders, and values that change no pixel are ignored.
    """
    found = []
    if old.version != __version__:
        found.append(f"program: {old.version} there, {__version__} now")
    ignored = metadata_of(old.job).keys() & metadata_of(new.job).keys()
    found += _changes(_relevant(old.job, ignored), _relevant(new.job, ignored))
    if old.scene.get("fingerprint", new.scene) != new.scene:
        found.append("scene: another model, texture or material")
    if not found and (old.name, old.fingerprint) != (new.name, new.fingerprint):
        found.append("job or scene")
    return found


def metadata_of(job: Mapping[str, Any]) -> dict[tuple[str, str], Any]:
    """Return the values of a job's table that change no pixel: (table, key) -> value."""
    found = {}
    for (section, key), (other, values) in NEEDS.items():
        table = job.get(section)
        if isinstance(table, Mapping) and key in table and table.get(other) not in values:
            found[section, key] = table[key]
    output = job.get("output")
    if isinstance(output, Mapping) and output.get("compression") in LOSSLESS:
        found["output", "compression"] = output["compression"]
    return found


def _relevant(job: Mapping[str, Any], ignored: Iterable[tuple[str, str]]) -> dict[str, Any]:
    """Return the part of a job's table that pixels and file names depend on, without keys that are to be ignored."""
    table: dict[str, Any] = json.loads(json.dumps({k: v for k, v in job.items() if k not in FREE}, default=str))
    for section, key in (("output", "directory"), ("scene", "file"), ("scene", "folders"), *ignored):
        table.get(section, {}).pop(key, None)
    return table


def _changes(old: Mapping[str, Any], new: Mapping[str, Any], place: str = "") -> list[str]:
    """List the keys whose values differ between two tables, with both values where these are short."""
    found = []
    for key in dict.fromkeys((*old, *new)):
        a: Any = old.get(key)
        b: Any = new.get(key)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            found += _changes(a, b, f"{place}{toml_key(key)}.")
        elif _are_alike(a, b):
            for k, (one, other) in enumerate(zip(a, b, strict=True)):
                found += _changes(one, other, f"{place}{toml_key(key)}[{k}].")
        elif a != b:
            both = f": {_short(a)} there, {_short(b)} now"
            found.append(f"{place}{toml_key(key)}{both if len(both) < LONGEST_SHOWN else ''}")
    return found


def _are_alike(a: Any, b: Any) -> bool:
    """Return True for two lists of as many tables, of the same types: sources, or keys."""
    if not (isinstance(a, list) and isinstance(b, list) and len(a) == len(b)):
        return False
    tables = all(isinstance(item, Mapping) for item in (*a, *b))
    return tables and [table.get("type") for table in a] == [table.get("type") for table in b]


def _short(value: Any) -> str:
    return "nothing" if value is None else json.dumps(value)


def conflict_text(old: Manifest, changed: Sequence[str]) -> str:
    """Word the conflict with the array in a folder: what it is, how it differs, and what to do."""
    axes = [counted(n, "light position") if axis == MAIN_AXIS else f"{n:,} of {axis}" for axis, n in old.axes.items()]
    images = " x ".join([counted(old.n_cameras, "camera position"), *axes])
    more = f" and {len(changed) - MOST_REPORTED} more" if len(changed) > MOST_REPORTED else ""
    return (
        f"holds another frame array, {old.name!r} with {images}, made by a different job or from a different scene "
        f"({'; '.join(changed[:MOST_REPORTED])}{more}); "
        "choose another folder with --output, or remove that array with --restart"
    )


def free_space(folder: Path) -> int:
    """Return the bytes free on the disk of a folder, which need not exist yet."""
    return shutil.disk_usage(_existing(folder)).free


def free_files(folder: Path) -> int | None:
    """Return the number of files that the disk of a folder can still hold; None if it has no such limit."""
    return free_inodes(_existing(folder))


def _existing(folder: Path) -> Path:
    """Return a folder, or its nearest ancestor that exists."""
    # unlike Path.exists, os.path.exists is false for a name that is too long
    while not os.path.exists(folder) and folder != folder.parent:
        folder = folder.parent
    return folder


def remove_array(old: Manifest) -> int:
    """Remove all files that a manifest lists, the manifest last; return how many were removed.

    Raises:
        OSError: one of them cannot be removed.
        OutputError: a link in the folder leads out of it; no file is removed.
    """
    folder, whole = old.directory, os.path.realpath(old.directory)
    waiting = (*record_files(folder), *strip_files(folder), table_file(folder))
    waiting += (folder / SENSORS,) if "sensors" in old.job else ()
    files = (*array_files(old), *waiting, folder / FILE_NAME)
    for place in {file.parent for file in files} - {folder}:
        if not Path(os.path.realpath(place)).is_relative_to(whole):
            raise OutputError(f"{place}: leads out of the folder of the array; remove what lies there yourself")
    found = [file for file in files if os.path.lexists(file) and not file.is_dir()]
    for file in found:
        file.unlink()
    with suppress(OSError):  # other files lie in it
        (folder / FOLDER).rmdir()
    return len(found)


class ArrayFolder:
    """An output folder, with locks on the cameras of this run."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._own = folder / FOLDER, Path()

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the guard of the folder; all other runs wait.

        Raises:
            OutputError: the folder cannot be written to, or another run does not release the guard.
        """
        make_folder(self._folder.parent)  # reports first what is in the way of the folder itself
        make_folder(self._folder)
        guard = self._folder / ".guard"
        try:
            with FileLock(guard, timeout=PATIENCE):
                yield
        except Timeout as error:
            raise OutputError(f"{guard}: another run has held it for {PATIENCE:.0f} s; end that run") from error
        except (OSError, NotImplementedError) as error:
            raise OutputError(f"{guard}: cannot be locked: {reason(error)}") from error

    @contextmanager
    def reserve(self, cameras: Sequence[int], text: str) -> Iterator[None]:
        """Lock some cameras against other runs; enter it within `exclusive`.

        Args:
            text: the cameras as a range.

        Raises:
            BusyError: another run renders some of them.
        """
        own = record_file(self._folder.parent, text).with_suffix(".lock")
        for other in self.other_locks():
            if not set(cameras).isdisjoint(_cameras_of(other)):
                raise BusyError(
                    f"{self._folder.parent}: another run is rendering cameras {other.stem} into this folder; "
                    "wait for it, or give both runs other cameras with --cameras"
                )
        lock = FileLock(own)
        lock.acquire(timeout=0)
        self._own = own
        try:
            yield
        finally:
            self._own = Path()
            with suppress(OSError):  # before the release: afterwards it might be the lock of another run
                own.unlink()
            lock.release()

    def require_no_other_run(self) -> None:
        """Refuse to go on while any other run renders into the folder.

        Raises:
            OutputError: another run does.
        """
        if held := self.other_locks():
            cameras = ", ".join(file.stem for file in held)
            raise OutputError(f"{self._folder.parent}: another run is rendering cameras {cameras} into this folder")

    def take_over_metadata(self, new: Identity, fps: float) -> list[str]:
        """Write values of a job that change no pixel into the manifest of the array, if they differ there.

        Files that exist keep theirs, such as the frame rate in the headers of EXR and PNG files.

        Returns:
            Notes for the user.

        Raises:
            OutputError: another run renders into the folder, or the manifest cannot be read or rewritten.
        """
        old, sensors = read_array(self._folder.parent), new.job.get("sensors")
        if changed := (old.job.get("sensors") if old else None) != sensors:
            (self._folder.parent / SENSORS).unlink(missing_ok=True)
        if old is None:
            return []
        before, now = metadata_of(old.job), metadata_of(new.job)
        if old.fps == fps and before == now and not changed:
            return []
        self.require_no_other_run()
        write_manifest(old.directory, replace(old, fps=fps, job=new.job))
        key = ("output", "compression")
        if new.job["output"]["format"] != "exr" or now.get(key) in (None, before.get(key)):
            return []
        kept = "files that are there keep theirs, which holds the same pixels"
        return [f"output.compression is {now[key]} now: {kept}"]

    def other_locks(self) -> list[Path]:
        """Return the locks that other runs hold, and remove those that no run holds."""
        held = []
        for file in sorted({*self._folder.glob("*.lock")} - {self._own}):
            lock = FileLock(file)
            try:
                lock.acquire(timeout=0)
            except Timeout:
                held.append(file)
                continue
            with suppress(OSError):
                file.unlink()
            lock.release()
        return held


def _cameras_of(lock: Path) -> Sequence[float]:
    """Return the cameras of another run; all, if its range is too long for a file name."""
    try:
        return parse_places(lock.stem, MOST)
    except ValueError:
        return range(MOST)
