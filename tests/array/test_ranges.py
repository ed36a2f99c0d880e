"""Frame ranges: texts that are read, and texts that are refused."""

import pytest

from framearray_cli.array.ranges import brief_frames_text, frames_text, parse_frames


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("0-3", (0, 1, 2, 3)),
        ("5", (5,)),
        ("0-9x4", (0, 4, 8)),
        ("0-9y4", (1, 2, 3, 5, 6, 7, 9)),
        ("0-3:2", (0, 1, 2, 3)),
        ("9-0x-4", (1, 5, 9)),
        ("3-1", (1, 2, 3)),
        ("8,0-2, 1", (0, 1, 2, 8)),
        ("7-7", (7,)),
    ],
)
def test_ranges(text: str, frames: tuple[int, ...]) -> None:
    assert parse_frames(text, 10) == frames
    assert parse_frames(frames_text(frames), 10) == frames


@pytest.mark.parametrize(
    "text", ["", "a", "3-1x1", "1-3x-1", "0-9x0", "0-9y1", "-1", "0-10", "10-0", "1..3", "1-2-3", "9" * 50]
)
def test_other_texts_are_refused_as_ranges(text: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        parse_frames(text, 10)


def test_a_brief_text_is_brief_however_scattered_frames_are() -> None:
    assert brief_frames_text([*range(5), 7]) == frames_text([*range(5), 7]) == "0-4,7"
    assert brief_frames_text(range(0, 24, 2)) == frames_text(range(0, 24, 2))
    assert brief_frames_text(range(0, 999, 2)) == "0,2,4,6,8,10,12,14,16,18,20,...,998"
