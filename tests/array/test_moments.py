"""Dates and times of light positions: names of positions, and places that are written as times."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from support.movies import plain

from framearray_cli.array.manifest import ManifestGroup, ManifestLight
from framearray_cli.array.moments import (
    axis_moments,
    day_spans,
    moment_of,
    moment_text,
    position_name,
    put_indices,
    without_times,
)
from framearray_cli.array.places import is_notation, parse_places

CLOCKS = ("06:00", "09:30", "13:00", "16:30")
MOMENTS = tuple(
    datetime.fromisoformat(f"2026-{day}T{clock}+0{hours}:00")
    for day, hours in (("03-20", 1), ("06-21", 2), ("12-21", 1))
    for clock in CLOCKS
)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("2026-03-20", [0, 1, 2, 3]),
        ("2026-06-21x3", [4, 7]),
        (" 2026-06-21 , 0", [4, 5, 6, 7, 0]),
        ("2026-06-21-2026-12-21", [4, 5, 6, 7, 8, 9, 10, 11]),
        ("2026-12-21-2026-06-21x-3", [11, 8, 5]),
        ("2026-06-21T09:30", [5]),
        ("2026-06-21 9:30", [5]),
        ("2026-06-21T09:29:59", [5]),
        ("2026-06-21T11:14", [5]),
        ("2026-06-21T11:16", [6]),
        ("2026-03-20T09:30-2026-06-21T06:00", [1, 2, 3, 4]),
        ("first-2026-03-20", [0, 1, 2, 3]),
        ("2026-12-21-last", [8, 9, 10, 11]),
        ("10-11,2026-03-20T06:00", [10, 11, 0]),
        ("0-3", [0, 1, 2, 3]),
    ],
)
def test_places_by_date_and_time(text: str, wanted: list[int]) -> None:
    assert parse_places(put_indices(text, MOMENTS), len(MOMENTS), "light") == wanted
    assert is_notation(without_times(text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2026-03-21", "expected a time within 2026-03-20 06:00 to 16:30, 2026-06-21 06:00 to 16:30, 2026-12-21 06:00 "
         'to 16:30, got "2026-03-21"'),
        ("2026-06-21T05:59", 'got "2026-06-21T05:59"'),
        ("2026-06-21T17:00", 'got "2026-06-21T17:00"'),
        ("2026-06-31", 'expected a date and time that exist, got "2026-06-31"'),
        ("2026-06-21T24:30", 'expected a date and time that exist, got "2026-06-21T24:30"'),
        ("2026-06-21T9:61-last", 'expected a date and time that exist, got "2026-06-21T9:61"'),
    ],
)  # fmt: skip
def test_times_that_are_not_there(text: str, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        put_indices(text, MOMENTS)
    assert str(caught.value).endswith(message)
    with pytest.raises(ValueError, match="expected an index, as these positions have no date and time, got"):
        put_indices(text, ())


@pytest.mark.parametrize("text", ["5", "-1", "0-47", "0-47x3", "47-0x-3", "50%", "first", "all", "1000-2000", "3.25"])
def test_other_places_stay(text: str) -> None:
    assert put_indices(text, ()) == without_times(text) == text


@pytest.mark.parametrize("text", ["2026-06-211", "2026-06-21T9", "12026-06-21", "2026-06-21T09:30:5"])
def test_what_is_no_time_is_no_place(text: str) -> None:
    assert not is_notation(without_times(text))


def test_many_days_are_not_all_listed() -> None:
    days = [datetime.fromisoformat(f"2026-01-{day:02d}T12:00+00:00") for day in range(1, 11)]
    assert put_indices("2026-01-03", days) == "2"
    with pytest.raises(ValueError, match=r"within 2026-01-01 12:00, .*2026-01-04 12:00 and 6 more days, got"):
        put_indices("2027-01-03", days)


def test_days_of_an_axis() -> None:
    spans = day_spans(MOMENTS)
    assert [(span.first, span.last) for span in spans] == [(0, 3), (4, 7), (8, 11)]
    assert spans[1].text == "2026-06-21 06:00 to 16:30"
    assert spans[1].indices_text == "light positions 4-7"
    (single,) = day_spans(MOMENTS[5:6])
    assert (single.text, single.indices_text) == ("2026-06-21 09:30", "light position 0")
    assert day_spans(()) == ()


def test_names_of_moments() -> None:
    assert moment_text(datetime.fromisoformat("2026-06-21T09:30:00-03:30")) == "2026-06-21 09:30"
    assert moment_text(datetime.fromisoformat("2026-06-21T09:30:20+02:00")) == "2026-06-21 09:30:20"
    for time in ("noon", 3, None):
        assert moment_of([{"type": "point"}, {"time": time}]) is None


def light(time: str | None) -> ManifestLight:
    source = {"type": "directional"} | ({"time": time} if time else {})
    return ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=({"type": "point"}, source))


def test_axes_of_groups_have_their_own_moments(tmp_path: Path) -> None:
    groups = (
        ManifestGroup(name="lamp", axis="lamps", images="l.c{camera:04d}.l{light:03d}.exr", lights=(light(None),) * 2),
        ManifestGroup(
            name="sun", axis="light", images="s.c{camera:04d}.l{light:03d}.exr",
            lights=tuple(light(moment.isoformat()) for moment in MOMENTS[:3]),
        ),
    )  # fmt: skip
    manifest = replace(plain(tmp_path, 4, 1), lights=(), images="", groups=groups, ambient_images="a.c{camera:04d}.exr")
    assert axis_moments(manifest) == {"light": MOMENTS[:3]}
    assert position_name(manifest, "light", 1) == "light 1  2026-03-20 09:30"
    assert position_name(manifest, "lamps", 1) == "lamps 1"
    assert axis_moments(plain(tmp_path, 4, 3)) == {}
