"""The folder of an export, and the pictures in it."""

import os
import shutil
from contextlib import suppress
from pathlib import Path

from framearray_cli.array.images.attributes import frame_attributes
from framearray_cli.array.images.images import ImageFormat, format_name, write_image
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import OutputError

from .selection import ExportedFrame


def earlier_export(target: Path, mark: str, *, force: bool) -> bool:
    """Return whether an earlier export is there, to be replaced.

    Args:
        target: must not exist, or be empty; with `force` it may hold an earlier export.
        mark: a file that every such export has, so that `force` removes nothing else.

    Raises:
        OutputError: something else is there.
    """
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
    if source is not None and not image_format.exposure and format_name(source) == image_format.format:
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
