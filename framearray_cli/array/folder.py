"""Whose folder it is: the files of one frame array never mix with those of another."""

import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from framearray_cli import __version__
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import make_folder, reason
from framearray_cli.base.forms.schema import toml_key

from .manifest import FILE_NAME, Manifest, array_files
from .manifest_toml import read_manifest
from .record import FOLDER, record_files

# Differences that a message tells, and how long the values of one may be.
MOST_TOLD, LONGEST_SHOWN = 4, 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """What decides every byte of an array's files.

    Attributes:
        name: of the job.
        fingerprint: of all that pixels depend on.
        scene: fingerprint of the scene alone.
        job: the job, a plain table.
    """

    name: str
    fingerprint: str
    scene: str
    job: dict[str, Any]


def check_folder(folder: Path, new: Identity, *, restart: bool) -> Manifest | None:
    """The array that lies in a folder, if any, once it is known that it may be written to or removed.

    Raises:
        OutputError: it may not, or its manifest cannot be read.
    """
    old = read_array(folder)
    if old is not None and not restart and (changed := differences(old, new)):
        raise OutputError(f"{folder}: {in_the_way(old, changed)}")
    return old


def claim_folder(folder: Path, new: Identity, *, restart: bool) -> int:
    """Make a folder ready for a frame array, and remove what lies there if that is wished.

    Args:
        restart: remove the array in the folder first, all files that its manifest lists and nothing else.

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


def differences(old: Manifest, new: Identity) -> list[str]:
    """What keeps a job from giving the very files that a manifest lists; nothing where it gives them.

    Where job and scene lie, and the machine that renders, play no part.
    """
    found = []
    if old.version != __version__:
        found.append(f"program: {old.version} there, {__version__} now")
    found += _changes(_relevant(old.job), _relevant(new.job))
    if old.scene.get("fingerprint", new.scene) != new.scene:
        found.append("scene: another model, texture or material")
    if not found and (old.name, old.fingerprint) != (new.name, new.fingerprint):
        found.append("job or scene")
    return found


def _relevant(job: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a job's table that files depend on."""
    table: dict[str, Any] = json.loads(json.dumps({k: v for k, v in job.items() if k != "render"}, default=str))
    for section, key in (("output", "directory"), ("scene", "file")):
        table.get(section, {}).pop(key, None)
    return table


def _changes(old: Mapping[str, Any], new: Mapping[str, Any], place: str = "") -> list[str]:
    """The keys that two tables disagree on, with both values where these are short."""
    found = []
    for key in dict.fromkeys((*old, *new)):
        a, b = old.get(key), new.get(key)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            found += _changes(a, b, f"{place}{toml_key(key)}.")
        elif a != b:
            both = f": {_short(a)} there, {_short(b)} now"
            found.append(f"{place}{toml_key(key)}{both if len(both) < LONGEST_SHOWN else ''}")
    return found


def _short(value: Any) -> str:
    return "nothing" if value is None else json.dumps(value)


def in_the_way(old: Manifest, changed: Sequence[str]) -> str:
    """Say what lies in a folder, what of it differs, and what can be done."""
    images = f"{old.n_cameras} x {' x '.join(map(str, old.axes.values()))} images"
    more = f" and {len(changed) - MOST_TOLD} more" if len(changed) > MOST_TOLD else ""
    return (
        f"holds another frame array, {old.name!r} with {images}, made by a different job or from a different scene "
        f"({'; '.join(changed[:MOST_TOLD])}{more}); "
        "choose another folder with --output, or remove that array with --restart"
    )


def free_space(folder: Path) -> int:
    """Bytes free on the disk of a folder, or of the nearest one above it that exists."""
    return shutil.disk_usage(_existing(folder)).free


def free_files(folder: Path) -> int | None:
    """How many more files the disk of a folder takes, however small; None where it does not count them."""
    if not hasattr(os, "statvfs"):  # Windows
        return None
    disk = os.statvfs(_existing(folder))
    return disk.f_favail if disk.f_files else None


def _existing(folder: Path) -> Path:
    """A folder, or the nearest one above it that exists."""
    # unlike Path.exists, os.path.exists is false for a name that is too long
    while not os.path.exists(folder) and folder != folder.parent:
        folder = folder.parent
    return folder


def remove_array(old: Manifest) -> int:
    """Remove all files that a manifest lists, and the manifest last; returns how many there were.

    Raises:
        OSError: one of them cannot be removed.
        OutputError: a link within the folder leads to one elsewhere; then none is removed.
    """
    removed, files = 0, (*array_files(old), *record_files(old.directory), old.directory / FILE_NAME)
    whole = old.directory.resolve()
    for folder in {file.parent for file in files} - {old.directory}:
        if not folder.resolve().is_relative_to(whole):
            raise OutputError(f"{folder}: leads out of the folder of the array; remove what lies there yourself")
    for file in files:
        if os.path.lexists(file) and not file.is_dir():
            file.unlink()
            removed += 1
    with suppress(OSError):  # somebody else's files in it
        (old.directory / FOLDER).rmdir()
    return removed
