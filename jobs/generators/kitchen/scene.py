"""kitchen.glb: a farmhouse kitchen, one window over the basin (-z), two tall ones by the table (+x).

Needs numpy and Pillow. Metres, y up; the floor is y = 0.
"""

import numpy as np

from ..common.furniture import chair, clock, pendant, picture, rug, table
from ..common.glb import Model, place
from ..common.parts import Part, moved
from ..common.plants import plant, tulips
from ..common.shapes import between, box, cushion, move, turn
from ..common.turned import lathe, rod
from .cooking import cooker, fridge, hanging, hood, kettle, pan, tap, toaster
from .crockery import BOWL, PLATE, basket, board, bottle, cup, fruit_bowl, jar, knife_block, loaf, plate_stack
from .cupboards import base_cupboard, basin, door, wall_cupboard, worktop
from .materials import materials
from .plan import BASIN_WINDOW, EAST, HEIGHT, NORTH, SOUTH, TABLE_X, TABLE_Z, WEST
from .room import garden, room, windows


def north_side(rng: np.random.Generator) -> Part:
    """The run of cupboards under the window, basin in its middle, wall cupboards and shelves beside the window."""
    front = NORTH + 0.62
    part: Part = []
    x = WEST + 0.63
    for width, kind in ((0.60, "doors"), (0.62, "drawers")):
        part += moved(base_cupboard(width, "Cabinet", kind), x, 0, front)
        x += width
    basin_x = -0.36
    part += moved(base_cupboard(basin_x - x, "Cabinet", "door"), x, 0, front)
    part += moved(basin(0.72), basin_x, 0.0, front)
    under = moved(door(0.36, 0.53, "Cabinet", 0.325, 0.45), basin_x, 0.105, front)
    under += moved(door(0.36, 0.53, "Cabinet", 0.035, 0.45), basin_x + 0.36, 0.105, front)
    under += [("Cabinet", between((basin_x + 0.002, 0.1, NORTH + 0.01), (basin_x + 0.718, 0.645, front - 0.001)))]
    under += [("Plinth", between((basin_x - 0.005, -0.01, NORTH), (basin_x + 0.725, 0.11, front - 0.05)))]
    part += under
    x = basin_x + 0.72
    for width, kind in ((0.62, "drawers"), (0.60, "doors"), (0.60, "drawers"), (EAST - x - 1.82, "doors")):
        part += moved(base_cupboard(width, "Cabinet", kind), x, 0, front)
        x += width
    part += [
        ("Worktop", move(mesh, 0, 0, front)) for mesh in worktop(WEST - 0.01, EAST + 0.01, (basin_x, basin_x + 0.72))
    ]
    part += moved(tap(), basin_x + 0.36, 0.914, NORTH + 0.085)
    part.append(("WallTiles", between((WEST - 0.01, 0.905, NORTH - 0.01), (EAST + 0.01, 1.08, NORTH + 0.010))))
    part.append(
        ("WallTiles", between((WEST - 0.01, 1.0795, NORTH - 0.01), (BASIN_WINDOW[0] - 0.06, 1.50, NORTH + 0.0098)))
    )
    part.append(
        (
            "WallTiles",
            between(
                (BASIN_WINDOW[0] + BASIN_WINDOW[2] + 0.06, 1.0795, NORTH - 0.01), (EAST + 0.01, 1.50, NORTH + 0.0098)
            ),
        )
    )
    part += moved(wall_cupboard(1.08, 0.78, "Cabinet"), -2.13, 1.50, NORTH + 0.33)
    return part + open_shelves(rng)


def open_shelves(rng: np.random.Generator) -> Part:
    """Three boards on iron brackets right of the window, full of plates, jars, cups and bottles."""
    part: Part = []
    x0, x1 = 1.16, 2.70
    for level, y in enumerate((1.46, 1.80, 2.12)):
        part.append(("Oak", between((x0, y, NORTH + 0.002), (x1, y + 0.028, NORTH + 0.25), 0.005)))
        for x in (x0 + 0.12, x1 - 0.12):
            part.append(("Iron", between((x, y - 0.16, NORTH + 0.001), (x + 0.02, y + 0.002, NORTH + 0.012))))
            part.append(("Iron", rod((x + 0.01, y - 0.15, NORTH + 0.008), (x + 0.01, y + 0.004, NORTH + 0.2), 0.006)))
        x = x0 + 0.14
        while x < x1 - 0.12:
            kind = int(rng.integers(6))
            z = NORTH + 0.13 + float(rng.uniform(-0.02, 0.02))
            wide, thing = shelf_thing(rng, kind, level)
            if x + wide > x1 - 0.02:
                break
            part += moved(thing, x + wide / 2 - 0.06, y + 0.0285, z, turn_y=float(rng.uniform(0, 360)))
            x += wide
    return part


