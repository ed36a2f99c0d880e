"""A contact sheet: a frame array as one picture, camera positions from left to right, light positions below."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images.images import (
    FOR_SCREENS,
    Extension,
    ImageFormat,
    format_name,
    require_writer,
    write_codes,
    write_image,
)
from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.moments import position_name
from framearray_cli.array.pictures import Pictures
from framearray_cli.array.places import MIDDLE_PLACE, read_indices
from framearray_cli.array.present import REMEDY, list_present
from framearray_cli.array.ranges import brief_frames_text
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import agree, counted

from .axes import LightIndices, evenly_spaced, given_places
from .drawing import GAP, MARGIN, SHEET_GREY, blank_tile, draw_sheet, gutter
from .mixing.mixer import SumOptions, open_pictures
from .progress import Progress
from .sheetlines import SheetLines, lay_out
from .shrinking import area_mean

MOST_COLUMNS, MOST_ROWS = 12, 8  # for an array of 192 x 48: 200 pixels per tile, on a sheet that fits a screen
WIDTH = 2400  # pixels
LEAST_TILE = 8  # pixels; smaller ones show nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetResult:
    """What a sheet shows.

    Attributes:
        target: the file.
        cameras: c of each column.
        lights: index along the shown axis of each row.
        size: width and height, pixels.
        warnings: for the user.
    """

    target: Path
    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    size: tuple[int, int]
    warnings: tuple[str, ...] = ()


def make_sheet(
    out: Path,
    target: Path,
    *,
    cameras: str | None = None,
    light: str | None = None,
    columns: int = MOST_COLUMNS,
    rows: int = MOST_ROWS,
    width: int = WIDTH,
    exposure: float = 0.0,
    side: str | None = None,
    at: Sequence[str] = (),
    wrap: bool = False,
    sums: SumOptions = SumOptions(),  # noqa: B008  # frozen
    progress: Progress | None = None,
    dry_run: bool = False,
) -> SheetResult:
    """Draw a contact sheet of a frame array; the file appears whole or not at all.

    Images shrink by area means of linear light. PNG and JPEG have labels. EXR and TIFF have radiance, edge to edge.
    Images that are not there yet leave a blank: a pattern, in EXR and TIFF black.

    Args:
        out: output folder of a render, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        cameras: places along the camera path, one per column; None: a few, evenly spaced.
        light: places along the first light axis, one per row if that is the axis shown, else one; None: as for `at`.
        columns, rows, width: cameras, light positions where they are not named, and pixels, at most.
        exposure: stops added to PNG and JPEG.
        side: axis of light positions from top to bottom; None: the first.
        at: "AXIS=PLACES" for further axes; the default is a few of the shown one, and the middle of all others.
        wrap: show one camera, the middle one if none is named, and its light positions line by line.
        sums: what pictures are sums of; those of all light positions leave one row of the first axis.
        progress: called after each image.
        dry_run: check everything but the pixels of images, and write nothing; the size is then (0, 0).

    Raises:
        JobError: an axis or a place is unknown, or images would be too small at that width.
        OutputError: no image is there, one is damaged, or the target cannot be written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format, manifest = sheet_format(target, exposure), read_manifest(out)
    axis = side if side is not None else next(iter(manifest.axes))
    pictures, left_out = open_pictures(manifest, sums)
    lights, fixed = _read_lights(manifest, axis, light, at, columns * rows if wrap else rows)
    lights, names = _name_rows(manifest, axis, lights, sums)
    chosen = choose_columns(manifest, MIDDLE_PLACE if wrap and cameras is None else cameras, columns)
    lines = lay_out(chosen, lights, names if image_format.format in FOR_SCREENS else [], columns if wrap else None)
    tile = tile_size(manifest, lines.n_columns, width, lines.labels)
    places = _Places(chosen, lights, list(manifest.axes).index(axis), fixed)
    there, warnings = _find_images(pictures, places, left_out)
    if dry_run:
        return SheetResult(target=target, cameras=chosen, lights=lights, size=(0, 0), warnings=warnings)
    tiles = _read_tiles(pictures, places, there, tile, progress)
    if lines.labels:
        shown = _screen_tiles(tiles, there, exposure)
        size = _draw(target, shown, lines, _heads(manifest, axis, fixed, chosen[0] if wrap else None), width)
    else:
        size = write_linear(target, lines.arrange(tiles, 0), image_format)
    return SheetResult(target=target, cameras=chosen, lights=lights, size=size, warnings=warnings)


