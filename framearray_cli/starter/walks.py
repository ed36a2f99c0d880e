"""Paths that the starter chooses from several by a judgement of their pictures.

In a room or along a street: a short walk for the eye, and a path for a lamp. Around a thing: an orbit for the eye that
shows the thing without the ground that it is on, and a sun that passes over.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Flags, Float32, Float64, box_of
from framearray_cli.scene.paths.curves import unit

from .probe import Probe, directions_around, level_directions, normals
from .site import CLEAR, SOME_DAY, Room, free_paths, open_share, select_clear

COLUMNS, ROWS = 16, 12  # rays per view
ROOM_FOV_DEG, ASPECT = 60.0, 4 / 3
NEAR = 0.3  # over the size of the place: a nearer thing fills the picture
AT_BORDER = 0.8  # over the size: what is nearer and at the border of the picture is cut off
FAR = 8.0  # over the same size: greater distances count as this one
SLICE = 0.2  # over the size: surfaces that face the same way and lie farther apart count as different ones
SHELL = 0.04  # share of all that is seen from anywhere: a larger surface is a wall, a floor or a ceiling
HALVES, DEPTH = 0.5, 1.2  # weights, over the variety of the whole picture, of its halves' variety and of its depth
# What a view gains: for content, the share of rays that see something else than the shell, up to MUCH; for edges
# between what neighbouring rays see, up to MANY of them; for a window or a gap that shows some sky.
CONTENT, MUCH, EDGES, MANY, SKY, SOME_SKY = 3.0, 0.5, 1.5, 0.35, 0.15, (0.01, 0.15)
# Penalties for the shares of rays that see nothing beyond some sky, that see the back of a surface, that end near the
# eye, and of rays at the border that end on something near: a wall, or a thing that is cut off. A view of ten different
# things at equal shares has a variety of 2.3; a fifth of a picture spoils about half of that.
EMPTY, BACKWARDS, CLOSE, CUT, CUT_THING = 4.0, 6.0, 6.0, 1.0, 1.5
_LEFT_RIGHT_BOTTOM = np.zeros((ROWS, COLUMNS), bool)
_LEFT_RIGHT_BOTTOM[:, [0, -1]] = _LEFT_RIGHT_BOTTOM[-1] = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TracedViews:
    """Surfaces that the rays of n views meet.

    Attributes:
        label: (n, rays) number of the surface: its material, the way it faces and where it lies; -1 for none.
        distance: (n, rays) inf for none.
        back: (n, rays) True if a ray meets the back of a surface.
    """

    label: NDArray[np.int64]
    distance: Float64
    back: Flags


def view_directions(look_dir: Float64, up_dir: Float64, fov_deg: float = ROOM_FOV_DEG) -> Float64:
    """(n, rows * columns, 3) directions through the pictures of n views, not of unit length.

    Args:
        look_dir: (n, 3) unit, none of them along up.
    """
    right = unit(np.cross(look_dir, up_dir))
    above = np.cross(right, look_dir)
    tall = np.tan(np.radians(fov_deg) / 2)
    x = (2 * (np.arange(COLUMNS) + 0.5) / COLUMNS - 1) * tall * ASPECT
    y = (1 - 2 * (np.arange(ROWS) + 0.5) / ROWS) * tall
    a, b = (part.reshape(-1)[None, :, None] for part in np.meshgrid(x, y))
    return np.asarray(look_dir[:, None] + a * right[:, None] + b * above[:, None])


def trace_views(
    probe: Probe, eye: Float64, look_dir: Float64, up_dir: Float64, size: float, fov_deg: float = ROOM_FOV_DEG
) -> TracedViews:
    """Trace the rays of n views.

    Args:
        eye, look_dir: (n, 3).
        size: of the place, such as the height of the room.
    """
    n, rays = len(eye), COLUMNS * ROWS
    directions = view_directions(look_dir, up_dir, fov_deg).reshape(-1, 3)
    origins = np.repeat(eye, rays, axis=0)
    seen = probe.trace(origins, directions)
    distance = np.where(seen.hit, seen.distance * np.linalg.norm(directions, axis=1), np.inf)
    normal = probe.normals(seen.triangle)
    axis = np.abs(normal).argmax(axis=1)[:, None]
    facing = 2 * axis[:, 0] + (np.take_along_axis(normal, axis, axis=1)[:, 0] > 0)
    along = np.take_along_axis(origins, axis, axis=1)[:, 0]
    along = along + np.take_along_axis(directions, axis, axis=1)[:, 0] * np.where(seen.hit, seen.distance, 0.0)
    place = np.floor(along / (SLICE * size) + 0.37).astype(np.int64) % 1000  # 0.37: planes at 0 are in one slice
    label = np.where(seen.hit, (6 * probe.scene.material[seen.triangle] + facing) * 1000 + place, -1)
    back = seen.hit & ~seen.front
    return TracedViews(label=label.reshape(n, rays), distance=distance.reshape(n, rays), back=back.reshape(n, rays))


def find_shell(views: TracedViews) -> NDArray[np.int64]:
    """Find the labels of the surfaces that fill most of all views together: walls, floors and ceilings."""
    labels, counts = np.unique(views.label[views.label >= 0], return_counts=True)
    return np.asarray(labels[counts > SHELL * max(counts.sum(), 1)])


def judge_views(views: TracedViews, shell: NDArray[np.int64], size: float) -> Float64:
    """Judge n views: (n,) how much each shows.

    A view is worth the variety of what is in it (the entropy of its surfaces), its depth (mean logarithm of the
    distance over the size), its content beyond bare walls, and its edges; it loses for what spoils pictures.

    Args:
        shell: labels of walls, floors and ceilings.
        size: of the place, such as the height of the room.
    """
    hit = views.label >= 0
    sky = 1 - hit.mean(axis=1)
    distance = np.log(np.clip(np.where(hit, views.distance, size) / size, 0.1, FAR))
    depth = distance.sum(axis=1) / np.maximum(hit.sum(axis=1), 1)
    thing = hit & ~np.isin(views.label, shell)
    content = thing.mean(axis=1)
    worth = (1 - HALVES) * entropy(views.label) + HALVES * _variety_of_halves(views.label) + DEPTH * depth
    worth += CONTENT * np.minimum(content, MUCH) + EDGES * np.minimum(edge_share(views.label), MANY)
    worth += SKY * ((sky >= SOME_SKY[0]) & (sky <= SOME_SKY[1]))
    worth -= EMPTY * np.maximum(sky - SOME_SKY[1], 0) + BACKWARDS * views.back.mean(axis=1)
    worth -= CLOSE * (views.distance < NEAR * size).mean(axis=1)
    border = _LEFT_RIGHT_BOTTOM.reshape(-1)
    near = (views.distance < AT_BORDER * size)[:, border]
    worth -= CUT * near.mean(axis=1) + CUT_THING * (near & thing[:, border]).mean(axis=1)
    return np.asarray(worth)


def judge_shapes(views: TracedViews) -> Float64:
    """Judge n views of a whole thing before the sky: (n,) the variety of its surfaces, and of its outline."""
    worth = entropy(views.label) + EDGES * np.minimum(edge_share(views.label), MANY)
    return np.asarray(worth - BACKWARDS * views.back.mean(axis=1))


def _variety_of_halves(label: NDArray[np.int64]) -> Float64:
    """(n,) mean entropy of the left and the right half: one that shows a bare wall costs half of it."""
    grid = label.reshape(len(label), ROWS, 2, COLUMNS // 2)
    left, right = (entropy(grid[:, :, half].reshape(len(label), -1)) for half in (0, 1))
    return np.asarray((left + right) / 2)


def edge_share(label: NDArray[np.int64]) -> Float64:
    """(n,) share of neighbouring rays, across and down, that meet different surfaces."""
    grid = label.reshape(len(label), ROWS, COLUMNS)
    across, down = grid[:, :, 1:] != grid[:, :, :-1], grid[:, 1:] != grid[:, :-1]
    return np.asarray((across.mean(axis=(1, 2)) + down.mean(axis=(1, 2))) / 2)


def entropy(label: NDArray[np.int64]) -> Float64:
    """(n,) entropy of the labels of each row."""
    ordered = np.sort(label, axis=1)
    n, rays = ordered.shape
    starts = np.ones((n, rays), bool)
    starts[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    first = np.flatnonzero(starts)
    share = np.diff(np.append(first, n * rays)) / rays
    return np.asarray(np.bincount(first // rays, weights=-share * np.log(share), minlength=n), np.float64)


ORBIT_FOV_DEG = 40.0  # longer than a room's: a thing seen from some way off is not distorted
# Elevations of the eye to choose from, and of one that looks down into a vessel.
ABOVE_DEG, INTO_DEG = (12.0, 22.0), (35.0,)
ARC_DEG, KEYS = 90.0, 7  # the largest number of keys: 15 degrees apart, the path leaves the circle by a thousandth
FILLED = 0.88  # largest share of the picture's height or width that the thing covers
SIDES = 16  # arcs to choose from
FRONT_BONUS = 0.12  # added to the worth of the front; the back loses as much
SUNNY = 0.8  # least cosine of the angle between the middle of an arc and the noon sun, seen from above
ARC_WEIGHTS = np.array([0.5, 0.3, 0.2])  # of its first, middle and last picture: people see the first one first
SUN_ARC_DEG, SUN_DEG, SUN_KEYS = 110.0, (35.0, 60.0), 5  # from left to right; elevation at the ends and at noon

# Directions in each of which the outermost corner is kept: what lies beyond is a hundredth of a picture.
OUTLINE_DIRECTIONS = 1200
CORNERS_TOGETHER = 1024  # corners at once
LEVELS = 400  # of the height, in which the ground is searched
GROUND = 0.5  # least share of the footprint that a ground covers
ABOVE = 0.01  # over the height: what is higher than the ground by that stands on it
LOWEST = 0.3  # share of the height below which a ground lies
SMALL = 0.5  # largest footprint of things on a ground over the ground's


def key_frames(n: int, most: int) -> tuple[list[int], Float64]:
    """Frames of at most `most` keys of a path of n frames, and the share of the path at each; of one frame, 0.5."""
    frames = spread_frames(n, most)
    return frames, np.array(frames) / (n - 1) if n > 1 else np.array([0.5])


def spread_frames(n: int, most: int) -> list[int]:
    """At most `most` frames of n, evenly spread from the first to the last."""
    return sorted({round(float(k)) for k in np.linspace(0, n - 1, most)})


def choose_orbit(
    probe: Probe,
    up: int,
    shares: Float64,
    aspect: float = ASPECT,
    *,
    from_above: bool = False,
    to_sun: Float64 | None = None,
) -> tuple[Float64, Float64]:
    """Choose the eyes of an orbit, (n, 3), and their common target (3,), in centred coordinates.

    Every picture shows the whole thing, without the ground on which it stands.

    Args:
        up: number of the up axis.
        shares: (n,) of the arc, 0 to 1.
        aspect: width over height of the pictures.
        from_above: True if to look down into it.
        to_sun: (3,) unit direction to the sun at noon, whose side the eyes keep to; None: no sun was chosen yet.
    """
    points = thing_corners(np.concatenate([probe.scene.corners, probe.scene.pane_corners]), up)
    target = box_of(points).sum(axis=0) / 2
    outline = outline_of(points) - target
    up_dir = np.eye(3)[up]
    size = float(np.linalg.norm(outline, axis=1).max())
    middle = level_directions(SIDES, up)
    above = [(direction, angle) for angle in (INTO_DEG if from_above else ABOVE_DEG) for direction in middle]
    tried = np.array([0.0, 0.5, 1.0])
    directions = np.concatenate([_arc(direction, up_dir, ARC_DEG, tried, high) for direction, high in above])
    far = _fitting_distances(outline, directions, up_dir, aspect)
    views = trace_views(probe, target + directions * far[:, None], -directions, up_dir, size, ORBIT_FOV_DEG)
    worth = judge_shapes(views).reshape(-1, 3)
    front = np.array([FRONT_BONUS * float(direction @ middle[0]) for direction, _ in above])
    if to_sun is not None:
        level = to_sun - to_sun[up] * up_dir
        sides = np.array([direction @ level for direction, _ in above])
        front[sides < SUNNY * np.linalg.norm(level)] = -np.inf
    best, high = above[int((worth @ ARC_WEIGHTS + front).argmax())]
    directions = _arc(best, up_dir, ARC_DEG, shares, high)
    return target + directions * _fitting_distances(outline, directions, up_dir, aspect).max(), target


def sun_directions(to_eye: Float64, up: int, shares: Float64) -> Float64:
    """Directions in which sunlight travels, (n, 3); the sun goes from left to right behind the eye.

    Args:
        to_eye: (3,) from the thing to the eye.
        shares: (n,) of the arc, 0 to 1.
    """
    up_dir = np.eye(3)[up]
    level = to_eye - (to_eye @ up_dir) * up_dir
    size = np.linalg.norm(level)
    level = level / size if size > 0 else level_directions(1, up)[0]
    low, high = SUN_DEG
    return -_arc(level, up_dir, SUN_ARC_DEG, shares, low + (high - low) * np.sin(np.pi * shares))


def _arc(middle: Float64, up_dir: Float64, arc_deg: float, shares: Float64, above_deg: float | Float64) -> Float64:
    """(n, 3) directions at shares of an arc about the up axis with a level middle, raised above the horizon."""
    turn, above = np.radians(arc_deg * (shares[:, None] - 0.5)), np.radians(np.reshape(above_deg, (-1, 1)))
    level = np.cos(turn) * middle + np.sin(turn) * np.cross(up_dir, middle)
    return np.asarray(np.cos(above) * level + np.sin(above) * up_dir)


def _fitting_distances(outline: Float64, directions: Float64, up_dir: Float64, aspect: float) -> Float64:
    """(n,) distance from which the outline fits into the picture from each of n directions."""
    tall = math.tan(math.radians(ORBIT_FOV_DEG) / 2) * FILLED
    right = unit(np.cross(-directions, up_dir))
    above = np.cross(right, -directions)
    across = np.maximum(np.abs(outline @ right.T) / (tall * aspect), np.abs(outline @ above.T) / tall)
    return np.asarray((across + outline @ directions.T).max(axis=0))


def thing_corners(corners: Float32, up: int) -> Float64:
    """Corners (n, 3) of what stands on a wide, level ground, or all corners.

    Args:
        corners: (triangles, 3, 3).
    """
    points = corners.reshape(-1, 3).astype(np.float64)
    level = _ground_level(corners, up)
    if level is None:
        return points
    tall = points[:, up].max() - level
    above = points[points[:, up] > level + ABOVE * tall]
    if not len(above) or tall <= 0:
        return points
    sides = [axis for axis in range(3) if axis != up]
    whole, part = (np.prod(np.ptp(some[:, sides], axis=0)) for some in (points, above))
    if part > SMALL * whole:
        return points
    feet = above.copy()
    feet[:, up] = level
    return np.concatenate([above, feet])


def _ground_level(corners: Float32, up: int) -> float | None:
    """Height of the level plane that covers most of the footprint; None if none covers half of it."""
    triangles, normal = corners.astype(np.float64), normals(corners) / 2
    level = normal[:, up] > 0.99 * np.linalg.norm(normal, axis=1)
    if not level.any():
        return None
    sides = [axis for axis in range(3) if axis != up]
    low, extent = triangles[..., up].min(), float(np.ptp(triangles[..., up]))
    footprint = float(np.prod([np.ptp(triangles[..., axis]) for axis in sides]))
    heights = triangles[level].mean(axis=1)[:, up]
    step = max(extent, 1e-30) / LEVELS
    area = np.bincount(((heights - low) / step).astype(np.int64), weights=normal[level, up])
    best = int(area.argmax())
    if area[best] < GROUND * footprint or best > LOWEST * LEVELS:
        return None
    return float(heights[((heights - low) / step).astype(np.int64) == best].mean())


def outline_of(points: Float64) -> Float64:
    """The points (n, 3) that lie outermost in any direction.

    Of most parts no point can: the bounds of the part lie nearer than what was found. Corners of neighbouring triangles
    follow each other in files, so these bounds are small.
    """
    directions = directions_around(OUTLINE_DIRECTIONS)
    best, far = np.zeros((OUTLINE_DIRECTIONS, 3)), np.full(OUTLINE_DIRECTIONS, -np.inf)
    few = points[:: -(-len(points) // CORNERS_TOGETHER)]
    for part in (few, *(points[first : first + CORNERS_TOGETHER] for first in range(0, len(points), CORNERS_TOGETHER))):
        low, high = box_of(part)
        tried = np.flatnonzero(np.maximum(directions * low, directions * high).sum(axis=1) > far)
        reach = directions[tried] @ part.T
        at = reach.argmax(axis=1)
        farther = (farthest := reach[np.arange(len(tried)), at]) > far[tried]
        best[tried[farther]], far[tried[farther]] = part[at[farther]], farthest[farther]
    ends = points[np.concatenate([points.argmin(axis=0), points.argmax(axis=0)])]
    return np.asarray(np.unique(np.concatenate([best, ends]), axis=0))


STANDS, TURNS = 250, 12  # places and directions whose views are judged: 576,000 rays
DOWN = 0.12  # tangent of the angle by which eyes look below the horizon
STARTS, PER_EYE = 30, 2  # the number of views from which walks are tried, and of those at one place
DIRECTIONS, LENGTHS = 12, (1.0, 0.6)  # directions and shares of the longest walk that are tried from each
WALK = 0.8  # longest walk, heights of the room; over 24 frames that is 8 cm per frame at 2.5 m
NEARER = 0.45  # longest walk, over the distance of what the eye looks at
FIRST, MIDDLE, LAST, WORST = 0.4, 0.2, 0.2, 0.2  # weights of the views of a walk: people see the first one first
LENGTH_BONUS = 0.4  # for the longest walk; a picture of more
LEVEL = 0.85  # least height of the eye at the end of a walk over that at its start

LAMP_SHARE = 0.75  # of the height of a room
LAMP_CLEAR = 0.15  # over the height: a lamp that is nearer would make a white spot on a wall
LAMPS, LIT_POINTS = 300, 300  # largest numbers of places for a lamp, and of points in the pictures for it to light
TRIED = 20  # ends of its path that are tried at once


def choose_walk(probe: Probe, room: Room, metre: float | None) -> Float64 | None:
    """Choose the walk whose pictures show most; None where no place has room for an eye.

    Args:
        metre: its length in scene units; None if it is not known.

    Returns:
        (2, 2, 3) first and last eye and target of a straight path with a fixed target.
    """
    eyes = select_clear(probe, room, room.eye_places(metre), CLEAR * room.height, STANDS)
    if not len(eyes):
        return None
    eyes = _by_windows(probe, room, eyes)
    looks = unit(level_directions(TURNS, room.up) - DOWN * room.up_dir)
    eye, look = np.repeat(eyes, TURNS, axis=0), np.tile(looks, (len(eyes), 1))
    views = trace_views(probe, eye, look, room.up_dir, room.height)
    shell = find_shell(views)
    value = judge_views(views, shell, room.height)
    best = _best_starts(value, TURNS)
    depth = _middle_distances(views.distance[best], room.height)
    targets = eye[best] + look[best] * np.maximum(depth, 0.5 * room.height)[:, None]
    return _best_walk(probe, room, shell, eye[best], targets, value[best])


def _by_windows(probe: Probe, room: Room, eyes: Float64) -> Float64:
    """Select the eyes (n, 3) in rooms with windows; all if no room has one."""
    if room.roofless:
        return eyes
    outside = open_share(probe, eyes)
    some = outside > min(SOME_DAY, outside.max() / 2)
    return eyes[some] if some.any() else eyes


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


def _middle_distances(distance: Float64, size: float) -> Float64:
    """(n,) median distance of what each view sees."""
    hit = np.isfinite(distance)
    return np.array([np.median(row[h]) if h.any() else FAR * size for row, h in zip(distance, hit, strict=True)])


def _best_walk(
    probe: Probe, room: Room, shell: NDArray[np.int64], eyes: Float64, targets: Float64, value: Float64
) -> Float64:
    """Choose the best of the free walks from some views, whose targets stay; see `choose_walk`."""
    directions = np.repeat(level_directions(DIRECTIONS, room.up), len(LENGTHS), axis=0)
    shares = np.tile(LENGTHS, DIRECTIONS)
    n = len(directions)
    longest = np.minimum(WALK * room.height, NEARER * np.linalg.norm(targets - eyes, axis=1))
    start, target, first = (np.repeat(values, n, axis=0) for values in (eyes, targets, value))
    share = np.tile(shares, len(eyes))
    end = start + np.tile(directions, (len(eyes), 1)) * (np.repeat(longest, n) * share)[:, None]
    below, later = (probe.trace(spot, -room.up_dir).distance for spot in (start, end))
    level = later >= LEVEL * below  # the floor does not rise: no table is in the way
    free = free_paths(probe, room, start, end, CLEAR * room.height) & level
    if not free.any():
        best = int(value.argmax())
        return np.array([[eyes[best], targets[best]]] * 2)
    start, end, target, first, share = (values[free] for values in (start, end, target, first, share))
    seen = (
        trace_views(probe, spot, unit(target - spot), room.up_dir, room.height) for spot in ((start + end) / 2, end)
    )
    middle, last = (judge_views(views, shell, room.height) for views in seen)
    worst = np.minimum(np.minimum(first, middle), last)
    worth = FIRST * first + MIDDLE * middle + LAST * last + WORST * worst + LENGTH_BONUS * share
    best = int(worth.argmax())
    return np.array([[start[best], target[best]], [end[best], target[best]]])


def choose_lamp_path(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> Float64 | None:
    """Choose the start and end of a lamp's path, (2, 3), that light what the eyes see; None where no place has room.

    Args:
        eyes, targets: (n, 3) of the views to light.
    """
    spots = select_clear(probe, room, room.at_share(LAMP_SHARE), LAMP_CLEAR * room.height, LAMPS)
    directions = view_directions(unit(targets - eyes), room.up_dir)
    _, points = probe.points(np.repeat(eyes, directions.shape[1], axis=0), directions.reshape(-1, 3))
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
        free = free_paths(probe, room, np.tile(start, (len(some), 1)), spots[some], LAMP_CLEAR * room.height / 2)
        if free.any():
            return np.array([start, spots[some[int(free.argmax())]]])
    return np.array([start, start])
