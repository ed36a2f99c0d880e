"""Frame ranges in the notation of OpenCue, separated by commas.

"5", "0-47", "0-47x3" (every third), "0-47y3" (all but every third), "0-47:3" (all; OpenCue would render them in another
order), "47-0x-3" (downwards). Order is ignored: frames are rendered in the order of the path.
"""

import re
from collections.abc import Iterable, Sequence
from itertools import groupby

MOST_RUNS = 12  # of a brief text

_PART = re.compile(r"(\d{1,6})(?:-(\d{1,6})(?:([xy:])(-?\d{1,6}))?)?")


def parse_frames(text: str, n: int) -> tuple[int, ...]:
    """Return the frames of a range, in rising order, each once.

    Args:
        n: number of frames of the path; frames count from 0.

    Raises:
        ValueError: the text is not a range, or exceeds the last frame; the message says what was expected.
    """
    found: set[int] = set()
    for part in text.replace(" ", "").split(","):
        match = _PART.fullmatch(part)
        if not match:
            raise ValueError(f'expected frames such as "0-47", "0-47x3" or "0-9,20-47", got {text[:60]!r}')
        first, last = int(match[1]), int(match[2] or match[1])
        way = 1 if first <= last else -1
        kind, step = match[3], int(match[4] or way)
        if step * way <= 0:
            raise ValueError(f"expected a step that leads from {first} to {last}, got {part!r}")
        if max(first, last) >= n:
            raise ValueError(f"expected frames from 0 to {n - 1}, got {part!r}")
        every, stepped = range(first, last + way, way), range(first, last + way, step)
        found.update(stepped if kind == "x" else set(every).difference(stepped) if kind == "y" else every)
    if not found:
        raise ValueError(f"expected at least one frame, got {text[:60]!r}, which leaves all out")
    return tuple(sorted(found))


def frames_text(frames: Iterable[int]) -> str:
    """Return the shortest text for some frames, by runs of consecutive ones: "0-47,50"."""
    return ",".join(_runs(frames))


def brief_frames_text(frames: Iterable[int]) -> str:
    """Return the text for some frames, for a message: at most MOST_RUNS runs, then the last one: "0-3,5,...,90"."""
    runs = _runs(frames)
    return ",".join(runs if len(runs) <= MOST_RUNS else [*runs[: MOST_RUNS - 1], "...", runs[-1]])


def _runs(frames: Iterable[int]) -> list[str]:
    runs = []
    for _, group in groupby(enumerate(sorted(set(frames))), key=lambda entry: entry[1] - entry[0]):
        run: Sequence[int] = [frame for _, frame in group]
        runs.append(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]))
    return runs