def shelf_thing(rng: np.random.Generator, kind: int, level: int) -> tuple[float, Part]:
    """A thing for a shelf, and its width."""
    glaze = ("Porcelain", "Glaze", "GlazeGreen", "Cream")[int(rng.integers(4))]
    if kind == 0:
        return 0.28, plate_stack(int(rng.integers(4, 9)), glaze, float(rng.uniform(0.8, 0.95)))
    if kind == 1:
        return 0.13, cup(glaze)
    if kind == 2:
        bowls: Part = [(glaze, move(lathe(BOWL * 0.85, 22), 0, 0.028 * i)) for i in range(int(rng.integers(2, 5)))]
        return 0.20, bowls
    if kind == 3 and level < 2:
        return 0.10, bottle(("Oil", "Vinegar", "GlazeGreen")[int(rng.integers(3))], float(rng.uniform(0.75, 0.92)))
    return 0.125, jar(("Flour", "Lentils", "Peas", "Coffee")[int(rng.integers(4))], float(rng.uniform(0.8, 1.4)))


def west_side(rng: np.random.Generator) -> Part:
    """The cooker under its hood, cupboards beside it, the refrigerator; all look along +x."""

    def along(part: Part, z: float, y: float = 0.0) -> Part:
        """Move a part whose left end is x = 0 so that it starts at z and runs towards -z."""
        return moved(part, WEST + 0.62, y, z, turn_y=90)

    part = along(base_cupboard(0.46, "Cabinet", "drawers"), -1.02) + along(cooker(), -0.115)
    part += along(base_cupboard(0.70, "Cabinet", "doors"), 0.60)
    part += along([("Worktop", m) for m in worktop(0.0, 0.458)], -1.021)
    part += along([("Worktop", m) for m in worktop(0.0, 0.71)], 0.60)
    part += along(hood(1.02), -0.055, 1.52)
    part.append(("WallTiles", between((WEST - 0.01, 0.905, -1.47), (WEST + 0.010, 1.53, 0.60))))
    part += along(fridge(), 1.40)
    rail = moved(hanging(rng, 0.94), WEST + 0.01, 1.46, -0.10, turn_y=90)
    part += rail
    part += moved(wall_cupboard(0.62, 0.78, "Cabinet"), WEST + 0.33, 1.50, 0.60, turn_y=90)
    on_hob = [
        (kettle(), -0.36, -0.29, 205.0),
        (pan(0.10, 0.11, "Copper", True), -0.61, -0.56, 300.0),
        (pan(0.12, 0.07, "Enamel", False), -0.38, -0.80, 250.0),
    ]
    for thing, dx, z, angle in on_hob:
        part += moved(thing, WEST + 0.62 + dx + 0.19, 0.9548, z, turn_y=angle)
    return part


def on_worktops(rng: np.random.Generator) -> Part:
    """Things on the worktops and the window sill."""
    y = 0.9155
    back = NORTH + 0.2
    part: Part = []
    part += moved(toaster(), 1.62, y, NORTH + 0.30, turn_y=-14)
    part += moved(loaf(), 0.83, y, NORTH + 0.36, turn_y=12)
    part += moved(knife_block(), -0.62, y, NORTH + 0.17, turn_y=20)
    part += moved(board(0.26, 0.34, 11), -0.95, y, NORTH + 0.085)
    part += moved(board(0.20, 0.27, 14), -1.16, y, NORTH + 0.10)
    for x, content, height in (
        (2.12, "Flour", 1.5),
        (2.27, "Lentils", 1.2),
        (2.42, "Peas", 1.0),
        (2.56, "Coffee", 0.8),
    ):
        part += moved(jar(content, height), x, y, back, turn_y=30)
    for x, z, kind, height in ((-1.62, 0.16, "Oil", 1.0), (-1.52, 0.22, "Vinegar", 0.9), (-1.72, 0.24, "Oil", 0.8)):
        part += moved(bottle(kind, height), x, y, NORTH + z)
    part += moved(basket(0.15, 0.13), -2.38, y, NORTH + 0.35)
    for i in range(7):
        egg = cushion(0.07, 0.06, 0.06, 0.029, 6)
        part.append(
            (
                ("Apple", "Lemon", "Orange")[i % 3],
                move(egg, -2.38 + 0.07 * np.cos(i), y + 0.06 + 0.012 * i, NORTH + 0.35 + 0.07 * np.sin(i)),
            )
        )
    for x, n, size, pot in (
        (-0.56, 14, 0.20, "Terracotta"),
        (-0.34, 12, 0.15, "Glaze"),
        (0.52, 14, 0.22, "Terracotta"),
    ):
        part += moved(plant(rng, n, size, pot), x, 1.0985, NORTH + 0.005, turn_y=float(rng.uniform(0, 360)))
    part += moved(pan(0.11, 0.10, "Copper", True), WEST + 0.33, y, 0.25, turn_y=-35)
    part += moved(plate_stack(5, "Glaze"), WEST + 0.30, y, 0.48)
    for x, z in ((1.25, 0.40), (1.13, 0.30)):
        part += moved(cup("Glaze"), x, y, NORTH + z, turn_y=float(rng.uniform(0, 360)))
    return part


