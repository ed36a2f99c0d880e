from collections import Counter
from fractions import Fraction
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest
from support import ROOT
from support.movies import array_of, path_file

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.errors import JobError
from framearray_cli.tools.movie.pathfile import load_movie_path
from framearray_cli.tools.movie.timeline import array_problems, make_timeline

JOBS = ROOT / "jobs"


def pairs_of(file: Path, manifest: Manifest) -> list[tuple[int, int]]:
    return [(shot.c, *shot.positions) for shot in make_timeline(file, load_movie_path(file), manifest).shots]


def frames_of(tmp_path: Path, text: str, n_cameras: int = 10, n_lights: int = 5) -> list[tuple[int, int]]:
    return pairs_of(path_file(tmp_path, text), array_of(n_cameras, n_lights))


def segments(*lines: str) -> str:
    return "".join(f"[[segments]]\n{line}\n" for line in lines)


def test_a_span_shows_both_ends(tmp_path: Path) -> None:
    frames = frames_of(tmp_path, segments("frames = 10\ncamera = [0, -1]\nlight = 2"))
    assert frames == [(c, 2) for c in range(10)]
    frames = frames_of(tmp_path, segments("frames = 5\ncamera = [9, 0]\nlight = [0, 4]"))
    assert frames == [(9, 0), (7, 1), (5, 2), (2, 3), (0, 4)]  # 6.75, 4.5, 2.25: the nearest, halves up


@pytest.mark.parametrize(
    ("place", "index"), [("0", 0), ("-1", 9), ("-10", 0), ('"first"', 0), ('"last"', 9), ('"50%"', 5), ('"33.4 %"', 3)]
)
def test_places(tmp_path: Path, place: str, index: int) -> None:
    assert frames_of(tmp_path, segments(f"frames = 2\ncamera = {place}")) == [(index, 0)] * 2


def test_slow_spans_repeat_images_evenly(tmp_path: Path) -> None:
    frames = frames_of(tmp_path, segments("frames = 9\nlight = [0, 4]"))
    assert [l for _, l in frames] == [0, 1, 1, 2, 2, 3, 3, 4, 4]
    counts = Counter(c for c, _ in frames_of(tmp_path, segments("frames = 500\ncamera = [0, 9]")))
    assert counts.total() == 500
    assert max(counts[c] for c in range(1, 9)) - min(counts[c] for c in range(1, 9)) <= 1


@pytest.mark.parametrize("middle", ["4", '"44%"'])
def test_a_join_is_shown_once(tmp_path: Path, middle: str) -> None:
    halves = segments(f"frames = 5\ncamera = [0, {middle}]", f"frames = 5\ncamera = [{middle}, 9]")
    assert frames_of(tmp_path, halves) == [(c, 0) for c in range(10)]


def test_a_cut_shows_both_ends(tmp_path: Path) -> None:
    frames = frames_of(tmp_path, segments("frames = 3\ncamera = [0, 2]", "frames = 3\ncamera = [5, 7]"))
    assert [c for c, _ in frames] == [0, 1, 2, 5, 6, 7]


def test_what_is_left_out_stays_where_it_was(tmp_path: Path) -> None:
    frames = frames_of(
        tmp_path, segments("frames = 3\nlight = [0, 2]", "frames = 2\ncamera = [0, 2]", "frames = 2\nlight = 4")
    )
    assert frames == [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 4), (2, 4)]


def test_one_frame_shows_the_first_end(tmp_path: Path) -> None:
    frames = frames_of(tmp_path, segments("frames = 1\ncamera = [2, 5]", "frames = 2"))
    assert frames == [(2, 0)] * 3


def test_seconds_count_frames_of_the_rate(tmp_path: Path) -> None:
    assert len(frames_of(tmp_path, segments("seconds = 2"))) == 48
    assert len(frames_of(tmp_path, "fps = 12.5\n" + segments("seconds = 2.0", "seconds = 0.001"))) == 26


def test_the_rate_is_the_arrays_unless_given(tmp_path: Path) -> None:
    file = path_file(tmp_path, segments("frames = 1"))
    assert make_timeline(file, load_movie_path(file), array_of(1, 1, fps=23.976)).fps == Fraction(24000, 1001)
    file = path_file(tmp_path, "fps = 30\n" + segments("frames = 1"))
    assert make_timeline(file, load_movie_path(file), array_of(1, 1)).fps == 30


def test_an_array_of_one_image(tmp_path: Path) -> None:
    text = segments('frames = 3\ncamera = ["first", "last"]\nlight = [-1, 0]')
    assert frames_of(tmp_path, text, 1, 1) == [(0, 0)] * 3


@pytest.mark.parametrize("size", [(192, 48), (24, 8), (2, 3), (1, 1)])
def test_the_papers_first_movie_fits_any_array(size: tuple[int, int]) -> None:
    file = JOBS / "first-movie.toml"
    frames = pairs_of(file, array_of(*size))
    last_c, last_l = size[0] - 1, size[1] - 1
    assert len(frames) == 240
    assert frames[0] == (0, 0)
    assert frames[47] == (0, last_l)
    assert {c for c, _ in frames[:48]} == {0}
    assert {l for _, l in frames[48:96]} == {last_l}
    assert frames[-1] == (last_c, 0)
    assert {c for c, _ in frames} == set(range(size[0]))
    assert all(0 <= b[0] - a[0] <= 1 and abs(b[1] - a[1]) <= 1 for a, b in pairwise(frames))


