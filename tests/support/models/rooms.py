"""Rooms and places: a dining room, a street, a bare room."""

from support.models.shapes import Model, block, drum, lathe, wall

WHITE, OAK, DARK = (0.75, 0.74, 0.7), (0.45, 0.3, 0.18), (0.12, 0.1, 0.1)
RED, GREEN, BLUE = (0.6, 0.12, 0.1), (0.2, 0.42, 0.2), (0.15, 0.25, 0.5)


def dining_room() -> Model:
    """5 x 4 x 2.6 m: a table with six chairs, two windows in one wall, a painting on another, and two bare walls."""
    m = Model()
    m.add("Floor", (0.4, 0.32, 0.24), block((-2.6, -0.1, -2.1), (2.6, 0, 2.1)))
    m.add("Ceiling", WHITE, block((-2.6, 2.6, -2.1), (2.6, 2.7, 2.1)))
    windows = [(0.8, 2.0, 0.9, 2.2), (3.0, 4.2, 0.9, 2.2)]
    m.add("Wall", WHITE, wall((-2.5, -2), (2.5, -2), 2.6, windows), wall((-2.5, 2), (2.5, 2), 2.6))
    m.add("Wall", WHITE, wall((2.5, -2), (2.5, 2), 2.6), wall((-2.5, -2), (-2.5, 2), 2.6))
    for x in (-1.7, 0.5):
        bars = [block((x, y, -2.03), (x + 1.2, y + 0.05, -1.97)) for y in (0.9, 1.5, 2.15)]
        m.add("WindowFrame", (0.5, 0.5, 0.48), *bars, block((x + 0.58, 0.9, -2.03), (x + 0.63, 2.2, -1.97)))
    m.add("Painting", RED, block((-2.44, 1.1, -0.3), (-2.4, 1.9, 0.9)))
    m.add("PaintingFrame", OAK, block((-2.44, 1.02, -0.38), (-2.41, 1.98, 0.98)))
    _dining_table(m, -0.4, -0.5)
    m.add("Sideboard", OAK, block((-2.44, 0.1, -1.7), (-2.0, 0.85, -0.6)), block((-2.4, 0, -1.6), (-2.1, 0.1, -0.7)))
    m.add("Vase", BLUE, lathe([(0, 0), (0.08, 0), (0.12, 0.12), (0.05, 0.25), (0, 0.25)]), at=(-2.2, 0.85, -1.1))
    return m


def _dining_table(m: Model, x: float, z: float) -> None:
    m.add("Table", OAK, block((x - 0.8, 0.71, z - 0.45), (x + 0.8, 0.75, z + 0.45)))
    legs = [(x + a, z + b) for a in (-0.72, 0.72) for b in (-0.38, 0.38)]
    m.add("Table", OAK, *[block((a - 0.03, 0, b - 0.03), (a + 0.03, 0.71, b + 0.03)) for a, b in legs])
    for k in range(6):
        side = -1 if k < 3 else 1
        _chair(m, (x + 0.5 * (k % 3 - 1), z + side * 0.55), 0 if side < 0 else 180)
    m.add("Bowl", GREEN, lathe([(0, 0), (0.07, 0), (0.15, 0.08), (0.14, 0.08), (0, 0.02)]), at=(x, 0.75, z))


def _chair(m: Model, place: tuple[float, float], turn_deg: float) -> None:
    legs = [block((x, 0, z), (x + 0.03, 0.43, z + 0.03)) for x in (-0.19, 0.16) for z in (-0.19, 0.16)]
    back = [block((x, 0.46, -0.2), (x + 0.03, 0.9, -0.17)) for x in (-0.19, 0.16)]
    shapes = [block((-0.2, 0.43, -0.2), (0.2, 0.46, 0.2)), block((-0.16, 0.65, -0.19), (0.16, 0.85, -0.17))]
    m.add("Chair", DARK, *legs, *back, *shapes, at=(place[0], 0, place[1]), turn_deg=turn_deg)


def street() -> Model:
    """80 m of a street between two rows of houses, with cars and trees, and a tower at its end."""
    m = Model()
    m.add("Ground", (0.3, 0.3, 0.3), block((-40, -0.2, -14), (40, 0, 14)))
    for side in (-1, 1):
        kerb, deep, face = (sorted((side * a, side * b)) for a, b in ((4, 6), (6, 13), (5.95, 6)))
        m.add("Pavement", (0.5, 0.5, 0.48), block((-40, 0, kerb[0]), (36, 0.15, kerb[1])))
        for k in range(6):
            x, high = -39 + 12.4 * k, 7 + (5 * k + 3 * side) % 4
            colour = ((0.6, 0.45, 0.35), (0.65, 0.6, 0.45), (0.5, 0.3, 0.25))[(k + side) % 3]
            m.add(f"House{(k + side) % 3}", colour, block((x, 0, deep[0]), (x + 11.6, high, deep[1])))
            for i in range(4):
                for y in (1.2, 4.2):
                    m.add("Pane", DARK, block((x + 1 + 2.7 * i, y, face[0]), (x + 2.2 + 2.7 * i, y + 1.6, face[1])))
        for x in (-30, -12, 6, 24):
            m.add("Trunk", OAK, drum(0.15, 0, 2.2), at=(x + 3 * side, 0, side * 4.8))
            crown = [(0, 1.9), (1.0, 2.4), (1.3, 3.2), (0.8, 4.1), (0, 4.4)]
            m.add("Crown", GREEN, lathe(crown, 12), at=(x + 3 * side, 0, side * 4.8))
    for x, z, colour in ((-22, 2.8, 0), (2, -2.8, 1), (13, 2.8, 2)):
        m.add(f"Car{colour}", (RED, BLUE, WHITE)[colour], block((x, 0.3, z - 0.8), (x + 4, 0.9, z + 0.8)))
        m.add(f"Car{colour}", (RED, BLUE, WHITE)[colour], block((x + 0.8, 0.9, z - 0.7), (x + 3.2, 1.45, z + 0.7)))
    m.add("Tower", (0.55, 0.5, 0.42), block((36, 0, -4), (40, 18, 4)))
    return m


def bare_room() -> Model:
    """Nothing but the inside of a room with a window and a door opening, and a stool in one corner."""
    m = Model()
    m.add("Floor", OAK, block((-2, -0.1, -1.5), (2, 0, 1.5)))
    m.add("Ceiling", WHITE, block((-2, 2.4, -1.5), (2, 2.5, 1.5)))
    m.add("Wall", WHITE, wall((-2, -1.5), (2, -1.5), 2.4, [(1.2, 2.8, 0.9, 2.0)]), wall((-2, 1.5), (2, 1.5), 2.4))
    m.add("Wall", WHITE, wall((2, -1.5), (2, 1.5), 2.4), wall((-2, -1.5), (-2, 1.5), 2.4, [(1.8, 2.7, 0, 2.0)]))
    m.add("Stool", RED, block((1.2, 0, -1.1), (1.6, 0.45, -0.7)))
    return m
