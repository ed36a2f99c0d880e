"""The hits of a frame with weights by area, made for the pixels of one task at a time."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from framearray_cli.base.arrays import Addresses, Flags, Int32

from ..kernels.simd import LANES
from .area import WHOLE, AreaRoom, factors, pixels_around, weigh_by_area
from .sources import COLUMNS, OF, ORDER, SCALE, SHARES, START, SourceList

# All hits of a pixel cover it a little better than two halves would: measured (docs/decisions/reuse.md).
EVENNESS = np.float32(0.96)
SPARE = 1.25  # room for more hits than asked for: tasks differ a little


class WeighedHits:
    """Hits in and around some pixels, with their weights.

    Attributes:
        addresses: of a list of these hits and of the sources that it refers to, as `accumulate` takes them.
        own: (n,) number of hits in each pixel.
        squares: (n,) sum of the squares of the weights in each pixel.
    """

    def __init__(self, listed: SourceList, first: int, n: int, room: AreaRoom) -> None:
        self.own, self.squares = room.own[:n], room.squares[:n]
        self.addresses: Addresses = np.zeros((1 + len(listed.sources), COLUMNS), np.int64)
        self.addresses[1:] = listed.addresses
        self.addresses[1:, START] = 0
        self.addresses[0, START] = room.start.ctypes.data - room.start.itemsize * first
        for column, array in ((ORDER, room.order), (SHARES, room.weight), (OF, room.of)):
            self.addresses[0, column] = array.ctypes.data


class AreaWeights:
    """Weighs the hits of frames of one size by area; keeps room from task to task."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size, self._factors = size, factors()
        self._rooms: list[AreaRoom] = []

    @contextmanager
    def weighed(
        self, listed: SourceList, first: int, n: int, halves: Int32 | None = None, half: int = WHOLE
    ) -> Iterator[WeighedHits]:
        """Weigh the hits in and around pixels first to first + n - 1, see `weigh_by_area`; lend them to a task."""
        low, high = pixels_around(self._size, first, n)
        counts = [int(s.by_pixel.start[high]) - int(s.by_pixel.start[low]) for s in listed.sources]
        room = self._room(n, high - low, sum(counts))
        try:
            which = np.zeros(len(counts), np.int32) if halves is None else halves
            weigh_by_area(listed.addresses, which, half, self._size, first, n, room)
            yield WeighedHits(listed, first, n, room)
        finally:
            self._rooms.append(room)

    @contextmanager
    def halved(self, listed: SourceList, halves: Int32, first: int, n: int, known: Flags) -> Iterator[Addresses]:
        """Weigh the hits of both halves by area, each as if there were no others; lend them with their factors in D.

        A mean of hits with weights w that sum to 1, and the same variance, has sum(w^2) times that. So D is the
        difference of the means a and b, times the root of sum(w^2) of all hits over that of a plus that of b, and times
        EVENNESS.

        Args:
            halves: (n_sources,) see `weigh_by_area`.
            known: (n_pixels,) overwritten in these pixels: whether they have hits of both halves.
        """
        with self.weighed(listed, first, n) as whole:
            squares = whole.squares.copy()
        with (
            self.weighed(listed, first, n, halves, 0) as even,
            self.weighed(listed, first, n, halves, 1) as odd,
        ):
            both = (even.own > 0) & (odd.own > 0)
            ratio = np.divide(squares, even.squares + odd.squares, out=np.zeros_like(squares), where=both)
            factors = EVENNESS * np.stack([np.sqrt(ratio), -np.sqrt(ratio)])
            known[first : first + n] = both
            for half, factor in zip((even, odd), factors, strict=True):
                half.addresses[0, SCALE] = factor.ctypes.data - factor.itemsize * first
            yield np.concatenate([even.addresses, odd.addresses])

    def _room(self, n: int, around: int, entries: int) -> AreaRoom:
        """Take room that nobody uses, or allocate it."""
        try:
            room = self._rooms.pop()
        except IndexError:
            pass
        else:
            if len(room.own) >= n and len(room.first) > around and len(room.source) >= entries:
                return room
        entries = int(SPARE * entries)
        most = 4 * entries + LANES  # a hit near a corner counts in four pixels
        return AreaRoom(
            start=np.empty(n + 1, np.int32),
            order=np.empty(most, np.int32),
            of=np.empty(most, np.int32),
            weight=np.empty(most, np.float32),
            first=np.empty(around + 1, np.int32),
            hit=np.empty(entries, np.int32),
            source=np.empty(entries, np.int32),
            place=np.empty(entries + LANES, np.uint8),
            balance=np.empty(entries + LANES, np.float32),
            near=np.empty(entries + LANES, np.int32),
            position=np.empty(entries + LANES, np.int32),
            strength=np.empty(entries + LANES, np.float32),
            share=np.empty(entries + LANES, np.float32),
            own=np.empty(n, np.int32),
            squares=np.empty(n, np.float32),
            columns=self._factors[0],
            rows=self._factors[1],
        )
