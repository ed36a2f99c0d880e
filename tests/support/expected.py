"""The pixels that the page must show, computed from the tiles by numpy, with bounds for the browser."""

import numpy as np

from framearray_cli.array.images import read_codes
from framearray_cli.base.arrays import Bytes, Float32, Float64
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear, srgb_from_linear
from framearray_cli.tools.view.coding import Coding
from framearray_cli.tools.view.tiles import Tiles

from .handmade import N_C, N_L, soft

Part = tuple[str, int, tuple[float, float, float]]  # key of a stream, position, RGB factor


def decode(codes: Bytes, coding: Coding) -> Float32:
    """Decode as the page's shader does: the inverse of `encode`, to half a code."""
    if not coding.scale:
        return np.asarray(coding.low + (coding.high - coding.low) * codes.astype(np.float32) / 255, np.float32)
    y = linear_from_srgb8(codes)
    x = 2 * y / ((1 - y) + np.sqrt((1 - y) ** 2 + 4 * y / coding.white**2))
    return np.asarray(coding.scale * x, np.float32)


def bounds(tiles: Tiles, c: int, parts: list[Part], exposure: float = 0.0) -> tuple[Float64, Float64]:
    """Lowest and highest 8-bit sRGB values of a sum of tiles, if decoders of JPEG differ by one code."""
    coding = {stream.key: stream.coding for stream in tiles.streams}
    ends = []
    for step in (-1, 1):
        total = np.zeros((*tiles.manifest.resolution[::-1], 3))
        for key, l, factor in parts:
            codes = read_codes(tiles.ensure_tile(key, c, l)).astype(np.int16) + step
            total += decode(np.clip(codes, 0, 255).astype(np.uint8), coding[key]) * np.array(factor)
        # half a code where the browser rounds
        ends.append(255 * srgb_from_linear(total * 2.0**exposure) + 0.5 * step)
    return ends[0], ends[1]


def outside(pixels: Bytes, low: Float64, high: Float64) -> float:
    """Return the share of values outside bounds."""
    return float(np.mean((pixels < low) | (pixels > high)))


def nearest_place(pixels: Bytes, exposure: float = 0.0) -> tuple[int, int]:
    """The (c, l) whose image of `handmade.plain` is most like the screen."""
    places = [(c, l) for c in range(N_C) for l in range(N_L)]
    errors = [
        np.abs(srgb8_from_linear(soft(c, l, 6.0) * 2.0**exposure) - pixels.astype(float)).mean() for c, l in places
    ]
    return places[int(np.argmin(errors))]
