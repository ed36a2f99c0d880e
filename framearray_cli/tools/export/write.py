"""Write a frame array as a folder that other tools read; all input is the manifest and the images it names."""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
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
from framearray_cli.array.integrity import list_present, missing_text
from framearray_cli.array.manifest import ManifestLight, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures, picture_attributes
from framearray_cli.array.places import ALL_PLACES, MIDDLE_PLACE, read_indices
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import whole_folder

from .. import ExportResult, Progress
from ..axes import read_light_indices
from ..mixing import SumOptions, open_pictures
from . import FORMATS
from .format import Export, ExportedFrame, Format, PointCloud, Selection, only_group
from .points import find_points, source_cameras
from .splits import OPTION, SETS, read_splits, shared_samples


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """The content of an export.

    Attributes:
        kind: one of EXPORT_KINDS.
        cameras: places along the camera path, see `places.read_indices`.
        light: places along the first light axis; None: see `Format.all_lights`.
        at: "AXIS=PLACES" for the other axes; the default is as for `light`.
        group: export only the light of this group of sources, along its own axis.
        image_format: of the pictures.
        points: in the point cloud, at most; a COLMAP model has some 25 bytes per point and image.
        sums: pictures as sums of light positions; sums of all light positions leave one picture per camera.
        split: rules of sets for training, validation and testing, see `splits.py`; none: no sets.
        seed: of the shares of sets.
        copy: copy pictures of the array that could be linked.
    """

    kind: str
    cameras: str = ALL_PLACES
    light: str | None = None
    at: Sequence[str] = ()
    group: str | None = None
    image_format: ImageFormat = field(default_factory=lambda: ImageFormat(format="png"))
    points: int = 10_000
    sums: SumOptions = field(default_factory=SumOptions)
    split: tuple[str, ...] = ()
    seed: int = 0
    copy: bool = False


def export_array(
    out: Path,
    target: Path,
    options: ExportOptions,
    *,
    force: bool = False,
    progress: Progress = lambda done, total: None,
) -> tuple[ExportResult, tuple[str, ...], tuple[str, ...]]:
    """Export the cameras that have all their images to another tool, as a folder that appears whole or not at all.

    Args:
        out: output folder of a render, or its manifest.
        target: the folder.
        force: replace an earlier export.
        progress: called after each picture.

    Returns:
        The content of the export, notes, and warnings.

    Raises:
        JobError: an option does not fit the array.
        OutputError: a file of the array is missing or damaged, or the target is in use or cannot be written.
    """
    manifest = only_group(read_manifest(out), options.group)
    module, name = FORMATS[options.kind].split(".")
    chosen: Format = getattr(import_module(f".{module}", __package__), name)
    default, notes = ALL_PLACES if chosen.all_lights else MIDDLE_PLACE, list[str]()
    selection = Selection(
        manifest=manifest,
        cameras=tuple(sorted(read_indices("--cameras", options.cameras, manifest.n_cameras))),
        lights=tuple(sorted(read_light_indices(manifest, options.light, options.at, default, notes.append))),
    )
    chosen.check(selection)
    if target.name in ("", ".."):
        raise OutputError(f"{target}: expected the name of a folder to be made")
    if chosen.images and options.image_format.format not in chosen.images:
        expected = f"expected {' or '.join(chosen.images)} for readers of {options.kind}"
        raise JobError("--image-format", [f"{expected}, got {options.image_format.format}"])
    pictures, warnings = open_pictures(manifest, options.sums)
    has_cloud = chosen.points and bool(manifest.layers)
    complete, left_out = _split_complete(pictures, _summed(selection, chosen, options), layers=has_cloud)
    selection = _divide(complete, chosen, options)
    replaces = _find_earlier(target, chosen.mark, force=force)
    exposure = options.image_format.exposure
    with whole_folder(target, replace=replaces) as folder:
        frames = _write_pictures(pictures, selection, chosen, folder, options, progress)
        cloud = _make_cloud(pictures, selection, exposure, options.points) if has_cloud else None
        chosen.write(Export(folder=folder, selection=selection, frames=frames, cloud=cloud, exposure=exposure))
    counts, n_points = Counter(frame.part for frame in frames), len(cloud.position) if cloud else 0
    result = ExportResult(
        directory=str(target), format=options.kind, cameras=len(selection.cameras), lights=len(selection.lights),
        points=n_points, pictures=len(frames), sets={name: counts[name] for name in SETS if counts[name]},
    )  # fmt: skip
    return result, (*notes, *_notes(chosen, selection, n_points, options.points)), (*warnings, *left_out)


def _divide(selection: Selection, chosen: Format, options: ExportOptions) -> Selection:
    """Return the selection in sets, without the cameras and light positions that are in none."""
    if options.split and not chosen.splits:
        raise JobError(OPTION, [f"expected another format than {options.kind}, which has no sets"])
    rules = options.split or ((chosen.rule,) if chosen.rule else ())
    splits = read_splits(rules, options.seed, selection.manifest, selection.cameras, selection.lights)
    if splits is None:
        return selection
    frames = replace(selection, splits=splits).frames
    cameras, lights = {frame.c for frame in frames}, {frame.lights for frame in frames}
    return replace(selection, splits=splits, cameras=tuple(sorted(cameras)), lights=tuple(sorted(lights)))


