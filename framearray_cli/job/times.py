"""Dates, times of day and time zones in a job, kept as plain text so that a job stays plain tables."""

import datetime
import re
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Annotated, TypeAlias
from zoneinfo import ZoneInfo, available_timezones

from pydantic import PlainValidator, ValidationError, WithJsonSchema

from framearray_cli.base.extras import install_command
from framearray_cli.base.forms.table import fail
from framearray_cli.base.forms.words import shown

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
    if problems:
        fail(problems)
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


def clock_minutes(clock: str) -> float:
    """The minutes from midnight to a checked time of day."""
    time = datetime.time.fromisoformat(clock)
    return time.hour * 60 + time.minute + time.second / 60


def moment(date: str, clock: str, zone: datetime.tzinfo) -> datetime.datetime:
    """The moment at which clocks in a zone show a checked date and time."""
    day, time = datetime.date.fromisoformat(date), datetime.time.fromisoformat(clock)
    return datetime.datetime.combine(day, time, tzinfo=zone)


def even_moments(
    dates: Sequence[str], start: str, stop: str, timezone: str | float, n: int, step: float | None = None
) -> tuple[datetime.datetime, ...]:
    """Return n local moments: n / len(dates) on each day, evenly spaced from start to stop; one moment is the start.

    Args:
        dates, start, stop, timezone: as checked; clock times of that zone.
        n: a multiple of the number of dates.
        step: minutes from one moment to the next; None: so that the last is at the stop.
    """
    zone = zone_of(timezone)
    moments: list[datetime.datetime] = []
    for date in dates:
        first = moment(date, start, zone).astimezone(datetime.UTC)  # in UTC, so that a clock change causes no jump
        span = moment(date, stop, zone).astimezone(datetime.UTC) - first
        each = n // len(dates)
        parts = [datetime.timedelta(minutes=step) * k if step else span * (k / max(each - 1, 1)) for k in range(each)]
        moments += [(first + part).astimezone(zone) for part in parts]
    return tuple(moments)


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
