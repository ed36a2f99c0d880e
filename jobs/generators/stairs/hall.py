"""Walls, windows and ceiling of the theatre staircase."""

from itertools import pairwise

import numpy as np

from ..common.furniture import picture
from ..common.parts import Part, moved
from ..common.shapes import between, box, move, slab, turn
from ..common.turned import polyline, sweep
from .chandeliers import sconce
from .furnishings import double_door, great_mirror
from .plan import (
    BACK,
    COLUMN_Z,
    FRONT,
    GALLERY,
    HALF_WIDTH,
    HEIGHT,
    LANDING,
    WALL,
    WINDOW_FOOT,
    WINDOW_SPRING,
    WINDOW_WIDTH,
    WINDOW_X,
)
from .stonework import arch_infill, arched_window, architrave, panel_moulding, rosette


def shell() -> Part:
    """Floor, walls, the window wall, ceiling; the walls overlap at the corners."""
    x, low, high = HALF_WIDTH + WALL, -0.2, HEIGHT + 0.1
    half = WINDOW_WIDTH / 2
    head = WINDOW_FOOT + WINDOW_SPRING + half
    holes = [(c - half + x, WINDOW_FOOT - low, c + half + x, head - low) for c in WINDOW_X]
    part: Part = [
        ("FloorMarble", between((-x, -0.3, BACK - WALL), (x, 0.0, FRONT + WALL))),
        ("Ceiling", between((-x, HEIGHT, BACK - WALL), (x, HEIGHT + 0.2, FRONT + WALL))),
        ("WallSilk", between((-x, low, BACK - WALL), (-HALF_WIDTH, high, FRONT + WALL))),
        ("WallSilk", between((HALF_WIDTH, low, BACK - WALL), (x, high, FRONT + WALL))),
        ("WallSilk", between((-x, low, BACK - WALL), (x, high, BACK))),
        ("Plaster", move(slab(2 * x, high - low, WALL, holes), -x, low, FRONT + WALL)),
        ("Street", between((-40, -1.2, FRONT + 0.1), (40, -1.0, 60))),
    ]
    heights = np.random.default_rng(4).uniform(4.5, 7.5, 12)
    for i, height in enumerate(heights):  # houses across the square, too low to block the sun
        left = -36.0 + 6.0 * i
        part.append(
            ("Facade" if i % 3 else "Plaster", between((left, -1.1, 50.0 - i % 2), (left + 5.99, height, 58.0)))
        )
        part.append(
            ("Roof", between((left - 0.1, height - 0.1, 49.6 - i % 2), (left + 6.08, height + 0.6, 58.2), 0.28))
        )
        for j in range(4):
            for k in range(2):
                low = (left + 0.55 + 1.4 * j, 0.6 + 2.1 * k, 49.9 - i % 2)
                part.append(("Roof", between(low, (low[0] + 0.8, low[1] + 1.3, low[2] + 0.3))))
    for c in WINDOW_X:
        part += moved(arch_infill(WINDOW_WIDTH, WALL), c, WINDOW_FOOT + WINDOW_SPRING, FRONT + WALL)
        part += moved(arched_window(WINDOW_WIDTH, WINDOW_SPRING), c, WINDOW_FOOT, FRONT + 0.22)
        part.append(("Plaster", move(architrave(WINDOW_WIDTH, WINDOW_SPRING), c, WINDOW_FOOT, FRONT)))
        part.append(
            (
                "Marble",
                between(
                    (c - half - 0.12, WINDOW_FOOT - 0.06, FRONT - 0.12),
                    (c + half + 0.12, WINDOW_FOOT + 0.004, FRONT + 0.2),
                    0.012,
                ),
            )
        )
    return part


def walls() -> Part:
    """Wainscot, pilasters, gilded fields, doors, pictures and the mirror."""
    part: Part = []
    skirting = polyline("-0.01 -0.02, 0.03 -0.02, 0.03 0.16, 0.015 0.2, -0.01 0.2")
    x, z0, z1 = HALF_WIDTH, BACK, FRONT
    ring = [(x, 0, z1), (x, 0, z0), (-x, 0, z0), (-x, 0, z1)]
    part.append(("MarbleRose", sweep(ring, np.array(skirting) * [-1, 1], closed=True, crease_deg=20.0)))
    dado = polyline("-0.01 0.92, 0.03 0.92, 0.05 0.95, 0.035 0.985, -0.01 0.985")
    part.append(
        ("Marble", sweep([(x, 0, z1), (x, 0, z0), (-x, 0, z0), (-x, 0, z1)], np.array(dado) * [-1, 1], crease_deg=20.0))
    )
    for s, angle in ((-1, 90), (1, -90)):
        for z in (0.0, 5.6):
            part += moved(double_door(), s * HALF_WIDTH, 0, z, turn_y=angle)
        for z in (-2.9, 2.7):
            part += moved(panel_moulding(1.5, 2.5), s * HALF_WIDTH, 1.25, z + s * 0.75, turn_y=angle)
            part += moved(sconce(), s * (HALF_WIDTH - 0.005), 2.5, z, turn_y=angle)
        for z in np.array(COLUMN_Z[:-1]) + 1.5:
            part += moved(panel_moulding(1.9, 2.3), s * HALF_WIDTH, GALLERY + 0.55, z + s * 0.95, turn_y=angle)
            part += moved(sconce(), s * (HALF_WIDTH - 0.005), GALLERY + 1.7, z, turn_y=angle)
        wide, high = 1.55, 1.25
        part += moved(
            picture(wide, high, "Opera" if s < 0 else "Ballet", "Gilding"), s * 3.55 - wide / 2, 4.95, BACK + 0.002
        )
        for dx in (2.02, 5.25):
            part += pilaster(s * dx)
        part += moved(sconce(), s * 1.72, LANDING + 2.0, BACK + 0.005)
    return part + moved(great_mirror(2.5, 3.3), -1.25, LANDING + 0.62, BACK)


