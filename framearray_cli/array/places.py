"""Places along an axis of an array, as people write them: the notation of all commands and of path files.

See docs/reference/conventions.md. An axis belongs to camera or light positions; its n indices count from 0.

    places = "all", or parts with commas between them
    part   = place | place-place | place-placexN | place-placeyN | place-place:N
    place  = 5 | -1 (the last) | first | last | 50%

A range includes both ends. "0-47x3" is every third of it, "0-47y3" all but every third; "0-47:3" is all, which OpenCue
would render in another order. "47-0x-3" goes downwards. A position is where a place lies: an index that need not be
whole, as 3.25 is a quarter of the way from 3 to 4.
"""

import math
import re
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import TypeAlias

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import counted

IndexPlace: TypeAlias = int | float | str

CAMERA_AXIS = "camera"  # next to the light axes of `Manifest.axes`
ALL_PLACES, MIDDLE_PLACE = "all", "50%"
WANTED_PLACE = 'expected an index, "first", "last" or a percentage such as "50%"'
WANTED_PLACES = "expected places such as 5, 0-47, 0-47x3, first, last, 50% or all, with commas between them"

PLACE = r"(?:first|last|\d{1,3}(?:\.\d{1,9})? ?%|[+-]?\d{1,9}(?:\.\d{1,9})?)"
PART = rf"({PLACE})(?:-({PLACE})(?:([xy:])(-?\d{{1,6}}))?)?"
_NOUNS = {CAMERA_AXIS: "camera position", "light": "light position"}
MOST_RUNS = 12  # of a brief text


# one place


def percent(text: str) -> float | None:
    """Read "50%" or "12.5 %"; return None for anything else and for percentages above 100."""
    found = re.fullmatch(r"(\d{1,3}(?:\.\d{1,9})?) ?%", text)
    value = float(found[1]) if found else None
    return value if value is not None and value <= 100 else None


def is_place(value: object) -> bool:
    """Return whether a value of a file is a place: a number, "first", "last" or a percentage."""
    if isinstance(value, str):
        return value in ("first", "last") or percent(value) is not None
    from framearray_cli.base.arrays import is_number  # loads numpy

    return is_number(value)


def position_of(place: IndexPlace, n: int) -> float:
    """Find the position of a place on an axis of n indices; it may lie outside the axis."""
    if isinstance(place, int | float):
        return float(place + n if place < 0 else place)
    return (n - 1) * ({"first": 0.0, "last": 100.0}.get(place, percent(place)) or 0.0) / 100


def nearest_index(position: float) -> int:
    """Find the index nearest to a position; halves go up."""
    return math.floor(position + 0.5)


def outside_problem(place: object, n: int, axis: str) -> str:
    """Word that a place lies outside an axis of n indices.

    Args:
        axis: its name: "camera", "light" or another light axis.
    """
    noun, of_axis = _NOUNS.get(axis, "position"), "" if axis in _NOUNS else f" of {axis}"
    if n == 1:
        return f"expected 0, the only {noun}{of_axis}, got {shown(place)}"
    return f"expected one of {counted(n, noun)}{of_axis} (0 to {n - 1}, or -{n} to -1), got {shown(place)}"


# sets of places


def is_notation(text: str) -> bool:
    """Return whether a text is in the notation, on an axis that is long enough."""
    return text.strip() == ALL_PLACES or all(_match_part(part) for part in text.split(","))


def parse_places(text: str, n: int, axis: str = CAMERA_AXIS, *, fractions: bool = False) -> list[float]:
    """Find the positions that a text names, in its order.

    Args:
        n: number of indices on the axis.
        axis: its name, for messages.
        fractions: keep positions between two indices; else a percentage means the nearest index, and 3.25 is an error.

    Raises:
        ValueError: the text is not in the notation, or leads beyond the axis; the message says what was expected.
    """
    if text.strip() == ALL_PLACES:
        return [float(index) for index in range(n)]
    found: list[float] = []
    for part in text.split(","):
        match = _match_part(part)
        if not match or (not fractions and re.search(r"\.\d+(?![\d%])", match[0])):
            raise ValueError(f"{WANTED_PLACES}, got {shown(text)}")
        first, last = (_position(end, n, axis) for end in (match[1], match[2] or match[1]))
        if match[2] is not None:
            found += _range(part, nearest_index(first), nearest_index(last), match[3], match[4])
        else:
            found.append(first if fractions else nearest_index(first))
    if not found:
        raise ValueError(f"expected at least one place, got {shown(text)}, which leaves all out")
    return found


def _match_part(part: str) -> re.Match[str] | None:
    """Match one part of a text; its groups are first, last, kind and step."""
    match = re.fullmatch(PART, re.sub(r"\s*([-xy:%])\s*", r"\1", part.strip()))
    ends = match.group(1, 2) if match else ()
    return None if any(end and "%" in end and percent(end) is None for end in ends) else match


def _position(text: str, n: int, axis: str) -> float:
    """Find the position of one place on an axis; a text that `PLACE` matches."""
    text = text.strip()
    number = 0.0 if is_place(text) else float(text)
    place = text if is_place(text) else int(number) if number.is_integer() else number
    position = position_of(place, n)
    if not 0 <= position <= n - 1:
        raise ValueError(outside_problem(place, n, axis))
    return position


def _range(part: str, first: int, last: int, kind: str | None, step_text: str | None) -> Sequence[int]:
    """List the indices from first to last, or those that a step leaves."""
    way = 1 if first <= last else -1
    step = int(step_text or way)
    if step * way <= 0:
        raise ValueError(f"expected a step that leads from {first} to {last}, got {shown(part)}")
    every, stepped = range(first, last + way, way), range(first, last + way, step)
    if kind == "y":
        return [index for index in every if index not in stepped]
    return stepped if kind == "x" else every


def read_indices(option: str, text: str, n: int, axis: str = CAMERA_AXIS) -> tuple[int, ...]:
    """Find the indices that an option names, in its order, each once; see `parse_places`.

    Args:
        option: that the text was given to, for messages.

    Raises:
        JobError: the text is not in the notation, or leads beyond the axis.
    """
    try:
        return tuple(dict.fromkeys(int(index) for index in parse_places(text, n, axis)))
    except ValueError as error:
        raise JobError(option, [str(error)]) from error


def frames_text(frames: Iterable[int]) -> str:
    """Return the shortest text for some frames, by runs of consecutive ones: "0-47,50"."""
    return ",".join(_runs(frames))


def brief_frames_text(frames: Iterable[int]) -> str:
    """Return the text for some frames, for a message: at most MOST_RUNS runs, then the last one: "0-3,5,...,90"."""
    runs = _runs(frames)
    return ",".join(runs if len(runs) <= MOST_RUNS else [*runs[: MOST_RUNS - 1], "...", runs[-1]])


def _runs(frames: Iterable[int]) -> list[str]:
    runs = []
    for _, group in groupby(enumerate(sorted(set(frames))), key=lambda entry: entry[1] - entry[0]):
        run: Sequence[int] = [frame for _, frame in group]
        runs.append(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]))
    return runs
