"""Explore a scene: its up axis, its kind (room, street, thing or vessel), its unit of length, and places inside of it.

A point is inside where most rays around it meet surfaces from their front: from inside a wall, a cupboard or a teapot
one sees the backs of things, and next to a thing on a lawn there is sky.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Flags, Float64, box_of
from framearray_cli.base.errors import JobError, SceneError
from framearray_cli.base.forms.words import shown
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.job.job import Z_UP_FORMATS
from framearray_cli.scene.files import Stage
from framearray_cli.scene.files.model import join_names
from framearray_cli.scene.scene import Scene

from .draft import StartOptions, Up
from .probe import Probe, directions_around, level_directions, points_in

POINTS, AROUND = 3000, 64
ROUNDS, ENOUGH, TRIM = 3, 1500, 2  # further rounds of points, until there are enough inside; per cent left out per side
# A point is inside if at least these shares of its rays hit, and of those that hit, hit a front.
ENCLOSED, FRONTS = 0.7, 0.75
MOST = 1600  # points kept, since every one is compared with every other
UNDER_SKY = 0.55  # instead of ENCLOSED in a place that has no roof
ROOFED = 0.3  # least share of the points inside that have something above them, in a place with a roof
# Least share of points in the bounds of a room that are inside. Rooms that were tried have 5 % (a house in a garden
# of 80 m) to 83 %; things seen from outside have none.
LEAST_INSIDE = 0.02
EYE_METRES, UPRIGHT_METRES = 1.5, (1.9, 12.0)  # height of an eye, in rooms in which one can stand
EYE_SHARE = 0.55  # of the height of any other room
MOST_ROOMS = 40  # names in a message
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
    stands: Flags
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
        """Places for an eye; `metre`: its length in scene units, None if it is not known."""
        low, high = UPRIGHT_METRES
        tall = self.ceiling - self.floor
        found = self.at_share(EYE_SHARE)
        if metre is not None:
            fits = (tall >= low * metre) & ((tall <= high * metre) | self.roofless)
            found[fits, self.up] = self.floor[fits] + EYE_METRES * metre
        return found[self.stands] if self.stands.any() else found


def find_room(probe: Probe, up: int, box: Float64 | None = None) -> tuple[Room | None, float]:
    """Find a room; also return the share of the bounds that is inside.

    Args:
        up: number of the up axis.
        box: (2, 3) bounds of the room or storey, if they are known, in centred coordinates.
    """

    def points_inside(low: Float64, high: Float64) -> Float64:
        places = points_in(low, high, POINTS)
        return places[surroundings(probe, places)[0]]

    found = points_inside(*(bounds(probe) if box is None else box))
    share = len(found) / POINTS
    if share < LEAST_INSIDE:
        return None, share
    for _ in range(ROUNDS):  # so that a house in a wide garden gets enough points
        if len(found) < ENOUGH:
            low, high = np.percentile(found, [TRIM, 100 - TRIM], axis=0)
            found = np.concatenate([found, points_inside(low, high)])
    return _room_of(probe, up, found[:: -(-len(found) // MOST)], None if box is None else float(box[0, up])), share


def _room_of(probe: Probe, up: int, places: Float64, level: float | None) -> Room | None:
    """The room of some points inside; None where nothing is below them, or no floor is near a level."""
    axis = np.eye(3)[up]
    below, above = (probe.trace(places, direction) for direction in (-axis, axis))
    roofless = bool((above.hit & below.hit).sum() < ROOFED * below.hit.sum())
    kept = below.hit & (above.hit | roofless)
    if not kept.any():
        return None
    places, below_by, above_by = places[kept], below.distance[kept], above.distance[kept]
    under, ceiling = places[:, up] - below_by, places[:, up] + above_by
    floor, stands = _find_floor(places, under, ceiling, up)
    height = float(np.median(ceiling - floor))
    if level is not None:  # not the hall below a gallery, or the rooms above
        near = np.abs(floor - level) <= STOREY * height
        if not near.any():
            return None
        places, floor, ceiling, stands = places[near], floor[near], ceiling[near], stands[near]
    stands &= ceiling - floor >= HEADROOM * height
    if roofless:
        height = _width(probe, places, up)
    return Room(up=up, places=places, floor=floor, ceiling=ceiling, stands=stands, height=height, roofless=roofless)


def _find_floor(places: Float64, under: Float64, ceiling: Float64, up: int) -> tuple[Float64, Flags]:
    """Find the floor (n,) below each place, which may be lower than the table below it, and where it is not."""
    level = np.delete(places, up, axis=1)
    size = float(np.median(np.minimum(ceiling, places[:, up].max()) - under))
    near = ((level[:, None] - level[None]) ** 2).sum(axis=2) <= (FLOOR_REACH * size) ** 2
    lower = under[:, None] - under[None]
    near &= (lower > 0) & (lower < STOREY * size)
    near &= ceiling[None] >= places[:, up, None]  # not below the floor, or below the table
    floor = np.minimum(under, np.where(near, under[None], np.inf).min(axis=1))
    return floor, under - floor <= FURNITURE * size


def _width(probe: Probe, places: Float64, up: int) -> float:
    """Median distance of what is around some places at their own height."""
    some = places[:: max(1, len(places) // 200)]
    directions = level_directions(16, up)
    seen = probe.trace(np.repeat(some, 16, axis=0), np.tile(directions, (len(some), 1)))
    return float(np.median(seen.distance[seen.hit])) if seen.hit.any() else float(np.ptp(places))


def bounds(probe: Probe) -> tuple[Float64, Float64]:
    """Least and largest coordinates of the scene, (3,) each."""
    low, high = box_of(probe.scene.corners).astype(np.float64)
    return low, high


def surroundings(probe: Probe, places: Float64, enclosed: float = ENCLOSED) -> tuple[Flags, Float64]:
    """(n,) True if each place is inside, and (n,) distance of the nearest thing."""
    n = len(places)
    around = directions_around(AROUND)
    seen = probe.trace(np.repeat(places, AROUND, axis=0), np.tile(around, (n, 1)))
    hit, front = seen.hit.reshape(n, AROUND), seen.front.reshape(n, AROUND)
    good = (hit.mean(axis=1) >= enclosed) & (front.sum(axis=1) >= FRONTS * hit.sum(axis=1))
    return good, seen.distance.reshape(n, AROUND).min(axis=1)


def free_paths(probe: Probe, room: Room, start: Float64, end: Float64, clear: float) -> Flags:
    """(n,) True if a ball of radius `clear` can move straight from start to end, (n, 3) each, and stay inside."""
    n, shares = len(start), np.linspace(0, 1, STEPS)[:, None]
    spots = start[:, None] + (end - start)[:, None] * shares
    inside, nearest = surroundings(probe, spots.reshape(-1, 3), room.enclosed)
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


MAY_LIE = (".obj", ".off", ".ply", ".stl")  # formats that do not say which axis points up, written with y or z

OUTSIDE_AIMS, OUTSIDE_DIRECTIONS = 64, 64  # points in the bounds, and directions from which they are seen
MODELLED_OUTSIDE = 0.8  # least share of fronts among what is seen from outside; a room without an outside shows backs
INSIDE_POINTS, WALL_POINTS = 60, 120  # of a room, to find out what stands between
# Share of the segments from points inside to its surfaces that something blocks; a room with a table has 0.2.
BARE = 0.05
ROUND = 0.6  # share of the surfaces inside that are level or upright along an axis; a bottle has less
LOOKS, SOME_DAY = 256, 0.004  # directions from a place, and the share of them that leave a room with a window
STANDING_METRES = 1.3  # the roof of a car is lower, and of a crawl space
MOSTLY_INSIDE = 1 / 3  # share of the bounds, in a room of unknown size; parts of machines have less
ONE_ROOM = 0.35  # least share of the pairs of points inside that see each other
STREET = 3.0  # least length of a place under the sky over the height of what stands around
STEP = 0.005  # share of the extent within which corners are at one level
LOWEST = 0.2  # share of the extent in which the floor lies
SUPPORT = 0.2  # least share of the footprint on which a scene stands, or by which one side is better than the other
FLATTER, MORE_FEET = 0.75, 1.5  # a scene lies on its side if its extents and corners differ that much


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A scene and what rays found in it.

    Attributes:
        up: number of the up axis.
        room: where one can be inside; None for a thing.
        metre: its length in scene units; None where nothing tells.
        size: largest extent.
        about: what was found, and why the scene is taken for what it is.
        from_above: True if a thing is best looked into from above.
    """

    probe: Probe
    up: int
    room: Room | None
    metre: float | None
    size: float
    about: tuple[str, ...]
    from_above: bool = False

    @property
    def centre(self) -> Float64:
        """Centre of the scene, (3,): the difference of file coordinates and centred ones."""
        return self.probe.scene.centre


