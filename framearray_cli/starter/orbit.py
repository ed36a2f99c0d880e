"""A thing seen from outside: an orbit around it without the ground that it stands on, and a sun that passes over."""

import math

import numpy as np

from framearray_cli.base.arrays import Float32, Float64

from .rays import Probe, directions_around, level_directions, normals
from .views import ASPECT, judge_shapes, trace_views

FOV_DEG = 40.0  # longer than a room's: a thing seen from some way off is not distorted
ABOVE_DEG, INTO_DEG = (
    (12.0, 22.0),
    (35.0,),
)  # elevations of the eye to choose from; of one that looks down into a vessel
ARC_DEG, KEYS = 90.0, 7  # the largest number of keys: 15 degrees apart, the path leaves the circle by a thousandth
FILLED = 0.88  # largest share of the picture's height or width that the thing covers
SIDES = 16  # arcs to choose from
FRONT_BONUS = 0.12  # added to the worth of the front; the back loses as much
ARC_WEIGHTS = np.array([0.5, 0.3, 0.2])  # of its first, middle and last picture: people see the first one first
SUN_ARC_DEG, SUN_DEG, SUN_KEYS = 110.0, (35.0, 60.0), 5  # from left to right; elevation at the ends and at noon

WAYS = 1200  # directions in each of which the outermost corner is kept: what lies beyond is a hundredth of a picture
BATCH = 200_000  # corners at once
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
    probe: Probe, up: int, shares: Float64, aspect: float = ASPECT, *, from_above: bool = False
) -> tuple[Float64, Float64]:
    """Choose the eyes of an orbit, (n, 3), and their common target (3,), in centred coordinates.

    Every picture shows the whole thing, without the ground on which it stands.

    Args:
        up: number of the up axis.
        shares: (n,) of the way around, 0 to 1.
        aspect: width over height of the pictures.
        from_above: True if to look down into it.
    """
    points = thing_corners(probe.scene.corners, up)
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    outline = outline_of(points) - target
    up_dir = np.eye(3)[up]
    size = float(np.linalg.norm(outline, axis=1).max())
    middle = level_directions(SIDES, up)
    above = [(way, angle) for angle in (INTO_DEG if from_above else ABOVE_DEG) for way in middle]
    tried = np.radians(ARC_DEG * (np.array([0.0, 0.5, 1.0]) - 0.5))
    ways = np.stack(
        [_raise_direction(turn_about(way, up_dir, turn), up_dir, high) for way, high in above for turn in tried]
    )
    far = _fitting_distances(outline, ways, up_dir, aspect)
    views = trace_views(probe, target + ways * far[:, None], -ways, up_dir, size, FOV_DEG)
    worth = judge_shapes(views).reshape(-1, 3)
    front = np.array([FRONT_BONUS * float(way @ middle[0]) for way, _ in above])
    best, high = above[int((worth @ ARC_WEIGHTS + front).argmax())]
    arc = np.radians(ARC_DEG * (shares - 0.5))
    ways = np.stack([_raise_direction(turn_about(best, up_dir, angle), up_dir, high) for angle in arc])
    return target + ways * _fitting_distances(outline, ways, up_dir, aspect).max(), target


def sun_directions(to_eye: Float64, up: int, shares: Float64) -> Float64:
    """Directions in which sunlight travels, (n, 3); the sun goes from left to right behind the eye.

    Args:
        to_eye: (3,) from the thing to the eye.
        shares: (n,) of the way over, 0 to 1.
    """
    up_dir = np.eye(3)[up]
    level = to_eye - (to_eye @ up_dir) * up_dir
    size = np.linalg.norm(level)
    level = level / size if size > 0 else level_directions(1, up)[0]
    low, high = SUN_DEG
    return -np.stack(
        [
            _raise_direction(
                turn_about(level, up_dir, math.radians(SUN_ARC_DEG * (share - 0.5))),
                up_dir,
                low + (high - low) * math.sin(math.pi * share),
            )
            for share in shares
        ]
    )


def turn_about(way: Float64, up_dir: Float64, angle: float) -> Float64:
    """Turn a level direction about the up axis by an angle, radians."""
    return np.asarray(math.cos(angle) * way + math.sin(angle) * np.cross(up_dir, way))


def _raise_direction(level: Float64, up_dir: Float64, above_deg: float) -> Float64:
    above = math.radians(above_deg)
    return np.asarray(math.cos(above) * level + math.sin(above) * up_dir)


def _fitting_distances(outline: Float64, ways: Float64, up_dir: Float64, aspect: float) -> Float64:
    """(n,) distance from which the outline fits into the picture from each of n directions."""
    tall = math.tan(math.radians(FOV_DEG) / 2) * FILLED
    needed = []
    for way in ways:
        right = np.cross(-way, up_dir)
        right /= np.linalg.norm(right)
        above = np.cross(right, -way)
        across = np.maximum(np.abs(outline @ right) / (tall * aspect), np.abs(outline @ above) / tall)
        needed.append(float((across + outline @ way).max()))
    return np.array(needed)


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
    """The points (n, 3) that lie outermost in any direction."""
    ways = directions_around(WAYS)
    best, far = np.zeros(WAYS, np.int64), np.full(WAYS, -np.inf)
    points32, ways32 = points.astype(np.float32), ways.T.astype(np.float32)
    for first in range(0, len(points), BATCH):
        reach = points32[first : first + BATCH] @ ways32
        at = reach.argmax(axis=0)
        farthest = reach[at, np.arange(WAYS)]
        farther = farthest > far
        best[farther], far[farther] = at[farther] + first, farthest[farther]
    low, high = points.argmin(axis=0), points.argmax(axis=0)
    return np.asarray(points[np.unique(np.concatenate([best, low, high]))])
