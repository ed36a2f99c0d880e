"""Hits to sum, as addresses that kernels read: a pixel's hits come from the eyes of a window, holes and mirrors."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Addresses, Float32

from ..frames.records import HitsByPixel

# Columns of a list of sources: addresses of arrays, 0 for an empty one. Hits weighed by area are one list over all
# sources (`area.py`): SHARES is the address of a weight per entry of ORDER instead of one per hit, OF the address of
# each entry's source, as the number of rows from the list to it. These rows have no START. EYE is the address of a
# position; MIRRORED is no address, but 1 for reflected hits.
START, ORDER, SCALE, ODD_SCALE, SHARES, OF, EYE, MIRRORED = range(8)
WEIGHTS, SUBPIXELS, ROW, LIGHTS, EMISSION = range(8, 13)
# The columns of hits that kernels know by number; columns of layers follow.
NUMBERED = {
    "weight": WEIGHTS, "subpixel": SUBPIXELS, "row": ROW, "light": LIGHTS, "emission": EMISSION,
}  # fmt: skip
FIRST_LAYER = 13
NO_SCALE = np.empty(0, np.float32)


class HitSource(NamedTuple):
    """Hits of one eye, or of one frame's holes or mirrors.

    Attributes:
        by_pixel: the hits of each pixel.
        columns: of all hits, (n_hits, *shape) by name; without a weight all hits count as 1.
        scale: (n_pixels,) a factor for all hits of a pixel, or (0,) where it is 1.
        odd_scale: (n_pixels,) the factor for odd samples, or (0,) where it is the same.
        eye: (3,) where gloss of the hits is seen from; (0,) where it is seen from the eye of the image.
        mirrored: True for reflected hits.
    """

    by_pixel: HitsByPixel
    columns: Mapping[str, Any]
    scale: Float32 = NO_SCALE
    odd_scale: Float32 = NO_SCALE
    eye: Float32 = NO_SCALE
    mirrored: bool = False


class SourceList:
    """Hits of several sources, as `accumulate` takes them; keeps the arrays that it points into.

    Attributes:
        sources: the list.
        columns: column of hits -> column of `addresses`.
        addresses: (n_sources, n_columns) of the arrays of each source, valid as long as the list lives.
    """

    def __init__(self, sources: Iterable[HitSource]) -> None:
        """List sources.

        Raises:
            ValueError: an array is not contiguous, or of another type than kernels read.
        """
        self.sources = list(sources)  # keeps the arrays
        layers = dict.fromkeys(name for s in self.sources for name in s.columns if name not in NUMBERED)
        self.columns = NUMBERED | {name: FIRST_LAYER + k for k, name in enumerate(layers)}
        self.addresses: Addresses = np.zeros((len(self.sources), FIRST_LAYER + len(layers)), np.int64)
        for row, source in zip(self.addresses, self.sources, strict=True):
            row[START], row[ORDER] = _address(source.by_pixel.start), _address(source.by_pixel.order)
            row[SCALE], row[ODD_SCALE] = _address(source.scale), _address(source.odd_scale)
            row[EYE], row[MIRRORED] = _address(source.eye), source.mirrored
            for name, array in source.columns.items():
                row[self.columns[name]] = _address(array)

    def addresses_from(self, pixel: int) -> Addresses:
        """The addresses for kernels that count pixels from this one."""
        found = self.addresses.copy()
        for column in (START, SCALE, ODD_SCALE):  # arrays of a number of 4 bytes per pixel
            found[:, column] += np.where(found[:, column] != 0, 4 * pixel, 0)
        return found


def _address(array: NDArray[Any]) -> int:
    if array.dtype not in (np.float32, np.int32, np.int64, np.uint8, np.uint16):
        raise ValueError(f"expected an array of float32, int32, int64, uint8 or uint16, got one of {array.dtype}")
    if not array.flags.c_contiguous:
        raise ValueError(f"expected a contiguous array, got one of shape {array.shape} with strides {array.strides}")
    return array.ctypes.data if array.size else 0
