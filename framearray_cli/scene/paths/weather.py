"""Weather files of EnergyPlus (EPW): the light of the sun and of the sky in every hour of a year."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.files import reason
from framearray_cli.job.rowfile import RowFileError

from .sky import EFFICACY

HOURS = 8760
MONTH, DAY, HOUR = 1, 2, 3  # columns
IRRADIANCE, ILLUMINANCE = (14, 15), (17, 18)  # columns: by the sun on a surface that faces it, by the sky
MISSING, NO_LUX = 9999.0, 999900.0  # from which on a value is missing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weather:
    """A year of light; each value is the mean of an hour.

    Attributes:
        latitude, longitude: degrees; `zone`: hours ahead of UTC.
        light: (2, HOURS) illuminance of a surface that faces the sun, and of a level one by the sky, lux.
    """

    latitude: float
    longitude: float
    zone: float
    light: Float64

    def at(self, times: Sequence[datetime]) -> Float64:
        """(2, n) illuminance at moments of any year with their time zones, between the middles of hours, lux."""
        local = timezone(timedelta(hours=self.zone))
        hours = [_hour_of_year(time.astimezone(local)) - 0.5 for time in times]
        known = np.arange(-1, HOURS + 1)
        return np.stack([np.interp(hours, known, np.pad(row, 1, "wrap")) for row in self.light])


def _hour_of_year(time: datetime) -> float:
    """Hours since the start of a year without leap day; 29 February counts as the 28th."""
    day = min(time.day, 28) if time.month == 2 else time.day
    since = time.replace(year=2001, day=day, tzinfo=None) - datetime(2001, 1, 1)
    return since.total_seconds() / 3600


def read_weather(path: Path) -> Weather:
    """Read a weather file. Where it has no illuminance, irradiance counts with EFFICACY; missing values count as dark.

    Raises:
        RowFileError: it is no EPW file, or lacks hours.
    """
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig", errors="replace").splitlines()))
    except OSError as error:
        raise RowFileError(f"cannot be read: {reason(error)}") from error
    except csv.Error as error:
        raise RowFileError(f"expected a weather file (EPW), got another kind of text: {error}") from error
    head = next((row for row in rows if row and row[0].strip().upper() == "LOCATION"), [])
    try:
        latitude, longitude, zone = (float(text) for text in head[6:9])
        if not (abs(latitude) <= 90 and abs(longitude) <= 360 and abs(zone) <= 15):
            raise ValueError
    except ValueError as error:
        wanted = "a weather file (EPW) with latitude, longitude and hours ahead of UTC in the line LOCATION"
        raise RowFileError(f"expected {wanted}, got {','.join(head)[:80] or 'none'}") from error
    light, found = np.zeros((2, HOURS)), np.zeros(HOURS, bool)
    for number, row in enumerate(rows, start=1):
        if len(row) <= ILLUMINANCE[1] or not row[0].strip().isdigit():
            continue
        try:
            values = [float(row[k]) for k in (MONTH, DAY, HOUR, *IRRADIANCE, *ILLUMINANCE)]
            start = datetime(2001, int(values[0]), int(values[1])) + timedelta(hours=values[2] - 1)
        except (ValueError, OverflowError) as error:
            if row[MONTH].strip() == "2" and row[DAY].strip() == "29":
                continue
            raise RowFileError(f"line {number}: expected numbers, got {','.join(row)[:60]}") from error
        hour = int((start - datetime(2001, 1, 1)).total_seconds()) // 3600 % HOURS
        watts, lux = values[3:5], values[5:7]
        valid = all(0 <= v < NO_LUX for v in lux) and min(lux) != MISSING  # some writers mark both alike
        known = valid and (max(lux) > 0 or max(watts) <= 0)
        light[:, hour] = lux if known else [EFFICACY * (w if 0 <= w < MISSING else 0.0) for w in watts]
        found[hour] = True
    if not found.all():
        raise RowFileError(f"expected {HOURS} hours, got {int(found.sum())}")
    return Weather(latitude=latitude, longitude=longitude, zone=zone, light=light)