def _summed(selection: Selection, chosen: Format, options: ExportOptions) -> Selection:
    """Return the selection with one place on the first axis, and no sources, if its pictures are sums of all places."""
    if not options.sums.collapses:
        return selection
    if chosen.one_source:
        expected = f"expected another format than {options.kind}, as a sum of light has no direction"
        raise JobError("--format", [expected])
    manifest, lights = selection.manifest, tuple(dict.fromkeys((0, *lights[1:]) for lights in selection.lights))

    def bare(lights: Sequence[ManifestLight]) -> tuple[ManifestLight, ...]:
        return tuple(replace(light, sources=()) for light in lights)

    groups = tuple(replace(group, lights=bare(group.lights)) for group in manifest.groups)
    return replace(selection, manifest=replace(manifest, lights=bare(manifest.lights), groups=groups), lights=lights)


def _split_complete(pictures: Pictures, selection: Selection, *, layers: bool) -> tuple[Selection, list[str]]:
    """Return the cameras of a selection with all pictures, perhaps layers too, and a warning about others."""
    manifest, present = selection.manifest, list_present(selection.manifest)

    def is_complete(c: int) -> bool:
        more = [layers_path(manifest, c)] if layers else []
        return present.has(more) and all(present.has(pictures.files(c, lights)) for lights in selection.lights)

    complete = tuple(c for c in selection.cameras if is_complete(c))
    if len(complete) == len(selection.cameras):
        return selection, []
    text = missing_text(set(selection.cameras) - set(complete), len(selection.cameras))
    if not complete:
        raise OutputError(f"{manifest.directory}: {text}")
    return replace(selection, cameras=complete), [f"left out: {text}"]


def _find_earlier(target: Path, mark: str, *, force: bool) -> bool:
    """Return True if the target has an earlier export, which `force` replaces; refuse a target with anything else."""
    if os.path.lexists(target) and (os.path.islink(target) or not os.path.isdir(target)):
        raise OutputError(f"{target}: a file of that name is there; choose another name")
    if not os.path.isdir(target) or not any(target.iterdir()):
        return False
    if not (target / mark).is_file():
        raise OutputError(f"{target}: holds other files, and no {mark} of an earlier export; choose another folder")
    if not force:
        raise OutputError(f"{target}: an earlier export is there; choose another folder, or give --force to replace it")
    return True


def _write_pictures(
    pictures: Pictures, selection: Selection, chosen: Format, folder: Path, options: ExportOptions, progress: Progress
) -> list[ExportedFrame]:
    """Write the pictures; return the frames with their files.

    A picture is a link to the array's own file, or its copy, if that is the picture; else a new file.
    """
    image_format = options.image_format
    frames = [replace(frame, file=f"{chosen.stem(frame)}.{image_format.format}") for frame in selection.frames]
    for place in {(folder / frame.file).parent for frame in frames}:
        place.mkdir(parents=True, exist_ok=True)
    for done, frame in enumerate(frames, start=1):
        image = pictures.picture(frame.c, frame.lights)  # read even if it is linked: a damaged one must not slip in
        source = pictures.whole_file(frame.c, frame.lights)
        if source is not None and not image_format.exposure and format_name(source) == image_format.format:
            link_or_copy(source, folder / frame.file, copy=options.copy)
        else:
            attributes, more = picture_attributes(pictures.manifest, frame.c, frame.lights[0]), None
            if image_format.format == "exr":
                attributes[COLOUR_ID], more = SCENE_LIGHT, pictures.differences(frame.c, frame.lights)
            alpha = pictures.alpha(frame.c) if image_format.format in WITH_ALPHA else None
            write_image(folder / frame.file, image, image_format, attributes, more, alpha)
        progress(done, len(frames))
    return frames


def _make_cloud(pictures: Pictures, selection: Selection, exposure: float, wanted: int) -> PointCloud:
    """Find points, with the colours that they have under the first light position."""
    lights = selection.frames[0].lights
    bright = np.float32(2.0**exposure)
    colours = {c: srgb8_from_linear(pictures.picture(c, lights) * bright) for c in source_cameras(selection.cameras)}
    return find_points(selection.manifest, selection.cameras, colours, wanted)


def _notes(chosen: Format, selection: Selection, n_points: int, wanted: int) -> list[str]:
    near = shared_samples(selection.splits, selection.manifest.job)
    notes = [near] if near else []
    if chosen.points and wanted and not selection.manifest.layers:
        notes.append("no points and no depth: the array was rendered without layers (output.layers)")
    elif chosen.points and wanted and not n_points:
        notes.append("no points: no two cameras see the same smooth surface; with samples.hits below 1 depth has holes")
    return notes
