"""Write a frame array as a folder that other tools read; all input is the manifest and the images it names."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from framearray_cli.array.images import ImageFormat, require_writer
from framearray_cli.array.integrity import list_present, missing_text
from framearray_cli.array.manifest import Manifest, ManifestLight, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.array.places import ALL_PLACES, MIDDLE_PLACE, read_indices
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import whole_folder

from ..axes import read_light_indices
from ..mixing.mixer import SumOptions, open_pictures
from ..progress import Progress
from . import cinema
from .folder import find_earlier_export, put_picture
from .formats import EXPORT_KINDS, FORMATS, ExportKind, Format, Written
from .onegroup import only_group
from .points import PointCloud, find_points, source_cameras
from .selection import ExportedFrame, Selection
from .shards import PER_SHARD, ShardWriter
from .splits import OPTION, SETS, SplitOptions, read_splits, shared_samples

PNG = ImageFormat(format="png")
MOST_POINTS = 10_000  # a COLMAP model has some 25 bytes per point and image


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportResult:
    """What an export holds.

    Attributes:
        target: the folder.
        n_cameras, n_lights: exported cameras, and light positions of each.
        n_pictures: pictures of these that belong to a set; all, if there are no sets.
        n_points: in the point cloud.
        sets: number of pictures of each set, in the order of SETS.
        replaces: whether an earlier export was there.
        notes, warnings: for the user.
    """

    target: Path
    n_cameras: int
    n_lights: int
    n_pictures: int
    n_points: int
    sets: Mapping[str, int] = field(default_factory=dict)
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
    group: str | None = None,
    image_format: ImageFormat = PNG,
    points: int = MOST_POINTS,
    sums: SumOptions = SumOptions(),  # noqa: B008  # frozen
    split: SplitOptions = SplitOptions(),  # noqa: B008  # frozen
    per_shard: int = PER_SHARD,
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
        light: places along the first light axis; None: as `Format.all_lights` says.
        at: "AXIS=PLACES" for the other axes; the default is as for `light`.
        group: export only the light of this group of sources, along its own axis.
        image_format: of the pictures.
        points: in the point cloud, at most.
        split: sets for training, validation and testing.
        per_shard: pictures per tar file of webdataset.
        sums: what pictures are sums of; those of all light positions are one picture per camera.
        copy: copy pictures of the array that could be linked.
        force: replace an earlier export.
        dry_run: check everything, and write nothing.
        progress: called after each picture.

    Raises:
        JobError: an option does not fit the array.
        OutputError: a file of the array is missing or damaged, or the target is in use or cannot be written.
    """
    manifest = only_group(read_manifest(out), group)
    selection, chosen, target = _select(manifest, kind, cameras, light, at), FORMATS[kind], _full_name(target, kind)
    _check_images(kind, chosen, image_format)
    pictures, warnings = open_pictures(manifest, sums)
    has_cloud = chosen.points and bool(manifest.layers)
    complete, left_out = _split_complete(pictures, _summed(selection, kind, sums), layers=has_cloud)
    selection, n_points = _divide(complete, kind, split), 0
    replaces = find_earlier_export(target, chosen.mark, force=force)
    if not dry_run:
        with whole_folder(target, replace=replaces) as folder:
            put = partial(_write_pictures, pictures, selection, chosen, folder, image_format, copy, progress)
            files = _write_shards(put, selection, folder, per_shard, image_format) if kind == "webdataset" else put()
            cloud = _make_cloud(pictures, selection, image_format.exposure, points) if has_cloud else None
            n_points = len(cloud.position) if cloud else 0
            chosen.write(Written(folder, selection, files, cloud, image_format.exposure))
    notes = [] if dry_run else _notes(chosen, selection, n_points, points)
    return _result(target, selection, n_points, replaces, notes, [*warnings, *left_out])


def _result(
    target: Path, selection: Selection, n_points: int, replaces: bool, notes: Sequence[str], warnings: Sequence[str]
) -> ExportResult:
    frames = selection.frames
    counts = Counter(frame.part for frame in frames)
    return ExportResult(
        target=target, n_cameras=len(selection.cameras), n_lights=len(selection.lights), n_pictures=len(frames),
        n_points=n_points, sets={name: counts[name] for name in SETS if counts[name]}, replaces=replaces,
        notes=tuple(notes), warnings=tuple(warnings),
    )  # fmt: skip


