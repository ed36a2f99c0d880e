"""Polygons -> triangles, also concave ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

Indices = NDArray[np.int64]


# Cutting the ears off a polygon of k corners takes time in proportion to k^2; for this sum of k^2 it takes 3 s.
MOST_WORK = 50_000_000


@dataclass(slots=True)
class Ears:
    """The work of cutting ears that is left for a file, and the number of concave polygons too large for it."""

    work: int = MOST_WORK
    fans: int = 0


def triangulate(corners: Float64, ears: Ears) -> Indices:
    """Split m polygons of k corners each.

    Convex polygons become fans, all at once. Concave ones lose one ear after another; quads are cut at the reflex
    corner.

    Args:
        corners: (m, k, 3) positions, k at least 3.
        ears: its work is reduced; concave polygons for which none is left become fans.

    Returns:
        (m, k - 2, 3) corner numbers from 0 to k - 1.
    """
    m, k = corners.shape[:2]
    middle = np.arange(1, k - 1)
    fan = np.stack([np.zeros_like(middle), middle, middle + 1], axis=1)
    triangles = np.broadcast_to(fan, (m, k - 2, 3)).copy()
    if k > 3:
        concave, reflex = _concave(corners)
        if k == 4:
            triangles[concave & (reflex % 2 == 1)] = OTHER_DIAGONAL
            return triangles
        for polygon in np.flatnonzero(concave):
            if ears.work < k * k:
                ears.fans += 1
            else:
                ears.work -= k * k
                triangles[polygon] = _clip_ears(corners[polygon])
    return triangles


OTHER_DIAGONAL = np.array([[1, 2, 3], [1, 3, 0]])


def _concave(corners: Float64) -> tuple[NDArray[np.bool_], Indices]:
    """(m,) whether a polygon turns both ways along its outline, and the corner where it turns back the most."""
    with np.errstate(all="ignore"):  # non-finite corners compare false; their triangles are dropped later
        centred = corners - corners.mean(axis=1, keepdims=True)
        normal = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)  # (m, 3), Newell
        ahead = np.roll(corners, -1, axis=1) - corners
        turn = np.einsum("mkc,mc->mk", np.cross(np.roll(ahead, 1, axis=1), ahead), normal)
        # rounding must not make a flat quad concave
        concave = (turn < -1e-9 * np.abs(turn).max(axis=1, keepdims=True)).any(axis=1)
    return np.asarray(concave), np.asarray(turn.argmin(axis=1))


def _clip_ears(corners: Float64) -> Indices:
    """Triangulate one polygon in the axis plane where its area is largest; (k - 2, 3) corner numbers."""
    centred = corners - corners.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    flat = np.delete(centred, int(np.argmax(np.abs(normal))), axis=1)  # (k, 2)
    area = _cross(flat, np.roll(flat, -1, axis=0)).sum()
    sign = 1.0 if area > 0 else -1.0
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        at = _ear(flat, left, sign)
        triangles.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    triangles.append((left[0], left[1], left[2]))
    return np.array(triangles, dtype=np.int64)


def _ear(flat: Float64, left: list[int], sign: float) -> int:
    """Find the index in `left` of a corner that can be cut off; 1 if there is none (the outline crosses itself)."""
    points = flat[left]  # (r, 2)
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    turn = sign * _cross(points - before, after - points)
    for at in np.flatnonzero(turn > 0):
        a, b, c = before[at], points[at], after[at]
        inside = (
            (sign * _cross(b - a, points - a) >= 0)
            & (sign * _cross(c - b, points - b) >= 0)
            & (sign * _cross(a - c, points - c) >= 0)
        )
        # corners that coincide with those of the ear (a bridge to a hole) do not block it
        same = (points == a).all(axis=1) | (points == b).all(axis=1) | (points == c).all(axis=1)
        if not (inside & ~same).any():
            return int(at)
    flat_corners = np.flatnonzero(turn == 0)
    return int(flat_corners[0]) if len(flat_corners) else 1


def _cross(a: Float64, b: Float64) -> Float64:
    """The z of the cross product of 2D vectors, last axis."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
