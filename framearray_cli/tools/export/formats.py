"""The formats of exports: what each of them needs, how it names pictures, and what writes its tables."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from framearray_cli.array.images import FOR_SCREENS
from framearray_cli.base.files import write_bytes

from . import blender, cinema, colmap, huggingface, nerfstudio, olat, rti, shards
from .points import PointCloud
from .selection import ExportedFrame, Selection

ExportKind: TypeAlias = Literal["nerfstudio", "colmap", "cinema", "rti", "blender", "olat", "webdataset", "huggingface"]


@dataclass(frozen=True, slots=True)
class Written:
    """The pictures of an export, which lie in its folder.

    Attributes:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.
        cloud: points of the scene, if the format wants them and the array has layers.
        exposure: of the pictures, in stops.
    """

    folder: Path
    selection: Selection
    files: Mapping[str, str]
    cloud: PointCloud | None
    exposure: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format.

    Attributes:
        mark: a file that every such export has: `--force` replaces no other folder.
        write: writes all that is not a picture.
        stem: the file of a picture, relative to the folder, without its suffix.
        all_lights: whether the default is every light position, not the middle one.
        points: whether it takes points and depths of the scene.
        splits: whether it has sets.
        rule: default of `--split`.
        images: image formats that its readers take; none: all.
        check: refuses what the format cannot say.
    """

    mark: str
    write: Callable[[Written], None]
    stem: Callable[[Selection, ExportedFrame], str] = lambda selection, frame: f"images/{frame.name}"
    all_lights: bool = True
    points: bool = False
    splits: bool = True
    rule: str = ""
    images: tuple[str, ...] = ()
    check: Callable[[Selection], None] = lambda selection: None


def _nerfstudio(made: Written) -> None:
    nerfstudio.write_transforms(made.folder, made.selection, made.files, cloud=made.cloud, exposure=made.exposure)


def _colmap(made: Written) -> None:
    colmap.write_model(made.folder, made.selection, _names(made), made.cloud or _NO_POINTS)


def _rti(made: Written) -> None:
    rti.write_lights(made.folder, made.selection, _names(made))


def _blender(made: Written) -> None:
    blender.write_sets(made.folder, made.selection, made.files, exposure=made.exposure)
    if made.cloud is not None and len(made.cloud.position):
        write_bytes(made.folder / blender.POINTS_FILE, nerfstudio.ply(made.cloud, normals=True))


def _names(made: Written) -> dict[str, str]:
    """Return the files without the folder `images`, for tables that lie in it or imply it."""
    return {name: file.removeprefix("images/") for name, file in made.files.items()}


def _olat_stem(selection: Selection, frame: ExportedFrame) -> str:
    camera = selection.camera_name(frame.c)
    return f"{camera}/{frame.name.removeprefix(f'{camera}_')}"


_NO_POINTS = PointCloud(position=np.empty((0, 3)), codes=np.empty((0, 3), np.uint8), observations={})

FORMATS: Mapping[ExportKind, Format] = {
    "nerfstudio": Format(mark=nerfstudio.TRANSFORMS_FILE, write=_nerfstudio, all_lights=False, points=True),
    "colmap": Format(mark=colmap.IMAGES_FILE, write=_colmap, all_lights=False, points=True),
    "cinema": Format(
        mark=cinema.TABLE_FILE, write=lambda made: cinema.write_table(made.folder, made.selection, made.files)
    ),
    "rti": Format(
        mark=rti.LIGHTS_FILE, write=_rti, splits=False, check=lambda selection: rti.check_lights(selection, "an .lp")
    ),
    "blender": Format(
        mark=blender.TRAIN_FILE, write=_blender, stem=lambda selection, frame: f"{frame.part}/{frame.name}",
        all_lights=False, points=True, rule=blender.DEFAULT_RULE, images=("png",), check=blender.check_lens,
    ),
    "olat": Format(
        mark=olat.POSITIONS_FILE, stem=_olat_stem,
        check=lambda selection: rti.check_lights(selection, olat.DIRECTIONS_FILE),
        write=lambda made: olat.write_lights(made.folder, made.selection, made.files, exposure=made.exposure),
    ),
    "webdataset": Format(mark=shards.INDEX_FILE, write=lambda made: None),  # `ShardWriter` writes as pictures come
    "huggingface": Format(
        mark=huggingface.TRAIN_FILE,
        images=FOR_SCREENS,
        stem=lambda selection, frame: f"{huggingface.folder_of(frame)}/{frame.name}",
        write=lambda made: huggingface.write_metadata(
            made.folder, made.selection, made.files, exposure=made.exposure
        ),
    ),
}  # fmt: skip
EXPORT_KINDS: tuple[ExportKind, ...] = tuple(FORMATS)
