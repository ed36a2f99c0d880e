"""The sun: against published angles, in scenes, and the errors of a sun that never shines."""

import math
import sys
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.lightjobs import read_lit

from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import black_body
from framearray_cli.base.errors import JobError, MissingExtraError, OutputError
from framearray_cli.base.sundays import sun_days
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.job.job import Job
from framearray_cli.job.light import LightTable
from framearray_cli.job.read import job_table, read_job
from framearray_cli.job.values import even_moments
from framearray_cli.render.render import render
from framearray_cli.scene.paths.paths import lights
from framearray_cli.scene.paths.sun import (
    PRESSURE_HPA,
    REFRACTION_DEG,
    TEMPERATURE_C,
    SunPath,
    daylight,
    directions_to_sun,
    sun_at,
)

WANTED = 0.1  # degrees
AGREED = 0.02  # degrees: both are good to 0.005 against the published values
# UTC, latitude, longitude, azimuth and zenith angle as published, degrees.
NREL_REPORT = [("2003-10-17T19:30:30", 39.742476, -105.1786, 194.34024, 50.11162)]  # [Reda04], its worked example
# Made by NREL's own program spa.c, with refraction; published as test data of the library solarpositioning.
NREL_PROGRAM = [
    ("2010-06-15T00:30:00", -36.840556, 174.74, 357.723597, 60.142480),  # Auckland, winter
    ("2010-06-15T03:30:00", -36.840556, 174.74, 315.749511, 74.707383),
    ("2010-12-15T03:30:00", -36.840556, 174.74, 274.070527, 43.612177),  # summer
    ("2010-09-15T18:30:00", -36.840556, 174.74, 85.646656, 88.599396),  # just risen
    ("2010-12-15T15:30:00", -15.793889, -47.882778, 215.325977, 9.278971),  # Brasilia, nearly overhead
    ("2010-06-15T12:30:00", -15.793889, -47.882778, 46.250557, 55.629466),
    ("2010-03-15T09:30:00", -15.793889, -47.882778, 91.385435, 86.910752),
    ("2010-06-15T09:30:00", 78.22, 15.65, 155.483089, 55.833654),  # Longyearbyen, summer
    ("2010-06-15T21:30:00", 78.22, 15.65, 339.394774, 77.579648),  # the midnight sun
    ("2010-03-15T06:30:00", 1.283333, 103.833333, 259.794538, 19.383306),  # Singapore
    ("2010-12-15T09:30:00", 1.283333, 103.833333, 244.624397, 69.986212),
]
# United States Naval Observatory, Berlin; printed to a tenth of a degree, with refraction.
NAVAL_OBSERVATORY = [("2010-10-19T10:30:00", 52.5, 13.4, 174.1, 90 - 27.3)]

BERLIN = {"latitude": 52.52, "longitude": 13.405, "timezone": "Europe/Berlin", "irradiance": 3.0}


def sun_of(**changes: Any) -> dict[str, Any]:
    """The table of a source; None is a key that it has not."""
    sun = {"type": "sun", "date": "2026-06-21", "start": "06:00", "stop": "20:00"} | BERLIN | changes
    return {key: value for key, value in sun.items() if value is not None}


def job(frames: int = 5, scene: dict[str, Any] | None = None, **source: Any) -> Job:
    return tiny.job(light={"sources": [sun_of(**source)], "frames": frames}, scene=scene or {})


def angle(azimuth: float, other: float) -> float:
    return abs((azimuth - other + 180) % 360 - 180)


@pytest.mark.parametrize("case", NREL_REPORT + NREL_PROGRAM + NAVAL_OBSERVATORY)
def test_the_sun_stands_where_it_was_published(case: tuple[str, float, float, float, float]) -> None:
    when, latitude, longitude, azimuth, zenith = case
    sun = sun_at([datetime.fromisoformat(f"{when}+00:00")], latitude, longitude)
    assert abs(90 - float(sun.elevation_deg[0]) - zenith) < WANTED
    # near the zenith an azimuth says little: what counts is the angle on the sky
    assert angle(float(sun.azimuth_deg[0]), azimuth) * math.sin(math.radians(zenith)) < WANTED


@pytest.mark.parametrize("year", [1000, 1581, 1900, 2026, 2999])
def test_another_almanac_agrees(year: int) -> None:
    """NREL's algorithm [Reda04], at all hours of a day, whether the sun is up, and in whichever calendar."""
    spa = pytest.importorskip("pvlib.spa", reason="pvlib is not installed")
    times = [datetime(year, 10, 9, tzinfo=UTC) + timedelta(hours=k) for k in range(24)]
    seconds = np.array([time.timestamp() for time in times])
    air = (0.0, PRESSURE_HPA, TEMPERATURE_C, spa.calculate_deltat(year, 10), REFRACTION_DEG)
    rows = spa.solar_position(seconds, -33.9, 151.2, *air, numthreads=1)
    other = SunPath(times=tuple(times), azimuth_deg=rows[4], elevation_deg=rows[2])
    one = sun_at(times, -33.9, 151.2)
    assert np.degrees(np.linalg.norm(_directions(one) - _directions(other), axis=1)).max() < AGREED


