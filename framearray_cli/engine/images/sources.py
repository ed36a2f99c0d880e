"""Hits to sum, as addresses that kernels read: a pixel's hits come from the eyes of a window, holes and mirrors."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from framearray_cli.base.arrays import Addresses, Float32

from ..frames.records import HitRecords, HitsByPixel

# Columns of a list of sources: addresses of arrays, 0 for an empty one; and what the arrays hold.
START, ORDER, WEIGHTS, SCALE, ODD_SCALE, ROW, IRRADIANCE = range(7)
_TYPES = (np.int32, np.int32, np.float32, np.float32, np.float32, np.float32, np.float32)
_NOTHING = np.empty(0, np.float32)


class HitSource(NamedTuple):
    """Hits of one eye, or of one frame's holes or mirrors.

    Attributes:
        by_pixel: the hits of each pixel.
        records: of all hits.
        weight: (n_hits,) w of each hit, or (0,) where all weigh 1.
        scale: (n_pixels,) a factor for all hits of a pixel, or (0,) where it is 1.
        odd_scale: (n_pixels,) the factor for odd samples, or (0,) where it is the same.
    """

    by_pixel: HitsByPixel
    records: HitRecords
    weight: Float32 = _NOTHING
    scale: Float32 = _NOTHING
    odd_scale: Float32 = _NOTHING


class SourceList:
    """Hits of several sources, as `accumulate` takes them; keeps the arrays that it points into.

    Attributes:
        addresses: (n_sources, 7) of the arrays of each source, valid as long as the list lives.
    """

    def __init__(self, sources: Iterable[HitSource]) -> None:
        """List sources.

        Raises:
            ValueError: an array is not contiguous, or of another type than kernels read.
        """
        self._kept = [
            (s.by_pixel.start, s.by_pixel.order, s.weight, s.scale, s.odd_scale, s.records.row, s.records.irradiance)
            for s in sources
        ]
        rows = [[_address(*of_column) for of_column in zip(arrays, _TYPES, strict=True)] for arrays in self._kept]
        self.addresses: Addresses = np.array(rows, np.int64).reshape(-1, len(_TYPES))


def _address(array: NDArray[Any], dtype: DTypeLike) -> int:
    if array.dtype != dtype:
        raise ValueError(f"expected an array of {np.dtype(dtype)}, got one of {array.dtype}")
    if not array.flags.c_contiguous:
        raise ValueError(f"expected a contiguous array, got one of shape {array.shape} with strides {array.strides}")
    return array.ctypes.data if array.size else 0
