"""Places on an axis of an array as people write them, and positions along a span of places.

Notation: a position is an index along an axis that need not be whole; n is the number of indices on the axis.
"""

import math
import re
from collections.abc import Sequence
from typing import Annotated, Any, TypeAlias

from pydantic import PlainValidator, WithJsonSchema

from framearray_cli.base.arrays import is_number
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
