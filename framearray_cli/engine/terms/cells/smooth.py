"""The filter of indirect light: a hit takes the mean over hits around it that lie on the same surface.

Each pass averages nine hits: the hit itself, and hits of the same sample number in the pixels 1, then 3, then 9 pixels
away along x, y or both (an a-trous filter with a box). Passes thus reach over 3, 9 and 27 pixels. What is averaged is
the light that arrives, without the reflectivity, so that textures stay sharp; which hits count depends on their
surfaces and on the lengths of their rays only, so that all light positions share the same means.

Light changes along a surface over about the distance to what it comes from: hits that lie farther apart than a share
of the harmonic mean length of their rays do not mix. That length is a mean over the first nine hits.

Hits take part in chunks of `HITS_TOGETHER`, as in gathering: which ones, depends on no batch and no thread.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb

from ...hits.hits import Hits, reflects
from ...kernels.bundle import allocated, bundle
from ...kernels.kernel import inlined, kernel
from ...kernels.simd import LANES, compress, lane_numbers, load, reals
from ..obscurance import HITS_TOGETHER
from .gather import COLOUR, LEVEL, LIGHT

# Distance in pixels between the hits of a pass is this times the distance in the pass before.
STEP = 3
# Two hits lie on the same surface if the line between them leaves both tangent planes by at most this sine, and the
# cosine between their normals is at least that.
SLOPE, FACING = np.float32(0.2), np.float32(0.9)
# Hits mix up to this share of the harmonic mean length of their rays apart.
APART = np.float32(0.2)
# The pixels of a chunk differ in their place modulo this, along x and y.
_TABLE = 64
_NONE = -1
_AROUND = 9


@bundle
class SmoothScratch(NamedTuple):
    """Arrays for one chunk of hits.

    Attributes:
        head: (_TABLE^2,) the first hit of each pixel; `follow`: (HITS_TOGETHER,) the next hit of the same pixel.
        ordinal: (HITS_TOGETHER,) the number of hits of the same pixel before.
        around: (HITS_TOGETHER, _AROUND) the hits that a hit's mean is taken over; `members`: their number.
        close: (HITS_TOGETHER,) mean of 1 / length of the rays of a hit and of those around it, of any distance.
        light: (HITS_TOGETHER, LIGHT + values) and `constant`: (HITS_TOGETHER, 3) what hits had before a pass.
    """

    head: Int32
    follow: Int32
    ordinal: Int32
    around: Int32
    members: Int32
    close: Float32
    light: Float32
    constant: Rgb


def room_for_smoothing(values: int) -> SmoothScratch:
    """Allocate arrays; `values`: numbers of indirect light per hit."""
    n = HITS_TOGETHER
    return allocated(
        SmoothScratch, head=_TABLE * _TABLE, follow=n, ordinal=n, around=(n, _AROUND), members=n, close=n,
        light=(n, LIGHT + values), constant=(n, 3),
    )  # fmt: skip


@inlined
def _place(x: int, y: int) -> int:
    """Slot of the pixel (x, y) in the table of a chunk."""
    return (y & (_TABLE - 1)) * _TABLE + (x & (_TABLE - 1))


@kernel
def _list_hits(hits: Hits, first: int, n: int, width: int, room: SmoothScratch) -> None:
    """List hits first to first + n - 1 by pixel, those that reflect."""
    for place in range(_TABLE * _TABLE):
        room.head[place] = _NONE
    for k in range(n - 1, -1, -1):
        pixel = hits.pixel[first + k]
        place = _place(pixel % width, pixel // width)
        later = room.head[place]
        room.follow[k] = later if later != _NONE and hits.pixel[first + later] == pixel else _NONE
        room.head[place] = k
    for k in range(n):
        room.ordinal[k] = 0
    for k in range(n):
        if room.follow[k] != _NONE:
            room.ordinal[room.follow[k]] = room.ordinal[k] + 1


@inlined
def _near_enough(square: float, close: float) -> bool:
    """Return True if hits at the square of a distance mix, by 1 / length of their rays."""
    return bool(square * close * close <= APART * APART)


@inlined
def _mix(hits: Hits, a: int, b: int, close: float) -> bool:
    """Return True if hits a and b mix: on one surface, nearly flat in between, near each other, of one half.

    Args:
        close: 1 / length of their rays.
    """
    p, g, m = hits.position, hits.geometric, hits.shading
    x, y, z = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    square = x * x + y * y + z * z
    most = SLOPE * SLOPE * square
    from_a = x * g[a, 0] + y * g[a, 1] + z * g[a, 2]
    from_b = x * g[b, 0] + y * g[b, 1] + z * g[b, 2]
    facing = m[a, 0] * m[b, 0] + m[a, 1] * m[b, 1] + m[a, 2] * m[b, 2]
    return bool(
        hits.half[a] == hits.half[b]
        and facing >= FACING
        and from_a * from_a <= most
        and from_b * from_b <= most
        and _near_enough(square, close)
    )


@kernel
def _find_around(hits: Hits, first: int, n: int, width: int, height: int, step: int, room: SmoothScratch) -> None:
    """List the hits that the mean of each hit of a chunk is taken over: itself, and up to eight around it."""
    for k in range(n):
        room.members[k] = 0
        if not reflects(hits, first + k):
            continue
        room.around[k, 0], found = k, 1
        pixel = hits.pixel[first + k]
        x, y = pixel % width, pixel // width
        for way in range(9):
            u, v = x + (way % 3 - 1) * step, y + (way // 3 - 1) * step
            if way == 4 or u < 0 or u >= width or v < 0 or v >= height:
                continue
            other = room.head[_place(u, v)]
            if other == _NONE or hits.pixel[first + other] != v * width + u:
                continue
            for _ in range(room.ordinal[k]):
                if other != _NONE:
                    other = room.follow[other]
            if other == _NONE or not reflects(hits, first + other):
                continue
            close = np.float32(0.5) * (room.close[k] + room.close[other])
            if _mix(hits, first + k, first + other, close):
                room.around[k, found] = other
                found += 1
        room.members[k] = found


@kernel
def _find_first(
    hits: Hits, first: int, n: int, width: int, height: int, closeness: Float32, room: SmoothScratch
) -> None:
    """Average 1 / length over each hit and the hits around it, and list the hits that are near enough to mix."""
    for k in range(n):
        room.close[k] = 0.0
    _find_around(hits, first, n, width, height, 1, room)
    for k in range(n):
        total = np.float32(0.0)
        for i in range(room.members[k]):
            total += closeness[first + room.around[k, i]]
        room.close[k] = total / np.float32(max(room.members[k], 1))
    p = hits.position
    for k in range(n):
        kept = min(room.members[k], 1)
        a = first + k
        for i in range(1, room.members[k]):
            other = room.around[k, i]
            b = first + other
            x, y, z = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
            close = np.float32(0.5) * (room.close[k] + room.close[other])
            if _near_enough(x * x + y * y + z * z, close):
                room.around[k, kept] = other
                kept += 1
        room.members[k] = kept


@kernel
def _average(first: int, n: int, room: SmoothScratch, light: Float32, constant: Rgb) -> None:
    """Write the means of the hits of a chunk over the lists of `_find_around`, in the order of the lists."""
    columns = light.shape[1]
    # what was there before; colours times their mean, so that they add up
    for k in range(n):
        if room.members[k] == 0:
            continue
        for l in range(0, columns, LANES):
            values = load(light, (first + k) * columns + l)
            compress(lane_numbers() < np.int32(columns - l), values, room.light, k * columns + l)
        for channel in range(3):
            room.light[k, COLOUR + channel] *= room.light[k, LEVEL]
            room.constant[k, channel] = constant[first + k, channel]
    for k in range(n):
        count = room.members[k]
        if count == 0:
            continue
        share = np.float32(1.0) / np.float32(count)
        for l in range(0, columns, LANES):
            total = reals(lane_numbers()) * np.float32(0.0)
            for i in range(count):
                total = total + load(room.light, room.around[k, i] * columns + l)
            compress(lane_numbers() < np.int32(columns - l), total * share, light, (first + k) * columns + l)
        mean = light[first + k, LEVEL]
        for channel in range(3):
            hue = light[first + k, COLOUR + channel]
            light[first + k, COLOUR + channel] = hue / mean if mean > np.float32(0.0) else np.float32(0.0)
            same = np.float32(0.0)
            for i in range(count):
                same += room.constant[room.around[k, i], channel]
            constant[first + k, channel] = share * same


@kernel
def smooth_light(
    hits: Hits, n: int, width: int, height: int, passes: int, closeness: Float32, room: SmoothScratch, light: Float32,
    constant: Rgb,
) -> None:  # fmt: skip
    """Smooth the indirect light of native hits 0 to n - 1 of one eye.

    Args:
        passes: number of passes.
        closeness: see `Gathered`.
        light, constant: see `Gathered`; overwritten.
    """
    for first in range(0, n, HITS_TOGETHER):
        m, step = min(HITS_TOGETHER, n - first), 1
        _list_hits(hits, first, m, width, room)
        _find_first(hits, first, m, width, height, closeness, room)
        for done in range(passes):
            if done > 0:
                step *= STEP
                _find_around(hits, first, m, width, height, step, room)
            _average(first, m, room, light, constant)
