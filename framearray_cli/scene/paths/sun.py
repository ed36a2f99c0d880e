"""The position of the sun: the door to ephem, and its angles as directions in a scene.

Elevations are apparent: the air bends sunlight, so the sun appears higher than it stands, by half a degree at the
horizon and a fiftieth of a degree halfway up. Azimuths run from north over east. See docs/decisions/lights.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.extras import extra
from framearray_cli.job.values import moment, zone_of

from .curves import PARALLEL, unit

PRESSURE_HPA, TEMPERATURE_C = 1013.25, 12.0  # of the air that bends the light, standard at sea level
REFRACTION_DEG = 0.5667  # at the horizon
SET_DEG = -(0.26667 + REFRACTION_DEG)  # true elevation of the centre where the upper rim leaves the horizon
DAY_S, DAYS_TO_1970 = 86400.0, 25567.5  # ephem counts days from noon of 1899-12-31
NEVER = "never"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SunPath:
    """The sun at n moments.

    Attributes:
        times: local.
        azimuth_deg: (n,) clockwise from north.
        elevation_deg: (n,) apparent, of the centre of the disc.
    """

    times: tuple[datetime, ...]
    azimuth_deg: Float64
    elevation_deg: Float64

    @property
    def is_up(self) -> Float64:
        """(n,) 1 where the sun is above the horizon, else 0."""
        return np.asarray(self.elevation_deg > 0, dtype=np.float64)


def sun_at(times: Sequence[datetime], latitude: float, longitude: float) -> SunPath:
    """Find the sun at some moments, by VSOP87 [Bretagnon88].

    Args:
        times: with their time zones.
        latitude, longitude: degrees, north and east positive.

    Raises:
        MissingExtraError: ephem is not installed.
    """
    with extra('a source of type "sun" needs ephem', "ephem"):
        import ephem
    place, sun = ephem.Observer(), ephem.Sun()
    place.lat, place.lon = np.radians(latitude), np.radians(longitude)
    place.temp = TEMPERATURE_C
    angles = np.zeros((len(times), 2))
    for k, time in enumerate(times):
        # a number: before 1582 ephem's dates are of another calendar
        place.date = time.timestamp() / DAY_S + DAYS_TO_1970
        place.pressure = 0.0  # no air, no refraction: where the sun has set, elevations are true
        sun.compute(place)
        if np.degrees(sun.alt) >= SET_DEG:
            place.pressure = PRESSURE_HPA
            sun.compute(place)
        angles[k] = sun.alt, sun.az
    elevation_deg, azimuth_deg = np.degrees(angles.T)
    return SunPath(times=tuple(times), azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)


def daylight(date: str, timezone: str | float, place: tuple[float, float]) -> str:
    """The hours at which the sun is up on a day, "06:12 to 18:05", to the minute; or NEVER."""
    zone = zone_of(timezone)
    first, last = (moment(date, time, zone).astimezone(UTC) for time in ("00:00:00", "23:59:00"))
    n = int((last - first).total_seconds()) // 60 + 1
    minutes = [(first + timedelta(minutes=k)).astimezone(zone) for k in range(n)]
    sun = sun_at(minutes, *place)
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], sun.is_up, [0.0]])))
    spans = list(pairwise(edges))[::2]
    return " and ".join(f"{minutes[a]:%H:%M} to {minutes[b - 1]:%H:%M}" for a, b in spans) or NEVER


def level_north(north: Sequence[float] | None, up_dir: Float64) -> Float64 | None:
    """Unit vector (3,) that points north in a scene: a direction without its part along up; None if it is along up.

    Args:
        north: None for -z in a scene with y up, and y in one with z up.
        up_dir: (3,) unit.
    """
    north_vec = unit(np.array(north or ((0.0, 1.0, 0.0) if up_dir[2] else (0.0, 0.0, -1.0))))
    north_vec = north_vec - (north_vec @ up_dir) * up_dir
    return unit(north_vec) if np.linalg.norm(north_vec) > PARALLEL else None


def directions_to_sun(sun: SunPath, up_dir: Float64, north_dir: Float64) -> Float64:
    """Turn angles into unit directions from the scene to the sun, (n, 3).

    Args:
        up_dir: (3,) unit, up in the scene.
        north_dir: (3,) unit, north in the scene, normal to `up_dir`.
    """
    azimuth, elevation = np.radians(sun.azimuth_deg)[:, None], np.radians(sun.elevation_deg)[:, None]
    east_dir = np.cross(north_dir, up_dir)
    level = np.cos(azimuth) * north_dir + np.sin(azimuth) * east_dir
    return np.asarray(np.cos(elevation) * level + np.sin(elevation) * up_dir)
