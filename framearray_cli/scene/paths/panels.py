"""Rectangles and discs that shine: which way they face, and how they are turned, at every light position."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64

from .directions import PARALLEL, unit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """A rectangle or disc at n light positions.

    Attributes:
        round: whether it is a disc.
        axis: (n, 3) unit normal of its front.
        across: (n, 3) unit direction in which the width of a rectangle runs.
        sides: (n, 2) width and height, scene units; of a disc the diameter, twice.
        two_sided: whether the back shines as the front does.
    """

    round: bool
    axis: Float64
    across: Float64
    sides: Float64
    two_sided: bool

    @property
    def half_axes(self) -> tuple[Float64, Float64]:
        """Vectors from the middle along the width and along the height to the edge, (n, 3) each."""
        up = np.cross(self.axis, self.across)
        return self.across * self.sides[:, :1] / 2, up * self.sides[:, 1:] / 2

    @property
    def area(self) -> Float64:
        """(n,) area of one side."""
        return np.asarray(self.sides.prod(axis=1) * (np.pi / 4 if self.round else 1.0))

    def table(self, l: int) -> dict[str, Any]:
        """Describe the panel at position l as the manifest does."""
        width, height = self.sides[l].tolist()
        size = {"radius": width / 2} if self.round else {"width": width, "height": height}
        turn = {"direction": self.axis[l].tolist()} | ({} if self.round else {"across": self.across[l].tolist()})
        return {"type": "disc" if self.round else "rect"} | turn | size | {"two_sided": self.two_sided}

    def at(self, rows: Sequence[int]) -> "Panel":
        """Return the panel at some light positions."""
        some = list(rows)
        return replace(self, axis=self.axis[some], across=self.across[some], sides=self.sides[some])


def carry_across(axis: Float64, up_dir: Float64) -> Float64:
    """Carry the width of a panel along the path of its axis without turning it (parallel transport), (n, 3).

    So its points move smoothly from one light position to the next. At first it is level, or any direction if the panel
    faces up or down.
    """
    across = np.empty_like(axis)
    across[0] = _level(axis[0], up_dir)
    for l in range(1, len(axis)):
        across[l] = _turned(across[l - 1], axis[l - 1], axis[l])
    return across


def across_under(axis: Float64, ups: Float64) -> Float64:
    """The width of a panel whose height runs along directions (n, 3), as far as its axis lets it.

    It is 0 where the two are parallel.
    """
    across = np.cross(ups, axis)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(np.divide(across, length, out=np.zeros_like(across), where=length > PARALLEL))


def _level(axis: Float64, up_dir: Float64) -> Float64:
    level = np.cross(up_dir, axis)
    if np.linalg.norm(level) <= PARALLEL:
        level = np.cross(np.eye(3)[np.abs(up_dir).argmin()], axis)
        level = np.cross(axis, level)
    return unit(level)


def _turned(across: Float64, before: Float64, now: Float64) -> Float64:
    """Turn a direction across an axis as the axis turns, by the shortest way."""
    about, cosine = np.cross(before, now), float(before @ now)
    if 1 + cosine < PARALLEL:  # turned round: the same direction lies across
        return across
    turned = across + np.cross(about, across) + np.cross(about, np.cross(about, across)) / (1 + cosine)
    return unit(turned - (turned @ now) * now)  # rounding must not add up along a path