def _check_images(kind: ExportKind, chosen: Format, image_format: ImageFormat) -> None:
    """Refuse a format of images that readers do not take, or that cannot be written here."""
    if chosen.images and image_format.format not in chosen.images:
        wanted = " or ".join(chosen.images)
        raise JobError("--image-format", [f"expected {wanted} for readers of {kind}, got {image_format.format}"])
    require_writer(image_format.format)


def _select(manifest: Manifest, kind: ExportKind, cameras: str, light: str | None, at: Sequence[str]) -> Selection:
    """Read which cameras and light positions to export."""
    if kind not in EXPORT_KINDS:
        raise JobError("--format", [f"expected {', '.join(EXPORT_KINDS)}, got {kind!r}"])
    default = ALL_PLACES if FORMATS[kind].all_lights else MIDDLE_PLACE
    selection = Selection(
        manifest=manifest,
        cameras=tuple(sorted(read_indices("--cameras", cameras, manifest.n_cameras))),
        lights=tuple(sorted(read_light_indices(manifest, light, at, default))),
    )
    FORMATS[kind].check(selection)
    return selection


def _divide(selection: Selection, kind: ExportKind, options: SplitOptions) -> Selection:
    """Return the selection in sets, without the cameras and light positions that are in none."""
    if options.rules and not FORMATS[kind].splits:
        raise JobError(OPTION, [f"expected another format than {kind}, which has no sets"])
    if not options.rules and FORMATS[kind].rule:
        options = replace(options, rules=(FORMATS[kind].rule,))
    splits = read_splits(options, selection.manifest, selection.cameras, selection.lights)
    if splits is None:
        return selection
    frames = replace(selection, splits=splits).frames
    cameras, lights = {frame.c for frame in frames}, {frame.lights for frame in frames}
    return replace(selection, splits=splits, cameras=tuple(sorted(cameras)), lights=tuple(sorted(lights)))


def _summed(selection: Selection, kind: ExportKind, sums: SumOptions) -> Selection:
    """Return the selection with one place on the first axis, and no sources, if its pictures are sums of all of them.

    Raises:
        JobError: the format needs a source per picture.
    """
    if not sums.collapses:
        return selection
    if kind in ("rti", "olat"):
        raise JobError("--format", [f"expected another format than {kind}, as a sum of light has no direction"])
    lights = tuple(dict.fromkeys((0, *lights[1:]) for lights in selection.lights))
    return replace(selection, manifest=_without_sources(selection.manifest), lights=lights)


def _without_sources(manifest: Manifest) -> Manifest:
    """Return the manifest of pictures that no position of the sources describes."""

    def bare(lights: Sequence[ManifestLight]) -> tuple[ManifestLight, ...]:
        return tuple(replace(light, sources=()) for light in lights)

    groups = tuple(replace(group, lights=bare(group.lights)) for group in manifest.groups)
    return replace(manifest, lights=bare(manifest.lights), groups=groups)


def _split_complete(pictures: Pictures, selection: Selection, *, layers: bool) -> tuple[Selection, list[str]]:
    """Return the cameras of a selection whose files are all there, and a warning about the others if there are any.

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
        return selection, []
    text = missing_text(set(selection.cameras) - set(complete), len(selection.cameras))
    if not complete:
        raise OutputError(f"{manifest.directory}: {text}")
    return replace(selection, cameras=complete), [f"left out: {text}"]


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
    chosen: Format,
    folder: Path,
    image_format: ImageFormat,
    copy: bool,
    progress: Progress | None,
    *,
    then: Callable[[ExportedFrame, Path], None] | None = None,
) -> dict[str, str]:
    """Write the pictures; return name of a frame -> its file, relative to the folder.

    Args:
        then: is called with each picture when it is there.
    """
    frames = selection.frames
    files = {frame.name: f"{chosen.stem(selection, frame)}.{image_format.format}" for frame in frames}
    for place in {(folder / file).parent for file in files.values()}:
        place.mkdir(parents=True, exist_ok=True)
    for done, frame in enumerate(frames, start=1):
        put_picture(pictures, frame, folder / files[frame.name], image_format, copy=copy)
        if then:
            then(frame, folder / files[frame.name])
        if progress:
            progress(done, len(frames))
    return files


def _write_shards(
    put: Callable[..., dict[str, str]], selection: Selection, folder: Path, per_shard: int, image_format: ImageFormat
) -> dict[str, str]:
    """Write pictures one after the other, and move each into its tar file."""
    with ShardWriter(folder, selection, image_format.exposure, per_shard) as shards:
        files = put(then=shards.add)
        shards.write_index()
    (folder / "images").rmdir()
    return files


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
