"""Write a frame array as a folder that other tools read; all input is the manifest and the images it names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from framearray_cli.array.images.images import ImageFormat, require_writer
from framearray_cli.array.manifest import Manifest, ManifestLight, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.array.places import ALL_PLACES, MIDDLE_PLACE, read_indices
from framearray_cli.array.present import list_present, missing_text
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import whole_folder

from ..axes import read_light_indices
from ..mixing.mixer import SumOptions, open_pictures
from ..progress import Progress
from . import cinema, colmap, nerfstudio, rti
from .folder import find_earlier_export, put_picture
from .points import PointCloud, find_points, source_cameras
from .selection import Selection

ExportKind: TypeAlias = Literal["nerfstudio", "colmap", "cinema", "rti"]

EXPORT_KINDS: tuple[ExportKind, ...] = ("nerfstudio", "colmap", "cinema", "rti")
ALL_LIGHTS = ("cinema", "rti")  # take every light position by default, and no points
MOST_POINTS = 10_000  # a COLMAP model has some 25 bytes per point and image
_MARK_FILES = {
    "nerfstudio": nerfstudio.TRANSFORMS_FILE,
    "colmap": colmap.IMAGES_FILE,
    "cinema": cinema.TABLE_FILE,
    "rti": rti.LIGHTS_FILE,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportResult:
    """What an export holds.

    Attributes:
        target: the folder.
        n_cameras, n_lights: exported cameras, and light positions of each.
        n_points: in the point cloud.
        replaces: whether an earlier export was there.
        notes, warnings: for the user.
    """

    target: Path
    n_cameras: int
    n_lights: int
    n_points: int
    replaces: bool
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def export_array(
    out: Path,
    target: Path,
    kind: ExportKind,
    *,
    cameras: str = ALL_PLACES,
    light: str | None = None,
    at: Sequence[str] = (),
    image_format: ImageFormat | None = None,
    points: int = MOST_POINTS,
    sums: SumOptions = SumOptions(),  # noqa: B008  # frozen
    copy: bool = False,
    force: bool = False,
    dry_run: bool = False,
    progress: Progress | None = None,
) -> ExportResult:
    """Export the cameras that have all their images to another tool, as a folder that appears whole or not at all.

    Args:
        out: output folder of a render, or its manifest.
        target: the folder; cinema adds the suffix .cdb.
        kind: one of EXPORT_KINDS.
        cameras: places along the camera path, see `places.read_indices`.
        light: places along the first light axis; None: all for cinema and rti, the middle one for the others.
        at: "AXIS=PLACES" for the other axes; the default is as for `light`.
        image_format: of the pictures; None: PNG.
        points: in the point cloud, at most.
        sums: what pictures are sums of; those of all light positions are one picture per camera.
        copy: copy pictures of the array that could be linked.
        force: replace an earlier export.
        dry_run: check everything, and write nothing.
        progress: called after each picture.

    Raises:
        JobError: a place or an axis is unknown.
        OutputError: a file of the array is missing or damaged, or the target is in use or cannot be written.
    """
    manifest = read_manifest(out)
    selection = _select(manifest, kind, cameras, light, at)
    target, image_format = _full_name(target, kind), image_format or ImageFormat(format="png")
    require_writer(image_format.format)
    pictures, warnings = open_pictures(manifest, sums)
    selection = _one_light(selection, kind) if sums.collapses else selection
    has_cloud = kind not in ALL_LIGHTS and bool(manifest.layers)
    selection, left_out = _split_complete(pictures, selection, layers=has_cloud)
    replaces = find_earlier_export(target, _MARK_FILES[kind], force=force)
    cloud = None
    if not dry_run:
        with whole_folder(target, replace=replaces) as folder:
            files = _write_pictures(pictures, selection, folder / "images", image_format, copy=copy, progress=progress)
            cloud = _make_cloud(pictures, selection, image_format.exposure, points) if has_cloud else None
            _write_tables(folder, kind, selection, files, cloud, image_format.exposure)
    n_points = len(cloud.position) if cloud else 0
    n_cameras, n_lights = len(selection.cameras), len(selection.lights)
    return ExportResult(
        target=target, n_cameras=n_cameras, n_lights=n_lights, n_points=n_points, replaces=replaces,
        notes=() if dry_run else _notes(kind, bool(manifest.layers), n_points, points),
        warnings=(*warnings, *([f"left out: {left_out}"] if left_out else [])),
    )  # fmt: skip


def _select(manifest: Manifest, kind: ExportKind, cameras: str, light: str | None, at: Sequence[str]) -> Selection:
    """Read which cameras and light positions to export."""
    if kind not in EXPORT_KINDS:
        raise JobError("--format", [f"expected {', '.join(EXPORT_KINDS)}, got {kind!r}"])
    default = ALL_PLACES if kind in ALL_LIGHTS else MIDDLE_PLACE
    selection = Selection(
        manifest=manifest,
        cameras=tuple(sorted(read_indices("--cameras", cameras, manifest.n_cameras))),
        lights=tuple(sorted(read_light_indices(manifest, light, at, default))),
    )
    if kind == "rti":
        rti.check_lights(selection)
    return selection


def _one_light(selection: Selection, kind: ExportKind) -> Selection:
    """Return a selection with one place on the first axis, and no sources: its pictures are sums of all of them.

    Raises:
        JobError: the format needs a source per picture.
    """
    if kind == "rti":
        raise JobError("--format", ["expected another format than rti, as a sum of light has no direction"])
    lights = tuple(dict.fromkeys((0, *lights[1:]) for lights in selection.lights))
    return replace(selection, manifest=_without_sources(selection.manifest), lights=lights)


def _without_sources(manifest: Manifest) -> Manifest:
    """Return the manifest of pictures that no position of the sources describes."""

    def bare(lights: Sequence[ManifestLight]) -> tuple[ManifestLight, ...]:
        return tuple(replace(light, sources=()) for light in lights)

    groups = tuple(replace(group, lights=bare(group.lights)) for group in manifest.groups)
    return replace(manifest, lights=bare(manifest.lights), groups=groups)


def _split_complete(pictures: Pictures, selection: Selection, *, layers: bool) -> tuple[Selection, str]:
    """Return the cameras of a selection whose files are all there, and a text about the others; "" if there are none.

    Args:
        layers: whether the layers of each camera are needed too.

    Raises:
        OutputError: no camera is complete.
    """
    manifest, present = selection.manifest, list_present(selection.manifest)

    def is_complete(c: int) -> bool:
        more = [layers_path(manifest, c)] if layers else []
        return present.has(more) and all(present.has(pictures.files(c, lights)) for lights in selection.lights)

    complete = tuple(c for c in selection.cameras if is_complete(c))
    if len(complete) == len(selection.cameras):
        return selection, ""
    text = missing_text(set(selection.cameras) - set(complete), len(selection.cameras))
    if not complete:
        raise OutputError(f"{manifest.directory}: {text}")
    return replace(selection, cameras=complete), text


def _full_name(target: Path, kind: ExportKind) -> Path:
    """Add the suffix of a Cinema database where it is missing."""
    if target.name in ("", ".."):
        raise OutputError(f"{target}: expected the name of a folder to be made")
    if kind == "cinema" and target.suffix != cinema.DATABASE_SUFFIX:
        return target.with_name(f"{target.name}{cinema.DATABASE_SUFFIX}")
    return target


def _write_pictures(
    pictures: Pictures,
    selection: Selection,
    folder: Path,
    image_format: ImageFormat,
    *,
    copy: bool,
    progress: Progress | None,
) -> dict[str, str]:
    """Fill a new folder with the pictures; return name of a frame -> its file in the folder."""
    folder.mkdir()
    frames = selection.frames
    files = {frame.name: f"{frame.name}.{image_format.format}" for frame in frames}
    for done, frame in enumerate(frames, start=1):
        put_picture(pictures, frame, folder / files[frame.name], image_format, copy=copy)
        if progress:
            progress(done, len(frames))
    return files


def _write_tables(
    folder: Path,
    kind: ExportKind,
    selection: Selection,
    files: Mapping[str, str],
    cloud: PointCloud | None,
    exposure: float,
) -> None:
    """Write what describes the pictures: the files that tools of this kind read first."""
    from_folder = {name: f"images/{file}" for name, file in files.items()}
    if kind == "nerfstudio":
        nerfstudio.write_transforms(folder, selection, from_folder, cloud=cloud, exposure=exposure)
    elif kind == "colmap":
        colmap.write_model(folder, selection, files, cloud or _NO_POINTS)
    elif kind == "rti":
        rti.write_lights(folder, selection, files)
    else:
        cinema.write_table(folder, selection, from_folder)


_NO_POINTS = PointCloud(position=np.empty((0, 3)), codes=np.empty((0, 3), np.uint8), observations={})


def _make_cloud(pictures: Pictures, selection: Selection, exposure: float, wanted: int) -> PointCloud:
    """Find points, with the colours that they have under the first light position."""
    lights = selection.lights[0]
    bright = np.float32(2.0**exposure)
    colours = {c: srgb8_from_linear(pictures.picture(c, lights) * bright) for c in source_cameras(selection.cameras)}
    return find_points(selection.manifest, selection.cameras, colours, wanted)


def _notes(kind: ExportKind, layers: bool, n_points: int, wanted: int) -> tuple[str, ...]:
    if kind in ALL_LIGHTS or not wanted:
        return ()
    if not layers:
        return ("no points and no depth: the array was rendered without layers (output.layers)",)
    if n_points:
        return ()
    return ("no points: no two cameras see the same smooth surface; with samples.hits below 1 depth has holes",)
