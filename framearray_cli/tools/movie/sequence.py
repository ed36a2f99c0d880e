"""Write a numbered image sequence, whole or not at all; images that stay as they are become hard links."""

import os
import re
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import get_args

import numpy as np

from framearray_cli.array.images.attributes import Attribute, frame_attributes
from framearray_cli.array.images.images import (
    FOR_SCREENS,
    Extension,
    ImageFormat,
    format_name,
    read_image,
    write_codes,
    write_image,
)
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import folder_for, reason, temporary_folder

from .look import Look, place_text, shown
from .timeline import Shot, Timeline


def sequence_pattern(target: Path, own_suffix: str, movies: Sequence[str]) -> Path:
    """Find the pattern of a sequence: a path whose name has one run of "#".

    Args:
        target: as the user gave it.
        own_suffix: of the array's images.
        movies: suffixes of movies, for the message.

    Raises:
        OutputError: it is no pattern.
    """
    if not target.suffix or os.path.isdir(target):
        return target / f"frame.####{own_suffix}"
    images = ", ".join(f".{name}" for name in get_args(Extension))
    if format_name(target) not in get_args(Extension):
        raise OutputError(f"{target}: expected {', '.join(movies)} (a movie), {images} (numbered images) or a folder")
    if len(re.findall("#+", target.name)) != 1:
        raise OutputError(f'{target}: expected a name with "####" where the frame number goes, as in frame.####.png')
    return target


def check_look(pattern: Path, look: Look) -> None:
    """Refuse to change radiance.

    Raises:
        OutputError: a look was asked for, and the format keeps radiance.
    """
    if look.changes and format_name(pattern) not in FOR_SCREENS:
        raise OutputError(
            f"{pattern}: {look.changes[0]} changes movies, PNG and JPEG alone; {pattern.suffix} keeps the radiance"
        )


def write_sequence(
    pictures: Pictures, line: Timeline, pattern: Path, look: Look, report: Callable[[int, int], None]
) -> None:
    """Write all frames into a folder beside the place, then move them there.

    Raises:
        OutputError: they cannot be written, or an earlier sequence lies there that is longer.
    """
    before, digits, after = re.split("(#+)", pattern.name)
    names = [f"{before}{k:0{len(digits)}d}{after}" for k in range(len(line.shots))]
    _check_leftovers(pattern.parent, before, after, set(names))
    try:
        with folder_for(pattern.parent), temporary_folder(pattern.parent, before) as part:
            last: tuple[Shot, Relight, Path] | None = None
            for k, (name, shot, relight) in enumerate(zip(names, line.shots, line.relights, strict=True)):
                if last is not None and last[:2] == (shot, relight):  # a held picture is made once
                    link(last[2], part / name)
                else:
                    _write_frame(pictures, shot, relight, part / name, line.fps, look)
                    last = (shot, relight, part / name)
                report(k + 1, len(names))
            _move(names, part, pattern.parent)
    except OSError as error:
        raise OutputError(f"{pattern}: cannot be written: {reason(error)}") from error


def _check_leftovers(folder: Path, before: str, after: str, names: set[str]) -> None:
    """Refuse to leave frames of an earlier, longer sequence behind the last one of this."""
    number = re.compile(re.escape(before) + r"\d+" + re.escape(after))
    entries = sorted(entry.name for entry in folder.iterdir()) if os.path.isdir(folder) else []
    left = [name for name in entries if number.fullmatch(name) and name not in names]
    if left:
        raise OutputError(
            f"{folder / left[0]}: belongs to an earlier sequence, with {len(left)} files that this one would not "
            "replace; delete them or choose another name"
        )


def _move(names: Sequence[str], part: Path, folder: Path) -> None:
    """Move all frames; an interrupt meanwhile is obeyed when that is done, a few milliseconds later."""
    try:
        for name in names:
            (part / name).replace(folder / name)
    except OSError:
        raise
    except BaseException:
        for name in names:
            with suppress(FileNotFoundError):  # was moved before
                (part / name).replace(folder / name)
        raise


def link(source: Path, target: Path) -> None:
    """Give a file a second name; where the file system cannot do that, copy it."""
    try:
        target.hardlink_to(source)
    except (OSError, NotImplementedError):  # another disk, FAT, too many links
        shutil.copyfile(source, target)


def _write_frame(pictures: Pictures, shot: Shot, relight: Relight, target: Path, fps: Fraction, look: Look) -> None:
    """Link one image, or compose and convert it where the format, the light or the look differs."""
    source = pictures.whole_file(shot.c, shot.positions, relight)
    if source is not None and format_name(source) == format_name(target) and not look.changes:
        read_image(source)  # a damaged image must not slip into the sequence
        link(source.resolve(), target)
        return
    image = pictures.picture(shot.c, shot.positions, relight)
    extension: Extension = format_name(target)  # type: ignore[assignment]  # checked by sequence_pattern
    attributes = _attributes(pictures.manifest, shot, fps)
    if format_name(target) in FOR_SCREENS:
        codes = shown(image, look, place_text(pictures.manifest, shot))
        write_codes(target, codes, ImageFormat(format=extension), attributes)
    else:
        write_image(target, np.ascontiguousarray(image), ImageFormat(format=extension), attributes)


def _attributes(manifest: Manifest, shot: Shot, fps: Fraction) -> dict[str, Attribute]:
    """What the file of a frame says about itself."""
    camera = manifest.cameras[shot.c]
    whole = len(shot.positions) == 1 and shot.positions[0] == int(shot.positions[0])
    attributes = frame_attributes(
        world_from_camera=camera.matrix,
        fov_deg=camera.fov,
        resolution=manifest.resolution,
        fps=fps,
        c=shot.c,
        l=int(shot.positions[0]) if whole else None,
        software=f"framearray {manifest.version}",
    )
    return attributes if whole else attributes | {"framearray:place": place_text(manifest, shot)}
