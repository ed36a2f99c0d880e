"""Judge how much a view shows, as a person who places a camera would, by a number."""

import numpy as np

from framearray_cli.base.arrays import Float64

from .rays import Probe

COLUMNS, ROWS = 16, 12  # rays per view
FOV_DEG, ASPECT = 60.0, 4 / 3
BATCH = 2000  # views traced together: 400,000 rays
NEAR = 0.3  # over the size of the place: a nearer thing fills the picture
FAR = 8.0  # over the same size: greater distances count as this one
# Penalties for the shares of rays that see nothing, that see the back of a surface, and that end near the eye. A view
# of ten different things at equal shares has a variety of 2.3; a fifth of a picture spoils about half of that.
EMPTY, BACKWARDS, CLOSE = 4.0, 6.0, 6.0


def view_directions(look_dir: Float64, up_dir: Float64, fov_deg: float = FOV_DEG) -> Float64:
    """(n, rows * columns, 3) directions through the pictures of n views, not of unit length.

    Args:
        look_dir: (n, 3) unit, none of them along up.
    """
    right = np.cross(look_dir, up_dir)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    above = np.cross(right, look_dir)
    tall = np.tan(np.radians(fov_deg) / 2)
    x = (2 * (np.arange(COLUMNS) + 0.5) / COLUMNS - 1) * tall * ASPECT
    y = (1 - 2 * (np.arange(ROWS) + 0.5) / ROWS) * tall
    a, b = (part.reshape(-1)[None, :, None] for part in np.meshgrid(x, y))
    return np.asarray(look_dir[:, None] + a * right[:, None] + b * above[:, None])


def judge_views(probe: Probe, eye: Float64, look_dir: Float64, up_dir: Float64, size: float) -> tuple[Float64, Float64]:
    """Judge n views: (n,) how much each shows, and (n,) median distance of what it sees.

    A view is worth the variety of what is in it (the entropy of its materials and of the ways surfaces face), and the
    depth (mean logarithm of the distance over the size); it loses for what spoils pictures.

    Args:
        eye, look_dir: (n, 3).
        size: of the place, such as the height of the room.
    """
    worths, depths = [], []
    for first in range(0, len(eye), BATCH):
        part = slice(first, first + BATCH)
        found = _judge_batch(probe, eye[part], look_dir[part], up_dir, size)
        worths.append(found[0])
        depths.append(found[1])
    return np.concatenate(worths), np.concatenate(depths)


def _judge_batch(
    probe: Probe, eye: Float64, look_dir: Float64, up_dir: Float64, size: float
) -> tuple[Float64, Float64]:
    n, rays = len(eye), COLUMNS * ROWS
    directions = view_directions(look_dir, up_dir).reshape(-1, 3)
    seen = probe.trace(np.repeat(eye, rays, axis=0), directions)
    length = np.linalg.norm(directions, axis=1)
    distance = np.where(seen.hit, seen.distance * length, np.inf).reshape(n, rays)
    hit, front = seen.hit.reshape(n, rays), seen.front.reshape(n, rays)
    normal = probe.normals(seen.triangle)
    axis = np.abs(normal).argmax(axis=1)
    facing = 2 * axis + (np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] > 0)
    label = np.where(seen.hit, 1 + 6 * probe.scene.material[seen.triangle] + facing, 0).reshape(n, rays)
    depth = np.log(np.clip(np.where(hit, distance, FAR * size) / size, 0.1, FAR)).mean(axis=1)
    spoiled = EMPTY * (1 - hit.mean(axis=1)) + BACKWARDS * (hit & ~front).mean(axis=1)
    spoiled += CLOSE * (distance < NEAR * size).mean(axis=1)
    middle = np.array([np.median(row[row < np.inf]) if (row < np.inf).any() else FAR * size for row in distance])
    return _entropy(label) + depth - spoiled, middle


def _entropy(label: Float64) -> Float64:
    """(n,) entropy of the labels of each row."""
    found = []
    for row in label:
        share = np.unique(row, return_counts=True)[1] / len(row)
        found.append(-(share * np.log(share)).sum())
    return np.array(found)
