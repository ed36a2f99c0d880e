"""Indices as short text."""

from framearray_cli.array.ranges import brief_frames_text, frames_text


def test_runs_are_joined() -> None:
    assert frames_text([]) == ""
    assert frames_text((50, 2, 0, 1, 2)) == "0-2,50"


def test_a_brief_text_is_brief_however_scattered_frames_are() -> None:
    assert brief_frames_text([*range(5), 7]) == frames_text([*range(5), 7]) == "0-4,7"
    assert brief_frames_text(range(0, 24, 2)) == frames_text(range(0, 24, 2))
    assert brief_frames_text(range(0, 999, 2)) == "0,2,4,6,8,10,12,14,16,18,20,...,998"
