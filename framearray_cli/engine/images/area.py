"""Weights by area: a hit of a pixel weighs as much as the part of the pixel that it stands for.

The hits of seven eyes lie in a pixel as they fall: two close together stand for the same part of it, and one far from
all others for a large part. So a pixel is cut into cells. Each cell is the mean of the hits around it, of other pixels
too if they lie at most a quarter pixel beyond the border, with the weight b exp(-d^2 / (2 s^2)) at distance d; b is the
balance weight of the hit, see `hits/outer.py`. The weight of a hit in the pixel is the mean of its shares of the cells.

Where the balance weights of these hits differ by more than a factor of LARGEST_RATIO, some eyes have not seen all of
the surfaces in the pixel, and the parts that hits stand for are wrong where one surface ends: there only the pixel's
own hits count, with their balance weights. Weights depend on places, never on what hits show.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Bytes, Flags, Float32, Int32, with_room

from ..hits.aiming import PARTS
from ..hits.row import BY_SAMPLE, HALF, ROW_BYTES
from ..kernels.bundle import allocated, bundle
from ..kernels.kernel import byte_at, index, inlined, integer_at, kernel, prefetch, real_at
from ..kernels.simd import (
    LANES,
    append,
    gather,
    integers,
    lane_numbers,
    largest_of_lanes,
    load,
    popcount,
    reals,
    select,
    store,
    sum_of_lanes,
)
from .sourcelists import OF, ORDER, ROW, SCALE, SHARES, START, SUBPIXELS, WEIGHTS, SourceList

CELLS = 8  # along each axis of a pixel
PACKETS = CELLS * CELLS // LANES  # of cells
RING = PARTS // 4  # parts of a pixel around it from which hits count
POSITIONS = PARTS + 2 * RING  # of hits, along each axis
# A position is a row, and a column in the last bits.
ROW_BITS = 5
COLUMN = (1 << ROW_BITS) - 1
LARGEST_RATIO = np.float32(2.5)
# s in pixels. Hits lie a quarter pixel apart where there are 14: half as much blurs outlines, and a third less does not
# lower the noise (docs/decisions/reuse.md).
SPREAD = 0.06
SMALLEST_FACTOR = 1e-18  # of one axis: the products of two and a weight are normal numbers
# Hits without places fill holes, pixels without other hits. In the centre they count in no other pixel; and no hit of
# another pixel weighs nearly as much, so that none counts in theirs.
CENTRE, OUTWEIGHING = (PARTS + 1) * PARTS // 2, np.float32(1e9)
LEAST_SHARE = np.float32(1 / 32)  # of the mean weight: lighter hits are dropped, which leaves composing less to do
AHEAD = 16  # prefetch what is known of the hit that a source has this many entries later
WHOLE = -1  # instead of a half: all hits


@bundle
class AreaRoom(NamedTuple):
    """Room for the hits and weights of the n pixels of a task, and what weights follow from.

    Attributes:
        start: (n + 1,) hits start[i] to start[i + 1] belong to pixel i.
        order, of, weight: (most,) number, source, counted from 1, and weight of each of them.
        first: (m + 1,) entries of the m pixels from the row above the task's first to the row below its last.
        hit, source, place, balance: (entries,) of the hits of those pixels, by pixel and source: number, source,
            counted from 1, place within its pixel, and balance weight.
        near, position, strength, share: (entries,) of the hits in and around one pixel: entry, position, balance
            weight, and weight in any unit.
        own: (n,) number of hits in each pixel.
        squares: (n,) sum of the squares of the weights in each pixel.
        columns: (POSITIONS, LANES) exp(-x^2 / (2 s^2)) for each column of hits and of the cells of a packet.
        rows: (POSITIONS, PACKETS, LANES) the same for rows.
    """

    start: Int32
    order: Int32
    of: Int32
    weight: Float32
    first: Int32
    hit: Int32
    source: Int32
    place: Bytes
    balance: Float32
    near: Int32
    position: Int32
    strength: Float32
    share: Float32
    own: Int32
    squares: Float32
    columns: Float32
    rows: Float32


def factors(spread: float = SPREAD) -> tuple[Float32, Float32]:
    """The factors of columns and rows, see `AreaRoom`."""
    hits = (np.arange(POSITIONS) + 0.5 - RING) / PARTS
    cells = (np.arange(CELLS) + 0.5) / CELLS
    of_axis = np.maximum(np.exp(-((hits[:, None] - cells) ** 2) / (2 * spread**2)), SMALLEST_FACTOR)
    columns = with_room((POSITIONS, LANES), np.float32)
    columns[:] = np.tile(of_axis, LANES // CELLS)
    rows = with_room((POSITIONS, PACKETS, LANES), np.float32)
    rows[:] = np.repeat(of_axis, CELLS, axis=1).reshape(POSITIONS, PACKETS, LANES)
    return columns, rows


@kernel
def pixels_around(size: tuple[int, int], first: int, n: int) -> tuple[int, int]:
    """The first pixel that touches one of pixels first to first + n - 1, and the one after the last."""
    width, height = size
    return max(first - width - 1, 0), min(first + n + width + 1, width * height)


@kernel
def weigh_by_area(
    sources: Addresses, halves: Int32, half: int, size: tuple[int, int], first_pixel: int, n: int, room: AreaRoom
) -> None:
    """Weigh the hits of pixels first_pixel to first_pixel + n - 1; the weights of a pixel sum to 1.

    Args:
        sources: of a `SourceList`.
        halves: (n_sources,) the half that all hits of a source belong to, or BY_SAMPLE.
        half: only these hits count, or WHOLE.
        size: (width, height) of the frame.
        room: overwritten.
    """
    low, high = pixels_around(size, first_pixel, n)
    _merge(sources, halves, half, low, high, room)
    room.start[0] = 0
    for i in range(n):
        here = first_pixel + i - low
        own = room.first[here + 1] - room.first[here]
        room.own[i], total = own, np.float32(0.0)
        # 1. The hits in and around the pixel, and their weights. Without hits of its own the pixel stays without any.
        found = _collect(size, first_pixel + i, low, room) if own > 0 else 0
        if found > 0 and _alike(found, room):
            total = _share_cells(found, room)
        elif found > 0:
            found, total = own, _keep_own(here, room)
        # 2. Write those that weigh anything.
        end, scale = room.start[i], np.float32(1.0) / total if total > 0.0 else np.float32(0.0)
        squares = reals(lane_numbers()) * np.float32(0.0)
        for k in range(0, found, LANES):
            entry, w = load(room.near, k), load(room.share, k) * scale
            kept = w > np.float32(0.0)
            append(kept, gather(room.hit, entry), room.order, end)
            append(kept, gather(room.source, entry), room.of, end)
            append(kept, w, room.weight, end)
            end, squares = end + popcount(kept), squares + w * w
        room.start[i + 1], room.squares[i] = end, sum_of_lanes(squares)


@inlined
def _merge(sources: Addresses, halves: Int32, half: int, low: int, high: int, room: AreaRoom) -> None:
    """List the hits of pixels low to high - 1, pixel by pixel, source by source."""
    end = 0
    for pixel in range(low, high):
        room.first[pixel - low] = end
        for s in range(sources.shape[0]):
            source = sources[s]
            last = integer_at(source[START], high)
            for entry in range(integer_at(source[START], pixel), integer_at(source[START], pixel + 1)):
                hit, at = integer_at(source[ORDER], entry), index(end)
                if entry + AHEAD < last:
                    later = integer_at(source[ORDER], entry + AHEAD)
                    prefetch(source[SUBPIXELS] + later, 1)
                    prefetch(source[WEIGHTS] + 4 * later, 1)
                if half != WHOLE:
                    its = halves[s]
                    if its == BY_SAMPLE:
                        its = int(real_at(source[ROW] + ROW_BYTES * hit, HALF))
                    if its != half:
                        continue
                room.hit[at], room.source[at] = hit, s + 1
                if source[SUBPIXELS] != 0:
                    room.place[at] = byte_at(source[SUBPIXELS], hit)
                    room.balance[at] = real_at(source[WEIGHTS], hit) if source[WEIGHTS] != 0 else np.float32(1.0)
                else:
                    room.place[at], room.balance[at] = CENTRE, OUTWEIGHING
                end += 1
    room.first[high - low] = end


@inlined
def _collect(size: tuple[int, int], pixel: int, low: int, room: AreaRoom) -> int:
    """List the hits in and around a pixel in `near`, `position` and `strength`; return their number.

    The last one is repeated, so that packets of hits have no others.
    """
    width, height = size
    y = pixel // width
    x = pixel - y * width
    found = 0
    for v in range(-1 if y > 0 else 0, 2 if y < height - 1 else 1):
        # entries of three pixels in a row: from `begin`, from `here`, from `right`, up to `last`
        at = pixel - low + v * width
        here, right = room.first[at], room.first[at + 1]
        begin = room.first[at - 1] if x > 0 else here
        last = room.first[at + 2] if x < width - 1 else right
        for packet in range(begin, last, LANES):
            inside, position = _positions(packet, here - packet, right - packet, last - packet, v, room)
            append(inside, lane_numbers() + np.int32(packet), room.near, found)
            append(inside, position, room.position, found)
            append(inside, load(room.balance, packet), room.strength, found)
            found += popcount(inside)
    if found > 0:
        store(room.near, found, room.near[found - 1])
        store(room.strength, found, room.strength[found - 1])
    return found


@inlined
def _positions(packet: int, here: int, right: int, last: int, v: int, room: AreaRoom) -> tuple[bool, int]:
    """True for each of 16 hits that is in the pixel or near enough to it, and their positions.

    Args:
        packet: entry of the first hit.
        here, right, last: the lanes from which hits are in the pixel's column, right of it, and none at all.
        v: the row above (-1) to below (1).
    """
    lane, places = lane_numbers(), integers(load(room.place, packet))
    aside = select(lane < np.int32(here), np.int32(RING - PARTS), np.int32(RING))
    aside = select(lane < np.int32(right), aside, np.int32(RING + PARTS))
    column = (places & np.int32(PARTS - 1)) + aside
    row = (places >> np.int32(4)) + np.int32(RING + v * PARTS)
    inside = (lane < np.int32(last)) & (column >= np.int32(0)) & (column < np.int32(POSITIONS))
    inside = inside & (row >= np.int32(0)) & (row < np.int32(POSITIONS))
    return inside, row * np.int32(1 << ROW_BITS) + column


@inlined
def _alike(found: int, room: AreaRoom) -> bool:
    """True if the balance weights of the collected hits differ by at most a factor of LARGEST_RATIO."""
    most = load(room.strength, 0)
    least = -most
    for k in range(LANES, found, LANES):
        w = load(room.strength, k)
        most, least = select(w > most, w, most), select(-w > least, -w, least)
    return bool(largest_of_lanes(most) <= LARGEST_RATIO * -largest_of_lanes(least))


@inlined
def _keep_own(here: int, room: AreaRoom) -> np.float32:
    """Replace the collected hits by the pixel's own, with their balance weights; return their sum."""
    total, first = np.float32(0.0), room.first[here]
    for k in range(room.first[here + 1] - first):
        room.near[k], room.share[k] = first + k, room.balance[first + k]
        total += room.share[k]
    store(room.share, room.first[here + 1] - first, np.float32(0.0))
    return total


