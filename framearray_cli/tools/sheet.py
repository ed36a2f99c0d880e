"""A contact sheet: a frame array as one picture, cameras from left to right, light positions from top to bottom."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

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
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.arrays import Bytes, Float32, Image
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.forms.words import shown

from .movie.label import typeface
from .places import MIDDLE_PLACE, LightIndices, evenly_spaced, read_light_indices
from .progress import Progress

MOST_COLUMNS, MOST_ROWS = 12, 8  # for an array of 192 x 48: 200 pixels per tile, on a sheet that fits a screen
WIDTH = 2400  # pixels
LEAST_TILE = 8  # pixels; smaller ones show nothing

# sRGB codes, all neutral: a dark grey that neither dazzles nor tints the images on it.
SHEET_GREY, HEADING, LABEL = 38, 225, 160
GAP, MARGIN = 4, 24  # pixels
HEAD_TEXT, LABEL_TEXT = 22, 15  # height of the letters' boxes, pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetResult:
    """What a sheet shows.

    Attributes:
        target: the file.
        cameras: c of each column.
        lights: index along the shown axis of each row.
        size: width and height, pixels.
    """

    target: Path
    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    size: tuple[int, int]


def make_sheet(
    out: Path,
    target: Path,
    *,
    columns: int = MOST_COLUMNS,
    rows: int = MOST_ROWS,
    width: int = WIDTH,
    exposure: float = 0.0,
    side: str | None = None,
    at: Sequence[str] = (),
    progress: Progress | None = None,
) -> SheetResult:
    """Draw a contact sheet of a frame array; the file appears whole or not at all.

    Images shrink by area means of linear light. PNG and JPEG have labels. EXR and TIFF keep the radiance, and hold only
    the images, edge to edge.

    Args:
        out: output folder of a render, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        columns, rows: the number of cameras and light positions, at most; they are evenly spaced.
        width: of the sheet, at most, pixels; images are never enlarged.
        exposure: stops added to PNG and JPEG.
        side: axis of light positions from top to bottom; None: the first.
        at: "AXIS=PLACE" for the other axes; the default is their middle.
        progress: called after each image.

    Raises:
        JobError: an axis or a place is unknown, or images would be too small at that width.
        OutputError: an image is missing or damaged, or the target cannot be written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format = _image_format(target, exposure)
    require_writer(image_format.format)
    manifest = read_manifest(out)
    axis = side if side is not None else next(iter(manifest.axes))
    fixed = _read_fixed_lights(manifest, axis, at)
    cameras = evenly_spaced(manifest.n_cameras, columns)
    lights = evenly_spaced(manifest.axes[axis], rows)
    labels = [f"{axis} {l}" for l in lights] if image_format.format in FOR_SCREENS else []
    tile = _tile_size(manifest, len(cameras), width, labels)
    tiles = _read_tiles(manifest, cameras, lights, (list(manifest.axes).index(axis), fixed), tile, progress)
    if labels:
        codes = _draw_sheet(tiles * np.float32(2.0**exposure), cameras, labels, _heads(manifest, axis, fixed), width)
        write_codes(target, codes, image_format)
        size = (codes.shape[1], codes.shape[0])
    else:
        n_rows, n_columns, tile_height, tile_width, _ = tiles.shape
        size = (n_columns * tile_width, n_rows * tile_height)
        write_image(target, tiles.swapaxes(1, 2).reshape(size[1], size[0], 3), image_format)
    return SheetResult(target=target, cameras=cameras, lights=lights, size=size)


def area_mean(image: Image, width: int, height: int) -> Image:
    """Shrink a linear image: each new pixel is the mean over its area, which may cut pixels.

    Args:
        image: (h, w, 3).
        width, height: pixels, at most those of the image.

    Returns:
        (height, width, 3) float32.
    """
    rows, columns = _shares(image.shape[0], height), _shares(image.shape[1], width)
    narrow = np.einsum("xw,hwk->hxk", columns, image, optimize=True)
    return np.asarray(np.einsum("yh,hxk->yxk", rows, narrow, optimize=True), np.float32)


def _shares(n: int, m: int) -> Float32:
    """Return the share (m, n) that each of n pixels has in each of m; rows sum to 1."""
    edges = np.arange(m + 1) * (n / m)
    low, high = np.arange(n)[None, :], np.arange(1, n + 1)[None, :]
    overlap = np.minimum(high, edges[1:, None]) - np.maximum(low, edges[:-1, None])
    return np.asarray(np.maximum(overlap, 0) * (m / n), np.float32)


def _image_format(target: Path, exposure: float) -> ImageFormat:
    name = format_name(target)
    if name not in get_args(Extension):
        raise OutputError(f"{target}: expected a .png, .jpg, .exr or .tif")
    if exposure and name not in FOR_SCREENS:
        raise OutputError(f"{target}: exposure changes only PNG and JPEG; {target.suffix} keeps the radiance")
    return ImageFormat(format=name)  # type: ignore[arg-type]  # just checked


def _read_fixed_lights(manifest: Manifest, axis: str, at: Sequence[str]) -> LightIndices:
    """Read the index along each axis that is not shown; the one along the shown axis is void."""
    if axis not in manifest.axes:
        raise JobError("--side", [f"expected one of the axes {', '.join(manifest.axes)}, got {shown(axis)}"])
    if any(text.partition("=")[0] == axis for text in at):
        raise JobError("--at", [f"expected other axes than {axis}, all of which is shown"])
    found = read_light_indices(manifest, None, at, MIDDLE_PLACE)
    if len(found) != 1:
        raise JobError("--at", ["expected one place for each axis, got several"])
    return found[0]


