"""Closed rooms that are hard to trace, and counting what light does in them that it must not do.

Every room is convex and closed: from inside, a lamp inside reaches every point of the walls, and a lamp outside none.
So each shadow ray has a known answer, and wrong ones are counted instead of looked for in pictures.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import tiny

from framearray_cli.embree import EmbreeScene
from framearray_cli.embree.packets import intersect, set_ray
from framearray_cli.hits import SURFACE, Hits, empty_hits, record_hits
from framearray_cli.kernel import kernel
from framearray_cli.lights import light_arrays
from framearray_cli.paths import LightPath, Lights
from framearray_cli.rays import room_for_hits, room_for_tests
from framearray_cli.surface import surfaces
from framearray_cli.terms.direct import direct

# Turns no wall into a coordinate plane, where float32 would be exact.
TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
# Lamps inside, in a room from -1 to 1: at the middle, and near walls, edges and corners.
INSIDE = np.array([[0, 0, 0], [0.3, -0.6, 0.2], [0.99, 0.1, 0], [-0.98, 0.98, 0.1], [0.97, -0.97, 0.97]])
OUTSIDE = np.array([[1.5, 0.2, 0.1], [0, 4, 1], [-2, -2, 2], [0.1, 0.2, -1.01], [30, -20, 10]])


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
    """Windings that tell nothing."""
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
            for a0, a1 in zip(cuts[0][:-1], cuts[0][1:], strict=True):
                for b0, b1 in zip(cuts[1][:-1], cuts[1][1:], strict=True):
                    square = [(a0, b0, sign), (a1, b0, sign), (a1, b1, sign), (a0, b1, sign)]
                    found.append(tiny.quad(*(np.roll(np.array(corner), k + 1) for corner in square)))
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
    h = np.tan(np.radians(0.5))
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
    return np.concatenate(
        [
            tiny.quad(place[j, i], place[j, i + 1], place[j + 1, i + 1], place[j + 1, i])
            for j in range(n)
            for i in range(2 * n)
        ]
    )


ROOMS: dict[str, Callable[[], Any]] = {
    room.__name__: room for room in (plain, thin, thinner, coincident, mixed, t_junctions, slivers, broken, wedge, ball)
}
# Where rooms are not as wide as the lamps above suppose: what the lamps' coordinates are multiplied with.
WIDTH = {"wedge": np.array([1, 0.0, 1]), "ball": np.array([0.55, 0.55, 0.55])}


@dataclass(frozen=True)
class Count:
    """Shadow rays whose answer is known, and how many of them gave the other one."""

    rays: int
    wrong: int


@kernel
def _shoot(origin: Any, way: Any, packets: Any) -> None:
    for i in range(way.shape[0]):
        set_ray(packets, i, origin[0], origin[1], origin[2], way[i, 0], way[i, 1], way[i, 2], np.float32(np.inf))


def count(name: str, *, size: float = 1.0, at: Any = (0.0, 0.0, 0.0), n: int = 16384) -> tuple[Count, Count]:
    """Leaks (from lamps outside) and false shadows (of lamps inside), on points that are seen from inside.

    Args:
        size: what all lengths are multiplied with.
        at: where the middle of the room is.
    """
    at, width = np.asarray(at, np.float64), WIDTH.get(name, np.ones(3))

    def placed(points: Any) -> Any:
        with np.errstate(invalid="ignore"):  # one room has corners that are no numbers
            return size * (points @ TURN) + at

    scene = tiny.scene_of(placed(ROOMS[name]()))
    eye = np.asarray(placed(np.array([0.11, 0.0, -0.17])) - scene.centre, np.float32)
    with EmbreeScene(scene) as embree:
        hits = _seen(scene, embree, eye, n)
        leaks = _lit(hits, embree, placed(OUTSIDE), scene.centre, size)
        lit = _lit(hits, embree, placed(INSIDE * width), scene.centre, size)
    return Count(leaks.size, int(leaks.sum())), Count(lit.size, int((~lit).sum()))


def _seen(scene: Any, embree: EmbreeScene, eye: Any, n: int) -> Hits:
    """What n rays in all directions meet: it must be a wall, whatever the direction."""
    way = np.random.default_rng(3).normal(size=(n, 3)).astype(np.float32)
    packets, hits = room_for_hits(n).packets, empty_hits(n)
    _shoot(eye, way, packets)
    intersect(embree.tracer, packets, n)
    record_hits(surfaces(scene), embree.tracer, packets, n, False, hits)
    assert (hits.kind == SURFACE).all(), "a ray left a closed room"
    return hits


def _lit(hits: Hits, embree: EmbreeScene, lamps: Any, centre: Any, size: float) -> Any:
    """(n_hits, n_lamps) which lamps reach which hits; those behind the surface do not count as shadows."""
    power = np.full((len(lamps), 3), size**2)
    lights = light_arrays(Lights(sources=(LightPath(kind="point", vector=lamps, intensity=power),)), centre)
    out = np.empty((len(hits.kind), 1, len(lamps)), np.float32)
    direct(hits, len(hits.kind), lights, embree.tracer, room_for_tests(4096, len(lamps)), out)
    return out[:, 0] > 0