@contextmanager
def explored(scene: Scene, file: Path, options: StartOptions, stage: Stage) -> Iterator[Site]:
    """Explore a scene, and keep it open for more rays.

    Args:
        options: True if it is a room and which axis points up, where the user says so.
        stage: may say which axis points up, and the unit of length.

    Raises:
        SceneError: it should be a room, and has no inside.
        JobError: the file names no such room.
    """
    suffix, inside = file.suffix.lower(), options.inside
    up, about = _find_up(scene, suffix, options.up, stage)
    with EmbreeScene(scene) as embree:
        probe = Probe(scene=scene, embree=embree)
        low, high = bounds(probe)
        metres = stage.metres or (1.0 if suffix in (".glb", ".gltf") else None)
        metre, size = 1 / metres if metres else None, float((high - low).max())
        site = Site(probe=probe, up=up, room=None, metre=metre, size=size, about=tuple(about))
        if inside is False:
            yield replace(site, about=(*about, "It is seen from outside, because of --outside."))
        else:
            yield _find_inside(site, file, inside, _box_of(options.room, stage, scene, file))


def _find_up(scene: Scene, suffix: str, asked: Up | None, stage: Stage) -> tuple[int, list[str]]:
    """Return the number of the up axis, and a reason where one is needed."""
    if asked is not None:
        return (2 if asked == "z" else 1), [f"{asked} is taken for up, as --up asks for."]
    usual = 2 if suffix in Z_UP_FORMATS or stage.up == "z" else 1
    up = _guess_up(scene.corners.reshape(-1, 3).astype(np.float64), usual) if suffix in MAY_LIE else usual
    old, new = "xyz"[usual], "xyz"[up]
    why = f"It lies on its side with {old} upwards, so {new} is taken for up; --up {old} says otherwise."
    return up, [why] if up != usual else []