def _directions(sun: SunPath) -> Float64:
    return directions_to_sun(sun, np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))


def test_true_elevations_would_fail() -> None:
    """The published values of a low sun distinguish refraction from none, and one hour from the next."""
    when, latitude, longitude, azimuth, zenith = NREL_PROGRAM[3]
    moment = datetime.fromisoformat(f"{when}+00:00")
    refraction = 0.355  # degrees, at an elevation of 1.4 [Reda04, eq. 42]
    sun = sun_at([moment, moment + timedelta(hours=1)], latitude, longitude)
    assert abs(90 - (float(sun.elevation_deg[0]) - refraction) - zenith) > WANTED
    assert angle(float(sun.azimuth_deg[1]), azimuth) > WANTED


def test_positions_are_evenly_spaced_in_time_across_a_clock_change() -> None:
    place = (52.52, 13.405)
    sun = sun_at(
        even_moments("2026-03-29", "00:00:00", "12:00:00", "Europe/Berlin", 12), *place
    )  # clocks jump from 2 to 3
    steps = [b.timestamp() - a.timestamp() for a, b in zip(sun.times, sun.times[1:], strict=False)]
    assert steps == pytest.approx([3600.0] * 11)
    assert [f"{time:%H:%M %z}" for time in (sun.times[0], sun.times[-1])] == ["00:00 +0100", "12:00 +0200"]
    assert [
        f"{time:%H:%M}" for time in sun_at(even_moments("2026-06-21", "09:00:00", "10:00:00", 2, 1), *place).times
    ] == ["09:00"]


@pytest.mark.parametrize(
    ("zone", "date", "hours"),
    [
        ("Europe/Berlin", "2026-03-29", 23),
        ("Europe/Berlin", "2026-10-25", 25),
        ("Europe/Berlin", "2026-06-21", 24),
        ("America/New_York", "2026-11-01", 25),
        ("Australia/Lord_Howe", "2026-04-05", 24.5),  # its clocks change by half an hour
    ],
)
def test_steps_fill_the_whole_day_when_clocks_change(zone: str, date: str, hours: float) -> None:
    """From 00:00 to 23:59 in steps of half an hour: as many as the day has, and none on the next day."""
    sun = {"type": "sun", "start": "00:00", "stop": "23:59", "step": 30.0}
    table = LightTable.model_validate({"sources": [sun | BERLIN | {"timezone": zone, "date": date}]})
    moments = table.moments["light"]
    assert len(moments) == table.frames == 2 * hours
    assert {f"{time:%Y-%m-%d}" for time in moments} == {date}
    assert {b.timestamp() - a.timestamp() for a, b in pairwise(moments)} == {1800.0}
    (day,) = sun_days(moments)
    assert (day.step_h, day.most_h) == (0.5, hours)


def test_days_with_different_numbers_of_steps_follow_one_another() -> None:
    dates = ["2026-03-28", "2026-03-29", "2026-10-25"]
    sun = {"type": "sun", "date": dates, "start": "00:00", "stop": "23:00", "step": 60.0}
    days = sun_days(LightTable.model_validate({"sources": [sun | BERLIN]}).moments["light"])
    assert [(day.date, len(day.lights)) for day in days] == [("2026-03-28", 24), ("2026-03-29", 23), ("2026-10-25", 25)]


def test_an_offset_is_a_time_zone_too() -> None:
    place = (52.52, 13.405)
    by_name, by_hours = (
        sun_at(even_moments("2026-06-21", "09:00:00", "15:00:00", zone, 4), *place) for zone in ("Europe/Berlin", 2.0)
    )
    np.testing.assert_array_equal(by_name.azimuth_deg, by_hours.azimuth_deg)


