"""Walls, windows and the garden of the kitchen."""

import numpy as np

from ..common.furniture import curtain, window
from ..common.parts import Part, moved
from ..common.shapes import Mesh, between, cushion, move, slab, turn
from ..common.turned import lathe, polyline, rod, sweep, torus
from .plan import BASIN_WINDOW, EAST, HEIGHT, NORTH, SOUTH, TABLE_WINDOWS, WALL, WEST


def room() -> Part:
    """Floor, walls with window openings, ceiling and beams; the walls overlap at the corners."""
    width, depth = EAST - WEST, SOUTH - NORTH
    x, y, w, h = BASIN_WINDOW
    north = slab(width + 2 * WALL, HEIGHT + 0.2, WALL, [(x - WEST + WALL, y + 0.1, x + w - WEST + WALL, y + h + 0.1)])
    holes = [(z - NORTH + WALL, y + 0.1, z + w - NORTH + WALL, y + h + 0.1) for z, y, w, h in TABLE_WINDOWS]
    east = turn(slab(depth + 2 * WALL, HEIGHT + 0.2, WALL, holes), "y", -90)
    part: Part = [
        ("FloorTiles", between((WEST - WALL, -0.2, NORTH - WALL), (EAST + WALL, 0.0, SOUTH + WALL))),
        ("Ceiling", between((WEST - WALL, HEIGHT, NORTH - WALL), (EAST + WALL, HEIGHT + 0.2, SOUTH + WALL))),
        ("WallPaint", move(north, WEST - WALL, -0.1, NORTH)),
        ("WallPaint", move(east, EAST, -0.1, NORTH - WALL)),
        ("WallPaint", between((WEST - WALL, -0.1, NORTH - WALL), (WEST, HEIGHT + 0.1, SOUTH + WALL))),
        ("WallPaint", between((WEST - WALL, -0.1, SOUTH), (EAST + WALL, HEIGHT + 0.1, SOUTH + WALL))),
    ]
    for z in np.linspace(NORTH + 0.45, SOUTH - 0.45, 4):
        part.append(
            ("Beam", between((WEST - 0.05, HEIGHT - 0.17, z - 0.07), (EAST + 0.05, HEIGHT + 0.05, z + 0.07), 0.012))
        )
    skirting = polyline("0 -0.01, 0 0.13, -0.008 0.13, -0.018 0.115, -0.018 -0.01")
    edge = 0.004  # into the wall
    path = [
        (EAST + edge, 0, NORTH + 0.6),
        (EAST + edge, 0, SOUTH + edge),
        (WEST - edge, 0, SOUTH + edge),
        (WEST - edge, 0, 1.4),
    ]
    part.append(("WindowPaint", sweep(path, skirting, crease_deg=20.0)))
    return part


def windows() -> Part:
    x, y, w, h = BASIN_WINDOW
    part = moved(window(w, h, 4, 3), x, y, NORTH - 0.12)
    for z, y, w, h in TABLE_WINDOWS:
        part += moved(window(w, h, 2, 4), EAST + 0.12, y, z, turn_y=-90)
    for z, width, seed in ((-1.22, 0.24, 1), (0.33, 0.26, 2), (1.90, 0.28, 3)):
        cloth = curtain(width, 2.30, seed, width * 26)
        part.append(("Linen", move(turn(cloth, "y", -90), EAST - 0.10, 0.09, z)))
    pole = turn(
        lathe(
            polyline(
                "0 -1.62, 0.024 -1.6, 0.03 -1.57, 0.018 -1.54, 0.012 -1.53, 0.012 1.53, 0.018 1.54, 0.03 1.57, "
                "0.024 1.6, 0 1.62"
            ),
            14,
        ),
        "x",
        90,
    )
    part.append(("Walnut", move(pole, EAST - 0.10, 2.395, 0.42)))
    for z in np.r_[np.linspace(-1.20, -1.0, 5), np.linspace(0.35, 0.57, 5), np.linspace(1.92, 2.16, 5)]:
        ring = turn(torus(0.018, 0.0035, 14, 6), "x", 90)
        part.append(("Brass", move(ring, EAST - 0.10, 2.391, float(z))))
    valance = curtain(2.1, 0.22, 4, 26)
    part.append(("Gingham", move(valance, -1.015, 2.235, NORTH + 0.055)))
    part.append(("Brass", rod((-1.05, 2.44, NORTH + 0.055), (1.12, 2.44, NORTH + 0.055), 0.008)))
    return part


def garden() -> Part:
    """A lawn and a hedge behind the windows, low enough to let the sun in."""
    part: Part = [("Garden", between((-9, -0.65, -12), (14, -0.45, 8)))]
    rng = np.random.default_rng(21)
    for i in range(26):
        along = i / 25.0
        x, z = (-8 + along * 30, -9.5) if i < 17 else (12.0, -9.5 + (i - 16) * 1.9)
        size = float(rng.uniform(0.8, 1.25))
        bush = cushion(2.3 * size, 1.3 * size, 1.7, 0.62, 8)
        wobble = rng.standard_normal((8, 3))
        points = bush.points + 0.09 * np.sin(bush.points @ wobble[:3].T * 2.5) @ wobble[3:6] * 0.6
        part.append(("Hedge", move(Mesh(points=points, faces=bush.faces, crease_deg=60.0), x, -0.75, z)))
    return part