def _name_rows(
    manifest: Manifest, axis: str, lights: tuple[int, ...], sums: SumOptions
) -> tuple[tuple[int, ...], list[str]]:
    """Return the light positions of the rows, one where they are summed, and their names."""
    if sums.collapses and axis == next(iter(manifest.axes)):
        return lights[:1], ["sum"]
    return lights, [position_name(manifest, axis, l) for l in lights]


def _screen_tiles(tiles: Float32, there: NDArray[np.bool_], exposure: float) -> Bytes:
    """Return the sRGB codes of tiles, with blanks where no image is."""
    shown = srgb8_from_linear(tiles * np.float32(2.0**exposure))
    shown[~there] = blank_tile(tiles.shape[3], tiles.shape[2])
    return shown


def _draw(target: Path, tiles: Bytes, lines: SheetLines, heads: Sequence[str], width: int) -> tuple[int, int]:
    """Write a sheet of tiles, (rows, columns, h, w, 3), with labels; return its width and height."""
    shown = lines.arrange(tiles, SHEET_GREY)
    return write_drawn(target, draw_sheet(shown, lines.columns, lines.labels, heads, width, lines.noun))


def write_drawn(target: Path, codes: Bytes) -> tuple[int, int]:
    """Write a sheet with labels; return its width and height."""
    write_codes(target, codes, sheet_format(target))
    return codes.shape[1], codes.shape[0]


def choose_columns(manifest: Manifest, cameras: str | None, most: int) -> tuple[int, ...]:
    """Read the cameras of the columns, or choose some."""
    n = manifest.n_cameras
    return evenly_spaced(n, most) if cameras is None else read_indices("--cameras", cameras, n)


def write_linear(target: Path, tiles: Float32, image_format: ImageFormat) -> tuple[int, int]:
    """Write images edge to edge, without labels; return width and height of the sheet."""
    n_rows, n_columns, height, width, _ = tiles.shape
    size = (n_columns * width, n_rows * height)
    write_image(target, tiles.swapaxes(1, 2).reshape(size[1], size[0], 3), image_format)
    return size


class _Places(NamedTuple):
    """The images of a sheet: cameras by column, lights along the axis number `side` by row, fixed along the others."""

    cameras: Sequence[int]
    lights: Sequence[int]
    side: int
    fixed: LightIndices

    def at(self, l: int) -> LightIndices:
        """Return the index along each axis for a row."""
        return (*self.fixed[: self.side], l, *self.fixed[self.side + 1 :])


def sheet_format(target: Path, exposure: float = 0.0) -> ImageFormat:
    """Return the format of a sheet by the suffix of its file."""
    name = format_name(target)
    if name not in get_args(Extension):
        raise OutputError(f"{target}: expected a .png, .jpg, .exr or .tif")
    if exposure and name not in FOR_SCREENS:
        raise OutputError(f"{target}: exposure changes only PNG and JPEG; {target.suffix} keeps the radiance")
    image_format = ImageFormat(format=name)  # type: ignore[arg-type]  # just checked
    require_writer(image_format.format)
    return image_format


