"""Paths in a room or along a street: a short walk for the eye, and a path for a lamp; several are tried and judged."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64
from framearray_cli.base.units import FARTHEST

from .model import NotedTable
from .rays import Probe, level_directions, points_in, unit
from .room import CLEAR, Room, bounds, free_ways, select_clear
from .views import TracedViews, find_shell, judge_views, trace_views, view_directions

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

LAMP_SHARE = 0.75  # of the height of a room
LAMP_CLEAR = 0.15  # over the height: a lamp that is nearer would make a white spot on a wall
LAMPS, LIT_POINTS = 300, 300  # largest numbers of places for a lamp, and of points in the pictures for it to light
LIT_STRIDE, MOST_LIT_BY = 5, 8  # rays of a view of which one is followed to the lights; lights that are tried
TRIED = 20  # ends of its path that are tried at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Walk:
    """A straight path of the eye with a fixed target: (2, 3) first and last eye, and (3,) target."""

    eyes: Float64
    target: Float64


def choose_walk(probe: Probe, room: Room, metre: float | None, lights: Sequence[NotedTable] = ()) -> Walk | None:
    """Choose the walk whose pictures show most; None where no place has room for an eye.

    Args:
        metre: its length in scene units; None if it is not known.
        lights: of the file; views that they light count for more.
    """
    eyes = select_clear(probe, room, room.eye_places(metre), CLEAR * room.height, STANDS)
    if not len(eyes):
        return None
    looks = unit(level_directions(TURNS, room.up) - DOWN * room.up_dir)
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


def _take(views: TracedViews, some: NDArray[np.int64]) -> TracedViews:
    return TracedViews(label=views.label[some], distance=views.distance[some], back=views.back[some])


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
    """(n,) True if the floor below the end of a walk is not higher than below its start: no table is in the way."""
    below, later = (probe.trace(spot, -room.up_dir).distance for spot in (start, end))
    return np.asarray(later >= LEVEL * below)


def _trace_to(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> TracedViews:
    return trace_views(probe, eyes, unit(targets - eyes), room.up_dir, room.height)


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
    """True if hardly anything stands in one side of the bounds: a wall with a window is not open."""
    spots = points_in(middle - half, middle + half, SIDE_RAYS)
    depth = float(np.abs(way @ half))
    spots += way * (depth - (spots - middle) @ way)[:, None] * (1 + 1e-3)
    seen = probe.trace(spots, -way)
    return bool((seen.distance < WALL_DEPTH * depth).mean() <= CLOSED)


def choose_lamp_path(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> Float64 | None:
    """Choose the start and end of a lamp's path, (2, 3), that light what the eyes see; None where no place has room.

    Args:
        eyes, targets: (n, 3) of the views to light.
    """
    spots = select_clear(probe, room, room.at_share(LAMP_SHARE), LAMP_CLEAR * room.height, LAMPS)
    points = _seen_points(probe, eyes, targets, room.up_dir)[1]
    points = points[:: max(1, len(points) // LIT_POINTS)]
    if not len(spots) or not len(points):
        return None
    lit = ~probe.blocked(np.repeat(spots, len(points), axis=0), np.tile(points, (len(spots), 1)))
    lit = lit.reshape(len(spots), -1)
    reach = np.linalg.norm(spots[:, None] - points[None], axis=2)
    # a distant lamp lights the points evenly, but then it mostly lights another room
    value = (lit / (1 + (reach / (2 * room.height)) ** 2)).mean(axis=1)
    first = int(value.argmax())
    start = spots[first]
    apart = np.linalg.norm(spots - start, axis=1)
    # squared, so that the light at the end of the path counts more than the length of the path
    order = np.argsort(-(value**2) * np.minimum(apart / room.height, 1.0), kind="stable")
    order = order[apart[order] > 0]
    for some in np.array_split(order, max(1, len(order) // TRIED)):
        free = free_ways(probe, room, np.tile(start, (len(some), 1)), spots[some], LAMP_CLEAR * room.height / 2)
        if free.any():
            return np.array([start, spots[some[int(free.argmax())]]])
    return np.array([start, start])


def lit_shares(probe: Probe, eyes: Float64, targets: Float64, up_dir: Float64, lights: Sequence[NotedTable]) -> Float64:
    """(n,) share of what each of n views shows that some light of the file reaches, halfway along the lights' paths."""
    hit, points = _seen_points(probe, eyes, targets, up_dir, LIT_STRIDE)
    lit = np.zeros(len(points), bool)
    for source in lights[:MOST_LIT_BY] if len(points) else ():
        key = source.keys[len(source.keys) // 2]
        vector = np.clip(key["position" if "position" in key else "direction"], -FARTHEST, FARTHEST)
        far = 4 * float(np.linalg.norm(np.ptp(probe.scene.corners, axis=(0, 1))))
        end = vector - probe.scene.centre if "position" in key else points - far * vector
        lit |= ~probe.blocked(points, end)
    reached = np.zeros(hit.shape, bool)
    reached[hit] = lit
    return np.asarray(reached.sum(axis=1) / np.maximum(hit.sum(axis=1), 1))


def _seen_points(
    probe: Probe, eyes: Float64, targets: Float64, up_dir: Float64, stride: int = 1
) -> tuple[NDArray[np.bool_], Float64]:
    """(views, rays) True if a ray of a view meets a surface, and points (hits, 3) slightly in front of them."""
    directions = view_directions(unit(targets - eyes), up_dir)[:, ::stride]
    n, rays = directions.shape[:2]
    seen, points = probe.points(np.repeat(eyes, rays, axis=0), directions.reshape(-1, 3))
    return seen.hit.reshape(n, rays), points
