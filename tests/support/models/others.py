"""Models that the choices of `init` were not tried on while they were made."""

import numpy as np

from support.models.rooms import BLUE, DARK, GREEN, OAK, RED, WHITE, _chair, _dining_table
from support.models.shapes import Model, block, drum, lathe, wall


def glazed_room() -> Model:
    """6 x 5 x 2.8 m: one wall is nearly all window, with the table before it; the wall opposite is bare."""
    m = Model()
    m.add("Floor", (0.4, 0.36, 0.3), block((-3.1, -0.1, -2.6), (3.1, 0, 2.6)))
    m.add("Ceiling", WHITE, block((-3.1, 2.8, -2.6), (3.1, 2.9, 2.6)))
    m.add("Wall", WHITE, wall((-3, -2.5), (3, -2.5), 2.8, [(0.3, 5.7, 0.2, 2.6)]), wall((-3, 2.5), (3, 2.5), 2.8))
    m.add("Wall", WHITE, wall((3, -2.5), (3, 2.5), 2.8), wall((-3, -2.5), (-3, 2.5), 2.8, [(3.6, 4.5, 0, 2.05)]))
    m.add("Post", DARK, *[block((x, 0.2, -2.53), (x + 0.05, 2.6, -2.47)) for x in (-1.5, 0.0, 1.5)])
    m.add("Painting", RED, block((2.9, 1.1, -0.6), (2.94, 1.9, 0.6)))
    _dining_table(m, 0.3, -1.0)
    return m


def corridor() -> Model:
    """14 x 1.8 x 2.5 m, with a doorway and doors, pictures, and a small table at its end."""
    m = Model()
    m.add("Floor", OAK, block((-7.1, -0.1, -1), (7.1, 0, 1)))
    m.add("Ceiling", WHITE, block((-7.1, 2.5, -1), (7.1, 2.6, 1)))
    m.add("Wall", WHITE, wall((-7, -0.9), (7, -0.9), 2.5), wall((-7, 0.9), (7, 0.9), 2.5))
    m.add("Wall", WHITE, wall((-7, -0.9), (-7, 0.9), 2.5, [(0.5, 1.3, 0, 2.0)]), wall((7, -0.9), (7, 0.9), 2.5))
    m.add("Door", OAK, *[block((x, 0, 0.8), (x + 0.8, 2.0, 0.84)) for x in (-5, -2, 1, 4)])
    m.add("Picture", BLUE, *[block((x, 1.3, -0.84), (x + 0.6, 1.8, -0.8)) for x in (-4, -1, 2)])
    m.add("Side", DARK, block((6.4, 0.75, -0.4), (6.9, 0.8, 0.4)), block((6.6, 0, -0.1), (6.7, 0.75, 0.1)))
    return m


def bowl() -> Model:
    """A wide bowl, 30 cm across, with a thick wall."""
    m = Model()
    outside = [(0, 0), (0.06, 0), (0.11, 0.03), (0.15, 0.1)]
    m.add("Clay", (0.5, 0.35, 0.25), lathe([*outside, (0.138, 0.1), (0.1, 0.04), (0.05, 0.015), (0, 0.015)], 48))
    return m


def full_cup() -> Model:
    """A cup with coffee in it."""
    m = Model()
    outside = [(0, 0), (0.04, 0), (0.045, 0.09), (0.041, 0.09), (0.037, 0.006), (0, 0.006)]
    m.add("Cup", WHITE, lathe(outside, 40))
    m.add("Coffee", DARK, lathe([(0.0405, 0.075), (0, 0.075)], 40))
    return m


def chair() -> Model:
    """One chair."""
    m = Model()
    _chair(m, (0.0, 0.0), 30)
    return m


def pavilion() -> Model:
    """A roof on posts over a bench and a bin, with one wall behind them, on a lawn of 30 x 30 m."""
    m = Model()
    m.add("Lawn", GREEN, block((-15, -0.2, -15), (15, 0, 15)))
    m.add("Back", WHITE, block((-2, 0, -1), (2, 2.4, -0.9)))
    m.add("Roof", DARK, block((-2.2, 2.4, -1.2), (2.2, 2.5, 1.2)))
    m.add("Post", DARK, *[drum(0.06, 0, 2.4) + np.array([x, 0, 0.9]) for x in (-1.9, 1.9)])
    m.add("Bench", OAK, block((-1.2, 0.4, -0.8), (1.2, 0.45, -0.35)), block((-1.0, 0, -0.7), (-0.9, 0.4, -0.4)))
    m.add("Bench", OAK, block((0.9, 0, -0.7), (1.0, 0.4, -0.4)))
    m.add("Bin", RED, drum(0.2, 0, 0.8), at=(1.6, 0, 0.2))
    return m