@pytest.mark.parametrize(("up", "north"), [("y", None), ("z", None), ("y", [1.0, 0.0, 0.0]), ("z", [1.0, 2.0, 5.0])])
def test_the_sun_of_a_scene_shines_from_its_azimuth_and_elevation(up: str, north: list[float] | None) -> None:
    """Light comes from the azimuth, clockwise from north as seen from above, and from the elevation."""
    path = lights(job(scene={"file": "tiny.glb", "up": up}, north=north)).sources[0]
    up_axis = 1 if up == "y" else 2
    for vector, note in zip(path.vector, path.notes, strict=True):
        to_sun = -vector
        assert np.linalg.norm(to_sun) == pytest.approx(1)
        assert math.degrees(math.asin(to_sun[up_axis])) == pytest.approx(note["elevation"], abs=1e-3)
        # a map: x to the east, y to the north, seen from above
        east, north_part = {
            ("y", None): (to_sun[0], -to_sun[2]),
            ("z", None): (to_sun[0], to_sun[1]),
            ("y", 1.0): (to_sun[2], to_sun[0]),
            ("z", 1.0): ((2 * to_sun[0] - to_sun[1]) / math.sqrt(5), (to_sun[0] + 2 * to_sun[1]) / math.sqrt(5)),
        }[up, north[0] if north else None]
        assert angle(math.degrees(math.atan2(east, north_part)), note["azimuth"]) < 1e-3


def test_the_sun_rises_in_the_east_and_is_highest_in_the_south() -> None:
    path = lights(job(start="05:00", stop="21:00", frames=33)).sources[0]
    morning, evening = -path.vector[0], -path.vector[-1]
    highest = -path.vector[np.argmin(path.vector[:, 1])]
    assert morning[0] > 0.5 and evening[0] < -0.5  # x is east
    assert highest[2] > 0 and abs(highest[0]) < 0.1  # z is south


def test_below_the_horizon_it_does_not_shine() -> None:
    path = lights(job(start="00:00", stop="12:00", frames=13)).sources[0]
    elevation = np.array([note["elevation"] for note in path.notes])
    assert (elevation < 0).sum() == 5  # it rises at 4:46
    np.testing.assert_array_equal(path.intensity, np.where(elevation > 0, 3.0, 0.0)[:, None] * np.ones(3))
    arrays = light_arrays(lights(job(start="00:00", stop="12:00", frames=13)), np.zeros(3))
    np.testing.assert_array_equal(arrays.lit[0], elevation > 0)


def test_a_sun_has_a_colour() -> None:
    plain, warm = (lights(job(**given)).sources[0] for given in ({}, {"color": "3200 K"}))
    np.testing.assert_allclose(warm.intensity, plain.intensity * black_body(3200.0))


def test_a_day_has_its_published_length() -> None:
    """Almanacs say 04:43 to 21:33 for Berlin, from and to the upper rim of the disc.

    Here it is the centre that shines, 0.267 degrees lower. The sun climbs 15 cos(latitude) sin(azimuth) = 6.9 degrees
    per hour, so that is 2.3 minutes; whole minutes within that are 04:46 to 21:30.
    """
    assert daylight("2026-06-21", "Europe/Berlin", (52.52, 13.405)) == "04:46 to 21:30"
    assert daylight("2026-12-21", 1, (78.22, 15.65)) == "never"
    assert daylight("2026-06-21", 2, (78.22, 15.65)) == "00:00 to 23:59"


def test_a_sun_that_is_down_all_the_time_is_refused_with_the_hours_of_the_day() -> None:
    night = r"light\.sources\[0\]: the sun is below the horizon from 22:30:00 to 23:30:00"
    with pytest.raises(JobError, match=f"{night}.* on 2026-06-21 it is up from 04:46 to 21:30"):
        lights(job(start="22:30", stop="23:30"))
    with pytest.raises(JobError, match="does not rise on that day"):
        lights(job(latitude=80.0, date="2026-12-21"))


def test_toml_dates_and_times_mean_the_same_as_text(tmp_path: Path) -> None:
    table = tiny.table(light={"frames": 5, "sources": [sun_of(date="D", start="S", stop="T")]})
    written = tomli_w.dumps(table).replace('"D"', "2026-06-21").replace('"S"', "06:00:00").replace('"T"', "20:00:00")
    file = tmp_path / "job.toml"
    file.write_text(written)
    read = read_job(file)
    assert read.light == job().light
    assert Job.model_validate(job_table(read)).light == read.light  # a round trip


def test_without_its_library_the_almanac_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ephem", None)
    with pytest.raises(MissingExtraError, match=r"needs ephem, which is not installed; .*pip .*ephem$"):
        lights(job())


