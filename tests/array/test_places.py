"""Places as people write them, indices as text, and times of light positions."""

import re
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.movies import DARK, plain

from framearray_cli.array.manifest import ManifestGroup, ManifestLight, axis_moments, moment_at, position_name
from framearray_cli.array.places import (
    brief_frames_text,
    frames_text,
    is_notation,
    parse_places,
    read_indices,
)
from framearray_cli.base.errors import JobError
from framearray_cli.base.sundays import moment_text, sun_days


@pytest.mark.parametrize(
    ("text", "indices"),
    [
        ("0-3", (0, 1, 2, 3)),
        ("5", (5,)),
        ("0-9x4", (0, 4, 8)),
        ("0-9y4", (1, 2, 3, 5, 6, 7, 9)),
        ("0-3:2", (0, 1, 2, 3)),
        ("9-0x-4", (9, 5, 1)),
        ("3-1", (3, 2, 1)),
        ("8,0-2, 1", (8, 0, 1, 2)),
        ("7-7", (7,)),
        ("-1", (9,)),
        ("7-last", (7, 8, 9)),
        ("-3--1", (7, 8, 9)),
        ("first-20%", (0, 1, 2)),
        ("0-lastx4", (0, 4, 8)),
        ("first, 50 %,last", (0, 5, 9)),
        ("12.5 %", (1,)),
        ("0 - 2 , 9", (0, 1, 2, 9)),
        (" all ", tuple(range(10))),
    ],
)
def test_places(text: str, indices: tuple[int, ...]) -> None:
    assert read_indices("--cameras", text, 10) == indices
    assert is_notation(text)
    assert read_indices("--cameras", frames_text(indices), 10) == tuple(sorted(indices))


def test_an_axis_of_one_place() -> None:
    for text in ("0", "-1", "first", "last", "50%", "all", "0-last"):
        assert read_indices("--light", text, 1) == (0,)
    with pytest.raises(JobError, match="--light: expected 0, the only light position, got 1"):
        read_indices("--light", "1", 1, "light")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "1..3",
        "1-2-3",
        "9" * 50,
        "x",
        "0,",
        "101%",
        "1;2",
        "all,1",
        "0-101%",
        "5x2",
        "--2",
        "-5%",
        "nan",
        "1e2",
    ],
)
def test_other_texts_are_refused(text: str) -> None:
    wanted = "--cameras: expected places such as 5, 0-47, 0-47x3, first, last, 50% or all, with commas between them, "
    with pytest.raises(JobError, match=re.escape(wanted) + "got "):
        read_indices("--cameras", text, 10)
    assert not is_notation(text)


def test_fractions_only_where_pictures_are_blended() -> None:
    assert parse_places("3.25,50%,2-3", 10, fractions=True) == [3.25, 4.5, 2, 3]
    for text in ("3.25", "1.5-3", "0-2.5"):
        with pytest.raises(ValueError, match="expected places such as"):
            parse_places(text, 10)


@pytest.mark.parametrize("text", ["3-1x1", "1-3x-1", "0-9x0", "last-firstx2"])
def test_a_step_that_leads_nowhere_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected a step that leads from"):
        parse_places(text, 10)


def test_a_range_that_leaves_all_out_is_refused() -> None:
    with pytest.raises(ValueError, match="expected at least one place, got "):
        parse_places("0-9y1", 10)


@pytest.mark.parametrize(
    ("text", "found"), [("10", "10"), ("-11", "-11"), ("0-10", "10"), ("10-0", "10"), ("0,12", "12")]
)
def test_places_beyond_the_axis_are_named(text: str, found: str) -> None:
    wanted = rf"--cameras: expected one of 10 camera positions \(0 to 9, or -10 to -1\), got {found}$"
    with pytest.raises(JobError, match=wanted):
        read_indices("--cameras", text, 10)
    with pytest.raises(JobError, match="expected one of 10 positions of lamps"):
        read_indices("--at lamps", text, 10, "lamps")


RANGES = st.tuples(st.integers(0, 99), st.integers(0, 99), st.sampled_from("xy:"), st.integers(1, 12))


@settings(deadline=None, max_examples=200)
@given(st.lists(RANGES, min_size=1, max_size=4))
def test_fileseq_reads_the_same_frames(ranges: list[tuple[int, int, str, int]]) -> None:
    """A second opinion, the notation of other tools; it renders "0-9:4" in an order of its own."""
    fileseq = pytest.importorskip("fileseq", reason="fileseq is not installed (extra dev)")
    parts = []
    for first, last, kind, step in ranges:
        sign = "-" if last < first else ""
        parts.append(f"{first}-{last}{kind}{sign if kind != ':' else ''}{step}" if step > 1 else f"{first}-{last}")
        if kind == ":" and last < first:
            parts[-1] = f"{first}-{last}"
        if kind == "y" and first == last and step > 1:
            parts[-1] = str(first)  # a range that leaves nothing
    text = ",".join(parts)
    theirs, ours = list(fileseq.FrameSet(text)), list(read_indices("--cameras", text, 100))
    assert sorted(ours) == sorted(theirs), text
    if ":" not in text:
        assert ours == theirs, text


def test_runs_are_joined() -> None:
    assert frames_text([]) == ""
    assert frames_text((50, 2, 0, 1, 2)) == "0-2,50"


def test_a_brief_text_is_brief_however_scattered_frames_are() -> None:
    assert brief_frames_text([*range(5), 7]) == frames_text([*range(5), 7]) == "0-4,7"
    assert brief_frames_text(range(0, 24, 2)) == frames_text(range(0, 24, 2))
    assert brief_frames_text(range(0, 999, 2)) == "0,2,4,6,8,10,12,14,16,18,20,...,998"


CLOCKS = ("06:00", "09:30", "13:00", "16:30")
MOMENTS = tuple(
    datetime.fromisoformat(f"2026-{day}T{clock}+0{hours}:00")
    for day, hours in (("03-20", 1), ("06-21", 2), ("12-21", 1))
    for clock in CLOCKS
)


def test_days_of_an_axis() -> None:
    spans = sun_days(MOMENTS)
    assert [span.lights for span in spans] == [range(4), range(4, 8), range(8, 12)]
    assert spans[1].text == "2026-06-21 06:00 to 16:30"
    assert spans[1].indices_text == "light positions 4-7"
    (single,) = sun_days(MOMENTS[5:6])
    assert (single.text, single.indices_text) == ("2026-06-21 09:30", "light position 0")
    assert sun_days(()) == ()


def test_names_of_moments(tmp_path: Path) -> None:
    assert moment_text(datetime.fromisoformat("2026-06-21T09:30:00-03:30")) == "2026-06-21 09:30"
    assert moment_text(datetime.fromisoformat("2026-06-21T09:30:20+02:00")) == "2026-06-21 09:30:20"
    for time in ("noon", 3, None):
        assert moment_at(replace(plain(tmp_path, 4, 1), lights=(light(time),)), "light", 0) is None


def light(time: Any) -> ManifestLight:
    source = {"type": "directional"} | ({"time": time} if time else {})
    return replace(DARK, sources=({"type": "point"}, source))


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
