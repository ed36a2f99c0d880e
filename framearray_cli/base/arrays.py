"""Names for array shapes, used in every signature.

numpy's types carry the dtype; each alias adds the shape and the meaning, in its name and comment.
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

# What kernels pass by value: float32 where it must not widen, else Python's float.
Real: TypeAlias = float | np.float32
Triple: TypeAlias = tuple[Real, Real, Real]

Points: TypeAlias = Float32  # (n, 3), scene units, centred
WorldPoints: TypeAlias = Float64  # (n, 3), scene units, in the scene file's own coordinates
Directions: TypeAlias = Float32  # (n, 3), unit length
Corners: TypeAlias = Float32  # (n_triangles, 3, 3), one point per corner
CornerUvs: TypeAlias = Float32  # (n_triangles, 3, 2), v upwards
Rgb: TypeAlias = Float32  # (n, 3), linear, Rec. 709 primaries
Image: TypeAlias = Float32  # (height, width, 3), linear radiance, row 0 at the top
Images: TypeAlias = NDArray[np.float32] | NDArray[np.float16]  # (n_lights, height, width, 3)


def is_number(value: object) -> bool:
    """Return True if a value from a file is a finite number that float64 can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def is_vector(value: object, length: int) -> bool:
    """Return True if a value is a tuple of that many numbers."""
    return isinstance(value, tuple) and len(value) == length and all(is_number(item) for item in value)


def box_of(points: NDArray[Any]) -> NDArray[Any]:
    """Return the least and the largest coordinates of points (..., 3), as (2, 3).

    numpy takes eight times as long for all three columns at once.
    """
    columns = points.reshape(-1, 3).T
    return np.array([[column.min() for column in columns], [column.max() for column in columns]])


def with_room(shape: tuple[int, ...], dtype: Any, fill: float | None = None) -> Any:
    """Allocate an array that starts at a cache line, with room behind it.

    Kernels read 16 numbers at a time, so they read beyond the end; they ignore what they find there.

    Args:
        fill: value of the array and of the room behind it; None leaves both uninitialized. Where a kernel computes
            with numbers that it then ignores, give a value: denormal numbers take a processor 100 times as long.
    """
    size, item = math.prod(shape), np.dtype(dtype).itemsize
    block = np.empty(size + 16 + LINE // item, dtype)
    if fill is not None:
        block[:] = fill
    return _at_line(block, size).reshape(shape)


def reshaped(array: Any, shape: tuple[int, ...]) -> Any:
    """Reuse the memory of an array from `with_room` for another shape; None if the shape does not fit.

    A shape fits if it needs no more memory than the array has, and no less than four fifths of it.
    """
    size, block = math.prod(shape), array.base
    needed = size + 16 + LINE // block.itemsize
    return _at_line(block, size).reshape(shape) if needed <= block.size <= 1.25 * needed else None


def _at_line(block: Any, size: int) -> Any:
    start = -block.ctypes.data % LINE // block.itemsize
    return block[start : start + size]
