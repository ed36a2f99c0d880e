"""Light that changes over a movie."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import ROOT
from support.making import assemble_movie
from support.movies import grouped, path_file, plain

from framearray_cli.array.images import read_codes, read_image
from framearray_cli.array.manifest import BACKGROUND, Manifest
from framearray_cli.array.pictures import AS_RENDERED, Pictures, Relight
from framearray_cli.base.colour import black_body, srgb8_from_linear
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.schema import published_schema
from framearray_cli.job.read import read_job
from framearray_cli.tools.movie.lightcurves import LightChange, LightCurve, relights, values_at
from framearray_cli.tools.movie.pathfile import MoviePath, load_movie_path
from framearray_cli.tools.movie.timeline import make_timeline

JOBS = ROOT / "jobs"
GREY = (1.0, 1.0, 1.0)


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return grouped(tmp_path / "out")


def lit(times: list[float], **changes: Any) -> list[Relight]:
    problems: list[str] = []
    movie = MoviePath.model_validate({"segments": [{"frames": 1}], **changes})
    found = relights(movie.groups, movie.ambient, times, problems)
    assert not problems
    return found


@given(
    keys=st.lists(st.tuples(st.floats(0, 10), st.floats(0, 5)), min_size=1, max_size=6),
    time=st.floats(-1, 12),
)
def test_a_curve_is_linear_between_key_frames_and_held_outside(keys: list[tuple[float, float]], time: float) -> None:
    keys = sorted({round(t, 2): v for t, v in keys}.items())
    times, values = [t for t, _ in keys], [v for _, v in keys]
    (found,) = values_at("", tuple((t, (v, v / 2, 0.0)) for t, v in keys), [time], [])
    expected = np.interp(time, times, values)
    np.testing.assert_allclose(found, (expected, expected / 2, 0), rtol=1e-12, atol=1e-12)


def test_two_key_frames_at_one_time_are_a_jump() -> None:
    curve: LightCurve = ((0.0, GREY), (1.0, GREY), (1.0, (3.0, 3.0, 3.0)), (2.0, GREY))
    found = values_at("", curve, [0.5, 0.999999, 1.0, 1.5, 2.0], [])
    assert found[:, 0] == pytest.approx([1, 1, 3, 2, 1])


def test_percentages_reach_from_the_first_frame_to_the_last() -> None:
    found = lit(
        [0.0, 0.5, 1.0, 1.5, 2.0],
        groups={
            "lamp": {"intensity": [{"time": "25%", "value": 0}, {"time": "100%", "value": 3}], "color": [1, 0.5, 0]}
        },
        ambient={"color": 0.5},
    )
    assert [relight.groups["lamp"] for relight in found] == [(k, k / 2, 0.0) for k in (0.0, 0.0, 1.0, 2.0, 3.0)]
    assert {relight.ambient for relight in found} == {(0.5, 0.5, 0.5)}
    assert lit([0.0, 1.0]) == [AS_RENDERED] * 2


def test_every_frame_has_the_light_of_its_time(array: Manifest, tmp_path: Path) -> None:
    """Expected: sums of the array's files in double precision, to half a unit of the half floats in the frames."""
    text = """
positions = "blend"
[[segments]]
frames = 7
camera = [0, 1]
light = [0, 3]
axes = { lamp = [2, 0] }
[groups.lamp]
intensity = [{ time = 0, value = 2.0 }, { time = "100%", value = 0.5 }]
color = [1.0, 0.6, 0.2]
[ambient]
intensity = [{ time = 0, value = 1 }, { time = "50%", value = 0 }, { time = "100%", value = 1 }]
"""
    assemble_movie(array.directory, path_file(tmp_path, text), tmp_path / "f.#.exr")
    read = {file.name: read_image(file).astype(np.float64) for file in array.directory.glob("*.exr")}
    for k in range(7):
        c, t = (0 if k < 3 else 1), k / 6
        lamp = (2 - 1.5 * t) * np.array([1.0, 0.6, 0.2])
        made, i_a = read[f"back.c{c:04d}.exr"].copy(), np.zeros(3)
        for name, position, factor in (("lamp", 2 - 2 * t, lamp), ("sun", 3 * t, np.ones(3))):
            low = min(int(position + 1e-9), 2 if name == "sun" else 1)
            group = next(group for group in array.groups if group.name == name)
            for l, share in ((low, low + 1 - position), (low + 1, position - low)):
                made += factor * share * read[f"{name}.c{c:04d}.l{l:03d}.exr"]
                i_a += factor * share * np.array(group.lights[l].ambient)
        made += abs(1 - 2 * t) * i_a * read[f"ambient.c{c:04d}.exr"]
        shown = read_image(tmp_path / f"f.{k}.exr")
        # half a unit in the last place of a half float, and positions rounded to a millionth
        np.testing.assert_allclose(shown, made, rtol=2**-11 + 5e-6, atol=1e-6)
        assert np.abs(shown - made).max() < 0.1 * np.abs(shown - Pictures(array).picture(c, (round(3 * t), 0))).max()


def test_codes_of_frames_are_those_of_the_pictures(array: Manifest, tmp_path: Path) -> None:
    path = path_file(tmp_path, "[[segments]]\nframes = 4\nlight = [0, 3]\n[groups.sun]\nintensity = 0.5\n")
    assemble_movie(array.directory, path, tmp_path / "f.#.png")
    for l in range(4):
        picture = Pictures(array).picture(0, (l, 0), Relight(groups={"sun": (0.5, 0.5, 0.5)}))
        np.testing.assert_array_equal(read_codes(tmp_path / f"f.{l}.png"), srgb8_from_linear(picture))