@pytest.mark.parametrize("size", [(192, 48), (24, 8), (2, 3), (1, 1)])
def test_the_example_of_easing_fits_any_array(size: tuple[int, int]) -> None:
    """3 s and a hold, two halves of a walk and a hold, four swings, the walk backwards: 16.5 s."""
    file = JOBS / "easing-movie.toml"
    shots = make_timeline(file, load_movie_path(file), array_of(*size)).shots
    assert len(shots) == 396
    light = [shot.positions[0] for shot in shots]
    assert light[71:84] == [size[1] - 1] * 13  # the light at its end, held for half a second
    assert [light[203 + 36 * k] / max(1, size[1] - 1) for k in range(5)] == [0.5, 1, 0.5, 1, 0.5] or size[1] == 1
    assert (shots[203].c, shots[348].c, shots[-1].c) == (size[0] - 1, size[0] - 1, 0)
    assert any(x != int(x) for x in light[:72]) == (size[1] > 1)
    assert all(x == int(x) for x in light[348:])


A_PLACE = 'expected an index, "first", "last" or a percentage such as "50%"'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["segments: missing; expected a list of tables"]),
        ("segments = []", ["segments: "]),
        ("segment = 1", ["segment: ", "segments: "]),
        (segments("frame = 3"), ["segments[0].frame: "]),
        (segments("camera = 1"), ["segments[0]: expected either frames or seconds, got neither"]),
        (segments("frames = 3\nseconds = 1"), ["segments[0]: "]),
        (segments("frames = 0"), ["segments[0].frames: "]),
        (segments("frames = 2.5"), ["segments[0].frames: "]),
        (segments('frames = "2"'), ["segments[0].frames: "]),
        (segments("frames = true"), ["segments[0].frames: "]),
        (segments("seconds = -1"), ["segments[0].seconds: "]),
        (segments("seconds = inf"), ["segments[0].seconds: "]),
        (segments("frames = 2\ncamera = []"), ["segments[0].camera: "]),
        (segments("frames = 2\ncamera = nan"), ["segments[0].camera: "]),
        (segments("frames = 2\ncamera = [0, inf]"), ["segments[0].camera[1]: "]),
        (segments("frames = 2\ncamera = [0, true]"), ["segments[0].camera[1]: "]),
        (segments('frames = 2\nlight = "101%"'), ["segments[0].light: "]),
        (segments('frames = 2\nlight = "-5%"'), ["segments[0].light: "]),
        (
            segments('frames = 2\nlight = "end"', "frames = 2\nlihgt = 1"),
            [f'segments[0].light: {A_PLACE}, got "end"', 'segments[1].lihgt: unknown key; did you mean "light"?'],
        ),
        (
            segments("frames = 2\ncamera = [0, 10]\nlight = -6", "frames = 2\nlight = [5, 2]"),
            [
                "segments[0].camera: expected one of 10 camera positions (0 to 9, or -10 to -1), got 10",
                "segments[0].light: expected one of 5 light positions (0 to 4, or -5 to -1), got -6",
                "segments[1].light: expected one of 5 light positions (0 to 4, or -5 to -1), got 5",
            ],
        ),
        *(
            (segments(f"frames = 2\n{key} = [0, {10**400}]"), [f"segments[0].{key}[1]: {A_PLACE}, got a number beyond"])
            for key in ("camera", "light")
        ),
        ("fps = 0\n" + segments("frames = 2"), ["fps: "]),
        ("fps = 'film'\n" + segments("frames = 2"), ["fps: "]),
    ],
)
def test_all_problems_are_named_with_their_place(tmp_path: Path, text: str, expected: list[str]) -> None:
    with pytest.raises(JobError) as caught:
        frames_of(tmp_path, text)
    assert all(line.startswith(f"{tmp_path / 'path.toml'}: ") for line in str(caught.value).splitlines())
    for problem, start in zip(sorted(caught.value.problems), sorted(expected), strict=True):
        assert problem.startswith(start), problem
        assert "\n" not in problem


def test_a_missing_file_is_a_job_error(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="no such file"):
        load_movie_path(tmp_path / "none.toml")


def test_all_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    """Those of keys, those between keys, and places that the array lacks."""
    text = """
    fps = 0
    nonsense = 1
    [[segments]]
    frames = 3
    camera = ["first", 99]
    ease = "x"
    [[segments]]
    light = [0, 77]
    frames = 0
    axes = { lamps = 1 }
    [[segments]]
    frames = 4
    seconds = 360000
    camera = [{}, 5]
    [groups.x]
    intensity = -1
    """
    with pytest.raises(JobError) as caught:
        load_movie_path(path_file(tmp_path, text), partial(array_problems, manifest=array_of(4, 3)))
    assert [problem.partition(": ")[0] for problem in caught.value.problems] == [
        "segments[0].camera",
        "segments[1].light",
        "segments[1].axes.lamps",
        "groups.x",
        "fps",
        "segments[0].ease",
        "segments[1].frames",
        "segments[2].seconds",
        "segments[2].camera[0]",
        "segments[2]",
        "groups.x.intensity",
        "nonsense",
    ]
