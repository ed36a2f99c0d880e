"""Easing, holds, loops, reversal, blends and joins, as properties of what the frames show."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.movies import DARK, array_of

from framearray_cli.array.manifest import Manifest, ManifestGroup
from framearray_cli.base.errors import JobError
from framearray_cli.tools.movie.pathfile import EASES, MoviePath, Segment, Sweep, interpolate_span, sweep_path
from framearray_cli.tools.movie.timeline import Shot, make_timeline

N_C, N_L, N_LAMPS = 20, 9, 5
PLAIN = array_of(N_C, N_L)
NAMES = {"lamps": ("lamps", N_LAMPS), "sun": ("light", N_L)}
NO_IMAGES: dict[str, Any] = {"images": "", "layers": "", "lights": (), "ambient_images": "a.c{camera}.exr"}
GROUPED = replace(
    PLAIN,
    **NO_IMAGES,
    groups=tuple(
        ManifestGroup(name=name, axis=axis, images=f"{name}.c{{camera}}.l{{light}}.exr", lights=(DARK,) * n)
        for name, (axis, n) in NAMES.items()
    ),
)

EASE = st.sampled_from(["linear", "in", "out", "in-out"])
PLACES = st.one_of(
    st.integers(-N_L, N_L - 1),
    st.floats(0, N_L - 1, allow_nan=False),
    st.sampled_from(["first", "last", "50%", "12.5%"]),
)
SPANS = st.lists(PLACES, min_size=1, max_size=4)
SEGMENTS = st.fixed_dictionaries(
    {"frames": st.integers(2, 30), "camera": SPANS, "light": SPANS, "ease": EASE},
    optional={"reverse": st.booleans(), "positions": st.sampled_from(["nearest", "blend"])},
)


def shots(*segments: dict[str, Any], manifest: Manifest = PLAIN, **more: Any) -> list[Shot]:
    movie = MoviePath.model_validate({"segments": list(segments), **more})
    return list(make_timeline("path", movie, manifest).shots)


def problems(manifest: Manifest, *segments: dict[str, Any], **more: Any) -> list[str]:
    with pytest.raises(JobError) as caught:
        shots(*segments, manifest=manifest, **more)
    return list(caught.value.problems)


@given(ease=EASE, t=st.floats(0, 1))
def test_easing_goes_from_0_to_1_and_never_back(ease: Any, t: float) -> None:
    assert (EASES[ease](0.0), EASES[ease](1.0)) == (0.0, 1.0)
    assert 0 <= EASES[ease](t) <= 1
    assert EASES[ease](t) <= EASES[ease](min(1.0, t + 0.01)) + 1e-12
    assert EASES["out"](1 - t) == pytest.approx(1 - EASES["in"](t))
    assert EASES["in-out"](1 - t) == pytest.approx(1 - EASES["in-out"](t), abs=1e-12)


@pytest.mark.parametrize(("ease", "start", "end"), [("in", 0, 2), ("out", 2, 0), ("in-out", 0, 0), ("linear", 1, 1)])
def test_speed_at_both_ends(ease: Any, start: float, end: float) -> None:
    h = 1e-6
    assert EASES[ease](h) / h == pytest.approx(start, abs=1e-5)
    assert (1 - EASES[ease](1 - h)) / h == pytest.approx(end, abs=1e-5)


@given(span=st.lists(st.floats(0, 100), min_size=1, max_size=6), u=st.floats(0, 1))
def test_places_of_a_span_are_met_at_even_times(span: list[float], u: float) -> None:
    last = len(span) - 1
    for k, place in enumerate(span):
        assert interpolate_span(span, k / last if last else 0.0) == pytest.approx(place, abs=1e-9)
    assert interpolate_span(span, 1.0) == span[-1]
    assert min(span) - 1e-9 <= interpolate_span(span, u) <= max(span) + 1e-9


@given(segment=SEGMENTS)
def test_reversed_is_the_same_backwards(segment: dict[str, Any]) -> None:
    forth = shots({**segment, "reverse": False}, positions="blend")
    back = shots({**segment, "reverse": True}, positions="blend")
    far = [(abs(a.c - b.c), abs(a.positions[0] - b.positions[0])) for a, b in zip(forth, reversed(back), strict=True)]
    # 1 - t is rounded, so that the nearest of two equally near indices may be the other one
    assert all(c <= 1 for c, _ in far) and sum(c for c, _ in far) <= len(far) // 2
    assert all(light <= (1.0 if segment.get("positions") == "nearest" else 2e-6) for _, light in far)


@given(segment=SEGMENTS, loops=st.integers(1, 4))
def test_loops_are_segments_written_again(segment: dict[str, Any], loops: int) -> None:
    assert shots({**segment, "loops": loops}) == shots(*[segment] * loops)


@given(segment=SEGMENTS, loops=st.integers(1, 4))
def test_back_and_forth_is_every_second_one_reversed(segment: dict[str, Any], loops: int) -> None:
    turned = {**segment, "reverse": not segment.get("reverse", False)}
    written = [turned if k % 2 else segment for k in range(loops)]
    assert shots({**segment, "loops": loops, "back_and_forth": True}) == shots(*written)


def test_back_and_forth_without_loops_is_two_passes() -> None:
    frames = shots({"frames": 4, "camera": [0, 3], "back_and_forth": True})
    assert [shot.c for shot in frames] == [0, 1, 2, 3, 2, 2, 1, 0]  # the turn is shown once, then four steps back


@given(segment=SEGMENTS, hold=st.floats(0, 3), loops=st.integers(1, 3))
def test_a_hold_shows_the_last_picture_and_lengthens(segment: dict[str, Any], hold: float, loops: int) -> None:
    without, held = shots({**segment, "loops": loops}), shots({**segment, "loops": loops, "hold": hold})
    assert held == without + [without[-1]] * round(Fraction(hold) * 24)
    assert len(without) == loops * segment["frames"]


@given(segments=st.lists(SEGMENTS, min_size=1, max_size=4))
def test_the_number_of_frames_is_the_one_asked_for(segments: list[dict[str, Any]]) -> None:
    found = shots(*segments)
    assert len(found) == sum(segment["frames"] for segment in segments)
    assert all(0 <= shot.c < N_C and 0 <= shot.positions[0] < N_L for shot in found)


@given(cut=st.integers(1, 11), mode=st.sampled_from(["nearest", "blend"]))
def test_a_movement_cut_in_two_keeps_its_pace(cut: int, mode: str) -> None:
    """13 frames from 0 to 12, one camera per frame, cut at one of them."""
    whole = shots({"frames": 13, "camera": [0, 12], "light": [0, 6]}, positions=mode)
    halves = shots(
        {"frames": cut + 1, "camera": [0, cut], "light": [0, cut / 2]},
        {"frames": 12 - cut, "camera": [cut, 12], "light": [cut / 2, 6]},
        positions=mode,
    )
    assert halves == whole


@given(segment=SEGMENTS)
def test_frames_move_by_no_more_than_their_speed(segment: dict[str, Any]) -> None:
    """The steepest slope of an easing is 2; the longest leg of a span is the whole axis."""
    found = shots({**segment, "positions": "blend"})
    legs = max(1, len(segment["light"]) - 1)
    fastest = 2 * legs * (N_L - 1) / (segment["frames"] - 1)
    assert all(abs(b.positions[0] - a.positions[0]) <= fastest + 1e-5 for a, b in pairwise(found))


def test_blends_are_fractional_and_the_camera_is_not() -> None:
    segment = {"frames": 5, "camera": [0, 2], "light": [0, 1]}
    blended = [Shot(c, (light,)) for c, light in zip((0, 1, 1, 2, 2), (0.0, 0.25, 0.5, 0.75, 1.0), strict=True)]
    assert shots({**segment, "positions": "blend"}) == blended
    assert [shot.positions for shot in shots(segment)] == [(0,), (0,), (1,), (1,), (1,)]
    assert shots(segment, positions="blend") == shots({**segment, "positions": "blend"})
    assert shots({**segment, "positions": "nearest"}, positions="blend") == shots(segment)


def test_fractional_places() -> None:
    assert shots({"frames": 1, "light": 3.25}, positions="blend") == [Shot(0, (3.25,))]
    assert shots({"frames": 1, "light": -1.5}, positions="blend") == [Shot(0, (7.5,))]
    assert shots({"frames": 1, "light": 3.25, "camera": 2.5}) == [Shot(3, (3,))]
    assert problems(PLAIN, {"frames": 1, "light": 8.5, "camera": -0.5}) == [
        "segments[0].camera: expected one of 20 camera positions (0 to 19, or -20 to -1), got -0.5",
        "segments[0].light: expected one of 9 light positions (0 to 8, or -9 to -1), got 8.5",
    ]


def test_a_text_may_name_several_places_on_the_way() -> None:
    assert shots({"frames": 4, "camera": "0-3"}) == shots({"frames": 4, "camera": [0, 3]})
    assert shots({"frames": 3, "light": "first-last"}) == shots({"frames": 3, "light": [0, -1]})
    assert [shot.c for shot in shots({"frames": 5, "camera": "3,5,3"})] == [3, 4, 5, 4, 3]
    assert [shot.c for shot in shots({"frames": 3, "camera": ["0-6x3", "9"]})] == [0, 5, 9]
    assert problems(PLAIN, {"frames": 2, "light": "0-9", "camera": "2-0x1"}) == [
        'segments[0].camera: expected a step that leads from 2 to 0, got "2-0x1"',
        "segments[0].light: expected one of 9 light positions (0 to 8, or -9 to -1), got 9",
    ]


def test_further_axes() -> None:
    assert list(GROUPED.axes) == ["light", "lamps"]
    found = shots({"frames": 3, "light": [0, 4], "axes": {"lamps": [4, 2]}}, {"frames": 2}, manifest=GROUPED)
    assert [shot.positions for shot in found] == [(0, 4), (2, 3), (4, 2), (4, 2), (4, 2)]


def test_all_axes_and_places_that_an_array_lacks_are_named() -> None:
    assert problems(GROUPED, {"frames": 2, "axes": {"lmaps": 1, "lamps": [0, 5]}}, {"frames": 1, "light": 9}) == [
        "segments[0].axes.lamps: expected one of 5 positions of lamps (0 to 4, or -5 to -1), got 5",
        "segments[0].axes.lmaps: no such light axis; the array has light, lamps",
        "segments[1].light: expected one of 9 light positions (0 to 8, or -9 to -1), got 9",
    ]
    only_lamps = replace(GROUPED, groups=GROUPED.groups[:1])
    assert problems(only_lamps, {"frames": 2, "light": [0, 1]}) == [
        "segments[0].light: no such light axis; the array has lamps"
    ]


def test_light_from_cells_has_no_ambient_light_to_change() -> None:
    cells = replace(GROUPED, job={"indirect": {"method": "cells"}})
    (problem,) = problems(cells, {"frames": 2}, ambient={"intensity": 2})
    assert problem.startswith("ambient: the images of this array hold the indirect light of their own sources")
    assert problems(cells, {"frames": 2, "light": 9}, groups={"lamps": {"intensity": 2}})[0].startswith("segments[0]")
    assert len(shots({"frames": 2}, manifest=GROUPED, ambient={"intensity": 2})) == 2


def test_too_many_frames_are_refused_before_they_are_listed() -> None:
    [problem] = problems(PLAIN, {"frames": 1_000_000, "loops": 10_000})
    assert problem == "segments: expected at most 1000000 frames in all, got 10000000000, at 24 frames per second"


# movements without a file


def swept_shots(kind: Any, manifest: Manifest = PLAIN, **more: Any) -> list[Shot]:
    return list(make_timeline(kind, sweep_path(Sweep(kind=kind, **more), manifest), manifest).shots)


def test_movements_show_every_image_on_their_way_once() -> None:
    assert swept_shots("walk", light="last") == [Shot(c, (N_L - 1,)) for c in range(N_C)]
    assert swept_shots("light", cameras="-2") == [Shot(N_C - 2, (l,)) for l in range(N_L)]
    both = swept_shots("diagonal")
    assert (len(both), both[0], both[-1]) == (N_C, Shot(0, (0,)), Shot(N_C - 1, (N_L - 1,)))
    assert swept_shots("light", GROUPED)[-1] == Shot(0, (N_L - 1, N_LAMPS - 1))
    assert swept_shots("walk", GROUPED, light="50%", at=("lamps=2",))[0] == Shot(0, (4, 2))
    assert swept_shots("walk", GROUPED, at=("lamps=1", "light=-1"))[0] == Shot(0, (8, 1))
    assert swept_shots("walk", GROUPED, at=("light=3",))[0] == Shot(0, (3, 0))
    assert swept_shots("walk", GROUPED, at=("sun=3",))[0] == Shot(0, (3, 0)), "a group stands for its axis"
    assert len(swept_shots("walk", seconds=2.0)) == 48


def test_movements_along_places() -> None:
    assert swept_shots(None, cameras="last-0", light="3") == [Shot(c, (3,)) for c in reversed(range(N_C))]
    assert swept_shots(None, light="0-8x4") == [Shot(0, (l,)) for l in (0, 4, 8)]
    assert swept_shots("walk", cameras="1,2", light="-1") == [Shot(c, (N_L - 1,)) for c in (1, 2)]
    assert swept_shots("light", cameras="50%") == [Shot(N_C // 2, (l,)) for l in range(N_L)]
    assert swept_shots("light", GROUPED, at=("lamps=2",))[-1] == Shot(0, (N_L - 1, 2))
    assert swept_shots(None, GROUPED, at=("lamps=0-2",))[-1] == Shot(0, (0, 2))
    assert swept_shots("light", cameras="3", light="0-2") == [Shot(3, (l,)) for l in (0, 1, 2)]


@pytest.mark.parametrize("at", ["9", "lamp=2"])
def test_where_the_other_stays_must_be_a_place(at: str) -> None:
    with pytest.raises(JobError) as caught:
        swept_shots("walk", at=(at,))
    assert str(caught.value) == f'--at: expected AXIS=PLACES with one of the axes light (0 to 8), got "{at}"'


def test_a_segment_counts_its_passes() -> None:
    assert [Segment(frames=1, **more).n_passes for more in ({}, {"loops": 3}, {"back_and_forth": True})] == [1, 3, 2]
