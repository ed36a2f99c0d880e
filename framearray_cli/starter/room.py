"""Places inside of a scene: the places of a room, its floor and its height.

A point is inside where most rays around it meet surfaces from their front: from inside a wall, a cupboard or a teapot
one sees the backs of things, and next to a thing on a lawn there is sky.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from .rays import Probe, directions_around, level_directions, points_in

POINTS, AROUND = 3000, 64
ROUNDS, ENOUGH, TRIM = 3, 1500, 2  # further rounds of points, until there are enough inside; per cent left out per side
# A point is inside if at least these shares of its rays hit, and of those that hit, hit a front.
ENCLOSED, FRONTS = 0.7, 0.75
# A point that sees this share of fronts, and less than FRONTS, is among surfaces that face both ways. They are turned
# if at least that share of the bounds is: a flat with inverted walls has 88 %, other scenes that were tried up to 13 %.
MIXED, LEAST_MIXED = 0.2, 0.3
MOST = 1600  # points kept, since every one is compared with every other
UNDER_SKY = 0.55  # instead of ENCLOSED in a place that has no roof
ROOFED = 0.3  # least share of the points inside that have something above them, in a place with a roof
# Least share of points in the bounds of a room that are inside. Rooms that were tried have 5 % (a house in a garden
# of 80 m) to 83 %; things seen from outside have none.
LEAST_INSIDE = 0.02
EYE_METRES, ROOM_METRES = 1.5, (1.9, 12.0)  # height of an eye, in rooms in which one can stand
EYE_SHARE = 0.55  # of the height of any other room
CLEAR = 0.12  # of the height of a room: least distance of an eye from anything; 0.3 m at 2.5 m
STEPS = 8  # points of a path whose surroundings are checked
# The floor below a place is the lowest surface below a place nearby, unless that is a storey lower: distance over the
# height above the surface below it, and largest and least step over the same height.
FLOOR_REACH, STOREY, FURNITURE = 0.5, 0.5, 0.06
HEADROOM = 0.6  # least height of what is above a standing person, over the height of the room; not below a table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Room:
    """Places inside, in centred coordinates.

    Attributes:
        up: number of the up axis.
        places: (n, 3).
        floor, ceiling: (n,) height of the floor below and of the surface above each place; inf under the sky.
        stands: (n,) True if a person there stands on the floor, and not on a table.
        height: of the room, median; in a place under the sky, the distance of what is around.
        roofless: True if it is a place under the sky, such as a street.
    """

    up: int
    places: Float64
    floor: Float64
    ceiling: Float64
    stands: NDArray[np.bool_]
    height: float
    roofless: bool = False

    @property
    def up_dir(self) -> Float64:
        """Unit vector, (3,)."""
        return np.asarray(np.eye(3)[self.up])

    @property
    def enclosed(self) -> float:
        """Least share of rays around a point inside that hit."""
        return UNDER_SKY if self.roofless else ENCLOSED

    def at_share(self, share: float) -> Float64:
        """The places, moved up or down to a share of the height."""
        moved = self.places.copy()
        tall = np.where(np.isfinite(self.ceiling), self.ceiling - self.floor, self.height)
        moved[:, self.up] = self.floor + share * tall
        return moved

    def eye_places(self, metre: float | None) -> Float64:
        """Places for an eye.

        Args:
            metre: its length in scene units; None if it is not known.
        """
        low, high = ROOM_METRES
        tall = self.ceiling - self.floor
        found = self.at_share(EYE_SHARE)
        if metre is not None:
            fits = (tall >= low * metre) & ((tall <= high * metre) | self.roofless)
            found[fits, self.up] = self.floor[fits] + EYE_METRES * metre
        return found[self.stands] if self.stands.any() else found


def find_room(probe: Probe, up: int) -> tuple[Room | None, float]:
    """Find a room; also return the share of the bounds that is inside.

    Args:
        up: number of the up axis.
    """
    low, high = bounds(probe)
    places = points_in(low, high, POINTS)
    inside, _ = surroundings(probe, places)
    share = float(inside.mean())
    if share < LEAST_INSIDE:
        return None, share
    found = places[inside]
    for _ in range(ROUNDS):  # so that a house in a wide garden gets enough points
        if len(found) >= ENOUGH:
            break
        low, high = np.percentile(found, [TRIM, 100 - TRIM], axis=0)
        places = points_in(low, high, POINTS)
        inside, _ = surroundings(probe, places)
        found = np.concatenate([found, places[inside]])
    return _room_of(probe, up, found[:: -(-len(found) // MOST)]), share


def turn_to_rooms(probe: Probe, share: float) -> Probe | None:
    """Turn the surfaces of rooms whose walls, floors and ceilings face both ways.

    The front of each is then the side that most rays of enclosed places meet.

    Args:
        share: of the bounds that is inside by the fronts of the file.

    Returns:
        None unless a good part of the bounds, and more than `share`, is among surfaces that face both ways.
    """
    places = points_in(*bounds(probe), POINTS)
    seen = probe.trace(np.repeat(places, AROUND, axis=0), np.tile(directions_around(AROUND), (POINTS, 1)))
    hit, front = seen.hit.reshape(POINTS, AROUND), seen.front.reshape(POINTS, AROUND)
    fronts = front.sum(axis=1) / np.maximum(hit.sum(axis=1), 1)
    mixed = (hit.mean(axis=1) >= ENCLOSED) & (fronts >= MIXED) & (fronts < FRONTS)
    if mixed.mean() <= max(share, LEAST_MIXED):
        return None
    counts = np.repeat(mixed, AROUND) & seen.hit
    votes = np.where(seen.front[counts], 1, -1)
    n = len(probe.scene.corners)
    return replace(probe, turned=np.bincount(seen.triangle[counts], weights=votes, minlength=n) < 0)


def _room_of(probe: Probe, up: int, places: Float64) -> Room | None:
    """The room of some points inside; None where nothing is below them."""
    axis = np.eye(3)[up]
    below, above = (probe.trace(places, way) for way in (-axis, axis))
    roofless = bool((above.hit & below.hit).sum() < ROOFED * below.hit.sum())
    kept = below.hit & (above.hit | roofless)
    if not kept.any():
        return None
    places, below_by, above_by = places[kept], below.distance[kept], above.distance[kept]
    level = places[:, up]
    under, ceiling = level - below_by, level + above_by
    floor, stands = _find_floor(places, under, ceiling, up)
    height = float(np.median(ceiling - floor))
    stands &= ceiling - floor >= HEADROOM * height
    if roofless:
        height = _width(probe, places, up)
    return Room(up=up, places=places, floor=floor, ceiling=ceiling, stands=stands, height=height, roofless=roofless)


def _find_floor(places: Float64, under: Float64, ceiling: Float64, up: int) -> tuple[Float64, NDArray[np.bool_]]:
    """Find the floor (n,) below each place, which may be lower than the table below it, and where it is not."""
    level = np.delete(places, up, axis=1)
    size = float(np.median(np.minimum(ceiling, places[:, up].max()) - under))
    floor = under.copy()
    for first in range(0, len(places), 500):
        part = slice(first, first + 500)
        near = ((level[part, None] - level[None]) ** 2).sum(axis=2) <= (FLOOR_REACH * size) ** 2
        lower = under[part, None] - under[None]
        near &= (lower > 0) & (lower < STOREY * size)
        near &= ceiling[None] >= places[part, up, None]  # not below the floor, or below the table
        floor[part] = np.minimum(under[part], np.where(near, under[None], np.inf).min(axis=1))
    return floor, under - floor <= FURNITURE * size


def _width(probe: Probe, places: Float64, up: int) -> float:
    """Median distance of what is around some places at their own height."""
    some = places[:: max(1, len(places) // 200)]
    ways = level_directions(16, up)
    seen = probe.trace(np.repeat(some, 16, axis=0), np.tile(ways, (len(some), 1)))
    return float(np.median(seen.distance[seen.hit])) if seen.hit.any() else float(np.ptp(places))


def bounds(probe: Probe) -> tuple[Float64, Float64]:
    """Least and largest coordinates of the scene, (3,) each."""
    corners = probe.scene.corners.reshape(-1, 3)
    low, high = (np.array([f(corners[:, axis]) for axis in range(3)], dtype=np.float64) for f in (np.min, np.max))
    return low, high


def surroundings(probe: Probe, places: Float64, enclosed: float = ENCLOSED) -> tuple[NDArray[np.bool_], Float64]:
    """(n,) True if each place is inside, and (n,) distance of the nearest thing."""
    n = len(places)
    around = directions_around(AROUND)
    seen = probe.trace(np.repeat(places, AROUND, axis=0), np.tile(around, (n, 1)))
    hit, front = seen.hit.reshape(n, AROUND), seen.front.reshape(n, AROUND)
    good = (hit.mean(axis=1) >= enclosed) & (front.sum(axis=1) >= FRONTS * hit.sum(axis=1))
    return good, seen.distance.reshape(n, AROUND).min(axis=1)


def free_ways(probe: Probe, room: Room, start: Float64, end: Float64, clear: float) -> NDArray[np.bool_]:
    """(n,) True if a ball of radius `clear` can move straight from start to end, (n, 3) each, and stay inside."""
    n, shares = len(start), np.linspace(0, 1, STEPS)[:, None]
    ways = start[:, None] + (end - start)[:, None] * shares
    inside, nearest = surroundings(probe, ways.reshape(-1, 3), room.enclosed)
    good = (inside & (nearest >= clear)).reshape(n, STEPS).all(axis=1)
    return np.asarray(good & ~probe.blocked(start, end))


def select_clear(probe: Probe, room: Room, places: Float64, clear: float, most: int) -> Float64:
    """Select at most `most` places that are inside and `clear` of everything, or half or a quarter of it if none is."""
    inside, nearest = surroundings(probe, places, room.enclosed)
    for least in (clear, clear / 2, clear / 4):
        good = places[inside & (nearest >= least)]
        if len(good):
            return good[:: -(-len(good) // most)]
    return places[:0]
