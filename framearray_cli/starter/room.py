"""Decide whether a scene is a room to be inside of; choose a short walk in it, and a path for a lamp.

A point is inside where most rays around it meet surfaces from their front: from inside a wall, a cupboard or a teapot
one sees the backs of things, and beside a thing on a lawn there is sky.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from .rays import Probe
from .sample import directions_around, level_directions, points_in
from .views import judge_views, view_directions

POINTS, AROUND = 3000, 64
# A point is inside if at least these shares of its rays hit, and of those that hit, hit a front.
ENCLOSED, FRONTS = 0.7, 0.75
# Least share of points in the bounds of a room that are inside. Rooms that were tried have 5 % (a house in a garden
# of 80 m) to 83 %; things to be looked at have none.
LEAST_INSIDE = 0.02
EYE_METRES, ROOM_METRES = 1.6, (2.0, 12.0)  # height of an eye, in rooms whose height is plausible in metres
EYE_SHARE = 0.55  # of the height of any other room
LAMP_SHARE = 0.75  # of the height of a room
CLEAR = 0.12  # of the height of a room: least distance of an eye from anything; 0.3 m at 2.5 m
LAMP_CLEAR = 0.15  # the same for a lamp, which would make a white spot on a wall nearby
STANDS, TURNS = 250, 12  # places and directions whose views are judged
DOWN = 0.1  # tangent of the angle by which eyes look below the horizon
WALK = 0.8  # longest walk, heights of the room; over 24 frames that is 8 cm per frame at 2.5 m
STEPS = 8  # points of a path whose surroundings are checked
OPEN_SIDE = (0.5, 0.7, 0.9)  # distances from a side of the bounds, heights of the room, from which eyes may look in
OPEN_BONUS = 0.2  # variety by which such a view must show more than any from inside
LAMPS, LIT_POINTS = 300, 300  # largest numbers of places for a lamp, and of points in the pictures for it to light


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Room:
    """Places inside, in centred coordinates.

    Attributes:
        up: number of the up axis.
        floor, ceiling: (n,) height of the surface below and above each place.
        places: (n, 3).
        height: of the room, median.
    """

    up: int
    places: Float64
    floor: Float64
    ceiling: Float64
    height: float

    @property
    def up_dir(self) -> Float64:
        """Unit vector, (3,)."""
        return np.asarray(np.eye(3)[self.up])

    def at_share(self, share: float, metres: float | None = None) -> Float64:
        """The places, moved up or down to a share of the height, or to `metres` above the floor where that fits."""
        low, high = ROOM_METRES
        tall = self.ceiling - self.floor
        moved = self.places.copy()
        fits = (tall >= low) & (tall <= high) & (metres is not None)
        moved[:, self.up] = self.floor + np.where(fits, metres or 0.0, share * tall)
        return moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Walk:
    """A straight path of the eye with a fixed target: (2, 3) first and last eye, and (3,) target."""

    eyes: Float64
    target: Float64


def find_room(probe: Probe, up: int) -> tuple[Room | None, float]:
    """Find a room; also return the share of the bounds that is inside.

    Args:
        up: number of the up axis.
    """
    corners = probe.scene.corners.reshape(-1, 3)
    low, high = (np.array([f(corners[:, axis]) for axis in range(3)], dtype=np.float64) for f in (np.min, np.max))
    places = points_in(low, high, POINTS)
    inside, _ = surroundings(probe, places)
    share = float(inside.mean())
    if share < LEAST_INSIDE:
        return None, share
    first = places[inside]
    again = points_in(first.min(axis=0), first.max(axis=0), POINTS)  # so that a house in a garden gets enough points
    inside, _ = surroundings(probe, again)
    places = np.concatenate([first, again[inside]])
    axis = np.eye(3)[up]
    below, above = (probe.trace(places, way) for way in (-axis, axis))
    between = below.hit & above.hit
    if not between.any():
        return None, share
    places, below_by, above_by = places[between], below.distance[between], above.distance[between]
    height = float(np.median(below_by + above_by))
    level = places[:, up]
    room = Room(up=up, places=places, floor=level - below_by, ceiling=level + above_by, height=height)
    return room, share


def surroundings(probe: Probe, places: Float64) -> tuple[NDArray[np.bool_], Float64]:
    """(n,) whether each place is inside, and (n,) distance of the nearest thing."""
    n = len(places)
    around = directions_around(AROUND)
    seen = probe.trace(np.repeat(places, AROUND, axis=0), np.tile(around, (n, 1)))
    hit, front = seen.hit.reshape(n, AROUND), seen.front.reshape(n, AROUND)
    good = (hit.mean(axis=1) >= ENCLOSED) & (front.sum(axis=1) >= FRONTS * hit.sum(axis=1))
    return good, seen.distance.reshape(n, AROUND).min(axis=1)


def choose_walk(probe: Probe, room: Room) -> Walk | None:
    """Choose the view that shows most and a short walk from there; None where no place has room for an eye."""
    eyes = _select_clear(probe, room.at_share(EYE_SHARE, EYE_METRES), CLEAR * room.height, STANDS)
    if not len(eyes):
        return None
    level = level_directions(TURNS, room.up)
    looks = level - DOWN * room.up_dir
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    eye, look = np.repeat(eyes, TURNS, axis=0), np.tile(looks, (len(eyes), 1))
    value, depth = judge_views(probe, eye, look, room.up_dir, room.height)
    best = int(value.argmax())
    target = eye[best] + look[best] * max(depth[best], 0.5 * room.height)
    return _walk_past_open_side(probe, room, float(value[best])) or _walk_from(probe, room, eye[best], target)


def _walk_past_open_side(probe: Probe, room: Room, least: float) -> Walk | None:
    """Choose a walk past an open side, as of a doll's house; None unless its view is worth more than `least`."""
    corners = probe.scene.corners.reshape(-1, 3)
    low, high = (np.array([f(corners[:, axis]) for axis in range(3)], dtype=np.float64) for f in (np.min, np.max))
    middle, half = (low + high) / 2, (high - low) / 2
    ways = np.repeat(level_directions(4, room.up), len(OPEN_SIDE), axis=0)
    away = np.abs(ways @ half) + np.tile(OPEN_SIDE, 4) * room.height
    eyes = middle + ways * away[:, None]
    value, _ = judge_views(probe, eyes, -ways, room.up_dir, room.height)
    best = int(value.argmax())
    if value[best] <= least + OPEN_BONUS:
        return None
    aside = np.cross(room.up_dir, ways[best]) * 0.25 * room.height
    return Walk(eyes=np.array([eyes[best] - aside, eyes[best] + aside]), target=middle)


