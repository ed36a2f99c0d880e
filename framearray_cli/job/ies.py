"""`ies` of a light source: a photometric file of IES LM-63 -> angles and intensities of a lamp [LM63].

Read are the versions of 1986, 1991, 1995, 2002 and 2019, and photometry of types C and B. After a line `TILT=` the
file is a list of numbers, whatever lines they stand on: 13 numbers about the lamp, the vertical and the horizontal
angles, and for each horizontal angle the candela at all vertical ones.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal, NoReturn

from framearray_cli.base.forms.words import shown

from .rowfile import RowFileError, read_data

MOST_ANGLES = 4000  # of each kind; twenty per degree
MOST_VALUES = 2_000_000  # candela of one file
MOST_TILTS = 1000
TYPES = {1: "C", 2: "B", 3: "A"}
CIRCLE, HALF, QUARTER = 360.0, 180.0, 90.0  # degrees
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d{1,3})?")
_NO_FACTOR = ("IESNA:LM-63-2002", "IES:LM-63-2019")  # versions whose second factor means something else


@dataclass(frozen=True, slots=True, kw_only=True)
class Photometry:
    """The light of a lamp, as an IES file describes it.

    Attributes:
        kind: "C": planes through a vertical axis; "B": through a horizontal one.
        vertical_deg: (n,) ascending; 0 is the lamp's axis.
        horizontal_deg: (m,) ascending.
        candela: m rows of n intensities, to be multiplied by `factor`.
        factor: multiplier of the file, times its ballast factors.
        tilted: True if the file has factors of tilted lamps, which are left out.
    """

    kind: Literal["B", "C"]
    vertical_deg: tuple[float, ...]
    horizontal_deg: tuple[float, ...]
    candela: tuple[tuple[float, ...], ...]
    factor: float
    tilted: bool = False


class _Numbers:
    """The numbers of some lines, read one by one."""

    def __init__(self, lines: Sequence[tuple[int, str]]) -> None:
        self._words = [(row, word) for row, line in lines for word in line.replace(",", " ").split()]
        self._next, self._last = 0, lines[-1][0] if lines else 1
        self.row = lines[0][0] if lines else 1  # line of the number read last

    def number(self, what: str, low: float = -math.inf, high: float = math.inf) -> float:
        """Read one number within bounds."""
        if self._next == len(self._words):
            raise RowFileError(f"line {self._last}: expected {what}, got the end of the file; it is cut off")
        self.row, word = self._words[self._next]
        self._next += 1
        value = float(re.sub("[dD]", "e", word)) if len(word) < 50 and _NUMBER.fullmatch(word) else math.nan
        if not (math.isfinite(value) and low <= value <= high):
            bounds = f" from {low:g} to {high:g}" if math.isfinite(low + high) else f" of at least {low:g}"
            self.refuse(f"expected {what}, a number{'' if low == -math.inf else bounds}, got {shown(word)}")
        return value

    def whole(self, what: str, low: int, high: int) -> int:
        """Read a whole number within bounds."""
        value = self.number(what, low, high)
        if value != int(value):
            self.refuse(f"expected {what}, a whole number, got {value:g}")
        return int(value)

    def refuse(self, problem: str) -> NoReturn:
        """Raise a problem of the number read last."""
        raise RowFileError(f"line {self.row}: {problem}")

    def angles(self, n: int, what: str) -> tuple[float, ...]:
        """Read n ascending angles, degrees."""
        found: list[float] = []
        for k in range(n):
            angle = self.number(f"{what} angle {k + 1} of {n}", -CIRCLE, CIRCLE)
            if found and angle <= found[-1]:
                self.refuse(f"expected a {what} angle beyond {found[-1]:g}, the one before, got {angle:g}")
            found.append(angle)
        return tuple(found)

    def end(self, n: int) -> None:
        """Refuse numbers behind the last of n intensities."""
        if self._next < len(self._words):
            row, word = self._words[self._next]
            raise RowFileError(
                f"line {row}: expected the end of the file after candela value {n}, got {shown(word)}; check the "
                "numbers of angles"
            )


def read_photometry(path: Path) -> Photometry:
    """Read an IES file."""
    data = read_data(path).removeprefix(b"\xef\xbb\xbf").rstrip(b"\x1a \t\r\n\0")
    if b"\0" in data:
        raise RowFileError("expected a text file of IES LM-63, got binary data")
    lines = list(enumerate(data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1))
    at = next((k for k, (_, line) in enumerate(lines) if line.lstrip().upper().startswith("TILT")), None)
    if at is None:
        raise RowFileError(
            f'line {len(lines)}: expected a line "TILT=NONE" before the numbers, found none; is it an IES file?'
        )
    row, line = lines[at]
    tilt = line.partition("=")[2].strip().upper()
    numbers = _Numbers(lines[at + 1 :] or [(row, "")])
    if tilt == "INCLUDE":
        numbers.whole("how the lamp lies", 1, 3)
        for _ in range(2 * numbers.whole("the number of tilts", 1, MOST_TILTS)):
            numbers.number("an angle or a factor of a tilt", -CIRCLE, 1000)
    return _photometry(numbers, lines[0][1].strip().upper(), tilted=tilt != "NONE")


def _photometry(numbers: _Numbers, version: str, *, tilted: bool) -> Photometry:
    """Read what follows the factors of tilted lamps."""
    numbers.whole("the number of lamps", 1, 1_000_000)
    numbers.number("the lumens per lamp, or -1 where candela are absolute", -1, 1e12)
    factor = numbers.number("the multiplier of candela", 0, 1e9)
    if factor == 0:
        numbers.refuse("expected a multiplier of candela above 0, got 0")
    n = numbers.whole("the number of vertical angles", 2, MOST_ANGLES)
    m = numbers.whole("the number of horizontal angles", 1, MOST_ANGLES)
    if n * m > MOST_VALUES:
        numbers.refuse(f"expected at most {MOST_VALUES} pairs of angles, got {n} x {m}")
    kind = TYPES[numbers.whole("the type of photometry, 1 (C) or 2 (B)", 1, 3)]
    if kind == "A":
        numbers.refuse("expected photometry of type 1 (C) or 2 (B), got 3 (A), for headlights; convert the file")
    numbers.whole("the unit of lengths, 1 (feet) or 2 (metres)", 1, 2)
    for what in ("width", "length", "height"):
        numbers.number(f"the {what} of the lamp", -1e6, 1e6)
    factor *= numbers.number("the ballast factor", 0, 1000)
    other = numbers.number("the second ballast factor", 0, 1000)
    factor *= 1.0 if version.startswith(_NO_FACTOR) else other
    if factor == 0:
        numbers.refuse("expected ballast factors above 0, got 0")
    numbers.number("the watts", 0, 1e12)
    vertical = numbers.angles(n, "vertical")
    if kind == "B":
        _check_sides(numbers, "vertical", vertical)
    elif vertical[0] not in (0.0, QUARTER) or vertical[-1] not in (QUARTER, HALF):
        numbers.refuse(
            f"expected vertical angles from 0 or 90 to 90 or 180, got {vertical[0]:g} to {vertical[-1]:g}; where it is "
            "dark, give them 0 candela"
        )
    horizontal = numbers.angles(m, "horizontal")
    if kind == "B":
        _check_sides(numbers, "horizontal", horizontal)
    else:
        horizontal = _check_circle(numbers, horizontal)
    rows = [
        tuple(numbers.number(f"candela value {j * n + i + 1} of {n * m}", 0, 1e12) for i in range(n)) for j in range(m)
    ]
    numbers.end(n * m)
    if not any(map(any, rows)):
        numbers.refuse("expected a lamp that shines, got candela of 0 only")
    rows += rows[:1] * (len(horizontal) - m)  # the plane at 360 degrees is that at 0
    return Photometry(
        kind="B" if kind == "B" else "C",
        vertical_deg=vertical,
        horizontal_deg=horizontal,
        candela=tuple(rows),
        factor=factor,
        tilted=tilted,
    )


def _check_sides(numbers: _Numbers, what: str, angles: tuple[float, ...]) -> None:
    """Check angles of type B: on both sides of 0, or on one, which the other mirrors."""
    if len(angles) < 2 or not -QUARTER <= angles[0] <= 0 < angles[-1] <= QUARTER:
        numbers.refuse(
            f"expected two or more {what} angles from -90 or 0 to 90, for type B, got {angles[0]:g} to {angles[-1]:g}"
        )


def _check_circle(numbers: _Numbers, angles: tuple[float, ...]) -> tuple[float, ...]:
    """Check the horizontal angles of type C; a circle of which only the last plane misses is closed."""
    ends = (angles[0], angles[-1])
    if ends in ((0.0, 0.0), (0.0, QUARTER), (0.0, HALF), (0.0, CIRCLE), (QUARTER, 3 * QUARTER)):
        return angles
    steps = [b - a for a, b in pairwise(angles)]
    if angles[0] == 0 and HALF < angles[-1] < CIRCLE and CIRCLE - angles[-1] <= max(steps) + 1e-6:
        return (*angles, CIRCLE)
    numbers.refuse(
        f"expected horizontal angles from 0 to 0, 90, 180 or 360, or from 90 to 270, got {ends[0]:g} to {ends[1]:g}"
    )
