"""Indices along the axes of an array."""

from math import isfinite

import numpy as np

from framearray_cli.array.places import outside_problem


def check_index(value: float, n: int, axis: str, *, whole: bool = False) -> float:
    """Check a position along an axis of n, where negative ones count from the end.

    Args:
        axis: its name: "camera", "light" or that of another light axis.
        whole: expect an index.

    Raises:
        TypeError: it is no number.
        IndexError: the axis has no such position.
    """
    number = isinstance(value, int | np.integer if whole else int | float | np.number) and not isinstance(value, bool)
    if not number or not isfinite(value):
        raise TypeError(f"{axis}: expected {'a whole number' if whole else 'a number'}, got {value!r}")
    found = value + n if value < 0 else value
    if not 0 <= found <= n - 1:
        raise IndexError(f"{axis}: {outside_problem(value, n, axis)}")
    return float(found)


def index_of(value: int, n: int, axis: str) -> int:
    """Return the index of a position along an axis of n; see `check_index`."""
    return int(check_index(value, n, axis, whole=True))
