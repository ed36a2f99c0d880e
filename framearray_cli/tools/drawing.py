"""Text in pictures, and contact sheets: small images on a grey ground, with labels. Letters are Pillow's typeface."""

import math
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.extras import extra

LINES_PER_PICTURE = 18  # heights of the text per height of the picture
SMALLEST = 10  # pixels; smaller letters cannot be read
SHADE = 0.35  # share of the picture's brightness left behind the text
# sRGB codes, all neutral: a dark grey that neither dazzles nor tints the images on it.
SHEET_GREY, HEADING, LABEL = 38, 225, 160
GAP, MARGIN = 4, 24  # pixels
HEAD_TEXT, LABEL_TEXT = 22, 15  # height of the letters' boxes, pixels
SCALE = 400  # longest, pixels
BLANK, STRIPE = "missing", 12  # an image that is not there: a word, and the distance of stripes in pixels


def burn(codes: NDArray[Any], text: str) -> NDArray[Any]:
    """Write a text into a picture.

    Args:
        codes: (h, w, 3) uint8 or uint16.

    Returns:
        A copy with white letters on darkened ground. Long text is smaller; text beyond the picture is cut off.
    """
    size = codes.shape[0] // LINES_PER_PICTURE
    fit = size * codes.shape[1] // _letters(text, max(SMALLEST, size)).shape[1]
    letters = _letters(text, max(SMALLEST, min(size, fit)))[: codes.shape[0], : codes.shape[1]]
    height, width = letters.shape
    white = np.iinfo(codes.dtype).max
    ground = codes[-height:, :width] * np.float32(SHADE)
    share = letters[..., None]
    burnt = codes.copy()
    burnt[-height:, :width] = np.rint(ground * (1 - share) + white * share).astype(codes.dtype)
    return burnt


@cache
def typeface(size: int) -> Any:
    """Return Pillow's own typeface, the same on every machine; it has only Latin letters.

    Args:
        size: of the letters, pixels.

    Raises:
        MissingExtraError: Pillow is built without FreeType, which draws it.
    """
    from PIL import ImageFont

    with extra("labels need Pillow with FreeType", "--force-reinstall Pillow", reason=True):
        return ImageFont.load_default(size)


@lru_cache(64)
def _letters(text: str, size: int) -> Float32:
    """Draw a text with a margin around it: (h, w), 1 where a letter is."""
    from PIL import Image, ImageDraw

    font = typeface(size)
    margin = size // 3
    _, top, right, bottom = font.getbbox("0123456789clp" + text)
    right = font.getbbox(text)[2]
    sheet = Image.new("L", (int(right) + 2 * margin, int(bottom - top) + 2 * margin), 0)
    ImageDraw.Draw(sheet).text((margin, margin - top), text, fill=255, font=font)
    return np.asarray(sheet, np.float32) / np.float32(255)