@inlined
def _share_cells(found: int, room: AreaRoom) -> np.float32:
    """Weigh the collected hits by area, very light ones with 0; return the sum of their weights."""
    # 1. The sum of the weights of all hits in each cell.
    zero = reals(lane_numbers()) * np.float32(0.0)
    a, b, c, d = zero, zero, zero, zero
    for k in range(found):
        at, column = (room.position[k] >> ROW_BITS) * (PACKETS * LANES), (room.position[k] & COLUMN) * LANES
        factor = load(room.columns, column) * room.strength[k]
        a = a + factor * load(room.rows, at)
        b = b + factor * load(room.rows, at + LANES)
        c = c + factor * load(room.rows, at + 2 * LANES)
        d = d + factor * load(room.rows, at + 3 * LANES)
    # 2. The shares of each hit, summed over all cells.
    one = zero + np.float32(1.0)
    a, b, c, d = one / a, one / b, one / c, one / d
    for k in range(found):
        at, column = (room.position[k] >> ROW_BITS) * (PACKETS * LANES), (room.position[k] & COLUMN) * LANES
        shares = a * load(room.rows, at) + b * load(room.rows, at + LANES)
        shares = shares + c * load(room.rows, at + 2 * LANES) + d * load(room.rows, at + 3 * LANES)
        room.share[k] = sum_of_lanes(shares * load(room.columns, column))
    # 3. Their weights; very light ones are dropped.
    least, total = LEAST_SHARE * np.float32(CELLS * CELLS) / np.float32(found), zero
    for k in range(0, found, LANES):
        share = load(room.share, k) * load(room.strength, k)
        share = select((share >= least) & (lane_numbers() < np.int32(found - k)), share, np.float32(0.0))
        store(room.share, k, share)
        total = total + share
    return sum_of_lanes(total)


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
        """Refer to the hits in a room, of pixels that kernels count from `first` on."""
        self.own, self.squares = room.own[:n], room.squares[:n]
        self.addresses: Addresses = np.zeros((1 + len(listed.sources), listed.addresses.shape[1]), np.int64)
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
        self, listed: SourceList, first: int, n: int, halves: Int32 | None = None, half: int = WHOLE, origin: int = 0
    ) -> Iterator[WeighedHits]:
        """Weigh the hits in and around pixels first to first + n - 1, see `weigh_by_area`; lend them to a task.

        Args:
            origin: the pixel from which kernels count that read the weighed hits.
        """
        low, high = pixels_around(self._size, first, n)
        counts = [int(s.by_pixel.start[high]) - int(s.by_pixel.start[low]) for s in listed.sources]
        room = self._room(n, high - low, sum(counts))
        try:
            which = np.zeros(len(counts), np.int32) if halves is None else halves
            weigh_by_area(listed.addresses, which, half, self._size, first, n, room)
            yield WeighedHits(listed, first - origin, n, room)
        finally:
            self._rooms.append(room)

    @contextmanager
    def halved(self, listed: SourceList, halves: Int32, first: int, n: int, known: Flags) -> Iterator[Addresses]:
        """Weigh the hits of both halves by area, each as if there were no others; lend them with their factors in D.

        A mean of hits with weights w that sum to 1, and the same variance, has sum(w^2) times that. So D is the
        difference of the means a and b, times EVENNESS and the root of (sum(w^2) of all hits / (sum(w^2) of a +
        sum(w^2) of b)).

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
        """Reuse free room, or allocate some."""
        try:
            room = self._rooms.pop()
        except IndexError:
            pass
        else:
            if len(room.own) >= n and len(room.first) > around and len(room.source) >= entries:
                return room
        entries = int(SPARE * entries)
        most = 4 * entries + LANES  # a hit near a corner counts in four pixels
        padded, (columns, rows) = entries + LANES, self._factors
        return allocated(
            AreaRoom, start=n + 1, order=most, of=most, weight=most, first=around + 1, hit=entries, source=entries,
            place=padded, balance=padded, near=padded, position=padded, strength=padded, share=padded, own=n,
            squares=n, columns=columns, rows=rows,
        )  # fmt: skip
