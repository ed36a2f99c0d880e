"""Write a numbered image sequence; images that need no change become hard links."""

import os
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import get_args

from framearray_cli.array.images import FOR_SCREENS, Extension, format_name
from framearray_cli.array.integrity import REMEDY
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import folder_for, reason, temporary_folder
from framearray_cli.base.units import agree, counted

from ..progress import Progress
from .frames import link_or_copy, write_frame
from .look import Look
from .timeline import Shot, Timeline


def sequence_pattern(target: Path, own_suffix: str, movies: Sequence[str]) -> Path:
    """Return the pattern of a sequence: a path whose name has one run of "#".

    Args:
        target: as the user gave it.
        own_suffix: of the array's images.
        movies: suffixes of movies, for the message.

    Raises:
        OutputError: the target is no pattern.
    """
    if not target.suffix or os.path.isdir(target):
        return target / f"frame.####{own_suffix}"
    images = ", ".join(f".{name}" for name in get_args(Extension))
    if format_name(target) not in get_args(Extension):
        raise OutputError(f"{target}: expected {', '.join(movies)} (a movie), {images} (numbered images) or a folder")
    if len(re.findall("#+", target.name)) != 1:
        raise OutputError(f'{target}: expected a name with "####" where the frame number goes, as in frame.####.png')
    return target


def check_layers(pattern: Path, manifest: Manifest, line: Timeline) -> None:
    """Refuse layers in a format that has no room for them, and of an array that lacks them.

    Raises:
        OutputError: the sequence is no EXR; the array has neither groups nor layers; a file of layers is missing.
    """
    if format_name(pattern) != "exr":
        raise OutputError(f"{pattern}: expected frame.####.exr with --layers; no other format holds layers")
    if not manifest.layers and not manifest.groups:
        where = f"{manifest.directory}: expected layers or groups of lights for --layers, found neither"
        raise OutputError(f"{where}; render again with output.layers = true")
    wanted = sorted({layers_path(manifest, shot.c) for shot in line.shots}) if manifest.layers else []
    missing = [path for path in wanted if not os.path.isfile(path)]
    if missing:
        gone = (
            f"{len(missing):,} of {counted(len(wanted), 'file')} of layers {agree(len(missing), 'is', 'are')} missing"
        )
        raise OutputError(f"{manifest.directory}: {gone}; the first is {missing[0].name}; {REMEDY}")


def check_look(pattern: Path, look: Look) -> None:
    """Refuse a look for a format that keeps radiance.

    Raises:
        OutputError: the look changes pictures, and the format keeps radiance.
    """
    if look.changes and format_name(pattern) not in FOR_SCREENS:
        raise OutputError(
            f"{pattern}: {look.changes[0]} changes only movies, PNG and JPEG; {pattern.suffix} keeps the radiance"
        )


def write_sequence(
    pictures: Pictures, line: Timeline, pattern: Path, look: Look, report: Progress, *, layered: bool = False
) -> None:
    """Write all frames into a temporary folder inside the target folder, then move them out of it.

    Args:
        layered: see `write_frame`.

    Raises:
        OutputError: the system refuses to write.
    """
    before, names = pattern.name.partition("#")[0], _names(pattern, len(line.shots))
    try:
        with folder_for(pattern.parent), temporary_folder(pattern.parent, before) as part:
            last: tuple[Shot, Relight, Path] | None = None
            for k, (name, shot, relight) in enumerate(zip(names, line.shots, line.relights, strict=True)):
                if last is not None and last[:2] == (shot, relight):  # a held picture is composed once
                    link_or_copy(last[2], part / name)
                else:
                    write_frame(pictures, shot, relight, part / name, line.fps, look, layered=layered)
                    last = (shot, relight, part / name)
                report(k + 1, len(names))
            _move(names, part, pattern.parent)
    except OSError as error:
        raise OutputError(f"{pattern}: cannot be written: {reason(error)}") from error


def _names(pattern: Path, n: int) -> list[str]:
    """Name the files of n frames."""
    before, digits, after = re.split("(#+)", pattern.name)
    return [f"{before}{k:0{len(digits)}d}{after}" for k in range(n)]


def check_earlier(pattern: Path, n: int, *, force: bool) -> None:
    """Refuse a folder that holds an earlier sequence of that name.

    Args:
        n: frames of the sequence to write.
        force: replace an earlier sequence; but not one whose last frames would follow the last one of this.

    Raises:
        OutputError: there is one.
    """
    folder, names = pattern.parent, set(_names(pattern, n))
    before, _, after = re.split("(#+)", pattern.name)
    number = re.compile(re.escape(before) + r"\d+" + re.escape(after))
    entries = sorted(entry.name for entry in folder.iterdir()) if os.path.isdir(folder) else []
    found = [name for name in entries if number.fullmatch(name)]
    if left := [name for name in found if name not in names]:
        kept = f"{counted(len(left), 'file')} that this one would not replace"
        raise OutputError(
            f"{folder / left[0]}: belongs to an earlier sequence, with {kept}; delete them or choose another name"
        )
    if found and not force:
        kept = f"{counted(len(found), 'file')} of an earlier sequence"
        remedy = "give another name with --output, or --force to replace them"
        raise OutputError(f"{folder / found[0]}: is there already, with {kept}; {remedy}")


def _move(names: Sequence[str], part: Path, folder: Path) -> None:
    """Move all frames; an interrupt takes effect once all are moved, a few milliseconds later.

    The folder may hold other files, so no single rename can replace it. If the system refuses to move a frame, those
    moved before stay.
    """
    try:
        for name in names:
            (part / name).replace(folder / name)
    except OSError:
        raise
    except BaseException:
        for name in names:
            with suppress(FileNotFoundError):  # moved before the interrupt
                (part / name).replace(folder / name)
        raise
