"""The folder of an export, and the pictures in it."""

import os
import shutil
from contextlib import suppress
from pathlib import Path

from framearray_cli.array.exr import frame_attributes
from framearray_cli.array.images import COLOUR_ID, SCENE_LIGHT, WITH_ALPHA, ImageFormat, format_name, write_image
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import OutputError

from .selection import ExportedFrame


def find_earlier_export(target: Path, mark: str, *, force: bool) -> bool:
    """Return whether the target holds an earlier export, which the new one may replace.

    Args:
        target: must be missing or empty; with `force` it may hold an earlier export.
        mark: a file that every export of this kind has, so that `force` removes nothing else.

    Raises:
        OutputError: the target holds anything else.
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


def put_picture(
    pictures: Pictures, frame: ExportedFrame, target: Path, image_format: ImageFormat, *, copy: bool
) -> None:
    """Put one picture into a folder: link the array's own file where it is that picture, else write a new one.

    Args:
        pictures: of the array.
        target: the file to make.
        image_format: of the file.
        copy: copy the array's own file instead of linking it; a file is also copied where the disk has no links.

    Raises:
        OutputError: a file of the array is missing or damaged, or the target cannot be written.
    """
    manifest = pictures.manifest
    image = pictures.picture(frame.c, frame.lights)  # read even if it is linked: a damaged one must not slip in
    source = pictures.whole_file(frame.c, frame.lights)
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
        lens=camera.lens,
        resolution=manifest.resolution,
        fps=manifest.fps,
        c=frame.c,
        l=frame.lights[0],
        software=f"framearray {manifest.version}",
    )
    is_exr = image_format.format == "exr"
    attributes |= {COLOUR_ID: SCENE_LIGHT} if is_exr else {}
    more = pictures.differences(frame.c, frame.lights) if is_exr else None
    alpha = pictures.alpha(frame.c) if image_format.format in WITH_ALPHA else None
    write_image(target, image, image_format, attributes, more, alpha)
