"""IES files as makers of lamps write them: every version, type, range of angles, tilt and factor."""

from collections.abc import Sequence
from math import cos, radians
from typing import Any

HEAD = "IESNA:LM-63-2002\n[TEST] 1234\n[MANUFAC] Lamps & Sons\n"
DOWN = [0.0, 30.0, 60.0, 90.0]
SPHERE = [0.0, 45.0, 90.0, 135.0, 180.0]


def glow(vertical: float, horizontal: float) -> float:
    """Candela into a direction, different for all of them."""
    return round(1000 + 500 * cos(radians(vertical)) + horizontal + vertical / 7, 3)


def ies(
    vertical: Sequence[float] = DOWN,
    horizontal: Sequence[float] = (0.0,),
    *,
    head: str = HEAD,
    tilt: str = "TILT=NONE\n",
    kind: int = 1,
    multiplier: Any = 1,
    lumens: Any = 1000,
    units: int = 2,
    factors: str = "1 1 55",
    size: str = "0 0 0",
    space: str = " ",
    end: str = "\n",
    candela: Sequence[Sequence[float]] | None = None,
) -> str:
    """An IES file as text."""
    rows = candela or [[glow(v, h) for v in vertical] for h in horizontal]
    lines = [
        space.join(map(str, [1, lumens, multiplier, len(vertical), len(horizontal), kind, units, size])),
        factors,
        space.join(map(str, vertical)),
        space.join(map(str, horizontal)),
        *(space.join(map(str, row)) for row in rows),
    ]
    return (head + tilt + "\n".join(lines) + "\n").replace("\n", end)


TILT = "TILT=INCLUDE\n1\n3\n0 45 90\n1.0 0.9 0.5\n"
LONG = ies(SPHERE, [0, 45, 90])
# By name: the text, and the candela at (vertical, horizontal) places of the lamp's own axes.
VARIANTS = {
    "1986, without a first line": ies(head="Some lamp\nof some maker\n"),
    "1991": ies(head="IESNA91\n[TEST] 1\n"),
    "1995": ies(head="IESNA:LM-63-1995\n[TEST] 1\n", horizontal=[90, 135, 180, 225, 270]),
    "2002": ies(),
    "2019": ies(head="IES:LM-63-2019\n[TEST] 1\n", factors="1 1.00001 20"),
    "round, down": ies(DOWN, [0]),
    "round, up": ies([90, 120, 150, 180], [0]),
    "round, whole sphere": ies(SPHERE, [0]),
    "quarters": ies(SPHERE, [0, 30, 90]),
    "halves": ies(DOWN, [0, 60, 120, 180]),
    "whole circle": ies(
        DOWN, [0, 90, 180, 270, 360], candela=[[5, 4, 3, 2], [6, 5, 4, 3], [7, 6, 5, 4], [8, 7, 6, 5], [5, 4, 3, 2]]
    ),
    "circle without its end": ies(DOWN, [0, 90, 180, 270]),
    "type B, all sides": ies([-90, -30, 0, 30, 90], [-90, 0, 90], kind=2),
    "type B, mirrored": ies([0, 30, 90], [0, 45, 90], kind=2),
    "type B, narrow": ies([-20, 0, 20], [-40, 0, 40], kind=2),
    "multiplier": ies(multiplier="2.5"),
    "absolute lumens": ies(lumens="-1"),
    "ballast factors": ies(head="IESNA:LM-63-1995\n", factors="0.9 0.8 40"),
    "tilt": ies(tilt=TILT),
    "commas": ies(space=", "),
    "lines of Windows": ies(end="\r\n"),
    "lines of the Mac": ies(end="\r"),
    "one number per line": ies(space="\n"),
    "feet, round opening": ies(units=1, size="-0.5 0 0"),
    "exponents": ies(DOWN, candela=[["1.5E+03", "1.2e3", ".5", "0"]]),  # type: ignore[list-item]  # as text
    "old end of file": ies() + "\x1a",
    "byte order mark": "\ufeff" + ies(),
}
