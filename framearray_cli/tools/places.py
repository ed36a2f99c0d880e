"""Places on an axis of an array as people write them, and positions along a span of places.

Notation: a position is an index along an axis that need not be whole; n is the number of indices on the axis.
"""

import math
import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Annotated, Any, TypeAlias

from pydantic import PlainValidator, WithJsonSchema

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.arrays import is_number
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import fail
from framearray_cli.base.forms.words import shown

# An index (negative: from the end; 3.25 is a quarter of the way from 3 to 4), "first", "last", or a percentage of the
# way from first to last.
IndexPlace: TypeAlias = int | float | str

_WANTED = 'expected an index, "first", "last" or a percentage such as "50%"'
_PLACE_SCHEMA: dict[str, Any] = {
    "anyOf": [{"type": "number"}, {"type": "string", "pattern": r"^(first|last|\d{1,3}(\.\d{1,9})? ?%)$"}]
}


def _span(value: object) -> tuple[IndexPlace, ...]:
    """Check a span; one place alone is a span that stays there."""
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
    PlainValidator(_span),
    WithJsonSchema({"anyOf": [*_PLACE_SCHEMA["anyOf"], {"type": "array", "items": _PLACE_SCHEMA, "minItems": 1}]}),
]


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


def positions(key: str, span: Sequence[IndexPlace], n: int, noun: str, problems: list[str]) -> tuple[float, ...]:
    """Find the positions of a span's places on an axis of n indices.

    Args:
        key: where the span stands, for messages.
        noun: of the indices, "cameras".
        problems: what lies outside of the axis is added.
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


def along(span: Sequence[float], u: float) -> float:
    """Find the position u of the way along a span whose places lie at even steps of u; places themselves are exact."""
    last = len(span) - 1
    if u == 1 or not last:
        return span[-1]
    k = min(int(u * last), last - 1)
    return span[k] + (span[k + 1] - span[k]) * (u * last - k)


def nearest(position: float) -> int:
    """Find the nearest index; halves go up."""
    return math.floor(position + 0.5)


def percent(text: str) -> float | None:
    """Read "50%" or "12.5 %"; None for anything else and for what is not within 0 and 100."""
    found = re.fullmatch(r"(\d{1,3}(?:\.\d{1,9})?) ?%", text)
    value = float(found[1]) if found else None
    return value if value is not None and value <= 100 else None


def _is_place(value: object) -> bool:
    if isinstance(value, str):
        return value in ("first", "last") or percent(value) is not None
    return is_number(value)


def position_of(place: IndexPlace, n: int) -> float:
    """Resolve a place on an axis of n indices; the result may lie outside."""
    if isinstance(place, int | float):
        return float(place + n if place < 0 else place)
    return (n - 1) * ({"first": 0.0, "last": 100.0}.get(place, percent(place)) or 0.0) / 100


LightPlace: TypeAlias = tuple[int, ...]

ALL, MIDDLE = "all", "50%"
_PLACE = r"[+-]?\d{1,9}|first|last|[\d.]+ ?%"  # whole indices alone: nothing is blended here
_WANTED_INDICES = '"all", or indices, "first", "last" or percentages with commas between them'


def indices(option: str, text: str, n: int) -> tuple[int, ...]:
    """Read "all", or places with commas between them: "0,3,-1", "first", "last", "50%" (the nearest index).

    Args:
        option: what the text was given as, for messages.
        n: indices on the axis.

    Returns:
        The indices, in the order given, none twice.

    Raises:
        JobError: it is none of these, or lies outside of the axis.
    """
    if text.strip() == ALL:
        return tuple(range(n))
    found: dict[int, None] = {}
    for place in text.split(","):
        index = _index(place.strip(), n)
        if index is None:
            raise JobError(option, [f"expected {_WANTED_INDICES}, got {shown(text)}"])
        if not 0 <= index < n:
            raise JobError(option, [f"expected 0 to {n - 1}, or -{n} to -1, got {place.strip()}"])
        found[index] = None
    return tuple(found)


def light_places(manifest: Manifest, light: str | None, at: Sequence[str], default: str) -> list[LightPlace]:
    """Read the light positions along every axis, and combine them.

    Args:
        light: places along the first axis; None: `default`.
        at: "AXIS=PLACES" for others, or for the first.
        default: places along the axes of which nothing is said.

    Raises:
        JobError: a place or an axis is not known, or one is told twice.
    """
    axes = manifest.axes
    told = _told(axes, at)
    first = next(iter(axes))
    if light is not None:
        if first in told:
            raise JobError("--light", [f"expected either this or --at {first}=..., got both"])
        told[first] = ("--light", light)
    chosen = [indices(*told.get(axis, (f"--at {axis}", default)), n) for axis, n in axes.items()]
    return list(product(*chosen))


def spread_with_ends(n: int, most: int) -> tuple[int, ...]:
    """At most so many of n indices, evenly, the first and the last among them; the middle one if there is one."""
    if n <= most:
        return tuple(range(n))
    if most == 1:
        return ((n - 1) // 2,)
    return tuple(round(k * (n - 1) / (most - 1)) for k in range(most))


def plain_names(axes: Mapping[str, int]) -> dict[str, str]:
    """Names of axes for keys and columns, of letters, digits and _: "light" for the main one, "light_..." for others.

    No two are the same.
    """
    names: dict[str, str] = {}
    for axis in axes:
        name = MAIN_AXIS if axis == MAIN_AXIS else f"light_{re.sub(r'[^0-9A-Za-z]+', '_', axis).strip('_')}"
        while name in names.values():
            name += "_"
        names[axis] = name
    return names


def _told(axes: Mapping[str, int], at: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Axis -> the option and its places."""
    told: dict[str, tuple[str, str]] = {}
    for text in at:
        axis, equals, places = text.partition("=")
        if not equals or axis not in axes or axis in told:
            known = ", ".join(f"{name} (0 to {n - 1})" for name, n in axes.items())
            problem = "twice the same axis" if axis in told else shown(text)
            raise JobError("--at", [f"expected AXIS=PLACES with one of the axes {known}, got {problem}"])
        told[axis] = (f"--at {axis}", places)
    return told


def _index(place: str, n: int) -> int | None:
    """The index that a place means, which may lie outside; None if it means nothing."""
    if not re.fullmatch(_PLACE, place):
        return None
    try:
        return nearest(position_of(read_place(place), n))
    except ValueError:  # more than 100 %
        return None