def _walk_from(probe: Probe, room: Room, eye: Float64, target: Float64) -> Walk:
    """Choose the end of a walk: the free path whose last view of the same target shows most."""
    ends, lengths = [], []
    longest = min(WALK * room.height, 0.45 * float(np.linalg.norm(target - eye)))
    for way in level_directions(16, room.up):
        for share in (1.0, 0.6):
            end = eye + way * longest * share
            if _is_free(probe, eye, end, CLEAR * room.height):
                ends.append(end)
                lengths.append(share)
    if not ends:
        return Walk(eyes=np.array([eye, eye]), target=target)
    look = target - np.array(ends)
    value, _ = judge_views(
        probe, np.array(ends), look / np.linalg.norm(look, axis=1, keepdims=True), room.up_dir, room.height
    )
    best = int((value + np.array(lengths)).argmax())
    return Walk(eyes=np.array([eye, ends[best]]), target=target)


def _is_free(probe: Probe, start: Float64, end: Float64, clear: float) -> bool:
    """Whether a ball of radius `clear` can move straight from start to end and stay inside."""
    way = start + (end - start) * np.linspace(0, 1, STEPS)[:, None]
    inside, nearest = surroundings(probe, way)
    return bool(inside.all() and (nearest >= clear).all() and not probe.blocked(start, end).any())


def _select_clear(probe: Probe, places: Float64, clear: float, most: int) -> Float64:
    """Select at most `most` places that are inside and `clear` of everything, or half or a quarter of it if none is."""
    inside, nearest = surroundings(probe, places)
    for least in (clear, clear / 2, clear / 4):
        good = places[inside & (nearest >= least)]
        if len(good):
            return good[:: -(-len(good) // most)]
    return places[:0]


def choose_lamp_path(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> Float64 | None:
    """Choose the start and end of a lamp's path, (2, 3), that light what the eyes see; None where no place has room.

    Args:
        eyes, targets: (n, 3) of the views to light.
    """
    spots = _select_clear(probe, room.at_share(LAMP_SHARE), LAMP_CLEAR * room.height, LAMPS)
    points = _seen_points(probe, eyes, targets, room.up_dir)
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
    for other in np.argsort(-(value**2) * np.minimum(apart / room.height, 1.0)):
        if apart[other] > 0 and _is_free(probe, start, spots[other], LAMP_CLEAR * room.height / 2):
            return np.array([start, spots[other]])
    return np.array([start, start])


def _seen_points(probe: Probe, eyes: Float64, targets: Float64, up_dir: Float64) -> Float64:
    """Points (n, 3) slightly in front of the surfaces that the views show."""
    look = targets - eyes
    look = look / np.linalg.norm(look, axis=1, keepdims=True)
    directions = view_directions(look, up_dir)
    origins = np.repeat(eyes, directions.shape[1], axis=0)
    directions = directions.reshape(-1, 3)
    seen = probe.trace(origins, directions)
    points = (origins + directions * (seen.distance * (1 - 1e-3))[:, None])[seen.hit]
    return np.asarray(points[:: max(1, len(points) // LIT_POINTS)])
