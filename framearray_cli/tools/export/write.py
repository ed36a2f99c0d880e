"""A frame array -> a folder that other tools read; from the manifest alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from framearray_cli.array.images.images import ImageFormat, require_writer
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import whole_folder

from ..places import ALL, MIDDLE, indices, light_places
from . import cinema, colmap, nerfstudio
from .folder import earlier_export, place_picture
from .points import Cloud, find_points, source_cameras
from .selection import Selection

Kind: TypeAlias = Literal["nerfstudio", "colmap", "cinema"]
Progress: TypeAlias = Callable[[int, int], None]  # pictures done, pictures in all

KINDS: tuple[Kind, ...] = ("nerfstudio", "colmap", "cinema")
POINTS = 10_000  # COLMAP writes a text of some 25 bytes for each point in each image
_MARKS = {"nerfstudio": nerfstudio.MARK, "colmap": colmap.MARK, "cinema": cinema.MARK}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportResult:
    """What was made.

    Attributes:
        target: the folder.
        n_cameras, n_places: cameras, and light places of each.
        n_points: in the cloud of points.
        notes: what a user should know.
    """

    target: Path
    n_cameras: int
    n_places: int
    n_points: int
    notes: tuple[str, ...]


def export(
    out: Path,
    target: Path,
    kind: Kind,
    *,
    cameras: str = ALL,
    light: str | None = None,
    at: Sequence[str] = (),
    image_format: ImageFormat | None = None,
    points: int = POINTS,
    copy: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> ExportResult:
    """Write a folder for another tool; it appears whole or not at all.

    Args:
        out: output folder of a render, or its manifest.
        target: the folder; for cinema it gets the suffix .cdb.
        kind: nerfstudio, colmap or cinema.
        cameras: places along the camera path, see `places.indices`.
        light: places along the first axis of light positions; None: all for cinema, the middle one for the others.
        at: "AXIS=PLACES" for the other axes; without, as for `light`.
        image_format: of the pictures; None: PNG.
        points: at most, in the cloud of points.
        copy: copy pictures of the array where they could be linked.
        force: replace an earlier export.
        progress: called after each picture.

    Raises:
        JobError: a place or an axis is not known.
        OutputError: a file of the array is missing or damaged, or the target is in use or cannot be written.
    """
    manifest = read_manifest(out)
    selection = Selection(
        manifest=manifest,
        cameras=tuple(sorted(indices("--cameras", cameras, manifest.n_cameras))),
        places=tuple(sorted(light_places(manifest, light, at, ALL if kind == "cinema" else MIDDLE))),
    )
    if kind not in KINDS:
        raise JobError("--format", [f"expected {', '.join(KINDS)}, got {kind!r}"])
    if target.name in ("", ".."):
        raise OutputError(f"{target}: expected the name of a folder to be made")
    wanted = image_format or ImageFormat(format="png")
    if kind == "cinema" and target.suffix != cinema.SUFFIX:
        target = target.with_name(f"{target.name}{cinema.SUFFIX}")
    require_writer(wanted.format)
    pictures, frames = Pictures(manifest), selection.frames
    replace = earlier_export(target, _MARKS[kind], force=force)
    with whole_folder(target, replace=replace) as folder:
        (folder / "images").mkdir()
        files = {frame.name: f"{frame.name}.{wanted.format}" for frame in frames}
        for done, frame in enumerate(frames, start=1):
            place_picture(pictures, frame, folder / "images" / files[frame.name], wanted, copy=copy)
            if progress:
                progress(done, len(frames))
        cloud = _cloud(pictures, selection, wanted.exposure, points) if kind != "cinema" and manifest.layers else None
        inside = {name: f"images/{file}" for name, file in files.items()}
        if kind == "nerfstudio":
            nerfstudio.write_transforms(folder, selection, inside, cloud=cloud, exposure=wanted.exposure)
        elif kind == "colmap":
            colmap.write_model(folder, selection, files, cloud or _NOTHING)
        else:
            cinema.write_table(folder, selection, inside)
    n_points = len(cloud.position) if cloud else 0
    return ExportResult(
        target=target,
        n_cameras=len(selection.cameras),
        n_places=len(selection.places),
        n_points=n_points,
        notes=_notes(kind, bool(manifest.layers), n_points, points),
    )


_NOTHING = Cloud(position=np.empty((0, 3)), codes=np.empty((0, 3), np.uint8), seen={})


def _cloud(pictures: Pictures, selection: Selection, exposure: float, wanted: int) -> Cloud:
    """Points with the colours of the first light place."""
    place = selection.places[0]
    bright = np.float32(2.0**exposure)
    shown = {c: srgb8_from_linear(pictures.picture(c, place) * bright) for c in source_cameras(selection.cameras)}
    return find_points(selection.manifest, selection.cameras, shown, wanted)


def _notes(kind: Kind, layers: bool, n_points: int, wanted: int) -> tuple[str, ...]:
    if kind == "cinema" or not wanted:
        return ()
    if not layers:
        return ("no points and no depth: the array was rendered without layers (output.layers)",)
    if n_points:
        return ()
    return ("no points: no two cameras see the same smooth surface; with samples.hits below 1 depth has holes",)
