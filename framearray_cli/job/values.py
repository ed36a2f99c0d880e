"""Types of values in a job, each with its check and its schema.

Dates, times of day and time zones stay plain text, so that a job stays plain tables.
"""

import datetime
import math
import re
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias
from zoneinfo import ZoneInfo, available_timezones

from pydantic import ByteSize, Field, PlainValidator, ValidationError, ValidationInfo, WithJsonSchema

from framearray_cli.base.colour import TEMPERATURE_EXAMPLE, TEMPERATURE_SCHEMA, temperature_colour
from framearray_cli.base.extras import install_command
from framearray_cli.base.files import LONGEST_PATH, absolute
from framearray_cli.base.forms.table import Float3, fail, refuse
from framearray_cli.base.forms.words import range_text, shown
from framearray_cli.base.units import FARTHEST, MOST_EMISSION

MOST_OFFSET = 14.0  # hours; no place on Earth is farther from UTC
YEARS = (1000, 3000)  # earlier the calendar was another; later the rotation of the Earth is not known to a second


def _date(value: object) -> str:
    """Check a date: TOML's own, or text such as "2026-06-21"."""
    if isinstance(value, str) and re.fullmatch(r"\d{4}-\d{2}-\d{2}", value.strip()):
        try:
            value = datetime.date.fromisoformat(value.strip())
        except ValueError:
            fail([((), f"expected a date that the calendar has, got {shown(value)}")])
    if not isinstance(value, datetime.date) or isinstance(value, datetime.datetime):
        fail([((), f"expected a date such as 2026-06-21, got {shown(value)}")])
    if not YEARS[0] <= value.year <= YEARS[1]:
        fail([((), f"expected a year from {YEARS[0]} to {YEARS[1]}, got {value.year}")])
    return value.isoformat()


def _dates(value: object) -> str | tuple[str, ...]:
    """Check a date, or a list of different dates."""
    if not isinstance(value, list | tuple):
        return _date(value)
    if not value:
        fail([((), "expected a date, or a list of at least 1, got an empty list")])
    found, problems = [], []
    for k, each in enumerate(value):
        try:
            date = _date(each)
        except ValidationError as error:
            problems += [((k,), each["ctx"]["text"]) for each in error.errors()]
        else:
            if date in found:
                problems.append(((k,), f"expected a day that the list does not hold yet, got {date} again"))
            found.append(date)
    refuse(problems)
    return tuple(found)


def _clock(value: object) -> str:
    """Check a time of day: TOML's own, or text such as "09:30"."""
    if isinstance(value, datetime.time) and value.tzinfo is None:
        return value.isoformat(timespec="seconds")
    if isinstance(value, str) and re.fullmatch(r"\d{1,2}:\d{2}(:\d{2})?", value.strip()):
        try:
            return datetime.time.fromisoformat(value.strip().zfill(5)).isoformat(timespec="seconds")
        except ValueError:
            pass
    fail([((), f'expected a time of day from "00:00" to "23:59", got {shown(value)}')])


def _zone(value: object) -> str | float:
    """Check a time zone: an IANA name, or hours ahead of UTC."""
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MOST_OFFSET:
        return float(value)
    if isinstance(value, str) and value.strip():
        try:
            return ZoneInfo(value.strip()).key
        except (KeyError, ValueError, OSError):  # unknown, an absolute path, or a folder of the database
            _unknown_zone(value)
    text = f'expected a time zone such as "Europe/Berlin", or hours from -{MOST_OFFSET:g} to {MOST_OFFSET:g}'
    fail([((), f"{text}, got {shown(value)}")])


def _unknown_zone(value: str) -> None:
    """Report an unknown name, and the one that was probably meant."""
    known = available_timezones()
    if not known:  # Windows has no time zone database
        remedy = f"give the hours ahead of UTC, or install it with: {install_command('tzdata')}"
        fail([((), f"this machine has no list of time zones; {remedy}")])
    by_city = {name.rpartition("/")[2].lower(): name for name in sorted(known)}
    city = value.strip().rpartition("/")[2].lower().replace(" ", "_")
    close = get_close_matches(city, by_city, n=1, cutoff=0.7)
    meant = f'; did you mean "{by_city[close[0]]}"?' if close else '; expected a name such as "Europe/Berlin"'
    fail([((), f"unknown time zone {shown(value)}{meant}")])


def zone_of(value: str | float) -> datetime.tzinfo:
    """The time zone that a checked value names."""
    if isinstance(value, str):
        return ZoneInfo(value)
    return datetime.timezone(datetime.timedelta(hours=value))


def moment(date: str, clock: str, zone: datetime.tzinfo) -> datetime.datetime:
    """The moment at which clocks in a zone show a checked date and time."""
    day, time = datetime.date.fromisoformat(date), datetime.time.fromisoformat(clock)
    return datetime.datetime.combine(day, time, tzinfo=zone)


def is_skipped(date: str, clock: str, timezone: str | float) -> bool:
    """True if clocks never show a checked time on a day, as they go forward over it."""
    time = moment(date, clock, zone_of(timezone))
    return time.astimezone(datetime.UTC).astimezone(time.tzinfo).replace(tzinfo=None) != time.replace(tzinfo=None)


