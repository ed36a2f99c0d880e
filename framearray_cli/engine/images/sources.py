"""Hits to sum, as addresses that kernels read: a pixel's hits come from the eyes of a window, holes and mirrors."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from framearray_cli.base.arrays import Addresses, Bytes, Float32

from ..frames.records import HitRecords, HitsByPixel

# Columns of a list of sources: addresses of arrays, 0 for an empty one; and what the arrays hold. Hits weighed by area
# are one list over all sources (`area_weights.py`): SHARES is that of a weight per entry of ORDER in place of one per
# hit, OF that of the source of each entry, as the number of rows from the list to it. These rows have no START.
# GLOSS_COLUMNS is no address, but the number of columns of GLOSS; EYE is that of a position.
START, ORDER, WEIGHTS, SCALE, ODD_SCALE, ROW, IRRADIANCE, GATHERED, EMISSION, HOURS, GLOSS, PLACES = range(12)
MARKS, FRONT, GLOSS_COLUMNS, SHARES, OF, EYE = range(12, 18)
COLUMNS = 18
_TYPES = (np.int32, np.int32, *[np.float32] * 9, np.uint8, np.float32, np.float32)
NO_SCALE, _NO_PLACES = np.empty(0, np.float32), np.empty(0, np.uint8)
NO_FRONT = np.empty((0, 2), np.float32)
NO_SOURCES: Addresses = np.empty((0, COLUMNS), np.int64)


class HitSource(NamedTuple):
    """Hits of one eye, or of one frame's holes or mirrors.

    Attributes:
        by_pixel: the hits of each pixel.
        records: of all hits.
        weight: (n_hits,) w of each hit, or (0,) where all weigh 1.
        scale: (n_pixels,) a factor for all hits of a pixel, or (0,) where it is 1.
        odd_scale: (n_pixels,) the factor for odd samples, or (0,) where it is the same.
        eye: (3,) where gloss of the hits is seen from; (0,) where it is seen from the eye of the image.
        place: (n_hits,) where each hit lies in its pixel, see `hits/places.py`; (0,) where nobody asks.
        front: (n_hits, 2) the pane before each hit, see `inputs/marks.py`; (0, 2) where nobody asks.
    """

    by_pixel: HitsByPixel
    records: HitRecords
    weight: Float32 = NO_SCALE
    scale: Float32 = NO_SCALE
    odd_scale: Float32 = NO_SCALE
    place: Bytes = _NO_PLACES
    eye: Float32 = NO_SCALE
    front: Float32 = NO_FRONT

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """The arrays in the order of the columns of a list."""
        found, records = self.by_pixel, self.records
        in_order = (found.start, found.order, self.weight, self.scale, self.odd_scale)
        light = (records.row, records.irradiance, records.indirect, records.emission, records.sun_hours, records.gloss)
        return (*in_order, *light, self.place, records.marks, self.front)


class SourceList:
    """Hits of several sources, as `accumulate` takes them; keeps the arrays that it points into.

    Attributes:
        sources: the list.
        addresses: (n_sources, COLUMNS) of the arrays of each source, valid as long as the list lives.
    """

    def __init__(self, sources: Iterable[HitSource]) -> None:
        """List sources.

        Raises:
            ValueError: an array is not contiguous, or of another type than kernels read.
        """
        self.sources = list(sources)  # keeps the arrays
        rows = [
            [
                *(_address(array, dtype) for array, dtype in zip(source.arrays, _TYPES, strict=True)),
                *(source.records.gloss.shape[1], 0, 0, _address(source.eye, np.float32)),
            ]
            for source in self.sources
        ]
        self.addresses: Addresses = np.array(rows, np.int64).reshape(-1, COLUMNS)


def _address(array: NDArray[Any], dtype: DTypeLike) -> int:
    if array.dtype != dtype:
        raise ValueError(f"expected an array of {np.dtype(dtype)}, got one of {array.dtype}")
    if not array.flags.c_contiguous:
        raise ValueError(f"expected a contiguous array, got one of shape {array.shape} with strides {array.strides}")
    return array.ctypes.data if array.size else 0
