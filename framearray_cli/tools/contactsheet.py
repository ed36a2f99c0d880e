"""Contact sheets: one picture of a frame array, or of its hours of sun, with cameras from left to right."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import (
    COLOUR_ID,
    DATA,
    FOR_SCREENS,
    SCENE_LIGHT,
    SUN_HOURS,
    Extension,
    ImageFormat,
    area_mean,
    format_name,
    read_channels,
    write_codes,
    write_image,
)
from framearray_cli.array.integrity import REMEDY, list_present
from framearray_cli.array.manifest import MAIN_AXIS, Manifest, axis_moments, layers_path, position_name
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import AS_RENDERED, Pictures, Relight
from framearray_cli.array.places import MIDDLE_PLACE, brief_frames_text, read_indices
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.ramp import ramp
from framearray_cli.base.sundays import sun_days
from framearray_cli.base.units import LUMENS_PER_WATT, agree, counted
from framearray_cli.base.views import SRGB, View

from . import Progress, SheetResult
from .axes import LightIndices, evenly_spaced, given_places
from .drawing import GAP, MARGIN, SHEET_GREY, blank_tile, draw_scale, draw_sheet, gutter
from .mixing import SumOptions, open_pictures

MOST_COLUMNS, MOST_ROWS = 12, 8  # for an array of 192 x 48: 200 pixels per tile, on a sheet that fits a screen
WIDTH = 2400  # pixels
DARK = 0.02  # reflectivity; a picture of darker surfaces does not tell their illuminance
LEAST_TILE = 8  # pixels; smaller ones show nothing


def _read_lights(
    manifest: Manifest, axis: str, light: str | None, at: Sequence[str], most: int
) -> tuple[tuple[int, ...], LightIndices]:
    """Read the rows, at most `most` unless named, and the index along each axis, which is void along the shown one."""
    if axis not in manifest.axes:
        raise JobError("--side", [f"expected one of the axes {', '.join(manifest.axes)}, got {shown(axis)}"])
    given = given_places(manifest, light, at)
    found = {
        name: read_indices(*given.get(name, (f"--at {name}", MIDDLE_PLACE)), n, name)
        for name, n in manifest.axes.items()
    }
    shown_rows = found[axis] if axis in given else evenly_spaced(manifest.axes[axis], most)
    for name, places in found.items():
        if name != axis and len(places) > 1:
            raise JobError(given[name][0], [f"expected one place, as the rows show {axis}, got {len(places)}"])
    return shown_rows, tuple(places[0] for places in found.values())


def _find_images(
    pictures: Pictures, cameras: Sequence[int], rows: Sequence[LightIndices]
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which images are there, (rows, columns), and warnings about the others; refuse a sheet without any."""
    manifest, present = pictures.manifest, list_present(pictures.manifest)
    there: NDArray[np.bool_] = np.array([[present.has(pictures.files(c, row)) for c in cameras] for row in rows])
    if there.all():
        return there, ()
    gone = int(np.count_nonzero(~there))
    lacking = [c for i, c in enumerate(cameras) if not there[:, i].all()]
    text = (
        f"{gone:,} of {counted(there.size, 'image')} of the sheet {agree(gone, 'is', 'are')} missing, "
        f"of {agree(len(lacking), 'camera', 'cameras')} {brief_frames_text(lacking)}; {REMEDY}"
    )
    if not there.any():
        raise OutputError(f"{manifest.directory}: {text}")
    return there, (text,)