def span_of_day(
    date: str, start: str, stop: str, timezone: str | float
) -> tuple[datetime.datetime, datetime.timedelta]:
    """The moment in UTC at which clocks of a zone show the start, and the time that passes until the stop.

    Of a time that clocks show twice, the first counts as start, and the second as stop.
    """
    zone = zone_of(timezone)
    first, last = moment(date, start, zone), moment(date, stop, zone).replace(fold=1)
    return first.astimezone(datetime.UTC), last.astimezone(datetime.UTC) - first.astimezone(datetime.UTC)


ROUNDING = 1e-6  # of steps; a third of an hour ends after three of them


def count_steps(date: str, start: str, stop: str, timezone: str | float, step: float) -> int:
    """Number of moments from start to stop, `step` minutes apart."""
    return int(span_of_day(date, start, stop, timezone)[1] / datetime.timedelta(minutes=step) + ROUNDING) + 1


def even_moments(
    date: str, start: str, stop: str, timezone: str | float, n: int, step: float | None = None
) -> list[datetime.datetime]:
    """Return local moments, evenly spaced in elapsed time from start to stop; one moment is the start.

    Args:
        date, start, stop, timezone: as checked; clock times of that zone.
        n: number of moments, the last at the stop.
        step: minutes from one moment to the next, instead of a number.
    """
    zone = zone_of(timezone)
    first, span = span_of_day(date, start, stop, timezone)
    if step:
        n = count_steps(date, start, stop, timezone, step)
        span = datetime.timedelta(minutes=step) * (n - 1)
    return [(first + span * k / max(n - 1, 1)).astimezone(zone) for k in range(n)]


_DAY = {"type": "string", "format": "date"}
_DATES = WithJsonSchema(
    {
        "anyOf": [_DAY, {"type": "array", "items": _DAY, "minItems": 1}],
        "x-words": "a date such as 2026-06-21, or a list of dates",
    }
)
_CLOCK = WithJsonSchema({"type": "string", "x-words": 'a time of day such as "09:30"'})
_ZONE = WithJsonSchema(
    {
        "anyOf": [{"type": "string"}, {"type": "number", "minimum": -MOST_OFFSET, "maximum": MOST_OFFSET}],
        "x-words": 'a name such as "Europe/Berlin", or hours ahead of UTC',
    }
)
Dates: TypeAlias = Annotated[str | tuple[str, ...], PlainValidator(_dates), _DATES]
Clock: TypeAlias = Annotated[str, PlainValidator(_clock), _CLOCK]
Zone: TypeAlias = Annotated[str | float, PlainValidator(_zone), _ZONE]


Auto: TypeAlias = Literal["auto"]  # see render/automatic/choose.py


MOST_SHIFT = 10.0  # of a lens, sides of the picture; whoever wants more turns the camera

SHORTEST = 1e-12  # scene units; shorter directions count as zero


def _number_problem(value: object, low: float, high: float, whole: bool) -> str | None:
    """Describe what is wrong with one number, if anything."""
    right_type = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if right_type and low <= value <= high:  # type: ignore[operator]
        return None
    beyond = right_type and (value < -FARTHEST or value > FARTHEST)  # type: ignore[operator]
    wanted = f"from {low:g} to {high:g}" if beyond else range_text(low, high)
    kind = "a whole number" if whole else "a number"
    return f"expected {kind} {wanted}".rstrip() + f", got {shown(value)}"


def _vector(
    count: int, low: float, high: float, *, grey: bool = False, whole: bool = False
) -> Callable[[object], tuple[Any, ...]]:
    """Make a check for `count` numbers within bounds; with `grey` one number stands for all of them."""
    kind = "whole numbers" if whole else "numbers"

    def check(value: object) -> tuple[Any, ...]:
        if grey and not isinstance(value, list | tuple):
            if isinstance(value, str | dict):
                fail([((), f"expected a number or {count} numbers, got {shown(value)}")])
            if problem := _number_problem(value, low, high, whole):
                fail([((), problem)])
            value = [value] * count
        if not isinstance(value, list | tuple):
            fail([((), f"expected {count} {kind}, got {shown(value)}")])
        if len(value) != count:
            fail([((), f"expected {count} {kind}, got {len(value)}")])
        found = [((i,), _number_problem(item, low, high, whole)) for i, item in enumerate(value)]
        refuse((place, text) for place, text in found if text)
        return tuple(item if whole else float(item) for item in value)

    return check


def _direction(value: object) -> tuple[Any, ...]:
    """Check three numbers that are not all zero."""
    vector = _vector(3, -FARTHEST, FARTHEST)(value)
    if math.hypot(*vector) < SHORTEST:
        fail([((), f"expected a direction, got the zero vector {shown(value)}")])
    return vector


