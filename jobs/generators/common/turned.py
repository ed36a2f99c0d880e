"""Turned, swept, extruded and free surfaces of the project's own scenes, around the origin; lengths in metres, y up."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .shapes import ROUND, Array, Mesh, clean, join, patch


def polyline(text: str) -> Array:
    """Points (n, 2) or (n, 3) written as "x y, x y, ...", so that long outlines stay short to read."""
    return np.array([[float(number) for number in point.split()] for point in text.split(",")])


def lathe(profile: ArrayLike, segments: int = 24, crease_deg: float = ROUND, start_deg: float = 0.0) -> Mesh:
    """Turn a profile of (radius, y) pairs, from bottom to top for an outside surface, about the y axis."""
    profile = np.asarray(profile, dtype=float)
    angle = np.radians(start_deg) + np.arange(segments) * (2 * np.pi / segments)
    ring = np.stack([np.cos(angle), np.zeros(segments), -np.sin(angle)], axis=-1)
    points = (
        profile[:, None, :1] * ring[None]
        + np.stack([np.zeros(len(profile)), profile[:, 1], np.zeros(len(profile))], axis=-1)[:, None]
    )
    return clean(patch(np.concatenate([points, points[:, :1]], axis=1).transpose(1, 0, 2)), crease_deg)


def ball(radius: float, segments: int = 16, rings: int = 10) -> Mesh:
    """A sphere around the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    return lathe(np.stack([radius * np.cos(angle).round(12), radius * np.sin(angle)], axis=-1), segments, 80.0)


def rod(a: ArrayLike, b: ArrayLike, radius: float, segments: int = 8) -> Mesh:
    """A round rod with flat ends from a to b."""
    return sweep([a, b], radius, segments)


def torus(radius: float, thickness: float, segments: int = 24, sides: int = 8) -> Mesh:
    """A ring about the y axis; `thickness` is the radius of its tube."""
    angle = np.linspace(-np.pi, np.pi, sides + 1)
    return lathe(
        np.stack([radius - thickness * np.cos(angle), -thickness * np.sin(angle)], axis=-1)[::-1], segments, 80.0
    )


def curve(points: ArrayLike, n: int = 8) -> Array:
    """A smooth path through the points (Catmull-Rom), n pieces between two of them."""
    p = np.asarray(points, dtype=float)
    padded = np.vstack([2 * p[0] - p[1], p, 2 * p[-1] - p[-2]])
    t = (np.arange(n) / n)[:, None]
    pieces = []
    for a, b, c, d in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        cubic = 3 * b - a - 3 * c + d
        pieces.append(b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * cubic)))
    return np.vstack([*pieces, p[-1:]])


