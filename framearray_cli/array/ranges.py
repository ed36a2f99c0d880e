"""Indices as short text, by runs of consecutive ones: "0-47,50". `places.parse_places` reads it."""

from collections.abc import Iterable, Sequence
from itertools import groupby

MOST_RUNS = 12  # of a brief text


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