def _read_lights(
    manifest: Manifest, axis: str, light: str | None, at: Sequence[str], rows: int
) -> tuple[tuple[int, ...], LightIndices]:
    """Read the rows of the sheet, and the index along each axis that is not shown; that along the shown one is void.

    Args:
        rows: at most, where neither `light` nor `at` names them.
    """
    if axis not in manifest.axes:
        raise JobError("--side", [f"expected one of the axes {', '.join(manifest.axes)}, got {shown(axis)}"])
    given = given_places(manifest, light, at)
    found = {
        name: read_indices(*given.get(name, (f"--at {name}", MIDDLE_PLACE)), n, name)
        for name, n in manifest.axes.items()
    }
    shown_rows = found[axis] if axis in given else evenly_spaced(manifest.axes[axis], rows)
    for name, places in found.items():
        if name != axis and len(places) > 1:
            raise JobError(given[name][0], [f"expected one place, as the rows are those of {axis}, got {len(places)}"])
    return shown_rows, tuple(places[0] for places in found.values())


def tile_size(manifest: Manifest, n_columns: int, width: int, labels: Sequence[str]) -> tuple[int, int]:
    """Return width and height of each image on a sheet with these labels at its side."""
    full_width, full_height = manifest.resolution
    room = (width - 2 * MARGIN - gutter(labels) + GAP) // n_columns - GAP if labels else width // n_columns
    if room < LEAST_TILE:
        few = f"{counted(width, 'pixel')} {agree(width, 'is', 'are')} too few"
        raise JobError("--width", [f"{few} for {counted(n_columns, 'column')}; try fewer --columns"])
    tile_width = min(room, full_width)
    return tile_width, max(1, round(tile_width * full_height / full_width))


def _find_images(
    pictures: Pictures, places: _Places, left_out: tuple[str, ...]
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which images are there, (rows, columns), and warnings: those before, and about the others.

    Raises:
        OutputError: none is there.
    """
    manifest, present = pictures.manifest, list_present(pictures.manifest)
    rows = [[present.has(pictures.files(c, places.at(l))) for c in places.cameras] for l in places.lights]
    there: NDArray[np.bool_] = np.array(rows)
    if there.all():
        return there, left_out
    gone = int(np.count_nonzero(~there))
    lacking = [c for i, c in enumerate(places.cameras) if not there[:, i].all()]
    text = (
        f"{gone:,} of {counted(there.size, 'image')} of the sheet {agree(gone, 'is', 'are')} missing, "
        f"of {agree(len(lacking), 'camera', 'cameras')} {brief_frames_text(lacking)}; {REMEDY}"
    )
    if not there.any():
        raise OutputError(f"{manifest.directory}: {text}")
    return there, (*left_out, text)


def _read_tiles(
    pictures: Pictures,
    places: _Places,
    there: NDArray[np.bool_],
    tile: tuple[int, int],
    progress: Progress | None,
) -> Float32:
    """Read the images that are there, and shrink them: (rows, columns, height, width, 3); the others are black."""
    total = int(np.count_nonzero(there))
    tiles = np.zeros((*there.shape, tile[1], tile[0], 3), np.float32)
    for done, (i, j) in enumerate(np.argwhere(there.T).tolist(), start=1):
        picture = pictures.picture(places.cameras[i], places.at(places.lights[j]))
        tiles[j, i] = area_mean(picture, *tile)
        if progress:
            progress(done, total)
    return tiles


def _heads(manifest: Manifest, axis: str, fixed: LightIndices, c: int | None) -> Sequence[str]:
    """Word the head line: the name, and a text of counts; with the camera where all images are of one."""
    width, height = manifest.resolution
    counts = [str(n) if name == MAIN_AXIS else f"{n} of {name}" for name, n in manifest.axes.items()]
    size = " x ".join([str(manifest.n_cameras), *counts])
    text = f"{size} images,  {width} x {height} pixels"
    others = [
        f"at {position_name(manifest, name, l)}" for name, l in zip(manifest.axes, fixed, strict=True) if name != axis
    ]
    others += [] if c is None else [f"camera {c}"]
    return manifest.name, ",  ".join([text, *others])