def _box_of(name: str | None, stage: Stage, scene: Scene, file: Path) -> Float64 | None:
    """The bounds of a room or storey of the file, centred."""
    if name is None:
        return None
    found = stage.room(name) if name else None
    if found is None:
        known = f"one of {join_names([room.name for room in stage.rooms], MOST_ROOMS)}" if stage.rooms else "none"
        what = "a room or storey of the file" if stage.rooms else "a file that names rooms, such as IFC"
        raise JobError(str(file), [f"--room: expected {what}, {known}, got {shown(name)}"])
    return np.asarray(np.clip(found.box - scene.centre, *box_of(scene.corners)))


def _find_inside(site: Site, file: Path, inside: bool | None, box: Float64 | None) -> Site:
    probe, up = site.probe, site.up
    room, share = find_room(probe, up, box)
    if inside:  # perhaps its faces are turned outwards, and only cupboards are closed from their fronts
        turned = replace(probe, turned=True)
        other, more = find_room(turned, up, box)
        if more > share or room is None:
            probe, room, share = turned, other, more
        low = box is not None and room is not None and room.height < STANDING_METRES * (site.metre or 0.0)
        if room is None or low:
            option = "--inside: nothing in it" if box is None else "--room: nothing there"
            raise SceneError(f"{file}: {option} looks like the inside of a room")
    if room is None:
        why = "There is no room in it to be inside of, so it is seen from outside; --inside forces a walk."
        return replace(site, about=(*site.about, why))
    reason = None if inside else reason_for_a_thing(probe, room, share, site.metre)
    if reason is not None:
        return replace(site, about=(*site.about, f"{reason}; --inside says otherwise."), from_above=room.roofless)
    found, taken = ("inside, under the sky", "a street or a yard") if room.roofless else ("inside", "a room")
    why = f"{share:.0%} of its bounds are {found}, so it is taken for {taken}; --outside says otherwise."
    if inside:
        why = "It is taken for a room, as --inside asks for." if box is None else "The eye stands where --room says."
    return replace(site, probe=probe, room=room, about=(*site.about, why))


def reason_for_a_thing(probe: Probe, room: Room, share: float, metre: float | None) -> str | None:
    """Return the reason to treat a scene with an inside as a thing; None if it is a room or a street.

    Args:
        share: of its bounds that is inside.
        metre: its length in scene units; None if it is not known.
    """
    shell, straight = fronts_outside(probe) >= MODELLED_OUTSIDE, straight_share(probe, room) >= ROUND
    bare = shell and blocked_share(probe, room) < BARE
    if bare and room.roofless:
        return "It is open at the top and nothing is in it, so it is taken for a vessel"
    if bare and not straight:
        return "It is round and nothing is in it, so it is taken for a vessel"
    around = shell or not straight  # not the walls of a room, modelled from inside
    if metre is not None and (around or room.roofless) and room.height < STANDING_METRES * metre:
        return "It has no place to stand in, so it counts as a thing"
    if metre is None and around and (share < MOSTLY_INSIDE or bare):
        return "Little is in it, or inside of it, and its unit of length is not known, so it counts as a thing"
    if not shell:
        return None
    if room.roofless:
        low, high = bounds(probe)
        extent = high - low
        level = np.delete(extent, room.up).max()
        return "It has no roof, so one looks into it from outside" if level < STREET * extent[room.up] else None
    if in_view_share(probe, room) < ONE_ROOM:
        return "It has several rooms and an outside, so it is seen from outside"
    if not probe.scene.emission.any() and np.median(open_share(probe, _some_places(room))) < SOME_DAY:
        return "It has an outside and no opening, so it counts as a thing"
    return None


