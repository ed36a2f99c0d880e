"""Names for array shapes, used in every signature.

numpy's types carry the dtype; the shape stands in the alias's name and comment.
"""

import math
import sys
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Float32: TypeAlias = NDArray[np.float32]
Float64: TypeAlias = NDArray[np.float64]
Int32: TypeAlias = NDArray[np.int32]
Bytes: TypeAlias = NDArray[np.uint8]
Flags: TypeAlias = NDArray[np.bool_]
Addresses: TypeAlias = NDArray[np.int64]
Keys: TypeAlias = NDArray[np.uint64]  # random streams

LINE = 64  # bytes of a cache line

# What kernels pass by value: Python's float where it does not matter, float32 where it is to stay that.
Real: TypeAlias = float | np.float32
Triple: TypeAlias = tuple[Real, Real, Real]

Points: TypeAlias = Float32  # (n, 3), scene units, centred
WorldPoints: TypeAlias = Float64  # (n, 3), scene units, in the scene file's own coordinates
Directions: TypeAlias = Float32  # (n, 3), unit length
Corners: TypeAlias = Float32  # (n_triangles, 3, 3), one point a corner
CornerUvs: TypeAlias = Float32  # (n_triangles, 3, 2), v upwards
Rgb: TypeAlias = Float32  # (n, 3), linear, Rec. 709 primaries
Image: TypeAlias = Float32  # (height, width, 3), linear radiance, row 0 at the top
Images: TypeAlias = NDArray[np.float32] | NDArray[np.float16]  # (n_lights, height, width, 3)


def is_number(value: object) -> bool:
    """Whether a value from a file is a number that float64 holds: not NaN, infinite or a whole number beyond."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def with_room(shape: tuple[int, ...], dtype: Any, fill: float | None = None) -> Any:
    """An array that starts at a cache line.

    Behind it there is room for what a kernel reads beyond its end, 16 numbers at a time, and ignores.

    Args:
        fill: the array and the room behind it are filled with it; None: their contents are arbitrary. Where a kernel
            computes with what it ignores, that matters: processors take a hundred times as long for denormal numbers.
    """
    size, item = math.prod(shape), np.dtype(dtype).itemsize
    block = np.empty(size + 16 + LINE // item, dtype)
    if fill is not None:
        block[:] = fill
    return _at_line(block, size).reshape(shape)


def reshaped(array: Any, shape: tuple[int, ...]) -> Any:
    """The memory of an array made by `with_room` as one of another shape, or None where that does not fit.

    What fits is not larger, nor so much smaller that more than a quarter would be wasted.
    """
    size, block = math.prod(shape), array.base
    needed = size + 16 + LINE // block.itemsize
    return _at_line(block, size).reshape(shape) if needed <= block.size <= 1.25 * needed else None


def _at_line(block: Any, size: int) -> Any:
    start = -block.ctypes.data % LINE // block.itemsize
    return block[start : start + size]
