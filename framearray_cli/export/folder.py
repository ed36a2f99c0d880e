"""A folder that appears whole or not at all, and the pictures in it."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import OutputError
from ..files import make_folder, reason
from ..imageattributes import frame_attributes
from ..images import ImageFormat, write_image
from ..pictures import Pictures
from .selection import ExportedFrame

_SAME = {"jpeg": "jpg", "tiff": "tif"}


@contextmanager
def whole_folder(target: Path, mark: str, *, force: bool) -> Iterator[Path]:
    """Yield a folder to write into; on success it becomes `target`, on any failure it is removed.

    Args:
        target: must not exist, or be empty; with `force` it may hold an earlier export.
        mark: a file that every such export has, so that `force` removes nothing else.
        force: put the new folder in place of the old one.

    Raises:
        OutputError: something else is there, or the system refused to write.
    """
    old = _in_the_way(target, mark, force)
    part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    aside = part.with_suffix(".old")
    try:
        make_folder(target.parent)
        part.mkdir()
        yield part
        if old:
            target.rename(aside)
        elif os.path.isdir(target):
            target.rmdir()
        part.rename(target)
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        if os.path.isdir(aside) and not os.path.exists(target):
            with suppress(OSError):
                aside.rename(target)
        if isinstance(error, OSError):
            raise OutputError(f"{target}: cannot be written: {reason(error)}") from error
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _in_the_way(target: Path, mark: str, force: bool) -> bool:
    """Whether an earlier export is to be replaced."""
    if os.path.lexists(target) and (os.path.islink(target) or not os.path.isdir(target)):
        raise OutputError(f"{target}: a file of that name is there; choose another name")
    if not os.path.isdir(target) or not any(target.iterdir()):
        return False
    if not (target / mark).is_file():
        raise OutputError(f"{target}: holds other files, and no {mark} of an earlier export; choose another folder")
    if not force:
        raise OutputError(f"{target}: an earlier export is there; choose another folder, or give --force to replace it")
    return True


def place_picture(
    pictures: Pictures, frame: ExportedFrame, target: Path, image_format: ImageFormat, *, copy: bool
) -> None:
    """Put one picture into a folder: a link to the array's own file where that is the very picture, else written.

    Args:
        pictures: of the array.
        target: the file; a link to it is made where the disk allows one, unless a copy is wanted.
        image_format: what is wanted.
        copy: never a link.

    Raises:
        OutputError: a file of the array is missing or damaged, or the target cannot be written.
    """
    manifest = pictures.manifest
    image = pictures.picture(frame.c, frame.place)  # also where it is linked: a damaged one must not slip in
    source = pictures.whole_file(frame.c, frame.place)
    if source is not None and not image_format.exposure and _format(source) == image_format.format:
        with suppress(OSError):
            if not copy:
                os.link(source, target)
                return
        shutil.copyfile(source, target)
        return
    camera = manifest.cameras[frame.c]
    attributes = frame_attributes(
        world_from_camera=camera.matrix,
        fov_deg=camera.fov,
        resolution=manifest.resolution,
        fps=manifest.fps,
        c=frame.c,
        l=frame.place[0],
        software=f"framearray {manifest.version}",
    )
    write_image(target, image, image_format, attributes)


def _format(path: Path) -> str:
    suffix = path.suffix.lower()[1:]
    return _SAME.get(suffix, suffix)
