"""Spans of a movie path: a place where the camera or the light stays, or places that it passes through in even steps.

The notation is that of `array/places.py`; n is the number of indices on an axis. A text that names several places, such
as "0-47" or "first-last", passes through all of them.
"""

from collections.abc import Callable, Sequence
from datetime import date, datetime
from typing import Annotated, Any, TypeAlias

from pydantic import PlainValidator, WithJsonSchema

from framearray_cli.array.moments import TIME, put_indices, without_times
from framearray_cli.array.places import (
    ALL_PLACES,
    PART,
    PLACE,
    WANTED_PLACE,
    IndexPlace,
    is_notation,
    is_place,
    outside_problem,
    parse_places,
    position_of,
)
from framearray_cli.base.forms.table import fail
from framearray_cli.base.forms.words import shown

_PART = PART.replace(PLACE, f"(?:{PLACE}|{TIME})")
_PLACES_PATTERN = rf"^({ALL_PLACES}|{_PART}(, ?{_PART})*)$".replace("?:", "")  # JSON Schema knows plain groups
_PLACE_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number"}, {"type": "string", "pattern": _PLACES_PATTERN}]}


def _check_span(value: object) -> tuple[IndexPlace, ...]:
    """Check a span; a single place is a span that stays there."""
    many = isinstance(value, list | tuple)
    places: Any = [_plain(each) for each in (value if many else [value])]  # type: ignore[attr-defined]  # a list
    if not places:
        fail([((), "expected a place, or a list of places, got an empty list")])
    bad = [((k,), f"{WANTED_PLACE}, got {shown(place)}") for k, place in enumerate(places) if not _is_part(place)]
    if bad:
        fail(bad if many else [((), bad[0][1])])
    return tuple(places)


def _plain(value: object) -> object:
    """Write TOML's own dates and times as text."""
    return value.isoformat() if isinstance(value, date) else value  # a datetime is a date


def _is_part(value: object) -> bool:
    """Return whether a value is a place, or a text that names several."""
    return is_notation(without_times(value)) if isinstance(value, str) else is_place(value)


Span: TypeAlias = Annotated[
    tuple[IndexPlace, ...],
    PlainValidator(_check_span),
    WithJsonSchema({"anyOf": [*_PLACE_SCHEMA["anyOf"], {"type": "array", "items": _PLACE_SCHEMA, "minItems": 1}]}),
]


def resolve_span(
    key: str,
    span: Sequence[IndexPlace],
    n: int,
    axis: str,
    problems: list[str],
    moments: Callable[[], Sequence[datetime]] = tuple,
) -> tuple[float, ...]:
    """Find the positions of a span's places on an axis of n indices.

    Args:
        key: where the span stands, for messages.
        axis: its name: "camera", "light" or that of another light axis.
        problems: receives a line for each place outside the axis.
        moments: returns those of the positions, for places that are dates or times.
    """
    found: list[float] = []
    for place in span:
        positions = [position_of(place, n)] if not isinstance(place, str) else []
        problem = ""
        if isinstance(place, str):
            try:
                if without_times(place) != place:
                    place = put_indices(place, moments())
                positions = parse_places(place, n, axis, fractions=True)
            except ValueError as error:
                problem = f"{key}: {error}"
        elif not 0 <= positions[0] <= n - 1:
            problem = f"{key}: {outside_problem(place, n, axis)}"
        if problem and problem not in problems:
            problems.append(problem)
        found += [0.0] if problem else positions
    return tuple(found)


def interpolate_span(span: Sequence[float], u: float) -> float:
    """Interpolate linearly between positions at even steps of u from 0 to 1, where the result is exact."""
    last = len(span) - 1
    if u == 1 or not last:
        return span[-1]
    k = min(int(u * last), last - 1)
    return span[k] + (span[k + 1] - span[k]) * (u * last - k)