def _canvas(codes: Bytes) -> tuple[Any, Any]:
    """Return a picture, and what draws on it."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(codes)
    return picture, ImageDraw.Draw(picture)


def _write(draw: Any, x: float, y: float, text: str, anchor: str, size: int = LABEL_TEXT, code: int = LABEL) -> None:
    """Write a text into a picture; Pillow names the anchors."""
    draw.text((x, y), text, font=typeface(size), fill=(code,) * 3, anchor=anchor)


def draw_sheet(
    tiles: Bytes,
    columns: Sequence[int],
    labels: Sequence[str],
    heads: Sequence[str],
    width: int,
    noun: str = "camera ",
) -> Bytes:
    """Put small images on a sheet with labels; return (h, w, 3) sRGB codes.

    Args:
        columns: a number over each column, with the noun before it where there is room.
        labels: one per row.
        width: pixels, to which the head line may widen the sheet.
    """
    n_rows, n_columns, tile_height, tile_width, _ = tiles.shape
    left, top = MARGIN + gutter(labels), MARGIN + HEAD_TEXT + 2 * LABEL_TEXT + 12
    step_x, step_y = tile_width + GAP, tile_height + GAP
    head_width = 2 * MARGIN + HEAD_TEXT + int(_length(heads[0], HEAD_TEXT) + _length(heads[1])) + 1
    sheet_width = max(left + n_columns * step_x - GAP + MARGIN, min(head_width, width))
    height = top + n_rows * step_y - GAP + MARGIN
    sheet = np.full((height, sheet_width, 3), SHEET_GREY, np.uint8)
    for j, i in np.ndindex(n_rows, n_columns):
        x, y = left + i * step_x, top + j * step_y
        sheet[y : y + tile_height, x : x + tile_width] = tiles[j, i]
    picture, draw = _canvas(sheet)
    _draw_heads(draw, heads, sheet_width)
    names = [f"{noun}{c}" for c in columns]
    if max(map(_length, names), default=0) + LABEL_TEXT > step_x:
        names = [str(c) for c in columns]
    stride = _label_stride(max(map(_length, names), default=0) + LABEL_TEXT / 2, step_x)
    for i in range(0, len(names), stride):
        _write(draw, left + i * step_x + tile_width / 2, top - 7, names[i], "ms")
    for j in range(0, n_rows, _label_stride(LABEL_TEXT, step_y)):
        _write(draw, left - LABEL_TEXT, top + j * step_y + tile_height / 2, labels[j], "rm")
    return np.asarray(picture)


def draw_scale(sheet: Bytes, ramp: Bytes, most: float, unit: str) -> Bytes:
    """Add a scale below a sheet: a bar with its colours, and values from 0 to `most`.

    Args:
        ramp: (1, n, 3) codes of the bar, from left to right.
    """
    height, width, _ = sheet.shape
    picture, draw = _canvas(np.pad(sheet, ((0, 3 * LABEL_TEXT), (0, 0), (0, 0)), constant_values=SHEET_GREY))
    left, length = 2 * MARGIN, max(min(SCALE, width - 6 * MARGIN), 1)
    picture.paste(_canvas(ramp)[0].resize((length, LABEL_TEXT)), (left, height))
    gap = LABEL_TEXT // 2
    _write(draw, left - gap, height + gap, "0", "rm")
    _write(draw, left + length + gap, height + gap, f"{most:g} {unit}", "lm")
    return np.asarray(picture)


def _draw_heads(draw: Any, heads: Sequence[str], width: int) -> None:
    """Draw the name large and the counts next to it, cut if the sheet is too narrow."""
    base, left, right = MARGIN + HEAD_TEXT - 5, float(MARGIN), width - MARGIN
    for text, size, code in ((heads[0], HEAD_TEXT, HEADING), (heads[1], LABEL_TEXT, LABEL)):
        cut = text
        while cut and left + _length(cut, size) > right:
            cut = cut.removesuffix("...")[:-1] and f"{cut.removesuffix('...')[:-1]}..."
        _write(draw, left, base, cut, "ls", size, code)
        left += _length(cut, size) + HEAD_TEXT


def _length(text: str, size: int = LABEL_TEXT) -> float:
    """Return the width of a text, pixels."""
    return float(typeface(size).getlength(text))


def gutter(labels: Sequence[str]) -> int:
    """Return the width of the labels at the side, pixels."""
    return int(max(_length(label) for label in labels)) + 1 + LABEL_TEXT


def _label_stride(length: float, step: int) -> int:
    """Return the number of images per label, so that labels do not touch."""
    return max(1, math.ceil(length / step))


def blank_tile(width: int, height: int) -> Bytes:
    """Draw the tile of a missing image: stripes, and a word where it fits; (height, width, 3) codes."""
    rows, columns = np.mgrid[:height, :width]
    stripes = np.where((rows + columns) % STRIPE < STRIPE // 4, SHEET_GREY + 24, SHEET_GREY - 16).astype(np.uint8)
    picture, draw = _canvas(np.repeat(stripes[..., None], 3, axis=2))
    if _length(BLANK) + LABEL_TEXT < width and height > 2 * LABEL_TEXT:
        x, y, w, h = width / 2, height / 2, _length(BLANK) / 2 + 6, 0.7 * LABEL_TEXT
        draw.rectangle((x - w, y - h, x + w, y + h), fill=(SHEET_GREY - 16,) * 3)
        _write(draw, x, y, BLANK, "mm")
    return np.asarray(picture)
