"""Tiles of the page: the 8-bit coding of radiance, and stamps that tell if a tile is up to date.

    y = x (1 + x / w^2) / (1 + x),   x = radiance / scale,   code = 255 sRGB(y)       ([Reinhard02] eq. 4)

y = 1 at x = w, so w is the brightest x that survives; values above white leave room for the exposure slider. Dark
values keep their sRGB codes (dy/dx = 1 at 0), x = 1 has code 188 for large w, and w = 1 gives the plain sRGB curve.

A stamp is a digest of the coding, and of time and size of each source file or of its absence. It is a comment in the
JPEG, so a tile and its stamp appear together, and stay together in a copy.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import encode_jpeg
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.base.files import line_digest, write_bytes

# A source file as it was found: time of its last change, nanoseconds, and size, bytes.
Source: TypeAlias = tuple[int, int]
# Beyond it one code step exceeds a tenth of the value, and a lamp seen directly is white at any exposure.
MOST_WHITE = 64.0
# White over the largest sampled value; other pictures may be brighter.
WHITE_MARGIN = 2.0
# 4:4:4. At 90 files are a quarter larger, and the error in a noisy picture is 3.3 codes instead of 4.1.
QUALITY = 85
HEAD = 64  # bytes of a tile with its stamp


@dataclass(frozen=True, slots=True, kw_only=True)
class Coding:
    """The coding of one kind of picture.

    Attributes:
        scale: radiance at x = 1; 0: not radiance, but data, coded linearly from `low` to `high`.
        white: the largest x, w.
        low, high: range of data.
    """

    scale: float = 1.0
    white: float = 1.0
    low: float = 0.0
    high: float = 1.0


PLAIN_CODING = Coding()


def coding_for(largest: float) -> Coding:
    """Choose the coding of radiance up to a largest value; dark pictures use all codes as well.

    Scale and white are powers of two, so that an array keeps its tiles when rendered again a little brighter.
    """
    if not 0 < largest < np.inf:
        return PLAIN_CODING
    scale = min(1.0, _power_of_two(largest))
    return Coding(scale=scale, white=min(_power_of_two(WHITE_MARGIN * largest / scale), MOST_WHITE))


def data_coding(largest: float) -> Coding:
    """Choose the coding of data from 0 to a largest value, rounded up to two digits."""
    if not 0 < largest < np.inf:
        return Coding(scale=0.0)
    step = 10.0 ** (math.floor(math.log10(largest)) - 1)
    return Coding(scale=0.0, high=float(f"{math.ceil(largest / step * (1 - 1e-6)) * step:.6g}"))


def _power_of_two(value: float) -> float:
    """Return the least power of two that is not below a value."""
    return float(2.0 ** math.ceil(math.log2(value)))


def encode(values: Float32, coding: Coding) -> Bytes:
    """Encode values of any shape; values outside the range are clipped to it, NaN becomes 0."""
    if not coding.scale:
        span = max(coding.high - coding.low, float(np.finfo(np.float32).tiny))
        shares = np.nan_to_num((values - coding.low) / span, nan=0.0)
        codes: Bytes = np.rint(255 * np.clip(shares, 0, 1)).astype(np.uint8)
        return codes
    with np.errstate(over="ignore"):
        half = (values * np.float32(1 / coding.scale)).astype(np.float16)
    return np.take(_code_of_half(coding.white), half.view(np.uint16))


@lru_cache(maxsize=64)
def _code_of_half(white: float) -> Bytes:
    """Tabulate the codes of all 65536 half floats; rounding to half moves a code by at most 0.06."""
    halves = np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float64)
    x = np.clip(np.nan_to_num(halves, nan=0.0, posinf=white), 0, white)
    codes: NDArray[Any] = np.rint(255 * srgb_from_linear(x * (1 + x / white**2) / (1 + x)))
    return codes.astype(np.uint8)


def source_of(path: Path | os.DirEntry[str]) -> Source | None:
    """Return a source file as it is now; None if it is not there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def stamp_of(how: str, sources: Sequence[Source | None]) -> str:
    """Return the stamp of a tile, 16 hexadecimal digits; "" if no source is there.

    Args:
        how: a text of all that the tile depends on apart from its sources.
    """
    if not any(sources):
        return ""
    return line_digest(repr((how, list(sources))).encode()).decode()


def write_tile(path: Path, codes: Bytes, stamp: str) -> None:
    """Write a tile, (h, w, 3) codes, whole or not at all."""
    write_bytes(path, encode_jpeg(codes, QUALITY, comment=stamp))


def is_fresh(path: Path, stamp: str) -> bool:
    """Return whether a tile is there and has this stamp."""
    try:
        with path.open("rb") as file:
            return bool(stamp) and stamp.encode() in file.read(HEAD)
    except OSError:
        return False
