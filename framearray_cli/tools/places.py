"""Places along an axis of an array, as people write them.

Notation: a place is what somebody writes: an index (negative: from the end; 3.25 is a quarter of the way from 3 to 4),
"first", "last", or a percentage of the way from first to last. A position is where a place lies: an index that need not
be whole. n is the number of indices on the axis.
"""

import math
import re
from collections.abc import Sequence
from itertools import product
from typing import Annotated, Any, TypeAlias

from pydantic import PlainValidator, WithJsonSchema

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.arrays import is_number
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import fail
from framearray_cli.base.forms.words import shown

IndexPlace: TypeAlias = int | float | str
LightIndices: TypeAlias = tuple[int, ...]  # one index per light axis, in the order of `Manifest.axes`

ALL_PLACES, MIDDLE_PLACE = "all", "50%"
_WANTED = 'expected an index, "first", "last" or a percentage such as "50%"'
_WANTED_LIST = '"all", or indices, "first", "last" or percentages with commas between them'
_WHOLE_INDEX = r"[+-]?\d{1,9}"
_PLACE_SCHEMA: dict[str, Any] = {
    "anyOf": [{"type": "number"}, {"type": "string", "pattern": r"^(first|last|\d{1,3}(\.\d{1,9})? ?%)$"}]
}


# one place


def read_place(text: str) -> IndexPlace:
    """Read a place from a command line: "3", "-1", "3.25", "first" or "50%".

    Raises:
        ValueError: it is none; the message says what was expected.
    """
    if _is_place(text):
        return text
    try:
        number = float(text)
    except ValueError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{_WANTED}, got {shown(text)}")
    return int(number) if number == int(number) else number


def percent(text: str) -> float | None:
    """Read "50%" or "12.5 %"; return None for anything else and for percentages above 100."""
    found = re.fullmatch(r"(\d{1,3}(?:\.\d{1,9})?) ?%", text)
    value = float(found[1]) if found else None
    return value if value is not None and value <= 100 else None


def position_of(place: IndexPlace, n: int) -> float:
    """Find the position of a place on an axis of n indices; it may lie outside the axis."""
    if isinstance(place, int | float):
        return float(place + n if place < 0 else place)
    return (n - 1) * ({"first": 0.0, "last": 100.0}.get(place, percent(place)) or 0.0) / 100


def nearest_index(position: float) -> int:
    """Find the index nearest to a position; halves go up."""
    return math.floor(position + 0.5)


def _is_place(value: object) -> bool:
    if isinstance(value, str):
        return value in ("first", "last") or percent(value) is not None
    return is_number(value)


# spans of places


def _check_span(value: object) -> tuple[IndexPlace, ...]:
    """Check a span; a single place is a span that stays there."""
    many = isinstance(value, list | tuple)
    places: Any = value if many else [value]
    if not places:
        fail([((), "expected a place, or a list of places, got an empty list")])
    bad = [((k,), f"{_WANTED}, got {shown(place)}") for k, place in enumerate(places) if not _is_place(place)]
    if bad:
        fail(bad if many else [((), bad[0][1])])
    return tuple(places)


Span: TypeAlias = Annotated[
    tuple[IndexPlace, ...],
    PlainValidator(_check_span),
    WithJsonSchema({"anyOf": [*_PLACE_SCHEMA["anyOf"], {"type": "array", "items": _PLACE_SCHEMA, "minItems": 1}]}),
]


def resolve_span(key: str, span: Sequence[IndexPlace], n: int, noun: str, problems: list[str]) -> tuple[float, ...]:
    """Find the positions of a span's places on an axis of n indices.

    Args:
        key: where the span stands, for messages.
        noun: for the indices in messages, such as "cameras".
        problems: receives a line for each place outside the axis.
    """
    found = []
    for place in span:
        position = position_of(place, n)
        if not 0 <= position <= n - 1:
            indices = f"0 to {n - 1}, or -{n} to -1" if n > 1 else "0 or -1"
            problem = f"{key}: expected one of {n} {noun} ({indices}), got {shown(place)}"
            if problem not in problems:
                problems.append(problem)
            position = 0.0
        found.append(position)
    return tuple(found)


def interpolate_span(span: Sequence[float], u: float) -> float:
    """Interpolate linearly between positions at even steps of u from 0 to 1, where the result is exact."""
    last = len(span) - 1
    if u == 1 or not last:
        return span[-1]
    k = min(int(u * last), last - 1)
    return span[k] + (span[k + 1] - span[k]) * (u * last - k)


# sets of indices


def read_indices(option: str, text: str, n: int) -> tuple[int, ...]:
    """Read "all", or places with commas between them: "0,3,-1", "first", "last", "50%" (the nearest index).

    Indices must be whole: nothing is blended here.

    Args:
        option: that the text was given to, for messages.
        n: indices on the axis.

    Returns:
        The indices in the order given, without repetition.

    Raises:
        JobError: the text is none of these, or a place lies outside the axis.
    """
    if text.strip() == ALL_PLACES:
        return tuple(range(n))
    found: dict[int, None] = {}
    for place in (part.strip() for part in text.split(",")):
        if not (re.fullmatch(_WHOLE_INDEX, place) or _is_place(place)):
            raise JobError(option, [f"expected {_WANTED_LIST}, got {shown(text)}"])
        index = nearest_index(position_of(read_place(place), n))
        if not 0 <= index < n:
            raise JobError(option, [f"expected 0 to {n - 1}, or -{n} to -1, got {place}"])
        found[index] = None
    return tuple(found)


def read_light_indices(manifest: Manifest, light: str | None, at: Sequence[str], default: str) -> list[LightIndices]:
    """Read places along every light axis, and combine them.

    Args:
        light: places along the first axis; None: `default`.
        at: "AXIS=PLACES" for other axes, or for the first.
        default: places along the axes that neither names.

    Raises:
        JobError: a place or an axis is unknown, or an axis is given twice.
    """
    axes = manifest.axes
    given = _places_by_axis(manifest, at)
    first = next(iter(axes))
    if light is not None:
        if first in given:
            raise JobError("--light", [f"expected either this or --at {first}=..., got both"])
        given[first] = ("--light", light)
    chosen = [read_indices(*given.get(axis, (f"--at {axis}", default)), n) for axis, n in axes.items()]
    return list(product(*chosen))


def _places_by_axis(manifest: Manifest, at: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Read "AXIS=PLACES": axis -> the option for messages, and the places."""
    axes = manifest.axes
    given: dict[str, tuple[str, str]] = {}
    for text in at:
        axis, equals, places = text.partition("=")
        if not equals or axis not in axes or axis in given:
            known = ", ".join(f"{name} (0 to {n - 1})" for name, n in axes.items())
            problem = "twice the same axis" if axis in given else shown(text)
            raise JobError("--at", [f"expected AXIS=PLACES with one of the axes {known}, got {problem}"])
        given[axis] = (f"--at {axis}", places)
    return given


def evenly_spaced(n: int, most: int) -> tuple[int, ...]:
    """Choose at most `most` of n indices, evenly spaced from first to last; the middle one if `most` is 1."""
    if n <= most:
        return tuple(range(n))
    if most == 1:
        return ((n - 1) // 2,)
    return tuple(round(k * (n - 1) / (most - 1)) for k in range(most))