@pytest.mark.parametrize("group", [None, "sun"])
def test_an_array_records_the_sun_and_is_dark_before_it_rises(group: str | None, tmp_path: Path) -> None:
    tiny.save_glb(tiny.room_meshes(), tmp_path / "tiny.glb")
    wanted = job(
        3, scene={"file": str(tmp_path / "tiny.glb")}, start="02:00", stop="12:00", group=group, irradiance=6.0
    )
    wanted = wanted.model_copy(update={"output": wanted.output.model_copy(update={"directory": tmp_path / "out"})})
    render(wanted)
    other = wanted.light.sources[0].model_copy(update={"latitude": 50.0})
    with pytest.raises(OutputError, match=r"light\.sources\[0\]\.latitude: 52\.52\d* there, 50\.0 now"):
        render(wanted.model_copy(update={"light": wanted.light.model_copy(update={"sources": (other,)})}))
    manifest = read_manifest(tmp_path / "out")
    noted = manifest.groups[0].lights if group else manifest.lights
    sources = [light.sources[0] for light in noted]
    assert [source["time"] for source in sources] == [f"2026-06-21T{hour:02}:00:00+02:00" for hour in (2, 7, 12)]
    sun = sun_at(even_moments("2026-06-21", "02:00:00", "12:00:00", "Europe/Berlin", 3), 52.52, 13.405)
    np.testing.assert_allclose([source["azimuth"] for source in sources], sun.azimuth_deg, atol=1e-4)
    np.testing.assert_allclose([source["elevation"] for source in sources], sun.elevation_deg, atol=1e-4)
    pictures = [Pictures(manifest).picture(0, (l,)) for l in range(3)]
    assert pictures[0].max() == 0  # the sky is black here
    assert min(picture.max() for picture in pictures[1:]) > 0.1


def test_days_follow_one_another_on_the_light_axis() -> None:
    days = ["2026-03-20", "2026-06-21", "2026-12-21"]
    path = lights(job(frames=12, date=days, start="10:00", stop="13:10", step=60)).sources[0]
    assert [note["time"][:16] for note in path.notes] == [f"{day}T{h}:00" for day in days for h in (10, 11, 12, 13)]
    (alone,) = lights(job(frames=4, date=days[1], start="10:00", stop="13:00")).sources
    # The rotation of the Earth is taken as on the first day: a fraction of a second within a year.
    np.testing.assert_allclose(path.vector[4:8], alone.vector, atol=1e-4)


def test_days_share_the_light_positions_of_a_job() -> None:
    path = lights(job(frames=6, date=["2026-03-20", "2026-06-21"], start="10:00", stop="12:00")).sources[0]
    assert [note["time"][5:16] for note in path.notes[2:4]] == ["03-20T12:00", "06-21T10:00"]


@pytest.mark.parametrize(
    ("frames", "changes", "message"),
    [
        (4, {"latitude": 91.0}, "latitude: expected a number from -90 to 90, got 91"),
        (4, {"date": "2026-02-30"}, "date: expected a date that the calendar has"),
        (4, {"date": "21.6.2026"}, "date: expected a date such as 2026-06-21"),
        (4, {"date": "0026-06-21"}, "date: expected a year from 1000 to 3000, got 26"),
        (4, {"start": "25:00"}, 'start: expected a time of day from "00:00" to "23:59", got "25:00"'),
        (4, {"start": "20:00", "stop": "6:00"}, "stop: expected a time after the start, 20:00:00, got 06:00:00"),
        (4, {"timezone": "Europe/Berln"}, 'timezone: unknown time zone "Europe/Berln"; did you mean "Europe/Berlin"?'),
        (4, {"timezone": "../etc"}, 'unknown time zone "../etc"'),
        (4, {"timezone": "Europe"}, 'unknown time zone "Europe"'),
        (4, {"date": "2026-03-29", "start": "02:30"},
         "start: expected a time that exists on 2026-03-29; clocks skip 02:30:00"),
        (4, {"timezone": 15}, "timezone: expected a time zone such as"),
        (4, {"timezone": None}, "timezone: missing"),
        (4, {"north": [0.0, 2.0, 0.0]}, "north: expected a direction that is not up"),
        (5, {"date": ["2026-03-20", "2026-06-21"]}, "expected a number of days that divides the number of light "
         "positions, 5, got 2; or give `step`."),
        (5, {"step": 60}, "expected as many light positions as its axis has, 5, got 15; remove the number of the "
         "axis."),
        (5, {"step": 0}, "expected a number from 0.0166667 to 1440, got 0."),
        (5, {"date": []}, "expected a date, or a list of at least 1, got an empty list."),
        (4, {"date": ["2026-06-21", "2026-06-21"]}, "date[1]: expected a day that the list does not hold "
         "yet, got 2026-06-21 again."),
        (4, {"date": ["2026-03-20", "2026-02-30"]}, 'date[1]: expected a date that the calendar has, got '
         '"2026-02-30".'),
        (None, {}, "light.frames: missing; expected the number of positions of the sun, which has no key frames."),
    ],
)  # fmt: skip
def test_messages(frames: int | None, changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    """A message with a full stop is the end of what is said."""
    with pytest.raises(JobError) as caught:
        lights(read_lit(tmp_path, sun_of(**changes), **({"frames": frames} if frames else {})))
    (problem,) = caught.value.problems
    assert message in f"{problem}."
