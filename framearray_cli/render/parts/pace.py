"""The time left of a render in parts, from what its workers expect of their chunks."""

import time
from collections.abc import Callable, Mapping


class ChunkPace:
    """What workers expect of the chunks that they render, and from it of those that wait."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begun: dict[int, tuple[float, int]] = {}  # by chunk: when, and its images
        self._ends: dict[int, float] = {}  # by chunk: when it is expected to end

    def begin(self, chunk: int, images: int) -> None:
        """A worker begins a chunk, named by its first camera."""
        self._begun[chunk] = self._clock(), images
        self._ends.pop(chunk, None)

    def expect(self, chunk: int, seconds: float) -> None:
        """A worker expects its chunk to take that much longer."""
        self._ends[chunk] = self._clock() + seconds

    def left(self, images: Mapping[int, int]) -> float | None:
        """Return the expected seconds until the end of all chunks; None: not known yet.

        Args:
            images: the number that is left, of every chunk that has not ended.
        """
        known = {chunk: end for chunk, end in self._ends.items() if chunk in self._begun}
        if not known:
            return None
        now = self._clock()
        at_work = [max(end - now, 0.0) for chunk, end in known.items() if chunk in images]
        each = sum((end - self._begun[chunk][0]) / max(self._begun[chunk][1], 1) for chunk, end in known.items())
        waiting = sum(left for chunk, left in images.items() if chunk not in known) * each / len(known)
        workers = max(len([chunk for chunk in self._begun if chunk in images]), 1)
        return max([*at_work, (sum(at_work) + waiting) / workers])
