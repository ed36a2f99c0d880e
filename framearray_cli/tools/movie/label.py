"""Labels: text in the lower left corner of a picture, in Pillow's own typeface."""

from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32
from framearray_cli.base.extras import extra

LINES_PER_PICTURE = 18  # heights of the text per height of the picture
SMALLEST = 10  # pixels; smaller letters cannot be read
SHADE = 0.35  # share of the picture's brightness left behind the text


def burn(codes: NDArray[Any], text: str) -> NDArray[Any]:
    """Write a text into a picture.

    Args:
        codes: (h, w, 3) uint8 or uint16.

    Returns:
        A copy with white letters on darkened ground; text beyond the picture is cut off.
    """
    letters = _letters(text, max(SMALLEST, codes.shape[0] // LINES_PER_PICTURE))[: codes.shape[0], : codes.shape[1]]
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
