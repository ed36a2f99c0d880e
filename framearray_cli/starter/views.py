"""Judge how much a view shows, as a person who places a camera would, by a number."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from .rays import Probe, unit

COLUMNS, ROWS = 16, 12  # rays per view
FOV_DEG, ASPECT = 60.0, 4 / 3
BATCH = 2000  # views traced together: 400,000 rays
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
    back: NDArray[np.bool_]

    def middle_distance(self, size: float) -> Float64:
        """(n,) median distance of what each view sees."""
        hit = np.isfinite(self.distance)
        return np.array(
            [np.median(row[h]) if h.any() else FAR * size for row, h in zip(self.distance, hit, strict=True)]
        )


def view_directions(look_dir: Float64, up_dir: Float64, fov_deg: float = FOV_DEG) -> Float64:
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
    probe: Probe, eye: Float64, look_dir: Float64, up_dir: Float64, size: float, fov_deg: float = FOV_DEG
) -> TracedViews:
    """Trace the rays of n views.

    Args:
        eye, look_dir: (n, 3).
        size: of the place, such as the height of the room.
    """
    parts = [
        _trace_batch(probe, eye[first : first + BATCH], look_dir[first : first + BATCH], up_dir, size, fov_deg)
        for first in range(0, len(eye), BATCH)
    ]
    label, distance, back = (np.concatenate(part) for part in zip(*parts, strict=True))
    return TracedViews(label=label, distance=distance, back=back)


def _trace_batch(
    probe: Probe, eye: Any, look_dir: Any, up_dir: Float64, size: float, fov_deg: float
) -> tuple[Any, ...]:
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
    return label.reshape(n, rays), distance.reshape(n, rays), (seen.hit & ~seen.front).reshape(n, rays)


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