def test_wrong_light_is_reported_before_anything_is_written(array: Manifest, tmp_path: Path) -> None:
    text = "[[segments]]\nframes = 3\nlight = 4\n[groups.moon]\nintensity = 2\n"
    text += "[groups.sun]\nintensity = [{ time = '50%', value = 1 }, { time = 0.02, value = 0 }]\n"
    with pytest.raises(JobError) as caught:
        assemble_movie(array.directory, path_file(tmp_path, text), tmp_path / "m.mp4")
    assert list(caught.value.problems) == [
        "groups.moon: no such group; the array has lamp, sun, background",
        "segments[0].light: expected one of 4 light positions (0 to 3, or -4 to -1), got 4",
        'groups.sun.intensity[1].time: expected at least the time before ("50%", 0.0416667 s), got 0.02 s',
    ]
    plain(tmp_path / "plain", 2, 2)
    text = "[[segments]]\nframes = 3\n[groups.sun]\nintensity = 2\n[ambient]\nintensity = 2\n"
    with pytest.raises(JobError) as caught:
        assemble_movie(tmp_path / "plain", path_file(tmp_path, text), tmp_path / "m.mp4")
    reason = "this array stores its light all together, so that it cannot be changed; render again with "
    reason += 'group = "..." in [[light.sources]]'
    assert list(caught.value.problems) == [f"groups.sun: {reason}", f"ambient: {reason}"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out", "path.toml", "plain"]


A_COLOUR = 'a number or 3 numbers from 0 to 1000000, or a temperature such as "3200 K"'


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("intensity = -1", "intensity: expected a number from 0 to 1000000, got -1"),
        ("intensity = [1, 2, 3]", "intensity: expected a number from 0 to 1000000, got [1, 2, 3]"),
        ('intensity = "3200 K"', 'intensity: expected a number from 0 to 1000000, got "3200 K"'),
        ("color = [1, 2]", f"color: expected {A_COLOUR}, got [1, 2]"),
        ("color = []", f"color: expected {A_COLOUR}, got a list of 0 values"),
        ('color = "warm"', f'color: expected {A_COLOUR}, got "warm"'),
        ('color = "90 K"', 'color: expected a temperature from 1000 to 40000 K, got "90 K"'),
        (
            "color = [{ time = 0, value = '5000 C' }]",
            f'color[0].value: expected {A_COLOUR}, got "5000 C"',
        ),
        (
            "color = [{ time = 0, value = '99000 K' }]",
            'color[0].value: expected a temperature from 1000 to 40000 K, got "99000 K"',
        ),
        ("colour = 1", 'colour: unknown key; did you mean "color"?'),
        (
            "intensity = [{ time = 'x', value = 1 }]",
            'intensity[0].time: expected seconds, or a percentage such as "50%", got "x"',
        ),
        ("intensity = [{ time = 0 }]", "intensity[0].value: missing; expected a number from 0 to 1000000"),
        ("color = [{ time = 0, value = 1, at = 2 }]", "color[0].at: unknown key; known here: time, value"),
        ("color = [{ time = 0, value = 1 }, 2]", "color[1]: expected a table with time and value, got 2"),
    ],
)
def test_messages(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(JobError) as caught:
        load_movie_path(path_file(tmp_path, f"[[segments]]\nframes = 1\n[groups.g]\n{text}\n"))
    assert list(caught.value.problems) == [f"groups.g.{problem}"]


def test_a_temperature_is_the_colour_of_a_black_body() -> None:
    keys = [{"time": 0, "value": "2700 K"}, {"time": 2, "value": [1, 1, 1]}]
    found = lit([0.0, 1.0, 2.0], groups={"a": {"color": "6500 K", "intensity": 2}, "b": {"color": keys}})
    assert found[0].groups["a"] == pytest.approx(np.multiply(2, black_body(6500.0)))
    warm = black_body(2700.0)
    assert [found[k].groups["b"] for k in range(3)] == [
        pytest.approx(warm),
        pytest.approx((np.array(warm) + 1) / 2),
        GREY,
    ]


def test_the_example_with_light_fits_an_array_with_its_groups(array: Manifest) -> None:
    file = JOBS / "relight-movie.toml"
    line = make_timeline(file, load_movie_path(file), array)
    assert (len(line.shots), line.shots[0].positions, line.shots[-1].positions) == (240, (0.0, 0.0), (3.0, 2.0))
    assert line.relights[0].groups == {"sun": GREY, "lamp": (0.0, 0.0, 0.0), "background": GREY}
    assert line.relights[-1].groups["sun"] == (0.0, 0.0, 0.0)
    assert line.relights[-1].groups["lamp"] == pytest.approx((2.0, 1.7, 1.4))
    lamp = [relight.groups["lamp"][0] for relight in line.relights]
    assert [k for k, (before, after) in enumerate(pairwise(lamp), start=1) if after > before + 0.4] == [108]  # 4.5 s


def test_the_groups_of_the_example_are_those_of_its_job() -> None:
    job, movie = read_job(JOBS / "kitchen-evening.toml"), load_movie_path(JOBS / "relight-movie.toml")
    assert movie.groups.keys() <= {source.group for source in job.light.sources} | {BACKGROUND}
    assert {axis for segment in movie.segments for axis in segment.axes} <= {
        source.axis for source in job.light.sources
    }


def test_published_defaults_are_values_of_the_file() -> None:
    change = published_schema(MoviePath, "")["$defs"]["LightChange"]["properties"]
    assert [change[key]["default"] for key in ("intensity", "color")] == [1.0, 1.0]
    assert LightChange.model_validate({"intensity": 1.0, "color": 1.0}) == LightChange()