def _tile_size(manifest: Manifest, n_columns: int, width: int, labels: Sequence[str]) -> tuple[int, int]:
    """Return width and height of each image on a sheet with these labels at its side."""
    full_width, full_height = manifest.resolution
    room = (width - 2 * MARGIN - _gutter(labels) + GAP) // n_columns - GAP if labels else width // n_columns
    if room < LEAST_TILE:
        raise JobError("--width", [f"{width} pixels are too few for {n_columns} columns; try fewer --columns"])
    tile_width = min(room, full_width)
    return tile_width, max(1, round(tile_width * full_height / full_width))


def _read_tiles(
    manifest: Manifest,
    cameras: Sequence[int],
    lights: Sequence[int],
    fixed: tuple[int, LightIndices],
    tile: tuple[int, int],
    progress: Progress | None,
) -> Float32:
    """Read all images, and shrink them: (rows, columns, height, width, 3).

    Args:
        fixed: which axis is shown, and the index along each other axis.
    """
    pictures, (side, others) = Pictures(manifest), fixed
    tiles = np.empty((len(lights), len(cameras), tile[1], tile[0], 3), np.float32)
    for i, c in enumerate(cameras):
        for j, l in enumerate(lights):
            tiles[j, i] = area_mean(pictures.picture(c, (*others[:side], l, *others[side + 1 :])), *tile)
            if progress:
                progress(i * len(lights) + j + 1, len(cameras) * len(lights))
    return tiles


def _heads(manifest: Manifest, axis: str, fixed: LightIndices) -> Sequence[str]:
    """Word the head line: the name, and a text of counts."""
    width, height = manifest.resolution
    counts = [_count(manifest.n_cameras, "camera")]
    counts += [_count(n, "light") if name == MAIN_AXIS else f"{n} of {name}" for name, n in manifest.axes.items()]
    text = f"{' x '.join(counts)},  {width} x {height} pixels"
    others = [f"at {name} {l}" for name, l in zip(manifest.axes, fixed, strict=True) if name != axis]
    return manifest.name, ",  ".join([text, *others])


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'s' if n > 1 else ''}"


def _draw_sheet(
    tiles: Float32, cameras: Sequence[int], labels: Sequence[str], heads: Sequence[str], width: int
) -> Bytes:
    """Put small images on a sheet with labels; the head line may widen it to `width`. Return (h, w, 3) sRGB codes."""
    import PIL.Image
    import PIL.ImageDraw

    n_rows, n_columns, tile_height, tile_width, _ = tiles.shape
    left, top = MARGIN + _gutter(labels), MARGIN + HEAD_TEXT + 2 * LABEL_TEXT + 12
    step_x, step_y = tile_width + GAP, tile_height + GAP
    head_width = 2 * MARGIN + HEAD_TEXT + int(_length(heads[0], HEAD_TEXT) + _length(heads[1])) + 1
    sheet_width = max(left + n_columns * step_x - GAP + MARGIN, min(head_width, width))
    height = top + n_rows * step_y - GAP + MARGIN
    sheet = np.full((height, sheet_width, 3), SHEET_GREY, np.uint8)
    for j in range(n_rows):
        for i in range(n_columns):
            x, y = left + i * step_x, top + j * step_y
            sheet[y : y + tile_height, x : x + tile_width] = srgb8_from_linear(tiles[j, i])
    picture = PIL.Image.fromarray(sheet)
    draw = PIL.ImageDraw.Draw(picture)
    _draw_heads(draw, heads, sheet_width)
    font, grey = typeface(LABEL_TEXT), (LABEL,) * 3
    names = [f"camera {c}" for c in cameras]
    if max(_length(name) for name in names) + LABEL_TEXT > step_x:
        names = [str(c) for c in cameras]
    stride = _label_stride(max(_length(name) for name in names) + LABEL_TEXT / 2, step_x)
    for i in range(0, n_columns, stride):
        draw.text((left + i * step_x + tile_width / 2, top - 7), names[i], font=font, fill=grey, anchor="ms")
    for j in range(0, n_rows, _label_stride(LABEL_TEXT, step_y)):
        y = top + j * step_y + tile_height / 2
        draw.text((left - LABEL_TEXT, y), labels[j], font=font, fill=grey, anchor="rm")
    return np.asarray(picture)


def _draw_heads(draw: Any, heads: Sequence[str], width: int) -> None:
    """Draw the name large and the counts beside it, cut where the sheet is too narrow."""
    base, left, right = MARGIN + HEAD_TEXT - 5, float(MARGIN), width - MARGIN
    for text, size, code in ((heads[0], HEAD_TEXT, HEADING), (heads[1], LABEL_TEXT, LABEL)):
        cut = text
        while cut and left + _length(cut, size) > right:
            cut = cut.removesuffix("...")[:-1] and f"{cut.removesuffix('...')[:-1]}..."
        draw.text((left, base), cut, font=typeface(size), fill=(code,) * 3, anchor="ls")
        left += _length(cut, size) + HEAD_TEXT


def _length(text: str, size: int = LABEL_TEXT) -> float:
    """Return the width of a text, pixels."""
    return float(typeface(size).getlength(text))


def _gutter(labels: Sequence[str]) -> int:
    """Return the width of the labels at the side, pixels."""
    return int(max(_length(label) for label in labels)) + 1 + LABEL_TEXT


def _label_stride(length: float, step: int) -> int:
    """Return the number of images per label, so that labels do not touch."""
    return max(1, math.ceil(length / step))