def pilaster(x: float) -> Part:
    """A flat column on the back wall from the landing's height to the cornice."""
    top = HEIGHT - 0.55
    return [
        ("Marble", between((x - 0.19, LANDING - 0.5, BACK - 0.02), (x + 0.19, top, BACK + 0.09), 0.01)),
        ("MarbleRose", between((x - 0.11, LANDING + 0.65, BACK + 0.05), (x + 0.11, top - 0.6, BACK + 0.105), 0.012)),
        ("Marble", between((x - 0.25, LANDING - 0.4, BACK - 0.02), (x + 0.25, LANDING + 0.42, BACK + 0.13), 0.012)),
        ("Gilding", between((x - 0.23, top - 0.38, BACK - 0.02), (x + 0.23, top - 0.02, BACK + 0.12), 0.03)),
        ("Marble", between((x - 0.27, top - 0.06, BACK - 0.02), (x + 0.27, top + 0.05, BACK + 0.16), 0.01)),
    ]


def ceiling() -> Part:
    """A cornice with dentils all around, beams that make coffers, blue fields, a rose over the chandelier."""
    part: Part = []
    cornice = polyline(
        "-0.02 -0.62, 0.06 -0.62, 0.07 -0.54, 0.14 -0.46, 0.16 -0.34, 0.2 -0.32, 0.2 -0.26, 0.34 -0.22, "
        "0.4 -0.1, 0.44 -0.08, 0.44 0.02, -0.02 0.02"
    )
    x, z0, z1 = HALF_WIDTH, BACK, FRONT
    ring = [(x, HEIGHT, z1), (x, HEIGHT, z0), (-x, HEIGHT, z0), (-x, HEIGHT, z1)]
    part.append(("Plaster", sweep(ring, cornice * [-1, 1], closed=True, crease_deg=35.0)))
    dentil = box(0.11, 0.11, 0.10)
    for along in np.arange(-HALF_WIDTH + 0.35, HALF_WIDTH - 0.3, 0.2):
        for z, s in ((BACK, 1), (FRONT, -1)):
            part.append(("Plaster", move(dentil, along, HEIGHT - 0.44, z + s * 0.19)))
    for along in np.arange(BACK + 0.35, FRONT - 0.3, 0.2):
        for s in (-1, 1):
            part.append(("Plaster", move(turn(dentil, "y", 90), s * (HALF_WIDTH - 0.19), HEIGHT - 0.44, along)))
    xs, zs = np.linspace(-HALF_WIDTH, HALF_WIDTH, 8), np.linspace(BACK, FRONT, 7)
    for i, beam in enumerate(xs[1:-1]):
        part.append(
            (
                "Ceiling",
                between((beam - 0.17, HEIGHT - 0.22, BACK - 0.02), (beam + 0.17, HEIGHT + 0.05, FRONT + 0.02), 0.03),
            )
        )
        part.append(
            (
                "Gilding",
                between((beam - 0.05, HEIGHT - 0.232, BACK), (beam + 0.05, HEIGHT - 0.2 - 0.0001 * i, FRONT), 0.006),
            )
        )
    for beam in zs[1:-1]:
        part.append(
            (
                "Ceiling",
                between(
                    (-HALF_WIDTH - 0.02, HEIGHT - 0.215, beam - 0.17),
                    (HALF_WIDTH + 0.02, HEIGHT + 0.05, beam + 0.17),
                    0.03,
                ),
            )
        )
    for x0, x1 in pairwise(xs):
        for z0, z1 in pairwise(zs):
            mx, mz, hx, hz = (x0 + x1) / 2, (z0 + z1) / 2, (x1 - x0) / 2 - 0.32, (z1 - z0) / 2 - 0.32
            part.append(("CofferBlue", between((mx - hx, HEIGHT - 0.02, mz - hz), (mx + hx, HEIGHT + 0.05, mz + hz))))
            ring = [
                (mx - hx, HEIGHT - 0.01, mz - hz),
                (mx + hx, HEIGHT - 0.01, mz - hz),
                (mx + hx, HEIGHT - 0.01, mz + hz),
                (mx - hx, HEIGHT - 0.01, mz + hz),
            ]
            part.append(
                (
                    "Gilding",
                    sweep(
                        ring, [(-0.03, -0.03), (0.03, -0.03), (0.03, 0.02), (-0.03, 0.02)], closed=True, crease_deg=30.0
                    ),
                )
            )
            if not (abs(mx) < 0.5 and 0.5 < mz < 2.5):
                part += moved(rosette(0.3), mx, HEIGHT - 0.018, mz)
    return part
