"""Light positions spread over a hemisphere, a sphere or a grid."""

from collections.abc import Sequence
from math import pi, sqrt

import numpy as np

from framearray_cli.base.arrays import Float64

from .directions import unit

GOLDEN_ANGLE = pi * (3 - sqrt(5))  # radians from one point of the spiral to the next


def dome_directions(n: int, top: Float64, *, whole: bool) -> Float64:
    """Spread n unit directions evenly over a hemisphere or sphere, (n, 3), along a spiral from the top [Swinbank06].

    Each stands for the same solid angle: their heights are the middles of n slices of equal area.

    Args:
        top: (3,) middle of the hemisphere, of any length but 0.
        whole: a sphere, which ends opposite the top.
    """
    k = np.arange(n)
    height = 1 - (k + 0.5) * ((2 if whole else 1) / n)
    around, level = k * GOLDEN_ANGLE, np.sqrt(1 - height * height)
    up_dir = unit(np.asarray(top, np.float64))
    first_dir = unit(np.cross(up_dir, np.eye(3)[np.abs(up_dir).argmin()]))
    other_dir = np.cross(up_dir, first_dir)
    flat = np.cos(around)[:, None] * first_dir + np.sin(around)[:, None] * other_dir
    return np.asarray(height[:, None] * up_dir + level[:, None] * flat)


def grid_points(
    counts: tuple[int, int], corner: Sequence[float], side: Sequence[float], other_side: Sequence[float]
) -> Float64:
    """Return the points of a flat grid, (counts[0] * counts[1], 3), row by row from the corner.

    Args:
        counts: points along `side`, in each row, and along `other_side`; a single one is at the corner.
        side, other_side: from the first point to the last along each.
    """
    along, across = (np.linspace(0.0, 1.0, n) for n in counts)
    rows = np.asarray(corner) + across[:, None, None] * np.asarray(other_side)  # (n_rows, 1, 3)
    return np.asarray((rows + along[:, None] * np.asarray(side)).reshape(-1, 3))
