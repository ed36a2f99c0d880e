"""Weights by area: a hit of a pixel weighs as much as the part of the pixel that it stands for.

The hits of seven eyes lie in a pixel as they fall: two close together stand for the same part of it, and one far from
all others for a large part. So a pixel is cut into cells. Each cell is the mean of the hits around it, of other pixels
too if they lie at most a quarter pixel beyond the border, with the weight b exp(-d^2 / (2 s^2)) at distance d; b is the
balance weight of the hit, see `hits/outer.py`. The weight of a hit in the pixel is the mean of its shares of the cells.

Where the balance weights of these hits differ by more than a factor of LARGEST_RATIO, some eyes have not seen all of
the surfaces in the pixel, and the parts that hits stand for are wrong where one surface ends: there only the pixel's
own hits count, with their balance weights. Weights depend on places, never on what hits show.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Bytes, Float32, Int32, with_room

from ..frames.records import BY_SAMPLE, HALF
from ..hits.aiming import PARTS
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
from .accumulate import ROW_BYTES
from .sources import ORDER, PLACES, ROW, START, WEIGHTS

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
WHOLE = -1  # in place of a half: all hits


class AreaRoom(NamedTuple):
    """Room for the hits and weights of the n pixels of a task, and what weights follow from.

    Attributes:
        start: (n + 1,) hits start[i] to start[i + 1] are those of pixel i.
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


@inlined
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
                    prefetch(source[PLACES] + later, 1)
                    prefetch(source[WEIGHTS] + 4 * later, 1)
                if half != WHOLE:
                    its = halves[s]
                    if its == BY_SAMPLE:
                        its = int(real_at(source[ROW] + ROW_BYTES * hit, HALF))
                    if its != half:
                        continue
                room.hit[at], room.source[at] = hit, s + 1
                if source[PLACES] != 0:
                    room.place[at] = byte_at(source[PLACES], hit)
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
        # entries of three pixels beside each other: from `begin`, from `here`, from `right`, up to `last`
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
    """Whether each of 16 hits is in the pixel or near enough to it, and their positions.

    Args:
        packet: entry of the first hit.
        here, right, last: the lanes from which hits are in the pixel's column, right of it, and none at all.
        v: the row above (-1) to below (1).
    """
    lane, places = lane_numbers(), integers(load(room.place, packet))
    beside = select(lane < np.int32(here), np.int32(RING - PARTS), np.int32(RING))
    beside = select(lane < np.int32(right), beside, np.int32(RING + PARTS))
    column = (places & np.int32(PARTS - 1)) + beside
    row = (places >> np.int32(4)) + np.int32(RING + v * PARTS)
    inside = (lane < np.int32(last)) & (column >= np.int32(0)) & (column < np.int32(POSITIONS))
    inside = inside & (row >= np.int32(0)) & (row < np.int32(POSITIONS))
    return inside, row * np.int32(1 << ROW_BITS) + column


@inlined
def _alike(found: int, room: AreaRoom) -> bool:
    """Whether the balance weights of the collected hits differ by at most a factor of LARGEST_RATIO."""
    most = load(room.strength, 0)
    least = -most
    for k in range(LANES, found, LANES):
        w = load(room.strength, k)
        most, least = select(w > most, w, most), select(-w > least, -w, least)
    return bool(largest_of_lanes(most) <= LARGEST_RATIO * -largest_of_lanes(least))


@inlined
def _keep_own(here: int, room: AreaRoom) -> np.float32:
    """Replace the collected hits by those of the pixel, with their balance weights; return their sum."""
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
    found_weight: np.float32 = sum_of_lanes(total)
    return found_weight
