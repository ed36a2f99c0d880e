"""Is a scene a room to be inside of? Where one can stand in it, a short walk, and a way for a lamp.

A point is inside where most rays around it meet surfaces from their front: from within a wall, a cupboard or a teapot
one sees the backs of things, and beside a thing on a lawn there is sky.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from .rays import Probe
from .sample import directions_around, level_directions, points_in
from .views import view_directions, view_worth

POINTS, AROUND = 3000, 64
ENCLOSED, FRONTS = 0.7, 0.75  # shares of the rays around a point that is inside
# Least share of points of the bounds that are inside, for a room. Rooms that were tried have 5 % (a house in a garden
# of 80 m) to 83 %; things to be looked at have none.
LEAST_INSIDE = 0.02
EYE_METRES, ROOM_METRES = 1.6, (2.0, 12.0)  # height of an eye, in rooms that can be meant in metres
EYE_SHARE = 0.55  # of the height of any other room
LAMP_SHARE = 0.75  # of the height of a room
CLEAR = 0.12  # of the height of a room: least distance of an eye from anything; 0.3 m at 2.5 m
LAMP_CLEAR = 0.15  # the same for a lamp, which would burn a white spot into a wall
STANDS, TURNS = 250, 12  # places and directions whose views are judged
DOWN = 0.1  # tangent of the angle that eyes look below the horizon
WALK = 0.8  # heights of the room, the longest walk; 24 frames of it are 8 cm each at 2.5 m
STEPS = 8  # places of a way whose surroundings are looked at
OPEN_SIDE = (0.5, 0.7, 0.9)  # heights of the room, from a side of the bounds: eyes that may look in through it
OPEN_BONUS = 0.2  # variety by which such a view must show more than any from inside
LAMPS, LIT = 300, 300  # places for a lamp, and points of the pictures that it should light


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Room:
    """Places inside, in centred coordinates.

    Attributes:
        up: number of the up axis.
        floor, ceiling: (n,) height of what is below and above each of the places.
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
        """The places, moved up or down to a share of the height, or to so many metres where that fits."""
        low, high = ROOM_METRES
        tall = self.ceiling - self.floor
        moved = self.places.copy()
        fits = (tall >= low) & (tall <= high) & (metres is not None)
        moved[:, self.up] = self.floor + np.where(fits, metres or 0.0, share * tall)
        return moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Walk:
    """A straight way of the eye with its eyes on one thing: (2, 3) eyes, and the target (3,)."""

    eyes: Float64
    target: Float64


def find_room(probe: Probe, up: int) -> tuple[Room | None, float]:
    """Look for a room; also tell the share of the bounds that is inside.

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
    again = points_in(first.min(axis=0), first.max(axis=0), POINTS)  # a house in a garden gets its points, too
    inside, _ = surroundings(probe, again)
    places = np.concatenate([first, again[inside]])
    axis = np.eye(3)[up]
    below, above = (probe.first_hits(places, way) for way in (-axis, axis))
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
    seen = probe.first_hits(np.repeat(places, AROUND, axis=0), np.tile(around, (n, 1)))
    hit, front = seen.hit.reshape(n, AROUND), seen.front.reshape(n, AROUND)
    good = (hit.mean(axis=1) >= ENCLOSED) & (front.sum(axis=1) >= FRONTS * hit.sum(axis=1))
    return good, seen.distance.reshape(n, AROUND).min(axis=1)


def walk_through(probe: Probe, room: Room) -> Walk | None:
    """Choose the view that shows most, and a short way to go on from there; None where nowhere is room for an eye."""
    eyes = _clear(probe, room.at_share(EYE_SHARE, EYE_METRES), CLEAR * room.height, STANDS)
    if not len(eyes):
        return None
    level = level_directions(TURNS, room.up)
    looks = level - DOWN * room.up_dir
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    eye, look = np.repeat(eyes, TURNS, axis=0), np.tile(looks, (len(eyes), 1))
    value, depth = view_worth(probe, eye, look, room.up_dir, room.height)
    best = int(value.argmax())
    target = eye[best] + look[best] * max(depth[best], 0.5 * room.height)
    return _through_open_side(probe, room, float(value[best])) or _go_on(probe, room, eye[best], target)


def _through_open_side(probe: Probe, room: Room, least: float) -> Walk | None:
    """A walk before a side that is open, as a doll's house has one; None unless its view shows more than `least`."""
    corners = probe.scene.corners.reshape(-1, 3)
    low, high = (np.array([f(corners[:, axis]) for axis in range(3)], dtype=np.float64) for f in (np.min, np.max))
    middle, half = (low + high) / 2, (high - low) / 2
    ways = np.repeat(level_directions(4, room.up), len(OPEN_SIDE), axis=0)
    away = np.abs(ways @ half) + np.tile(OPEN_SIDE, 4) * room.height
    eyes = middle + ways * away[:, None]
    value, _ = view_worth(probe, eyes, -ways, room.up_dir, room.height)
    best = int(value.argmax())
    if value[best] <= least + OPEN_BONUS:
        return None
    aside = np.cross(room.up_dir, ways[best]) * 0.25 * room.height
    return Walk(eyes=np.array([eyes[best] - aside, eyes[best] + aside]), target=middle)