def dining(rng: np.random.Generator) -> Part:
    """The table laid for a late breakfast, the rug, three lamps."""
    part = moved(table(1.75, 0.92), TABLE_X, 0, TABLE_Z)
    part.append(("RugWool", move(rug(2.2, 1.65), TABLE_X - 0.05, 0, TABLE_Z)))
    y = 0.7505
    for x, z in ((-0.45, -0.27), (0.42, -0.27), (-0.45, 0.27), (0.42, 0.27)):
        part += moved(
            plate_stack(1, "Porcelain", 1.0) + moved(plate_stack(1, "Glaze", 0.72), 0, 0.009),
            TABLE_X + x,
            y,
            TABLE_Z + z,
        )
        part += moved(cup("Porcelain"), TABLE_X + x + 0.19, y, TABLE_Z + z - 0.03, turn_y=float(rng.uniform(0, 360)))
        knife = box(0.018, 0.003, 0.2, 0.001)
        part.append(
            ("Chrome", move(turn(knife, "y", float(rng.uniform(-5, 5))), TABLE_X + x - 0.17, y - 0.0005, TABLE_Z + z))
        )
    part += moved(fruit_bowl(rng), TABLE_X - 0.02, y, TABLE_Z + 0.02)
    part += moved(tulips(rng), TABLE_X + 0.36, y, TABLE_Z + 0.03)
    part += moved(kettle(), TABLE_X - 0.33, y + 0.012, TABLE_Z - 0.02, turn_y=150)
    part.append(
        (
            "Oak",
            move(
                lathe([(0.0, 0.0), (0.12, 0.0), (0.12, 0.013), (0.0, 0.013)], 28, 30.0),
                TABLE_X - 0.33,
                y - 0.0007,
                TABLE_Z - 0.02,
            ),
        )
    )
    return part


def south_side(rng: np.random.Generator) -> Part:
    """A dresser with plates, a clock and pictures on the wall behind the camera's start."""
    part: Part = []
    cupboard: Part = []
    for i in range(3):
        cupboard += moved(base_cupboard(0.5, "Dresser", "door"), 0.5 * i, 0, 0)
    cupboard.append(("Worktop", between((-0.02, 0.872, -0.6), (1.52, 0.905, 0.03), 0.006)))
    for x in (0.0, 1.47):
        cupboard.append(("Dresser", between((x, 0.90, -0.6), (x + 0.03, 1.95, -0.36), 0.004)))
    for y in (1.22, 1.55, 1.93):
        cupboard.append(("Dresser", between((0.01, y, -0.599), (1.49, y + 0.022, -0.355), 0.004)))
        for x in np.arange(0.17, 1.4, 0.235) if y < 1.9 else ():
            dish = turn(lathe(PLATE * 0.95, 26), "x", 78)
            colour = ("Glaze", "Porcelain", "Cream")[int(rng.integers(3))]
            cupboard.append((colour, move(dish, float(x), y + 0.147, -0.575)))
    part += moved(cupboard, 0.95, 0, SOUTH - 0.6, turn_y=180)
    part += moved(clock(), -1.1, 1.95, SOUTH, turn_y=180)
    part += moved(picture(0.62, 0.46, "Meadow"), 2.15, 1.42, SOUTH - 0.002, turn_y=180)
    part += moved(picture(0.34, 0.44, "Dusk"), 2.62, 1.42, SOUTH - 0.002, turn_y=180)
    part += moved(plant(rng, 16, 0.30, "Terracotta"), 0.68, 0.905, SOUTH - 0.30)
    part += moved(basket(0.19, 0.3), 2.45, 0.0, SOUTH - 0.28)
    return part


def build() -> Model:
    """The whole kitchen."""
    rng = np.random.default_rng(2006)
    model = Model(materials=materials())
    model.add("room", room())
    model.add("windows", windows())
    model.add("garden", garden())
    model.add("north-side", north_side(rng))
    model.add("west-side", west_side(rng))
    model.add("south-side", south_side(rng))
    model.add("worktop-things", on_worktops(rng))
    model.add("dining", dining(rng))
    model.add("lamp", pendant(), [place(TABLE_X + dx, HEIGHT - 1.0, TABLE_Z) for dx in (-0.55, 0.0, 0.55)])
    seats = ((-0.42, -0.58, 4), (0.40, -0.66, -9), (-0.46, 0.62, 183), (0.44, 0.60, 172), (-1.10, 0.05, 97))
    for i, (x, z, angle) in enumerate(seats):
        model.add(
            f"chair-{i}", chair(rng, "Cream" if i % 2 else "Dresser"), [place(TABLE_X + x, 0.0, TABLE_Z + z, angle)]
        )
    return model
