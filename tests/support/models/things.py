"""Things to look at from outside: vessels, a car, a table on a wide floor."""

from support.models.rooms import DARK, GREEN, OAK, RED, WHITE
from support.models.shapes import Model, block, drum, lathe


def mug() -> Model:
    """9.5 cm high, with a wall of 4 mm."""
    m = Model()
    outside = [(0, 0), (0.038, 0), (0.041, 0.004), (0.041, 0.095)]
    inside = [(0.037, 0.095), (0.037, 0.009), (0.034, 0.006), (0, 0.006)]
    m.add("Glaze", (0.3, 0.45, 0.6), lathe(outside + inside, 48))
    return m


def bottle() -> Model:
    """A hollow bottle, 30 cm high, open at its narrow neck."""
    m = Model()
    outside = [(0, 0), (0.04, 0), (0.04, 0.18), (0.015, 0.24), (0.015, 0.3)]
    inside = [(0.012, 0.3), (0.012, 0.239), (0.037, 0.179), (0.037, 0.003), (0, 0.003)]
    m.add("Clay", (0.55, 0.35, 0.22), lathe(outside + inside, 40))
    m.add("Label", WHITE, lathe([(0.0405, 0.05), (0.0405, 0.13)], 40))
    return m


def car() -> Model:
    """4.2 m long; a body with walls, four seats inside, openings instead of panes, wheels."""
    m = Model()
    paint = (0.55, 0.08, 0.06)
    m.add("Body", paint, block((-2.1, 0.3, -0.8), (2.1, 0.42, 0.8)), block((0.9, 0.42, -0.8), (2.1, 0.95, 0.8)))
    m.add("Body", paint, block((-2.1, 0.42, -0.8), (-1.5, 0.95, 0.8)), block((-1.3, 1.36, -0.7), (0.5, 1.42, 0.7)))
    for z in (-0.8, 0.74):
        m.add("Body", paint, block((-1.5, 0.42, z), (0.9, 0.9, z + 0.06)))
        for x in (-1.48, -0.4, 0.72):
            m.add("Pillar", DARK, block((x, 0.9, z), (x + 0.08, 1.37, z + 0.06)))
    for x in (-1.1, 0.0):
        for z in (-0.45, 0.25):
            back = block((x, 0.6, z), (x + 0.12, 1.1, z + 0.45))
            m.add("Seat", (0.3, 0.25, 0.2), block((x, 0.42, z), (x + 0.5, 0.6, z + 0.45)), back)
    for x in (-1.35, 1.35):
        for z in (-0.82, 0.62):
            lying = drum(0.32, 0, 0.2, 24)[:, :, [0, 2, 1]][:, ::-1]
            m.add("Wheel", DARK, lying, at=(x, 0.32, z))
    lights = [block((2.1, 0.6, z), (2.12, 0.75, z + 0.3)) for z in (-0.7, 0.4)]
    m.add("Lights", (0.8, 0.8, 0.6), *lights)
    return m


def table_scene() -> Model:
    """A table with a bowl, books and a bottle on it, on a floor of 40 x 40 m."""
    m = Model()
    m.add("Ground", (0.4, 0.42, 0.4), block((-20, -0.2, -20), (20, 0, 20)))
    m.add("Table", OAK, block((-0.8, 0.71, -0.45), (0.8, 0.75, 0.45)))
    legs = [(x, z) for x in (-0.72, 0.72) for z in (-0.38, 0.38)]
    m.add("Table", OAK, *[block((x - 0.03, 0, z - 0.03), (x + 0.03, 0.71, z + 0.03)) for x, z in legs])
    m.add("Bowl", GREEN, lathe([(0, 0), (0.08, 0), (0.18, 0.1), (0.17, 0.1), (0, 0.02)]), at=(-0.3, 0.75, 0.1))
    books = [block((0.2, 0.75 + 0.04 * k, -0.2), (0.45 - 0.02 * k, 0.79 + 0.04 * k, 0.12)) for k in range(3)]
    m.add("Books", RED, *books)
    bottle = lathe([(0, 0), (0.04, 0), (0.04, 0.2), (0.015, 0.26), (0.015, 0.32), (0, 0.32)])
    m.add("Bottle", DARK, bottle, at=(0.05, 0.75, -0.2))
    return m
