"""Ranges of frames as OpenCue writes them: "0-47", "0-47x3" (every third), "5", and several of them: "0-9,20-47x2"."""

import re
from collections.abc import Iterable, Sequence
from itertools import groupby

_PART = re.compile(r"(\d{1,6})(?:-(\d{1,6})(?:x(\d{1,6}))?)?")


def parse_frames(text: str, n: int) -> tuple[int, ...]:
    """The frames of a range, in rising order, each once.

    Args:
        n: how many there are; frames count from 0.

    Raises:
        ValueError: the text is no range, or goes beyond the last frame; it says what was expected.
    """
    found: set[int] = set()
    for part in text.replace(" ", "").split(","):
        match = _PART.fullmatch(part)
        if not match:
            raise ValueError(f'expected frames such as "0-47", "0-47x3" or "0-9,20-47", got {text[:60]!r}')
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if first > last or step == 0:
            raise ValueError(
                f"expected a first frame, a last one that is not before it, and a step above 0, got {part!r}"
            )
        if last >= n:
            raise ValueError(f"expected frames from 0 to {n - 1}, got {part!r}")
        found.update(range(first, last + 1, step))
    return tuple(sorted(found))


def frames_text(frames: Iterable[int]) -> str:
    """The shortest range of consecutive frames that says the same: "0-47,50"."""
    runs = []
    for _, group in groupby(enumerate(sorted(set(frames))), key=lambda entry: entry[1] - entry[0]):
        run: Sequence[int] = [frame for _, frame in group]
        runs.append(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]))
    return ",".join(runs)