def _go_on(probe: Probe, room: Room, eye: Float64, target: Float64) -> Walk:
    """Choose the end of the walk: the free way whose last view, of the same target, shows most."""
    ends, lengths = [], []
    longest = min(WALK * room.height, 0.45 * float(np.linalg.norm(target - eye)))
    for way in level_directions(16, room.up):
        for share in (1.0, 0.6):
            end = eye + way * longest * share
            if _free(probe, eye, end, CLEAR * room.height):
                ends.append(end)
                lengths.append(share)
    if not ends:
        return Walk(eyes=np.array([eye, eye]), target=target)
    look = target - np.array(ends)
    value, _ = view_worth(
        probe, np.array(ends), look / np.linalg.norm(look, axis=1, keepdims=True), room.up_dir, room.height
    )
    best = int((value + np.array(lengths)).argmax())
    return Walk(eyes=np.array([eye, ends[best]]), target=target)


def _free(probe: Probe, start: Float64, end: Float64, clear: float) -> bool:
    """Whether a thing of that radius could go straight from start to end, all the way inside."""
    way = start + (end - start) * np.linspace(0, 1, STEPS)[:, None]
    inside, nearest = surroundings(probe, way)
    return bool(inside.all() and (nearest >= clear).all() and not probe.blocked(start, end).any())


def _clear(probe: Probe, places: Float64, clear: float, most: int) -> Float64:
    """Those of the places that are inside and far enough from everything, at most so many; nearer ones if need be."""
    inside, nearest = surroundings(probe, places)
    for least in (clear, clear / 2, clear / 4):
        good = places[inside & (nearest >= least)]
        if len(good):
            return good[:: -(-len(good) // most)]
    return places[:0]


def lamp_way(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> Float64 | None:
    """Choose where a lamp starts and ends, (2, 3), so that it lights what the eyes see; None where nowhere is room.

    Args:
        eyes, targets: (n, 3) of the views that are to be lit.
    """
    spots = _clear(probe, room.at_share(LAMP_SHARE), LAMP_CLEAR * room.height, LAMPS)
    points = _seen_points(probe, eyes, targets, room.up_dir)
    if not len(spots) or not len(points):
        return None
    lit = ~probe.blocked(np.repeat(spots, len(points), axis=0), np.tile(points, (len(spots), 1)))
    lit = lit.reshape(len(spots), -1)
    reach = np.linalg.norm(spots[:, None] - points[None], axis=2)
    # a lamp far from what it should light lights it evenly, but then it is another room that it lights most
    value = (lit / (1 + (reach / (2 * room.height)) ** 2)).mean(axis=1)
    first = int(value.argmax())
    start = spots[first]
    apart = np.linalg.norm(spots - start, axis=1)
    # squared: the end of the way must light the pictures, too, and how long the way is counts less
    for other in np.argsort(-(value**2) * np.minimum(apart / room.height, 1.0)):
        if apart[other] > 0 and _free(probe, start, spots[other], LAMP_CLEAR * room.height / 2):
            return np.array([start, spots[other]])
    return np.array([start, start])


def _seen_points(probe: Probe, eyes: Float64, targets: Float64, up_dir: Float64) -> Float64:
    """Points of surfaces that the views show, (n, 3), a little before them."""
    look = targets - eyes
    look = look / np.linalg.norm(look, axis=1, keepdims=True)
    directions = view_directions(look, up_dir)
    origins = np.repeat(eyes, directions.shape[1], axis=0)
    directions = directions.reshape(-1, 3)
    seen = probe.first_hits(origins, directions)
    points = (origins + directions * (seen.distance * (1 - 1e-3))[:, None])[seen.hit]
    return np.asarray(points[:: max(1, len(points) // LIT)])
