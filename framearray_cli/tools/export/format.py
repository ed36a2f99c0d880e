"""A format of exports, and the folder and pictures that every export has."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from framearray_cli.array.images import (
    COLOUR_ID,
    SCENE_LIGHT,
    WITH_ALPHA,
    ImageFormat,
    format_name,
    link_or_copy,
    write_image,
)
from framearray_cli.array.pictures import Pictures, picture_attributes
from framearray_cli.base.errors import OutputError

from .points import PointCloud
from .selection import ExportedFrame, Selection

NO_POINTS = PointCloud(position=np.empty((0, 3)), codes=np.empty((0, 3), np.uint8), observations={})


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """An export with all pictures in its folder; the writer of its format adds the rest.

    Attributes:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.
        cloud: points of the scene, if the format has points and the array has layers.
        exposure: of the pictures, in stops.
        per_shard: pictures per file, in formats that pack them.
    """

    folder: Path
    selection: Selection
    files: Mapping[str, str]
    cloud: PointCloud | None = None
    exposure: float = 0.0
    per_shard: int = 1

    @property
    def names(self) -> dict[str, str]:
        """`files` without the folder `images`, for tables that are in it or imply it."""
        return {name: file.removeprefix("images/") for name, file in self.files.items()}

    @property
    def head(self) -> dict[str, float]:
        """The exposure as a table, empty without."""
        return {"exposure": self.exposure} if self.exposure else {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format.

    Attributes:
        mark: a file that every such export has: `--force` replaces no other folder.
        write: writes all that is not a picture. Raises OutputError if the pose of a camera is no rigid motion, layers
            are missing or damaged, or a file cannot be written.
        stem: the file of a picture, relative to the folder, without its suffix.
        suffix: of the folder.
        all_lights: True if the default is every light position, not the middle one.
        points: True if the format has points and depths of the scene.
        splits: True if the format has sets.
        rule: default of `--split`.
        images: image formats that readers of the format accept; none: all.
        one_source: True if each picture needs one source of light.
        check: refuses cameras or lights that the format cannot describe.
    """

    mark: str
    write: Callable[[Export], None]
    stem: Callable[[Selection, ExportedFrame], str] = lambda selection, frame: f"images/{frame.name}"
    suffix: str = ""
    all_lights: bool = True
    points: bool = False
    splits: bool = True
    rule: str = ""
    images: tuple[str, ...] = ()
    one_source: bool = False
    check: Callable[[Selection], None] = lambda selection: None


def find_earlier_export(target: Path, mark: str, *, force: bool) -> bool:
    """Return True if the target has an earlier export, which the new one may replace.

    Args:
        target: must be missing or empty; with `force` it may have an earlier export.
        mark: a file that every export of this format has, so that `force` removes nothing else.

    Raises:
        OutputError: the target has anything else.
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
    """Put one picture into a folder: link the array's own file if it is that picture, else write a new one.

    Args:
        copy: copy the array's own file instead of linking it.

    Raises:
        OutputError: a file of the array is missing or damaged, or the target cannot be written.
    """
    image = pictures.picture(frame.c, frame.lights)  # read even if it is linked: a damaged one must not slip in
    source = pictures.whole_file(frame.c, frame.lights)
    if source is not None and not image_format.exposure and format_name(source) == image_format.format:
        link_or_copy(source, target, copy=copy)
        return
    attributes, more = picture_attributes(pictures.manifest, frame.c, frame.lights[0]), None
    if image_format.format == "exr":
        attributes[COLOUR_ID], more = SCENE_LIGHT, pictures.differences(frame.c, frame.lights)
    alpha = pictures.alpha(frame.c) if image_format.format in WITH_ALPHA else None
    write_image(target, image, image_format, attributes, more, alpha)
