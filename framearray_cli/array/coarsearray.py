"""A coarse array inside the folder of the array that is being rendered: small pictures of some positions.

It lies in a hidden folder, and is a frame array with the same camera positions and fewer light positions. The run that
made it holds a lock there, and removes it at its end; the next run removes what a killed run left.
"""

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from filelock import FileLock, Timeout

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import make_folder, reason

from .manifest import FILE_NAME, Manifest
from .manifest_toml import read_manifest, write_manifest

COARSE_FOLDER = ".coarse"
_LOCK = "lock"
_KEY = "coarse"  # of the summary: light axis -> positions in the whole array


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseArray:
    """Small pictures of an array that is being rendered.

    Attributes:
        manifest: of the pictures, with all camera positions of the array and fewer light positions.
        places: light axis -> the positions of the array that these are, in rising order.
    """

    manifest: Manifest
    places: Mapping[str, Sequence[int]]


def write_coarse(folder: Path, manifest: Manifest, places: Mapping[str, Sequence[int]]) -> CoarseArray:
    """Write the manifest of a coarse array into its folder, before its pictures.

    Raises:
        OutputError: it cannot be written.
    """
    table = {axis: list(positions) for axis, positions in places.items()}
    manifest = replace(manifest, summary={_KEY: table}, directory=folder)
    write_manifest(folder, manifest)
    return CoarseArray(manifest=manifest, places=places)


def read_coarse(folder: Path, fingerprint: str) -> CoarseArray | None:
    """Return the coarse array in the folder of an array; None if there is none, or one of another job or scene."""
    path = folder / COARSE_FOLDER
    if not os.path.exists(path / FILE_NAME):
        return None
    try:
        manifest = read_manifest(path)
    except OutputError:  # removed meanwhile, or damaged: the page does without
        return None
    places = manifest.summary.get(_KEY)
    if not isinstance(places, dict) or {axis: len(found) for axis, found in places.items()} != manifest.axes:
        return None
    return CoarseArray(manifest=manifest, places=places) if manifest.fingerprint == fingerprint else None


@contextmanager
def coarse_folder(folder: Path) -> Iterator[Path | None]:
    """Make the folder of a coarse array, and remove it at the end of the block.

    Args:
        folder: of the array.

    Yields:
        The folder; None if another run has a coarse array there.

    Raises:
        OutputError: it cannot be written to.
    """
    path = folder / COARSE_FOLDER
    make_folder(path)
    lock = FileLock(path / _LOCK)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        yield None
        return
    except (OSError, NotImplementedError) as error:
        raise OutputError(f"{path}: cannot be locked: {reason(error)}") from error
    try:
        yield path
    finally:
        _remove(path, lock)


def remove_left_coarse(folder: Path) -> None:
    """Remove the coarse array that a killed run left in the folder of an array; keep it while that run goes on."""
    if os.path.isdir(folder / COARSE_FOLDER):
        with suppress(OSError, OutputError), coarse_folder(folder):  # where it cannot be removed, it harms nothing
            pass


def _remove(path: Path, lock: FileLock) -> None:
    """Remove a folder whose lock this process holds, the lock last: another run may wait for it."""
    if not os.path.islink(path):
        for file in path.iterdir():
            if file.name == _LOCK:
                continue
            if file.is_dir() and not file.is_symlink():
                shutil.rmtree(file, ignore_errors=True)
            else:
                with suppress(OSError):
                    file.unlink()
    with suppress(OSError):  # Windows removes no file that is open
        (path / _LOCK).unlink()
    lock.release()
    with suppress(OSError):
        (path / _LOCK).unlink()
    with suppress(OSError):
        path.rmdir()
