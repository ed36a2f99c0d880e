"""Closed rooms that are hard to trace.

Every room is convex and closed: from inside, all of it is in sight, and nothing outside is. So each ray has a known
answer; `counting.py` counts the wrong ones.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from support import tiny

# Turns no wall into a coordinate plane, where float32 would be exact.
TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
# Lamps inside, in a room from -1 to 1: at the middle, and near walls, edges and corners.
INSIDE = np.array([[0, 0, 0], [0.3, -0.6, 0.2], [0.99, 0.1, 0], [-0.98, 0.98, 0.1], [0.97, -0.97, 0.97]])
OUTSIDE = np.array([[1.5, 0.2, 0.1], [0, 4, 1], [-2, -2, 2], [0.1, 0.2, -1.01], [30, -20, 10]])


TIP = np.tan(np.radians(0.5))  # half the slope of the wedge


def plain() -> Any:
    """A box of twelve triangles."""
    return tiny.box((-1, -1, -1), (1, 1, 1))


def thin() -> Any:
    """Walls that are 1e-4 of the room thick: an inner and an outer face, which must not be taken for each other."""
    return np.concatenate([plain(), 1.0002 * plain()])


def thinner() -> Any:
    """Walls of 1e-6: a few float32 roundings of a coordinate."""
    return np.concatenate([plain(), 1.000002 * plain()])


def coincident() -> Any:
    """Every wall three times, cut along either diagonal."""
    other = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]], np.float64)
    turned = [other @ _axes(k, sign).T + sign * np.eye(3)[k] for k in range(3) for sign in (-1, 1)]
    crossed = [np.roll(face[:, :, :], 1, axis=1) for face in turned]
    flipped = [face * [-1, 1, 1] for face in turned]
    return np.concatenate([plain(), *crossed, *flipped])


def _axes(k: int, sign: int) -> Any:
    """Columns: two axes of a wall, and the one that it is normal to."""
    axes = np.eye(3)
    return np.stack([axes[(k + 1) % 3], sign * axes[(k + 2) % 3], axes[k]], axis=1)


def mixed() -> Any:
    """Windings that are inconsistent."""
    corners = grid(5)
    turn = np.random.default_rng(2).random(len(corners)) < 0.5
    corners[turn] = corners[turn][:, ::-1]
    return corners


def grid(n: int, rows: int | None = None) -> Any:
    """A box whose walls are cut into n x rows rectangles at uneven places."""
    rng, found = np.random.default_rng(n), []
    for k in range(3):
        for sign in (-1, 1):
            cuts = [np.concatenate([[-1], np.sort(rng.uniform(-1, 1, m - 1)), [1]]) for m in (n, rows or n)]
            a, b = np.meshgrid(*cuts, indexing="ij")
            found.append(np.roll(tiny.patches(np.stack([a, b, np.full_like(a, sign)], axis=-1)), k + 1, axis=-1))
    return np.concatenate(found)


def t_junctions() -> Any:
    """Corners in the middle of a neighbour's edge: on every edge of the room, and within the walls."""
    return grid(7)


def slivers() -> Any:
    """Strips as long as the room and down to a ten-thousandth of it wide."""
    return grid(300, 1)


def broken() -> Any:
    """Walls beside triangles without an area, doubled ones, and ones with corners that are no numbers."""
    walls = grid(4)
    lines = np.stack([walls[:, 0], walls[:, 1], (walls[:, 0] + walls[:, 1]) / 2], axis=1)
    points = np.repeat(walls[:20, :1], 3, axis=1)
    nowhere = walls[:20].copy()
    nowhere[:, 1, 2] = [np.nan, np.inf] * 10
    return np.concatenate([walls, lines, walls[::2], points, nowhere])


def wedge() -> Any:
    """A room that ends in an edge of one degree, where walls come nearer to each other than rays start above them."""
    h = TIP
    near, far = [(-1, 0, z) for z in (-1, 1)], [(1, y, z) for y in (-2 * h, 2 * h) for z in (-1, 1)]
    (a, b), (c, d, e, f) = near, far
    sides = [np.array([[a, c, e]], np.float64), np.array([[b, d, f]], np.float64)]
    return np.concatenate([tiny.quad(a, b, d, c), tiny.quad(a, b, f, e), tiny.quad(c, d, f, e), *sides])


def ball() -> Any:
    """A sphere of twenty thousand triangles: shallow edges everywhere."""
    n = 70
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n + 1), np.linspace(0, np.pi, n + 1))
    place = np.stack([np.sin(up) * np.cos(around), np.cos(up), np.sin(up) * np.sin(around)], axis=-1)
    place[:, -1] = place[:, 0]
    return tiny.patches(place.swapaxes(0, 1))


ROOMS: dict[str, Callable[[], Any]] = {
    room.__name__: room for room in (plain, thin, thinner, coincident, mixed, t_junctions, slivers, broken, wedge, ball)
}
# Where rooms are not as wide as the lamps above suppose: what the lamps' coordinates are multiplied with.
WIDTH = {"wedge": np.array([1, 0.0, 1]), "ball": np.array([0.55, 0.55, 0.55])}

# Points exactly on walls, edges and corners of a room.
BOX_WALLS = [(1, 0.3, -0.2), (-0.7, 1, 0.4), (1, 1, 0.3), (1, -1, 1)]
ON_WALLS: dict[str, list[Any]] = {name: BOX_WALLS for name in ROOMS} | {
    "wedge": [(1, 0.3 * TIP, 0.2), (0.5, 1.5 * TIP, -0.4), (1, 2 * TIP, 1), (-1, 0, 0.2)],
    "ball": [ball()[0].mean(axis=0), ball()[5000, :2].mean(axis=0), ball()[12000, 0], (1, 0, 0)],
}


def planes(name: str) -> tuple[Any, Any]:
    """Unit normals (n, 3) outwards, and distances (n,) from the middle, of the planes that a room lies between."""
    box = np.concatenate([np.eye(3), -np.eye(3)])
    if name == "ball":
        return _planes_of(ball())
    if name == "wedge":
        slopes = np.array([[-TIP, 1, 0], [-TIP, -1, 0]]) * np.cos(np.radians(0.5))
        return np.concatenate([box[[0, 2, 5]], slopes]), np.array([1, 1, 1, *(-slopes[:, 0])])
    return box, np.ones(6)


def _planes_of(corners: Any) -> tuple[Any, Any]:
    """Those of the triangles of a convex body about the middle."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal, corner = normal[length > 1e-12] / length[length > 1e-12, None], corners[length > 1e-12, 0]
    distance = (normal * corner).sum(axis=1)
    return normal * np.sign(distance)[:, None], abs(distance)
