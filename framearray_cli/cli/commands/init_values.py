"""Values of options of `framearray init`."""

import re
from datetime import date
from typing import NamedTuple

from ..values import refusal

MOST_PIXELS = 16384  # of a side, as in a job


class Resolution(NamedTuple):
    """Pixels."""

    width: int
    height: int


class SunPlace(NamedTuple):
    """Degrees north and east, and year-month-day."""

    latitude: float
    longitude: float
    date: str


def read_resolution(value: object) -> Resolution:
    """Read a size such as 640x480."""
    found = re.fullmatch(r"([0-9]{1,6})[xX*]([0-9]{1,6})", str(value).strip())
    if found is None or not all(1 <= int(side) <= MOST_PIXELS for side in found.groups()):
        raise refusal(f"width and height of 1 to {MOST_PIXELS} pixels, such as 640x480", value)
    return Resolution(int(found[1]), int(found[2]))


def read_sun(value: object) -> SunPlace:
    """Read a place and a day: 48.1,11.6,2026-06-21."""
    expected = "latitude, longitude and date, such as 48.1,11.6,2026-06-21"
    parts = [part.strip() for part in str(value).split(",")]
    try:
        latitude, longitude, day = float(parts[0]), float(parts[1]), date.fromisoformat(",".join(parts[2:]))
    except (ValueError, IndexError):
        raise refusal(expected, value) from None
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        raise refusal("a latitude from -90 to 90 and a longitude from -180 to 180", value)
    return SunPlace(latitude, longitude, day.isoformat())
