"""Tell a room from a vessel, a car or a street, by whether it is open, what is inside, and whether one can stand."""

import numpy as np

from framearray_cli.base.arrays import Float64

from .rays import Probe
from .room import Room, bounds
from .sample import directions_around, points_in
from .scale import Unit

OUTSIDE_AIMS, OUTSIDE_WAYS = 64, 64  # points in the bounds, and directions from which they are looked at
MODELLED_OUTSIDE = 0.8  # least share of fronts among what is seen from outside; a room without an outside shows backs
INSIDE_POINTS, WALL_POINTS = 60, 120  # of a room, to find out what stands between
BARE = 0.05  # share of the ways from points inside to its surfaces that something blocks; a room with a table has 0.2
ROUND = 0.6  # share of the surfaces inside that are level or upright along an axis; a bottle has less
STANDING_METRES = 1.3  # the roof of a car is lower, and of a crawl space
MOSTLY_INSIDE = 0.4  # share of the bounds; a car, whose wheels and engine are outside, has less
STREET = 3.0  # least length of a place under the sky over the height of what stands around


def reason_for_a_thing(probe: Probe, room: Room, share: float, unit: Unit | None) -> str | None:
    """Say why a scene that has an inside is a thing to look at from outside; None if it is a room or a street.

    Args:
        share: of its bounds that is inside.
    """
    if fronts_outside(probe) < MODELLED_OUTSIDE:
        return None
    bare = blocked_share(probe, room) < BARE
    if room.roofless:
        if bare:
            return "It is open at the top and nothing is in it, so it is taken for a vessel"
        low, high = bounds(probe)
        extent = high - low
        if np.delete(extent, room.up).max() < STREET * extent[room.up]:
            return "It has no roof, so one looks into it from outside"
        return None
    if bare and straight_share(probe, room) < ROUND:
        return "It is round and nothing is in it, so it is taken for a vessel"
    low_roof = unit is None or room.height < STANDING_METRES * unit.metre
    if low_roof and share < MOSTLY_INSIDE:
        return "Nobody can stand in it, so it is taken for a thing"
    return None


def fronts_outside(probe: Probe) -> float:
    """Share of fronts among what is seen from all around the scene."""
    low, high = bounds(probe)
    ways, aims = directions_around(OUTSIDE_WAYS), points_in(low, high, OUTSIDE_AIMS)
    far = float(np.linalg.norm(high - low))
    ways = np.tile(ways, (OUTSIDE_AIMS, 1))
    seen = probe.trace(np.repeat(aims, OUTSIDE_WAYS, axis=0) - far * ways, ways)
    return float(seen.front.sum() / max(int(seen.hit.sum()), 1))


def blocked_share(probe: Probe, room: Room) -> float:
    """Share of the ways between points inside and surfaces seen from other points inside that something blocks."""
    places = room.places[:: max(1, len(room.places) // INSIDE_POINTS)]
    walls, _ = _surfaces(probe, room, WALL_POINTS)
    if not len(walls):
        return 0.0
    start, end = np.repeat(places, len(walls), axis=0), np.tile(walls, (len(places), 1))
    return float(probe.blocked(start, end).mean())


def straight_share(probe: Probe, room: Room) -> float:
    """Share of what is seen inside that is a floor, a ceiling or an upright surface along an axis."""
    _, normals = _surfaces(probe, room, 2000)
    if not len(normals):
        return 1.0
    return float((np.abs(normals).max(axis=1) > 0.98 * np.linalg.norm(normals, axis=1)).mean())


def _surfaces(probe: Probe, room: Room, n: int) -> tuple[Float64, Float64]:
    """At most n points slightly in front of surfaces seen from inside, and their normals, (n, 3) each."""
    ways = directions_around(64)
    places = room.places[:: max(1, len(room.places) // max(1, n // 8))]
    origins, ways = np.repeat(places, 8, axis=0), np.resize(ways, (len(places) * 8, 3))
    seen = probe.trace(origins, ways)
    points = (origins + ways * (seen.distance * (1 - 1e-3))[:, None])[seen.hit]
    return points[:n], probe.normals(seen.triangle[seen.hit])[:n]
