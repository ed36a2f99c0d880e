"""Range of obscurance where a job sets none: half the free height around the cameras, or a share of a thing's size."""

from dataclasses import replace

import numpy as np

from framearray_cli.base.arrays import Corners, Float64
from framearray_cli.base.forms.table import changed
from framearray_cli.base.units import digits
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.paths import Eyes
from framearray_cli.scene.scene import Scene

ROOM_RANGE, THING_RANGE = 0.5, 0.2  # d_max over the free height in a room, and over the largest extent of a thing
MOST_EYES = 16  # whose free height is measured
DIGITS = 2  # of the range; a rounded value is easier to repeat in a job


def with_range(job: Job, scene: Scene, eyes: Eyes) -> tuple[Job, Scene]:
    """Give a job without `obscurance.range` a range that suits the scene.

    Returns:
        The job with the range; the scene with a note on the choice, if images depend on it.
    """
    if job.obscurance.range is not None:
        return job, scene
    value, reason = default_range(scene, eyes, up=2 if job.scene.up == "z" else 1)
    new = changed(job, obscurance=changed(job.obscurance, range=value))
    if job.indirect.method != "obscurance":
        return new, scene
    note = f"obscurance.range: {value:g} scene units, {reason}"
    return new, replace(scene, report=replace(scene.report, notes=(*scene.report.notes, note)))


def default_range(scene: Scene, eyes: Eyes, up: int) -> tuple[float, str]:
    """Choose d_max, in scene units, and say why.

    Args:
        up: the axis that points up.
    """
    rows = np.unique(np.linspace(0, eyes.n - 1, MOST_EYES).astype(int))
    points = eyes.world_from_camera[rows, :3, 3] - scene.centre
    heights = free_heights(scene.corners, points, up)
    if 2 * np.isfinite(heights).sum() > len(heights):
        height = float(np.median(heights[np.isfinite(heights)]))
        return _rounded(ROOM_RANGE * height), f"half the free height of {digits(height, DIGITS)} at the cameras"
    corners = scene.corners.reshape(-1, 3)
    size = float((corners.max(axis=0) - corners.min(axis=0)).max())
    return _rounded(THING_RANGE * size), f"a fifth of the scene's size of {digits(size, DIGITS)}"


def free_heights(corners: Corners, points: Float64, up: int) -> Float64:
    """Distances from the first surface below each point to the first above it, (n,); infinite without one of them.

    Args:
        corners: (m, 3, 3) triangles.
        points: (n, 3) in the same coordinates.
        up: the axis that points up.
    """
    across = [axis for axis in range(3) if axis != up]
    low, high = corners[:, :, across].min(axis=1), corners[:, :, across].max(axis=1)
    found = np.full(len(points), np.inf)
    for i, point in enumerate(points):
        flat = point[across]
        near = corners[((low <= flat) & (flat <= high)).all(axis=1)].astype(np.float64)
        a, b, c = (near[:, k, across] - flat for k in range(3))
        areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])  # barycentric, times twice the area
        total = areas.sum(axis=0)
        inside = (total != 0) & ((areas >= 0).all(axis=0) | (areas <= 0).all(axis=0))
        levels = (areas.T[inside] * near[inside][:, :, up]).sum(axis=1) / total[inside] - point[up]
        if (levels > 0).any() and (levels < 0).any():
            found[i] = levels[levels > 0].min() - levels[levels < 0].max()
    return found


def _cross(a: Float64, b: Float64) -> Float64:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _rounded(length: float) -> float:
    return float(f"{length:.{DIGITS}g}")
