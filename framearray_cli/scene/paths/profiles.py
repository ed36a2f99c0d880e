"""Photometric profiles of lamps: the share of its largest intensity that a lamp sends into each direction."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.files import fingerprint
from framearray_cli.job.ies import read_photometry


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Web:
    """Intensity over directions: a table on a sphere, bilinear between its angles and 0 beyond them.

    Attributes:
        polar_deg: (n,) ascending angles from the pole.
        around_deg: (m,) ascending angles about the pole, within -180 to 180; or one, where they make no difference.
        share: (m, n) of the largest intensity.
        candela: the largest intensity.
        sideways: True if the pole is not the lamp's axis, but lies across it, as in photometry of type B.
        note: on what is left out of the file, or "".
    """

    polar_deg: Float64
    around_deg: Float64
    share: Float64
    candela: float
    sideways: bool
    note: str = ""

    @property
    def flux(self) -> float:
        """The integral of the share over all directions, sr."""
        start, end = np.radians(self.polar_deg[:-1]), np.radians(self.polar_deg[1:])
        low, high = self.share[:, :-1], self.share[:, 1:]
        # of a share that is linear in the angle, times its sine
        parts = low * np.cos(start) - high * np.cos(end) + (high - low) * (np.sin(end) - np.sin(start)) / (end - start)
        planes = parts.sum(axis=1)
        if len(planes) == 1:
            return float(2 * np.pi * planes[0])
        return float(np.trapezoid(planes, np.radians(self.around_deg)))

    @property
    def digest(self) -> str:
        """Hash of the table."""
        arrays = (self.polar_deg, self.around_deg, self.share, np.array(self.candela))
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

    def table(self, l: int) -> dict[str, Any]:
        """Describe the profile at position l as the manifest does."""
        return {
            "type": "spot",
            "ies": self.file,
            "direction": (self.axis[l] + 0.0).tolist(),
            "up": (self.zero[l] + 0.0).tolist(),
        }


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
        note=f"{path.name}: factors of tilted lamps are left out" if found.tilted else "",
    )


def _whole_circle(horizontal: Float64, candela: Float64) -> tuple[Float64, Float64]:
    """Mirror a part of a circle, which begins at 0 or 90 degrees, and let it run from -180 to 180."""
    if len(horizontal) == 1:
        return horizontal, candela
    first, last = horizontal[0], horizontal[-1]
    mirrors: tuple[int, ...] = (360,) if last <= 180 else ()  # twice the angles at which the other part is mirrored
    if first == 90:  # to 270
        mirrors = (540,)
    elif last == 90:
        mirrors = (180, 360)
    for twice in mirrors:
        horizontal, candela = np.append(horizontal, twice - horizontal[-2::-1]), np.append(candela, candela[-2::-1], 0)
    around = np.append((horizontal[:-1] + 180) % 360 - 180, -180.0)
    around, order = np.unique(around, return_index=True)
    values = candela[:-1][np.minimum(order, len(candela) - 2)]
    if order[0] == len(candela) - 1:  # no plane at 180 degrees: between its neighbours
        a, b = around[-1], around[1] + 360
        values[0] = values[-1] + (values[1] - values[-1]) * (180 - a) / (b - a)
    return np.append(around, 180.0), np.append(values, values[:1], 0)
