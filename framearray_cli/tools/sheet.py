"""A contact sheet: a frame array as one picture, camera positions from left to right, light positions below."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import (
    COLOUR_ID,
    FOR_SCREENS,
    SCENE_LIGHT,
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
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.units import agree, counted

from .axes import LightIndices, evenly_spaced
from .drawing import GAP, MARGIN, SHEET_GREY, blank_tile, draw_sheet, gutter
from .mixing.mixer import SumOptions, open_pictures
from .progress import Progress
from .sheetlines import SheetLines, lay_out
from .sheettiles import SheetPlaces, find_images, read_lights, read_tiles

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
    pictures, left_out = open_pictures(manifest, sums)
    sheet = plan_sheet(
        pictures, cameras=cameras, light=light, columns=columns, rows=rows, width=width, side=side, at=at, wrap=wrap,
        summed=sums.collapses, labels=image_format.format in FOR_SCREENS,
    )  # fmt: skip
    warnings = (*left_out, *sheet.warnings)
    size = (0, 0)
    if not dry_run:
        tiles = read_tiles(pictures, sheet.places, sheet.there, sheet.tile, progress)
        if sheet.lines.labels:
            size = write_drawn(target, drawn_sheet(sheet, tiles, exposure))
        else:
            size = write_linear(target, sheet.lines.arrange(tiles, 0), image_format)
    cameras_of, lights_of = sheet.places.cameras, sheet.places.lights
    return SheetResult(target=target, cameras=tuple(cameras_of), lights=tuple(lights_of), size=size, warnings=warnings)


class SheetPlan(NamedTuple):
    """A sheet before any image is read.

    Attributes:
        heads: texts of the head line.
        tile: width and height of each image, pixels; `width`: of the sheet, at most.
        there: which images are there, (rows, columns).
        warnings: about the others.
    """

    places: SheetPlaces
    lines: SheetLines
    heads: Sequence[str]
    tile: tuple[int, int]
    width: int
    there: NDArray[np.bool_]
    warnings: tuple[str, ...]


def plan_sheet(
    pictures: Pictures,
    *,
    cameras: str | None,
    light: str | None,
    columns: int,
    rows: int,
    width: int,
    side: str | None,
    at: Sequence[str],
    wrap: bool = False,
    summed: bool = False,
    labels: bool = True,
) -> SheetPlan:
    """Choose the images of a sheet, and find out which are there.

    Args:
        summed: whether all positions along the first axis are one picture.
        labels: whether the sheet has labels.
        cameras, light, columns, rows, width, side, at, wrap: as in `make_sheet`.

    Raises:
        JobError, OutputError, MissingExtraError: as `make_sheet`.
    """
    manifest = pictures.manifest
    axis = side if side is not None else next(iter(manifest.axes))
    lights, fixed = read_lights(manifest, axis, light, at, columns * rows if wrap else rows)
    lights, names = _name_rows(manifest, axis, lights, summed=summed)
    chosen = choose_columns(manifest, MIDDLE_PLACE if wrap and cameras is None else cameras, columns)
    lines = lay_out(chosen, lights, names if labels else [], columns if wrap else None)
    tile = tile_size(manifest, lines.n_columns, width, lines.labels)
    places = SheetPlaces(chosen, lights, list(manifest.axes).index(axis), fixed)
    there, warnings = find_images(pictures, places)
    heads = _heads(manifest, axis, fixed, chosen[0] if wrap else None)
    return SheetPlan(places, lines, heads, tile, width, there, warnings)


def drawn_sheet(sheet: SheetPlan, tiles: Float32, exposure: float) -> Bytes:
    """Draw a sheet of tiles, (rows, columns, h, w, 3), with labels; return its sRGB codes."""
    lines = sheet.lines
    shown = lines.arrange(_screen_tiles(tiles, sheet.there, exposure), SHEET_GREY)
    return draw_sheet(shown, lines.columns, lines.labels, sheet.heads, sheet.width, lines.noun)


def _name_rows(
    manifest: Manifest, axis: str, lights: tuple[int, ...], *, summed: bool
) -> tuple[tuple[int, ...], list[str]]:
    """Return the light positions of the rows, one where they are summed, and their names."""
    if summed and axis == next(iter(manifest.axes)):
        return lights[:1], ["sum"]
    return lights, [position_name(manifest, axis, l) for l in lights]


def _screen_tiles(tiles: Float32, there: NDArray[np.bool_], exposure: float) -> Bytes:
    """Return the sRGB codes of tiles, with blanks where no image is."""
    shown = srgb8_from_linear(tiles * np.float32(2.0**exposure))
    shown[~there] = blank_tile(tiles.shape[3], tiles.shape[2])
    return shown


def write_drawn(target: Path, codes: Bytes) -> tuple[int, int]:
    """Write a sheet with labels; return its width and height."""
    write_codes(target, codes, sheet_format(target))
    return codes.shape[1], codes.shape[0]


def choose_columns(manifest: Manifest, cameras: str | None, most: int) -> tuple[int, ...]:
    """Read the cameras of the columns, or choose some."""
    n = manifest.n_cameras
    return evenly_spaced(n, most) if cameras is None else read_indices("--cameras", cameras, n)


def write_linear(
    target: Path, tiles: Float32, image_format: ImageFormat, meaning: str = SCENE_LIGHT
) -> tuple[int, int]:
    """Write images edge to edge, without labels; return width and height of the sheet.

    Args:
        meaning: of the values, which EXR says: SCENE_LIGHT or DATA.
    """
    n_rows, n_columns, height, width, _ = tiles.shape
    size = (n_columns * width, n_rows * height)
    attributes = {COLOUR_ID: meaning} if image_format.format == "exr" else {}
    write_image(target, tiles.swapaxes(1, 2).reshape(size[1], size[0], 3), image_format, attributes)
    return size


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


def tile_size(manifest: Manifest, n_columns: int, width: int, labels: Sequence[str]) -> tuple[int, int]:
    """Return width and height of each image on a sheet with these labels at its side."""
    full_width, full_height = manifest.resolution
    room = (width - 2 * MARGIN - gutter(labels) + GAP) // n_columns - GAP if labels else width // n_columns
    if room < LEAST_TILE:
        few = f"{counted(width, 'pixel')} {agree(width, 'is', 'are')} too few"
        raise JobError("--width", [f"{few} for {counted(n_columns, 'column')}; try fewer --columns"])
    tile_width = min(room, full_width)
    return tile_width, max(1, round(tile_width * full_height / full_width))


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