def circle(radius: float, n: int) -> Array:
    """n points of a circle, counter-clockwise, in two dimensions."""
    angle = np.arange(n) * (2 * np.pi / n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def sweep(
    path: ArrayLike,
    profile: float | ArrayLike,
    sides: int = 8,
    *,
    radii: ArrayLike | None = None,
    closed: bool = False,
    up: ArrayLike = (0.0, 1.0, 0.0),
    crease_deg: float = ROUND,
) -> Mesh:
    """Carry a closed profile (k, 2), or a circle of that radius, along a path (n, 3), mitred at its corners.

    The profile's second axis follows `up`, its first points to the right of the path; ends are capped. Texture
    coordinates run along the profile (u) and the path (v), both in metres.
    """
    p = np.asarray(path, dtype=float)
    shape = circle(float(profile), sides) if np.isscalar(profile) else np.asarray(profile, dtype=float)
    steps = np.diff(np.vstack([p, p[:1]]) if closed else p, axis=0)
    ways = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    before = np.vstack([ways[-1:] if closed else ways[:1], ways[: len(p) - 1]])
    after = ways if closed else np.vstack([ways, ways[-1:]])
    size = np.ones(len(p)) if radii is None else np.asarray(radii, dtype=float)
    rings = []
    side_before: Array | None = None
    for i in range(len(p)):
        way = before[i] + after[i]
        way /= np.linalg.norm(way)
        side = np.cross(way, np.asarray(up, dtype=float))
        if np.linalg.norm(side) < 1e-6:  # the path runs along `up`: keep the previous side
            side = np.array([1.0, 0.0, 0.0]) if side_before is None else side_before - way * (side_before @ way)
        side /= np.linalg.norm(side)
        if side_before is not None and np.isscalar(profile) and side @ side_before < 0:
            side = -side
        lift = np.cross(side, way)
        mitre = 1.0 / max(float(np.sqrt((1 + before[i] @ after[i]) / 2)), 0.3)
        bend_axis = after[i] - before[i]
        stretch = np.eye(3)
        if np.linalg.norm(bend_axis) > 1e-6:
            bend_axis = bend_axis - way * (bend_axis @ way)
            bend_axis /= np.linalg.norm(bend_axis)
            stretch += (mitre - 1) * np.outer(bend_axis, bend_axis)
        rings.append(p[i] + size[i] * (shape[:, :1] * side + shape[:, 1:] * lift) @ stretch)
        side_before = side
    if closed:
        rings.append(rings[0])
    points = np.stack(rings)  # (n, k, 3)
    wrapped = np.concatenate([points, points[:, :1]], axis=1)
    u = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(np.vstack([shape, shape[:1]]), axis=0), axis=1))]
    v = np.r_[0.0, np.cumsum(np.linalg.norm(steps, axis=1))][: len(wrapped)]
    tube = patch(wrapped, np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1))
    tube = replace(tube, faces=tube.faces[:, ::-1])
    if closed:
        return clean(tube, crease_deg)
    caps = [_cap(rings[0], shape, flip=False), _cap(rings[-1], shape, flip=True)]
    return clean(join([tube, *caps]), crease_deg)


def extrude(outline: ArrayLike, depth: float, crease_deg: float = 30.0) -> Mesh:
    """A prism over a simple counter-clockwise outline (k, 2) in x and y, from z = 0 to depth."""
    shape = np.asarray(outline, dtype=float)
    low = np.c_[shape, np.zeros(len(shape))]
    high = np.c_[shape, np.full(len(shape), depth)]
    wall = np.stack([np.vstack([low, low[:1]]), np.vstack([high, high[:1]])], axis=1)
    caps = [_cap(low, shape, flip=True), _cap(high, shape, flip=False)]
    return clean(join([patch(wall), *caps]), crease_deg)


def surface(points: Array, uvs: Array | None = None, crease_deg: float = 80.0) -> Mesh:
    """A free surface over a grid of points (n_u, n_v, 3); it has no thickness."""
    return clean(patch(points, uvs), crease_deg)


def _cap(ring: Array, outline: Array, *, flip: bool) -> Mesh:
    """The polygon `ring` (k, 3), cut into triangles by its flat outline (k, 2), counter-clockwise in it."""
    faces = _triangulate(outline)
    return Mesh(points=ring, faces=faces[:, ::-1] if flip else faces)


def _triangulate(outline: Array) -> NDArray[np.int64]:
    """Cut ears off a simple outline (k, 2) until one triangle is left; keeps the outline's sense of turning."""
    nxt = np.roll(outline, -1, axis=0)
    sense = np.sign((outline[:, 0] * nxt[:, 1] - nxt[:, 0] * outline[:, 1]).sum())
    left = list(range(len(outline)))
    faces: list[list[int]] = []
    while len(left) > 3:
        for i in range(len(left)):
            ear = [left[i - 1], left[i], left[(i + 1) % len(left)]]
            a, b, c = outline[ear]
            if sense * _cross(b - a, c - b) <= 1e-14:
                continue
            others = outline[[k for k in left if k not in ear]]
            inside = np.ones(len(others), dtype=bool)
            for p, q in ((a, b), (b, c), (c, a)):
                inside &= sense * _cross(q - p, others - p) > -1e-12
            if not inside.any():
                faces.append(ear)
                left.pop(i)
                break
        else:  # only flat corners are left
            left.pop(0)
    faces.append(left)
    return np.array(faces)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