class SheetPlan(NamedTuple):
    """A sheet before any image is read.

    Attributes:
        cameras: by column; one where lines show the light positions of one camera.
        lights: by row: index along the shown axis; `rows`: along each axis.
        columns: a number over each column, or none; `noun`: before these numbers.
        labels: one per line; none on sheets without.
        per_line: images per line, where lines show the light positions of one camera; else None.
        heads: texts of the head line.
        tile: width and height of each image, pixels.
        there: True for images that exist, (rows, columns).
        warnings: about the others.
    """

    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    rows: Sequence[LightIndices]
    columns: Sequence[int]
    noun: str
    labels: Sequence[str]
    per_line: int | None
    heads: Sequence[str]
    tile: tuple[int, int]
    there: NDArray[np.bool_]
    warnings: tuple[str, ...]

    def arrange(self, tiles: NDArray[Any], blank: int) -> NDArray[Any]:
        """Put tiles in lines: (rows, columns, h, w, 3) -> (lines, images per line, h, w, 3).

        Args:
            blank: fills what is left of the last line.
        """
        if self.per_line is None:
            return tiles
        n, n_lines = len(tiles), -(-len(tiles) // self.per_line)
        padded = np.full((n_lines * self.per_line, *tiles.shape[2:]), blank, tiles.dtype)
        padded[:n] = tiles[:, 0]
        return padded.reshape(n_lines, self.per_line, *tiles.shape[2:])


def read_tiles(
    pictures: Pictures,
    sheet: SheetPlan,
    progress: Progress = lambda done, total: None,
    relight: Relight = AS_RENDERED,
) -> Float32:
    """Read the images that are there, and shrink them: (rows, columns, height, width, 3); the others are black."""
    width, height = sheet.tile
    total = int(np.count_nonzero(sheet.there))
    tiles = np.zeros((*sheet.there.shape, height, width, 3), np.float32)
    for done, (i, j) in enumerate(np.argwhere(sheet.there.T).tolist(), start=1):
        tiles[j, i] = area_mean(pictures.picture(sheet.cameras[i], sheet.rows[j], relight), width, height)
        progress(done, total)
    return tiles


@dataclass(frozen=True, slots=True)
class SheetOptions:
    """The content of a sheet.

    Attributes:
        cameras: places along the camera path, one per column; None: a few, evenly spaced.
        light: places along the first light axis, one per row if that is the axis shown, else one; None: as for `at`.
        columns, rows, width: cameras, light positions if they are not named, and pixels, at most.
        exposure: stops added to PNG and JPEG.
        side: axis of light positions from top to bottom; None: the first.
        at: "AXIS=PLACES" for further axes; the default is a few of the shown one, and the middle of all others.
        lux: show illuminance in false colour, up to that many lux; None: the pictures.
        wrap: show one camera, the middle one if none is named, and its light positions line by line.
        view: shows the light in PNG and JPEG.
    """

    cameras: str | None = None
    light: str | None = None
    columns: int = MOST_COLUMNS
    rows: int = MOST_ROWS
    width: int = WIDTH
    exposure: float = 0.0
    side: str | None = None
    at: Sequence[str] = ()
    wrap: bool = False
    lux: float | None = None
    view: View = SRGB


def make_sheet(
    out: Path,
    target: Path,
    options: SheetOptions,
    *,
    sums: SumOptions,
    progress: Progress = lambda done, total: None,
) -> tuple[SheetResult, tuple[str, ...]]:
    """Draw a contact sheet of a frame array; the file appears whole or not at all.

    Images shrink by area means of linear light. PNG and JPEG have labels. EXR and TIFF have radiance, edge to edge.
    Missing images leave a blank: a pattern, in EXR and TIFF black.

    Args:
        out: output folder of a render, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        sums: pictures as sums of light positions; sums of all light positions leave one row of the first axis.
        progress: called after each image.

    Returns:
        The content of the sheet, and warnings.

    Raises:
        JobError: an axis or a place is unknown, or images would be too small at that width.
        OutputError: no image is there, one is damaged, or the target cannot be written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format, manifest = sheet_format(target, options.exposure, options.view), read_manifest(out)
    pictures, left_out = open_pictures(manifest, sums)
    sheet = plan_sheet(pictures, options, summed=sums.collapses, labels=image_format.format in FOR_SCREENS)
    tiles = read_tiles(pictures, sheet, progress)
    if options.lux is not None:
        tiles *= _lux_of_radiance(manifest, sheet)
    if sheet.labels:
        size = write_drawn(target, drawn_sheet(sheet, tiles, options))
    else:
        linear = tiles if options.lux is None else np.repeat(np.nan_to_num(tiles @ LUMINANCE)[..., None], 3, axis=-1)
        meaning = SCENE_LIGHT if options.lux is None else DATA
        size = write_linear(target, sheet.arrange(linear.astype(np.float32), 0), image_format, meaning)
    made = SheetResult(file=str(target), cameras=sheet.cameras, lights=sheet.lights, size=size)
    return made, (*left_out, *sheet.warnings)


def plan_sheet(pictures: Pictures, options: SheetOptions, *, summed: bool = False, labels: bool = True) -> SheetPlan:
    """Choose the images of a sheet, and find out which exist.

    Args:
        summed: True if all positions along the first axis are one picture.
        labels: True for a sheet with labels.

    Raises:
        JobError, OutputError, MissingExtraError: as `make_sheet`.
    """
    manifest = pictures.manifest
    first = next(iter(manifest.axes))
    axis = options.side if options.side is not None else first
    most = options.columns * options.rows if options.wrap else options.rows
    lights, fixed = _read_lights(manifest, axis, options.light, options.at, most)
    names = [position_name(manifest, axis, l) for l in lights]
    if summed and axis == first:
        lights, names = lights[:1], ["sum"]
    middle = options.wrap and options.cameras is None
    cameras = choose_columns(manifest, MIDDLE_PLACE if middle else options.cameras, options.columns)
    columns, noun, per_line = cameras, "camera ", None
    if options.wrap:
        if len(cameras) > 1:
            raise JobError("--wrap", [f"expected one camera position, got {len(cameras)}; give one with --cameras"])
        noun, per_line = "+", min(options.columns, len(lights))
        step = lights[1] - lights[0] if len(lights) > 1 else 1
        even = step > 0 and list(lights) == list(range(lights[0], lights[-1] + 1, step))
        # each so far from the first of its line
        columns = tuple(k * step for k in range(per_line)) if even else ()
    shown = names[:: per_line or 1] if labels else []
    side = list(manifest.axes).index(axis)
    rows = [(*fixed[:side], l, *fixed[side + 1 :]) for l in lights]
    there, warnings = _find_images(pictures, cameras, rows)
    return SheetPlan(
        cameras=cameras,
        lights=lights,
        rows=rows,
        columns=columns,
        noun=noun,
        labels=shown,
        per_line=per_line,
        heads=_heads(manifest, axis, fixed, cameras[0] if options.wrap else None),
        tile=tile_size(manifest, per_line or len(cameras), options.width, shown),
        there=there,
        warnings=warnings,
    )


def drawn_sheet(sheet: SheetPlan, tiles: Float32, options: SheetOptions) -> Bytes:
    """Draw a sheet of tiles, (rows, columns, h, w, 3), with labels; return its sRGB codes."""
    if options.lux is None:
        shown = options.view.codes(tiles * np.float32(2.0**options.exposure))
    else:
        shown = _lux_codes(tiles @ LUMINANCE, options.lux)
    shown[~sheet.there] = blank_tile(tiles.shape[3], tiles.shape[2])
    shown = sheet.arrange(shown, SHEET_GREY)
    codes = draw_sheet(shown, sheet.columns, sheet.labels, sheet.heads, options.width, sheet.noun)
    if options.lux is None:
        return codes
    scale = _lux_codes(np.tile(np.linspace(0, options.lux, 256), (LEAST_TILE, 1)), options.lux)
    return draw_scale(codes, scale, options.lux, f"lux, a line every {_step(options.lux):g}")


def _lux_of_radiance(manifest: Manifest, sheet: SheetPlan) -> Float32:
    """Illuminance of diffuse surfaces over their radiance, (1, columns, h, w, 1): pi / R in lumens; NaN of dark ones.

    R and the radiance are luminances, which is exact for white light on any surface, and any light on a grey one.
    """
    names, found = [f"reflectivity.{letter}" for letter in "RGB"], []
    for c in sheet.cameras:
        layer = area_mean(read_channels(layers_path(manifest, c), names, manifest.resolution), *sheet.tile) @ LUMINANCE
        found.append(np.where(layer > DARK, np.pi * LUMENS_PER_WATT / np.maximum(layer, DARK), np.nan))
    return np.stack(found)[None, ..., None].astype(np.float32)


def _step(most: float) -> float:
    """Return the distance of iso-lines: 1, 2 or 5 times a power of 10, for 4 to 10 of them."""
    power = 10.0 ** np.floor(np.log10(most / 4))
    return float(max(k * power for k in (1, 2, 5) if k * power <= most / 4))


def _lux_codes(lux: NDArray[Any], most: float) -> Bytes:
    """Return sRGB codes of illuminance (..., h, w) with iso-lines of the smoothed values; grey where it is NaN."""
    codes, smooth = ramp(np.nan_to_num(lux) / most), lux
    for axis in (-1, -2, -1, -2):
        ends = np.concatenate([smooth.take([0], axis), smooth, smooth.take([-1], axis)], axis)
        smooth = (ends.take(range(2, ends.shape[axis]), axis) + smooth + ends.take(range(smooth.shape[axis]), axis)) / 3
    band = np.floor(smooth / _step(most))
    line = np.zeros(lux.shape, bool)
    line[..., 1:, :] |= abs(np.diff(band, axis=-2)) > 0
    line[..., 1:] |= abs(np.diff(band, axis=-1)) > 0
    codes[line] = np.where(smooth[line] < most / 2, 255, 0)[:, None]
    codes[np.isnan(lux)] = SHEET_GREY
    return codes


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


def sheet_format(target: Path, exposure: float = 0.0, view: View = SRGB) -> ImageFormat:
    """Return the format of a sheet by the suffix of its file."""
    name = format_name(target)
    if name not in get_args(Extension):
        raise OutputError(f"{target}: expected a .png, .jpg, .exr or .tif")
    if exposure and name not in FOR_SCREENS:
        raise OutputError(f"{target}: exposure changes only PNG and JPEG; {target.suffix} keeps the radiance")
    if view is not SRGB and name not in FOR_SCREENS:
        raise OutputError(f"{target}: a view is only for PNG and JPEG; {target.suffix} keeps the radiance")
    return ImageFormat(format=name)  # type: ignore[arg-type]  # just checked


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


def make_sun_sheet(
    out: Path,
    target: Path,
    options: SheetOptions,
    *,
    progress: Progress = lambda done, total: None,
) -> SheetResult:
    """Draw a sheet of hours of direct sun; EXR and TIFF contain the hours themselves, in all channels.

    Args:
        out: output folder of a render of a sun study, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        options: only `cameras`, `columns` and `width` count.
        progress: called after each camera and day.

    Raises:
        JobError: a place is unknown, or images would be too small at that width.
        OutputError: the array lacks the data for hours of sun, or a file cannot be read or written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format, manifest = sheet_format(target, 0.0), read_manifest(out)
    if not manifest.has_sun_hours:
        raise OutputError(f"{manifest.directory}: holds no hours of sun; render again with output.sun_hours = true")
    days = sun_days(next(iter(axis_moments(manifest).values()), ()))
    if not days:
        raise OutputError(f"{manifest.directory}: expected the times of a sun next to its hours, found none")
    chosen = choose_columns(manifest, options.cameras, options.columns)
    labels = [day.date for day in days] if image_format.format in FOR_SCREENS else []
    tile = tile_size(manifest, len(chosen), options.width, labels)
    lights = tuple(day.lights[0] for day in days)
    tiles = np.zeros((len(days), len(chosen), tile[1], tile[0], 3), np.float32)
    channels = [f"{SUN_HOURS}.{day.date}" for day in days]
    for i, c in enumerate(chosen):
        hours = read_channels(layers_path(manifest, c), channels, manifest.resolution)
        for j in range(len(days)):
            tiles[j, i] = area_mean(np.repeat(hours[..., j : j + 1], 3, axis=2), *tile)
            progress(i * len(days) + j + 1, len(days) * len(chosen))
    if labels:
        most = max(*(day.most_h for day in days), 1e-9)
        heads = (manifest.name, f"hours of direct sun,  {counted(days[-1].lights.stop, 'light position')}")
        codes = draw_sheet(ramp(tiles[..., 0] / most), chosen, labels, heads, options.width)
        codes = draw_scale(codes, ramp(np.linspace(0, 1, 256, dtype=np.float32)[None]), most, "h")
        size = write_drawn(target, codes)
    else:
        size = write_linear(target, tiles, image_format, DATA)
    return SheetResult(file=str(target), cameras=chosen, lights=lights, size=size)
