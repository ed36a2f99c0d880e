"""Photometric profiles of lamps: the share of its largest intensity that a lamp sends into each direction."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.hashing import fingerprint
from framearray_cli.job.ies import read_photometry

from .directions import PARALLEL, unit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Web:
    """Intensity over directions: a table on a sphere, bilinear between its angles and 0 beyond them.

    Attributes:
        polar_deg: (n,) ascending angles from the pole.
        around_deg: (m,) ascending angles about the pole, within -180 to 180; or one, where they make no difference.
        share: (m, n) of the largest intensity.
        candela: the largest intensity.
        sideways: whether the pole is not the lamp's axis, but lies across it, as in photometry of type B.
    """

    polar_deg: Float64
    around_deg: Float64
    share: Float64
    candela: float
    sideways: bool

    @property
    def digest(self) -> str:
        """Hash of the table."""
        arrays = (self.polar_deg, self.around_deg, self.share)
        return fingerprint(*(np.ascontiguousarray(array).data for array in arrays), bytes([self.sideways]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """The profile of a lamp and how it is turned, at n light positions.

    Attributes:
        file: name of its file.
        axis: (n, 3) unit direction of vertical angle 0: down, of a lamp that hangs.
        zero: (n, 3) unit direction across it, of horizontal angle 0.
    """

    file: str
    web: Web
    axis: Float64
    zero: Float64

    @property
    def frames(self) -> Float64:
        """(n, 3, 3) pole of the table, direction of its angle 0 about the pole, and of 90 degrees."""
        across = np.cross(self.zero, self.axis)
        rows = (across, self.axis, self.zero) if self.web.sideways else (self.axis, self.zero, across)
        return np.stack(rows, axis=1)

    def at(self, positions: list[int]) -> "Profile":
        """Return the profile at some of its positions, in their order."""
        return replace(self, axis=self.axis[positions], zero=self.zero[positions])


@cache
def read_web(path: Path) -> Web:
    """Read an IES file.

    Raises:
        RowFileError: the file is missing or broken.
    """
    found = read_photometry(path)
    vertical, horizontal = np.array(found.vertical_deg), np.array(found.horizontal_deg)
    candela = np.array(found.candela)  # (horizontal, vertical)
    if found.kind == "B":
        # planes through a horizontal pole: vertical angles go about it, horizontal ones, clockwise, from its equator
        polar, around, share = 90 + horizontal, vertical, candela.T
        if horizontal[0] == 0 and len(horizontal) > 1:
            polar, share = np.append(90 - horizontal[:0:-1], polar), np.append(share[:, :0:-1], share, axis=1)
        if vertical[0] == 0 and len(vertical) > 1:
            around, share = np.append(-around[:0:-1], around), np.append(share[:0:-1], share, axis=0)
    else:
        polar = vertical
        around, share = _whole_circle(horizontal, candela)
    largest = float(candela.max())
    return Web(
        polar_deg=polar,
        around_deg=around,
        share=share / largest,
        candela=largest * found.factor,
        sideways=found.kind == "B",
    )


def _whole_circle(horizontal: Float64, candela: Float64) -> tuple[Float64, Float64]:
    """Mirror a part of a circle, which begins at 0 or 90 degrees, and let it run from -180 to 180."""
    if len(horizontal) == 1:
        return horizontal, candela
    first, last = horizontal[0], horizontal[-1]
    if first == 90:  # to 270: the other half is its mirror image
        horizontal, candela = np.append(horizontal, 540 - horizontal[-2::-1]), np.append(candela, candela[-2::-1], 0)
    else:
        if last == 90:
            horizontal, candela = (
                np.append(horizontal, 180 - horizontal[-2::-1]),
                np.append(candela, candela[-2::-1], 0),
            )
        if last <= 180:
            horizontal, candela = (
                np.append(horizontal, 360 - horizontal[-2::-1]),
                np.append(candela, candela[-2::-1], 0),
            )
    around = np.append((horizontal[:-1] + 180) % 360 - 180, -180.0)
    around, order = np.unique(around, return_index=True)
    values = candela[:-1][np.minimum(order, len(candela) - 2)]
    if order[0] == len(candela) - 1:  # no plane at 180 degrees: between its neighbours
        a, b = around[-1], around[1] + 360
        values[0] = values[-1] + (values[1] - values[-1]) * (180 - a) / (b - a)
    return np.append(around, 180.0), np.append(values, values[:1], 0)


def turn_across(axis: Float64, wanted: Float64, fallback: Float64, roll_deg: Float64, fixed: bool) -> Float64:
    """Find directions of horizontal angle 0 along a path of axes, (n, 3) unit vectors across them.

    Args:
        axis: (n, 3).
        wanted: (3,) direction that they come as close to as they can; at first or, if `fixed`, at every position.
        fallback: (3,) the same where the axis lies along `wanted`.
        roll_deg: (n,) further turn about the axis, clockwise as seen along it.
    """
    zero = np.empty_like(axis)
    for l, way in enumerate(axis):
        near = [wanted, *zero[l - 1 : l], fallback] if fixed or l == 0 else [_carried(zero[l - 1], axis[l - 1], way)]
        level = [vector - (vector @ way) * way for vector in [*near, wanted, fallback]]
        zero[l] = unit(next(vector for vector in level if np.linalg.norm(vector) > PARALLEL))
    angle = np.radians(roll_deg)[:, None]
    return np.cos(angle) * zero + np.sin(angle) * np.cross(axis, zero)


def _carried(vector: Float64, start: Float64, end: Float64) -> Float64:
    """Turn a vector as the shortest turn from `start` to `end` does; both are unit directions across it at first."""
    middle = start + end
    if np.linalg.norm(middle) <= PARALLEL:
        return vector  # half a turn: about the vector itself
    middle = unit(middle)
    return _mirrored(_mirrored(vector, start), middle)  # two mirrors make a turn


def _mirrored(vector: Float64, normal: Float64) -> Float64:
    return vector - 2 * (vector @ normal) * normal
