"""What of a scene is the thing to look at, without the ground on which it stands, and the points of its outline."""

import numpy as np

from framearray_cli.base.arrays import Float32, Float64

from .sample import directions_around

WAYS = 1200  # directions in each of which the outermost corner is kept: what lies beyond is a hundredth of a picture
BATCH = 200_000  # corners at once
LEVELS = 400  # of the height, in which the ground is searched
GROUND = 0.5  # least share of the footprint that a ground covers
ABOVE = 0.01  # over the height: what is higher than the ground by that stands on it
LOWEST = 0.3  # share of the height below which a ground lies
SMALL = 0.5  # largest footprint of things on a ground over that of the ground


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
    triangles = corners.astype(np.float64)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
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
