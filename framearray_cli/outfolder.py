"""Whose folder it is: the files of one frame array never mix with those of another."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

from .errors import OutputError
from .files import make_folder, reason
from .manifest import FILE_NAME, Manifest, array_files
from .manifestfile import read_manifest


def claim_folder(folder: Path, name: str, fingerprint: str, output: dict[str, Any], *, restart: bool) -> int:
    """Make a folder ready for a frame array, and remove what lies there if that is wished.

    The array is the same as the one in the folder if name, fingerprint and the job's output table, but for its
    directory, are equal. Its images would be the same files: they are simply written again.

    Args:
        name, fingerprint, output: of the array that is to be written; `output` is the job's table.
        restart: remove the array in the folder first, all files that its manifest lists and nothing else.

    Returns:
        Number of files removed.

    Raises:
        OutputError: another array lies there, its manifest cannot be read, or the folder cannot be written to.
    """
    old = read_array(folder)
    if old is not None and not restart and not is_same(old, name, fingerprint, output):
        raise OutputError(f"{folder}: {in_the_way(old)}")
    make_folder(folder)
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
        return remove_array(old) if old is not None and restart else 0
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written to: {reason(error)}") from error


def read_array(folder: Path) -> Manifest | None:
    """The manifest in a folder; None without one.

    Raises:
        OutputError: there is one and it cannot be read.
    """
    try:
        if not (folder / FILE_NAME).exists():
            return None
    except OSError as error:
        raise OutputError(f"{folder}: cannot be read: {reason(error)}") from error
    try:
        return read_manifest(folder)
    except OutputError as error:
        known = str(error).split(";")[0]
        raise OutputError(f"{known}; remove that file, or choose another folder with --output") from error


def is_same(old: Manifest, name: str, fingerprint: str, output: dict[str, Any]) -> bool:
    """Whether a job gives the very files that a manifest lists."""
    return (old.name, old.fingerprint, _format(old.job.get("output", {}))) == (name, fingerprint, _format(output))


def in_the_way(old: Manifest) -> str:
    """Say what lies in a folder, and what can be done."""
    images = f"{old.n_cameras} x {' x '.join(map(str, old.axes.values()))} images"
    return (
        f"holds another frame array, {old.name!r} with {images}, made by a different job or from a different scene; "
        "choose another folder with --output, or remove that array with --restart"
    )


def free_space(folder: Path) -> int:
    """Bytes free on the disk of a folder, or of the nearest one above it that exists."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return shutil.disk_usage(folder).free


def remove_array(old: Manifest) -> int:
    """Remove all files that a manifest lists, and the manifest last; returns how many there were.

    Raises:
        OSError: one of them cannot be removed.
    """
    removed = 0
    for file in (*array_files(old), old.directory / FILE_NAME):
        if file.is_file() or file.is_symlink():
            file.unlink()
            removed += 1
    return removed


def _format(output: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in output.items() if key != "directory"}
