"""A contact sheet: a frame array as one picture, cameras from left to right, light positions from top to bottom."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, get_args

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
from .places import MIDDLE, light_places, spread_with_ends

Progress: TypeAlias = Callable[[int, int], None]  # images done, images in all

COLUMNS, ROWS = 12, 8  # of an array of 192 x 48: 200 pixels a tile on a sheet that fits a screen
WIDTH = 2400  # pixels
LEAST_TILE = 8  # pixels; smaller ones show nothing

# sRGB codes, all neutral: a dark grey that neither dazzles nor tints what lies on it.
BACKGROUND, HEADING, LABEL = 38, 225, 160
GAP, MARGIN = 4, 24  # pixels
HEAD_TEXT, LABEL_TEXT = 22, 15  # height of the letters' boxes, pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetResult:
    """What was made.

    Attributes:
        target: the file.
        cameras: c of each column.
        places: index along the axis of each row.
        size: width and height, pixels.
    """

    target: Path
    cameras: tuple[int, ...]
    places: tuple[int, ...]
    size: tuple[int, int]


def make_sheet(
    out: Path,
    target: Path,
    *,
    columns: int = COLUMNS,
    rows: int = ROWS,
    width: int = WIDTH,
    exposure: float = 0.0,
    side: str | None = None,
    at: Sequence[str] = (),
    progress: Progress | None = None,
) -> SheetResult:
    """Draw a contact sheet of a frame array; the file appears whole or not at all.

    Images are made smaller by the mean over areas of linear light. PNG and JPEG have labels. EXR and TIFF keep the
    radiance, and hold the images alone, edge to edge.

    Args:
        out: output folder of a render, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        columns, rows: at most so many cameras and light positions, spread evenly.
        width: at most, pixels; images are never enlarged.
        exposure: stops added to PNG and JPEG.
        side: axis of light positions from top to bottom; None: the first.
        at: "AXIS=PLACE" for the other axes; without, their middle.
        progress: called after each image.

    Raises:
        JobError: an axis or a place is not known, or nothing would be seen at that width.
        OutputError: an image is missing or damaged, or the target cannot be written.
        MissingExtraError: labels cannot be drawn here, or the format not written.
    """
    image_format = _image_format(target, exposure)
    require_writer(image_format.format)
    manifest = read_manifest(out)
    axis = side if side is not None else next(iter(manifest.axes))
    place = _place_beside(manifest, axis, at)
    cameras = spread_with_ends(manifest.n_cameras, columns)
    places = spread_with_ends(manifest.axes[axis], rows)
    labels = [f"{axis} {l}" for l in places] if image_format.format in FOR_SCREENS else []
    tile = _tile(manifest, len(cameras), width, labels)
    tiles = _tiles(manifest, cameras, places, (list(manifest.axes).index(axis), place), tile, progress)
    if labels:
        codes = _drawn(tiles * np.float32(2.0**exposure), cameras, labels, _heads(manifest, axis, place), width)
        write_codes(target, codes, image_format)
        size = (codes.shape[1], codes.shape[0])
    else:
        n_rows, n_columns, tile_height, tile_width, _ = tiles.shape
        size = (n_columns * tile_width, n_rows * tile_height)
        write_image(target, tiles.swapaxes(1, 2).reshape(size[1], size[0], 3), image_format)
    return SheetResult(target=target, cameras=cameras, places=places, size=size)


def area_mean(image: Image, width: int, height: int) -> Image:
    """Make a linear image smaller: each new pixel is the mean over its area, with parts of pixels at its border.

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
    """(m, n): the share that each of n pixels has in each of m; rows sum to 1."""
    edges = np.arange(m + 1) * (n / m)
    low, high = np.arange(n)[None, :], np.arange(1, n + 1)[None, :]
    overlap = np.minimum(high, edges[1:, None]) - np.maximum(low, edges[:-1, None])
    return np.asarray(np.maximum(overlap, 0) * (m / n), np.float32)


def _image_format(target: Path, exposure: float) -> ImageFormat:
    name = format_name(target)
    if name not in get_args(Extension):
        raise OutputError(f"{target}: expected a .png, .jpg, .exr or .tif")
    if exposure and name not in FOR_SCREENS:
        raise OutputError(f"{target}: exposure changes PNG and JPEG alone; {target.suffix} keeps the radiance")
    return ImageFormat(format=name)  # type: ignore[arg-type]  # just checked


def _place_beside(manifest: Manifest, axis: str, at: Sequence[str]) -> tuple[int, ...]:
    """The one light place of the axes that are not shown; that of the shown one means nothing."""
    if axis not in manifest.axes:
        raise JobError("--side", [f"expected one of the axes {', '.join(manifest.axes)}, got {shown(axis)}"])
    if any(text.partition("=")[0] == axis for text in at):
        raise JobError("--at", [f"expected other axes than {axis}, all of which is shown"])
    places = light_places(manifest, None, at, MIDDLE)
    if len(places) != 1:
        raise JobError("--at", ["expected one place for each axis, got several"])
    return places[0]