def _some_places(room: Room) -> Float64:
    """About INSIDE_POINTS of the places of a room, (n, 3)."""
    return room.places[:: max(1, len(room.places) // INSIDE_POINTS)]


def open_share(probe: Probe, places: Float64) -> Float64:
    """(n,) share of the directions from each place in which nothing is."""
    rays = np.repeat(places, LOOKS, axis=0), np.tile(directions_around(LOOKS), (len(places), 1))
    return np.asarray(1 - probe.trace(*rays).hit.reshape(-1, LOOKS).mean(axis=1))


def fronts_outside(probe: Probe) -> float:
    """Share of fronts among what is seen from all around the scene."""
    low, high = bounds(probe)
    directions, aims = directions_around(OUTSIDE_DIRECTIONS), points_in(low, high, OUTSIDE_AIMS)
    far = float(np.linalg.norm(high - low))
    directions = np.tile(directions, (OUTSIDE_AIMS, 1))
    seen = probe.trace(np.repeat(aims, OUTSIDE_DIRECTIONS, axis=0) - far * directions, directions)
    return float(seen.front.sum() / max(int(seen.hit.sum()), 1))


def blocked_share(probe: Probe, room: Room) -> float:
    """Share of the segments between points inside and surfaces seen from other points inside that something blocks."""
    places = _some_places(room)
    walls, _ = _surfaces(probe, room, WALL_POINTS)
    if not len(walls):
        return 0.0
    start, end = np.repeat(places, len(walls), axis=0), np.tile(walls, (len(places), 1))
    return float(probe.blocked(start, end).mean())


def in_view_share(probe: Probe, room: Room) -> float:
    """Share of the pairs of points inside that see each other."""
    places = room.places[:: max(1, len(room.places) // WALL_POINTS)]
    return 1 - float(probe.blocked(np.repeat(places, len(places), axis=0), np.tile(places, (len(places), 1))).mean())


def straight_share(probe: Probe, room: Room) -> float:
    """Share of what is seen inside that is a floor, a ceiling or an upright surface along an axis."""
    _, normals = _surfaces(probe, room, 2000)
    if not len(normals):
        return 1.0
    return float((np.abs(normals).max(axis=1) > 0.98 * np.linalg.norm(normals, axis=1)).mean())


def _surfaces(probe: Probe, room: Room, n: int) -> tuple[Float64, Float64]:
    """At most n points slightly in front of surfaces seen from inside, and their normals, (n, 3) each."""
    directions = directions_around(64)
    places = room.places[:: max(1, len(room.places) // max(1, n // 8))]
    origins, directions = np.repeat(places, 8, axis=0), np.resize(directions, (len(places) * 8, 3))
    seen, points = probe.points(origins, directions)
    return points[:n], probe.normals(seen.triangle[seen.hit])[:n]


def _guess_up(corners: Float64, usual: int) -> int:
    """Guess the up axis: the one along which a scene stands on more of its footprint, or else the usual one.

    If both sides are wide enough, z is up where it is flat along z, and many things begin at its bottom there.
    """
    y, z = (_support(corners, up) for up in (1, 2))
    if abs(y - z) > SUPPORT:
        return 1 if y > z else 2
    flat = np.ptp(corners[:, 2]) < FLATTER * np.ptp(corners[:, 1])
    feet = _share_of_feet(corners[:, 2]) > MORE_FEET * _share_of_feet(corners[:, 1])
    return 2 if z > SUPPORT and flat and feet else usual


def _support(corners: Float64, up: int) -> float:
    """Share of the bounds of the footprint that the lowest corners span."""
    level = corners[:, up]
    lowest = corners[level <= level.min() + STEP * np.ptp(level)]
    part, whole = (float(np.prod(np.ptp(np.delete(some, up, axis=1), axis=0))) for some in (lowest, corners))
    return part / whole if whole > 0 else 0.0


def _share_of_feet(level: Float64) -> float:
    """Largest share of the corners that lie at one level near the bottom: feet of tables and walls on the floor."""
    low, extent = float(level.min()), max(float(np.ptp(level)), 1e-30)
    near = level[level <= low + LOWEST * extent]
    return int(np.bincount(((near - low) / (STEP * extent)).astype(np.int64)).max()) / len(level)