def _file_name(value: object, info: ValidationInfo) -> Path:
    """Check a file name and make it absolute."""
    if not isinstance(value, str | Path) or not str(value).strip() or "\0" in str(value):
        fail([((), f"expected a file name, got {shown(value)}")])
    if re.match(r"([A-Za-z]:|\\).*[\x00-\x1f]", str(value), re.DOTALL):
        remedy = "TOML reads a backslash in double quotes as an escape; write / for it, or use single quotes"
        fail([((), f"expected a file name, got {shown(value)}: {remedy}")])
    if len(str(value)) > LONGEST_PATH:
        fail([((), f"expected a file name of at most {LONGEST_PATH} characters, got one of {len(str(value))}")])
    job_file = (info.context or {}).get("job_file")
    return absolute(Path(value), job_file)


def _colour(value: object) -> tuple[Any, ...]:
    """Check factors by channel, or read a colour temperature."""
    if not isinstance(value, str):
        return _vector(3, 0.0, MOST_EMISSION, grey=True)(value)
    try:
        found = temperature_colour(value)
    except ValueError as error:
        fail([((), str(error))])
    if found is None:
        fail([((), f"expected a number, 3 numbers or {TEMPERATURE_EXAMPLE}, got {shown(value)}")])
    return found


MOST_HITS = 65000  # per pixel and frame; random streams distinguish 2^16

SHARES = (1 / 2, 1 / 3, 1 / 4, 1 / 5, 1 / 6, 1 / 7, 1 / 8)  # of pixels that get a hit in one frame


def _hits(value: object) -> float | Auto:
    """Check a number of hits per pixel: a whole number, a unit fraction down to 1/8, or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, int | float) and not isinstance(value, bool):
        if 1 <= value <= MOST_HITS and value == int(value):
            return float(value)
        for share in SHARES if 0 < value < 1 else ():
            if abs(value - share) < 1e-3:  # 0.333 means a third
                return share
    fail([((), f'expected a whole number from 1 to {MOST_HITS}, 1/2, 1/3, ... 1/8 or "auto", got {shown(value)}')])


MOST_N_R = 64  # more would not fit into memory


def _half_window(value: object) -> int | Auto:
    """Check N_r, or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST_N_R:
        return value
    fail([((), f'expected a whole number from 0 to {MOST_N_R} or "auto", got {shown(value)}')])


def _vector_schema(count: int, *, grey: bool = False, whole: bool = False, **bounds: float) -> WithJsonSchema:
    """Describe `count` numbers, or one grey number, in JSON Schema."""
    item = {"type": "integer" if whole else "number", **bounds}
    vector = {"type": "array", "items": item, "minItems": count, "maxItems": count}
    return WithJsonSchema({"anyOf": [item, vector]} if grey else vector)


Point: TypeAlias = Annotated[Float3, PlainValidator(_vector(3, -FARTHEST, FARTHEST)), _vector_schema(3)]

Rectangle: TypeAlias = Annotated[
    tuple[float, float, float, float], PlainValidator(_vector(4, -FARTHEST, FARTHEST)), _vector_schema(4)
]

LensShift: TypeAlias = Annotated[
    tuple[float, float], PlainValidator(_vector(2, -MOST_SHIFT, MOST_SHIFT)), _vector_schema(2)
]

Direction: TypeAlias = Annotated[Float3, PlainValidator(_direction), _vector_schema(3)]

Emission: TypeAlias = Annotated[
    Float3, PlainValidator(_vector(3, 0.0, MOST_EMISSION, grey=True)), _vector_schema(3, grey=True, minimum=0)
]

Colour: TypeAlias = Annotated[
    Float3,
    PlainValidator(_colour),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0},
                {"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 3, "maxItems": 3},
                TEMPERATURE_SCHEMA,
            ],
            "x-words": f"a number or 3 numbers of at least 0, or {TEMPERATURE_EXAMPLE}",
        }
    ),
]

Reflectivity: TypeAlias = Annotated[
    Float3, PlainValidator(_vector(3, 0.0, 1.0, grey=True)), _vector_schema(3, grey=True, minimum=0, maximum=1)
]

Size: TypeAlias = Annotated[
    tuple[int, int],
    PlainValidator(_vector(2, 1, 16384, whole=True)),
    _vector_schema(2, whole=True, minimum=1, maximum=16384),
]

HitCount: TypeAlias = Annotated[
    int | float | Auto,
    PlainValidator(_hits),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0.125, "maximum": MOST_HITS, "x-words": "a number"},
                {"const": "auto"},
            ]
        }
    ),
]

HalfWindow: TypeAlias = Annotated[
    int | Auto,
    PlainValidator(_half_window),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 0, "maximum": MOST_N_R}, {"const": "auto"}]}),
]

MemorySize: TypeAlias = Annotated[
    ByteSize,
    Field(gt=0),
    WithJsonSchema(
        {
            "anyOf": [{"type": "string"}, {"type": "integer", "minimum": 1}],
            "x-words": 'an amount of memory such as "8 GiB" or "500 MB"',
        }
    ),
]

FileName: TypeAlias = Annotated[
    Path, PlainValidator(_file_name), WithJsonSchema({"type": "string", "minLength": 1, "x-words": "a file name"})
]