def _tile(manifest: Manifest, n_columns: int, width: int, labels: Sequence[str]) -> tuple[int, int]:
    """Width and height of each image on a sheet with those labels at its side."""
    full_width, full_height = manifest.resolution
    room = (width - 2 * MARGIN - _gutter(labels) + GAP) // n_columns - GAP if labels else width // n_columns
    if room < LEAST_TILE:
        raise JobError("--width", [f"{width} pixels are too few for {n_columns} columns; try fewer --columns"])
    tile_width = min(room, full_width)
    return tile_width, max(1, round(tile_width * full_height / full_width))


def _tiles(
    manifest: Manifest,
    cameras: Sequence[int],
    places: Sequence[int],
    beside: tuple[int, tuple[int, ...]],
    tile: tuple[int, int],
    progress: Progress | None,
) -> Float32:
    """All images, small: (rows, columns, height, width, 3)."""
    pictures, (shown, place) = Pictures(manifest), beside
    tiles = np.empty((len(places), len(cameras), tile[1], tile[0], 3), np.float32)
    for i, c in enumerate(cameras):
        for j, l in enumerate(places):
            tiles[j, i] = area_mean(pictures.picture(c, (*place[:shown], l, *place[shown + 1 :])), *tile)
            if progress:
                progress(i * len(places) + j + 1, len(cameras) * len(places))
    return tiles


def _heads(manifest: Manifest, axis: str, place: Sequence[int]) -> Sequence[str]:
    """The head line: name, and what there is."""
    width, height = manifest.resolution
    counts = [_counted(manifest.n_cameras, "camera")]
    counts += [_counted(n, "light") if name == MAIN_AXIS else f"{n} of {name}" for name, n in manifest.axes.items()]
    text = f"{' x '.join(counts)},  {width} x {height} pixels"
    beside = [f"at {name} {l}" for name, l in zip(manifest.axes, place, strict=True) if name != axis]
    return manifest.name, ",  ".join([text, *beside])


def _counted(n: int, noun: str) -> str:
    return f"{n} {noun}{'s' if n > 1 else ''}"


def _drawn(tiles: Float32, cameras: Sequence[int], labels: Sequence[str], heads: Sequence[str], most: int) -> Bytes:
    """Put small images on a sheet with labels, at most so wide: (height, width, 3) sRGB codes."""
    import PIL.Image
    import PIL.ImageDraw

    n_rows, n_columns, tile_height, tile_width, _ = tiles.shape
    left, top = MARGIN + _gutter(labels), MARGIN + HEAD_TEXT + 2 * LABEL_TEXT + 12
    step_x, step_y = tile_width + GAP, tile_height + GAP
    width = left + n_columns * step_x - GAP + MARGIN
    width = max(width, min(2 * MARGIN + HEAD_TEXT + int(_length(heads[0], HEAD_TEXT) + _length(heads[1])) + 1, most))
    height = top + n_rows * step_y - GAP + MARGIN
    sheet = np.full((height, width, 3), BACKGROUND, np.uint8)
    for j in range(n_rows):
        for i in range(n_columns):
            x, y = left + i * step_x, top + j * step_y
            sheet[y : y + tile_height, x : x + tile_width] = srgb8_from_linear(tiles[j, i])
    picture = PIL.Image.fromarray(sheet)
    draw = PIL.ImageDraw.Draw(picture)
    _write_heads(draw, heads, width)
    font, grey = typeface(LABEL_TEXT), (LABEL,) * 3
    names = [f"camera {c}" for c in cameras]
    if max(_length(name) for name in names) + LABEL_TEXT > step_x:
        names = [str(c) for c in cameras]
    every = _every(max(_length(name) for name in names) + LABEL_TEXT / 2, step_x)
    for i in range(0, n_columns, every):
        draw.text((left + i * step_x + tile_width / 2, top - 7), names[i], font=font, fill=grey, anchor="ms")
    for j in range(0, n_rows, _every(LABEL_TEXT, step_y)):
        y = top + j * step_y + tile_height / 2
        draw.text((left - LABEL_TEXT, y), labels[j], font=font, fill=grey, anchor="rm")
    return np.asarray(picture)


def _write_heads(draw: Any, heads: Sequence[str], width: int) -> None:
    """The name large, the rest beside it; cut where the sheet is too narrow."""
    base, left, right = MARGIN + HEAD_TEXT - 5, float(MARGIN), width - MARGIN
    for text, size, code in ((heads[0], HEAD_TEXT, HEADING), (heads[1], LABEL_TEXT, LABEL)):
        shown = text
        while shown and left + _length(shown, size) > right:
            shown = shown.removesuffix("...")[:-1] and f"{shown.removesuffix('...')[:-1]}..."
        draw.text((left, base), shown, font=typeface(size), fill=(code,) * 3, anchor="ls")
        left += _length(shown, size) + HEAD_TEXT


def _length(text: str, size: int = LABEL_TEXT) -> float:
    """Pixels that a text takes."""
    return float(typeface(size).getlength(text))


def _gutter(labels: Sequence[str]) -> int:
    """Room for the labels at the side, pixels."""
    return int(max(_length(label) for label in labels)) + 1 + LABEL_TEXT


def _every(length: float, step: int) -> int:
    """One label for how many images, so that they do not touch."""
    return max(1, math.ceil(length / step))
