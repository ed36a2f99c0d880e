"""Choose a short walk in a room or along a street: several are tried, and judged by what their pictures show."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from .lamps import lit_shares
from .model import LightKeys
from .rays import Probe
from .room import CLEAR, Room, bounds, free_ways, select_clear
from .sample import level_directions, points_in
from .views import Views, find_shell, judge_views, trace_views

STANDS, TURNS = 250, 12  # places and directions whose views are judged
DOWN = 0.12  # tangent of the angle by which eyes look below the horizon
STARTS, PER_EYE = 30, 2  # the number of views from which walks are tried, and of those at one place
WAYS, LENGTHS = 12, (1.0, 0.6)  # directions and shares of the longest walk that are tried from each
WALK = 0.8  # longest walk, heights of the room; over 24 frames that is 8 cm per frame at 2.5 m
NEARER = 0.45  # longest walk, over the distance of what the eye looks at
FIRST, MIDDLE, LAST, WORST = 0.4, 0.2, 0.2, 0.2  # weights of the views of a walk: people see the first one first
LENGTH_BONUS = 0.4  # for the longest walk; a picture of more
LIT = 1.5  # for a view of which everything is lit by the lights of the file
LEVEL = 0.85  # least height of the eye at the end of a walk over that at its start
OPEN_SIDE = (0.5, 0.7, 0.9)  # distances from a side of the bounds, heights of the room, from which eyes may look in
SIDE_RAYS, WALL_DEPTH, CLOSED = (
    400,
    0.1,
    0.25,
)  # an open side: at most that share of its rays ends so near, of half the depth
OPEN_BONUS = 0.2  # variety by which such a view must show more than any from inside


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Walk:
    """A straight path of the eye with a fixed target: (2, 3) first and last eye, and (3,) target."""

    eyes: Float64
    target: Float64


def choose_walk(probe: Probe, room: Room, metre: float | None, lights: Sequence[LightKeys] = ()) -> Walk | None:
    """Choose the walk whose pictures show most; None where no place has room for an eye.

    Args:
        metre: its length in scene units; None if it is not known.
        lights: of the file; views that they light count for more.
    """
    eyes = select_clear(probe, room, room.eye_places(metre), CLEAR * room.height, STANDS)
    if not len(eyes):
        return None
    looks = level_directions(TURNS, room.up) - DOWN * room.up_dir
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    eye, look = np.repeat(eyes, TURNS, axis=0), np.tile(looks, (len(eyes), 1))
    views = trace_views(probe, eye, look, room.up_dir, room.height)
    shell = find_shell(views)
    value = judge_views(views, shell, room.height)
    best = _best_starts(value, TURNS)
    if lights:
        value[best] += LIT * lit_shares(probe, eye[best], eye[best] + look[best], room.up_dir, lights)
    depth = _take(views, best).middle_distance(room.height)
    targets = eye[best] + look[best] * np.maximum(depth, 0.5 * room.height)[:, None]
    past = None if room.roofless else _walk_past_open_side(probe, room, shell, float(value.max()))
    return past or _best_walk(probe, room, shell, eye[best], targets, value[best])


def _best_starts(value: Float64, turns: int) -> NDArray[np.int64]:
    """Indices of the best views, few of each place."""
    found: list[int] = []
    used: dict[int, int] = {}
    for k in np.argsort(-value, kind="stable"):
        place = int(k) // turns
        if used.get(place, 0) < PER_EYE:
            used[place] = used.get(place, 0) + 1
            found.append(int(k))
        if len(found) == STARTS:
            break
    return np.array(found)


def _take(views: Views, some: NDArray[np.int64]) -> Views:
    return Views(label=views.label[some], distance=views.distance[some], back=views.back[some])


def _best_walk(
    probe: Probe, room: Room, shell: NDArray[np.int64], eyes: Float64, targets: Float64, value: Float64
) -> Walk:
    """Choose the best of the free walks from some views, whose targets stay."""
    ways = np.repeat(level_directions(WAYS, room.up), len(LENGTHS), axis=0)
    shares = np.tile(LENGTHS, WAYS)
    n = len(ways)
    longest = np.minimum(WALK * room.height, NEARER * np.linalg.norm(targets - eyes, axis=1))
    start, target, first = (np.repeat(values, n, axis=0) for values in (eyes, targets, value))
    share = np.tile(shares, len(eyes))
    end = start + np.tile(ways, (len(eyes), 1)) * (np.repeat(longest, n) * share)[:, None]
    free = free_ways(probe, room, start, end, CLEAR * room.height) & _stays_level(probe, room, start, end)
    if not free.any():
        best = int(value.argmax())
        return Walk(eyes=np.array([eyes[best], eyes[best]]), target=targets[best])
    start, end, target, first, share = (values[free] for values in (start, end, target, first, share))
    middle, last = (
        judge_views(_trace_to(probe, room, spot, target), shell, room.height) for spot in ((start + end) / 2, end)
    )
    worst = np.minimum(np.minimum(first, middle), last)
    worth = FIRST * first + MIDDLE * middle + LAST * last + WORST * worst + LENGTH_BONUS * share
    best = int(worth.argmax())
    return Walk(eyes=np.array([start[best], end[best]]), target=target[best])


def _stays_level(probe: Probe, room: Room, start: Float64, end: Float64) -> NDArray[np.bool_]:
    """(n,) whether the floor below the end of a walk is not higher than below its start: no table is in the way."""
    below, later = (probe.trace(spot, -room.up_dir).distance for spot in (start, end))
    return np.asarray(later >= LEVEL * below)


def _trace_to(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> Views:
    look = targets - eyes
    return trace_views(probe, eyes, look / np.linalg.norm(look, axis=1, keepdims=True), room.up_dir, room.height)


def _walk_past_open_side(probe: Probe, room: Room, shell: NDArray[np.int64], least: float) -> Walk | None:
    """Choose a walk past an open side, as of a doll's house; None unless its view is worth more than `least`."""
    low, high = bounds(probe)
    middle, half = (low + high) / 2, (high - low) / 2
    sides = np.array([way for way in level_directions(4, room.up) if _is_open(probe, middle, half, way)])
    if not len(sides):
        return None
    ways = np.repeat(sides, len(OPEN_SIDE), axis=0)
    away = np.abs(ways @ half) + np.tile(OPEN_SIDE, len(sides)) * room.height
    eyes = middle + ways * away[:, None]
    value = judge_views(trace_views(probe, eyes, -ways, room.up_dir, room.height), shell, room.height)
    best = int(value.argmax())
    if value[best] <= least + OPEN_BONUS:
        return None
    aside = np.cross(room.up_dir, ways[best]) * 0.25 * room.height
    return Walk(eyes=np.array([eyes[best] - aside, eyes[best] + aside]), target=middle)


def _is_open(probe: Probe, middle: Float64, half: Float64, way: Float64) -> bool:
    """Whether hardly anything stands in one side of the bounds: a wall with a window is not open."""
    spots = points_in(middle - half, middle + half, SIDE_RAYS)
    depth = float(np.abs(way @ half))
    spots += way * (depth - (spots - middle) @ way)[:, None] * (1 + 1e-3)
    seen = probe.trace(spots, -way)
    return bool((seen.distance < WALL_DEPTH * depth).mean() <= CLOSED)
