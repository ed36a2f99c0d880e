"""Make kitchen.glb: a farmhouse kitchen, one window over the basin (-z), two tall ones by the table (+x).

Run `python jobs/scenes/make_kitchen.py [FILE]`. Needs numpy and Pillow. Metres, y up; the floor is y = 0.
"""

import sys
from pathlib import Path

import kitchen_parts as kit
import numpy as np
import textures as tex
from glb import Material, Model, Part, place, write
from shapes import Mesh, between, box, lathe, move, slab, sweep, turn

WEST, EAST, NORTH, SOUTH, HEIGHT = -2.8, 2.8, -2.1, 2.35, 2.65  # the room's inner faces
WALL = 0.26
BASIN_WINDOW = (-0.94, 1.10, 1.95, 1.28)  # x, y of the lower left corner, width, height
TABLE_WINDOWS = ((-1.02, 0.32, 1.36, 1.98), (0.58, 0.32, 1.36, 1.98))  # z instead of x
TABLE_X, TABLE_Z = 1.18, 0.62


def materials() -> dict[str, Material]:
    """Linear reflectivities, mostly 0.2 to 0.8."""
    white = (1.0, 1.0, 1.0)
    return {
        "WallPaint": Material(colour=(0.80, 0.76, 0.67)),
        "Ceiling": Material(colour=(0.84, 0.83, 0.79)),
        "Plaster": Material(colour=(0.78, 0.75, 0.68)),
        "FloorTiles": Material(
            colour=white, metres=1.6,
            texture=tex.tiles([(0.48, 0.27, 0.17), (0.60, 0.50, 0.37)], (0.30, 0.26, 0.21), 1, 768, 4, 0.035, 0.09),
        ),
        "WallTiles": Material(
            colour=white, metres=0.6,
            texture=tex.tiles([(0.78, 0.79, 0.76), (0.72, 0.76, 0.75)], (0.5, 0.44, 0.41), 2, 512, 6, 0.05, 0.04),
        ),
        "Cabinet": Material(colour=(0.38, 0.52, 0.44)),
        "Dresser": Material(colour=(0.22, 0.36, 0.46)),
        "Cream": Material(colour=(0.76, 0.70, 0.57)),
        "WindowPaint": Material(colour=(0.80, 0.79, 0.75)),
        "Worktop": Material(colour=white, metres=1.3, texture=tex.wood((0.62, 0.43, 0.25), (0.40, 0.24, 0.12), 3, planks=8)),
        "TableTop": Material(colour=white, metres=1.1, texture=tex.wood((0.60, 0.41, 0.23), (0.38, 0.22, 0.10), 4, planks=6)),
        "Oak": Material(colour=white, metres=1.2, texture=tex.wood((0.48, 0.31, 0.17), (0.27, 0.15, 0.07), 5, 256, 1)),
        "Walnut": Material(colour=(0.24, 0.12, 0.06)),
        "Beam": Material(colour=white, metres=1.5, texture=tex.wood((0.44, 0.31, 0.19), (0.26, 0.17, 0.09), 6, 256, 1)),
        "Plinth": Material(colour=(0.14, 0.15, 0.14)),
        "Brass": Material(colour=(0.60, 0.42, 0.18)),
        "Iron": Material(colour=(0.09, 0.09, 0.095)),
        "Enamel": Material(colour=(0.68, 0.66, 0.58)),
        "Pastel": Material(colour=(0.62, 0.30, 0.22)),
        "Porcelain": Material(colour=(0.80, 0.80, 0.78)),
        "Glaze": Material(colour=(0.24, 0.42, 0.52)),
        "GlazeGreen": Material(colour=(0.36, 0.48, 0.30)),
        "Terracotta": Material(colour=(0.52, 0.24, 0.14)),
        "Wicker": Material(colour=(0.50, 0.35, 0.19)),
        "Gingham": Material(colour=white, metres=0.16, texture=tex.tiles([(0.60, 0.16, 0.12), (0.72, 0.62, 0.54)], (0.66, 0.40, 0.33), 7, 256, 4, 0.0, 0.03)),
        "Linen": Material(colour=white, metres=0.12, texture=tex.cloth((0.74, 0.68, 0.57), 8)),
        "RugWool": Material(colour=white, metres=1.1, texture=tex.lozenges((0.42, 0.16, 0.13), (0.70, 0.60, 0.44), (0.16, 0.20, 0.30), 9)),
        "Meadow": Material(colour=white, texture=tex.landscape(10, (0.50, 0.62, 0.74), [(0.28, 0.36, 0.38), (0.28, 0.38, 0.18), (0.50, 0.46, 0.16)])),
        "Dusk": Material(colour=white, texture=tex.landscape(11, (0.72, 0.50, 0.34), [(0.30, 0.26, 0.34), (0.18, 0.20, 0.22)])),
        "Flour": Material(colour=(0.76, 0.72, 0.62)),
        "Lentils": Material(colour=(0.55, 0.25, 0.10)),
        "Peas": Material(colour=(0.34, 0.40, 0.14)),
        "Coffee": Material(colour=(0.16, 0.09, 0.05)),
        "Oil": Material(colour=(0.42, 0.40, 0.08)),
        "Vinegar": Material(colour=(0.32, 0.07, 0.05)),
        "Apple": Material(colour=(0.58, 0.09, 0.06)),
        "Lemon": Material(colour=(0.74, 0.58, 0.08)),
        "Orange": Material(colour=(0.76, 0.32, 0.04)),
        "Lime": Material(colour=(0.34, 0.50, 0.08)),
        "Crust": Material(colour=(0.48, 0.26, 0.10)),
        "Crumb": Material(colour=(0.68, 0.52, 0.32)),
        "Leaf": Material(colour=(0.20, 0.38, 0.10)),
        "LeafDark": Material(colour=(0.10, 0.26, 0.09)),
        "Stem": Material(colour=(0.22, 0.33, 0.12)),
        "Tulip": Material(colour=(0.72, 0.14, 0.12)),
        "TulipPale": Material(colour=(0.78, 0.52, 0.22)),
        "Garden": Material(colour=white, metres=6.0, texture=tex.leaves([(0.12, 0.22, 0.05), (0.20, 0.30, 0.08), (0.09, 0.15, 0.05)], 12)),
        "Hedge": Material(colour=white, metres=1.6, texture=tex.leaves([(0.05, 0.11, 0.03), (0.14, 0.24, 0.07), (0.03, 0.06, 0.02)], 13, 256)),
        "Chrome": Material(colour=(0.78, 0.79, 0.80), mirror=True),
        "OvenGlass": Material(colour=(0.22, 0.22, 0.23), mirror=True),
        "Copper": Material(colour=(0.80, 0.46, 0.30), mirror=True),
    }  # fmt: skip


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
        part.append(("Beam", between((WEST - 0.05, HEIGHT - 0.17, z - 0.07), (EAST + 0.05, HEIGHT + 0.05, z + 0.07), 0.012)))
    skirting = [(0.0, -0.01), (0.0, 0.13), (-0.008, 0.13), (-0.018, 0.115), (-0.018, -0.01)]
    edge = 0.004  # into the wall
    path = [(EAST + edge, 0, NORTH + 0.6), (EAST + edge, 0, SOUTH + edge), (WEST - edge, 0, SOUTH + edge), (WEST - edge, 0, 1.4)]
    part.append(("WindowPaint", sweep(path, skirting, crease_deg=20.0)))
    return part


def windows() -> Part:
    x, y, w, h = BASIN_WINDOW
    part = kit.moved(kit.window(w, h, 4, 3), x, y, NORTH - 0.12)
    for z, y, w, h in TABLE_WINDOWS:
        part += kit.moved(kit.window(w, h, 2, 4), EAST + 0.12, y, z, turn_y=-90)
    for z, width, seed in ((-1.22, 0.24, 1), (0.33, 0.26, 2), (1.90, 0.28, 3)):
        cloth = kit.curtain(width, 2.30, seed, width * 26)
        part.append(("Linen", move(turn(cloth, "y", -90), EAST - 0.10, 0.09, z)))
    rod = turn(lathe([(0.0, -1.62), (0.024, -1.60), (0.030, -1.57), (0.018, -1.54), (0.012, -1.53), (0.012, 1.53), (0.018, 1.54),
                      (0.030, 1.57), (0.024, 1.60), (0.0, 1.62)], 14), "x", 90)  # fmt: skip
    part.append(("Walnut", move(rod, EAST - 0.10, 2.395, 0.42)))
    for z in np.r_[np.linspace(-1.20, -1.0, 5), np.linspace(0.35, 0.57, 5), np.linspace(1.92, 2.16, 5)]:
        ring = turn(kit.torus(0.018, 0.0035, 14, 6), "x", 90)
        part.append(("Brass", move(ring, EAST - 0.10, 2.391, float(z))))
    valance = kit.curtain(2.1, 0.22, 4, 26)
    part.append(("Gingham", move(valance, -1.015, 2.235, NORTH + 0.055)))
    part.append(("Brass", kit.rod((-1.05, 2.44, NORTH + 0.055), (1.12, 2.44, NORTH + 0.055), 0.008)))
    return part


def garden() -> Part:
    """A lawn and a hedge behind the windows, low enough to let the sun in."""
    part: Part = [("Garden", between((-9, -0.65, -12), (14, -0.45, 8)))]
    rng = np.random.default_rng(21)
    for i in range(26):
        along = i / 25.0
        x, z = (-8 + along * 30, -9.5) if i < 17 else (12.0, -9.5 + (i - 16) * 1.9)
        size = float(rng.uniform(0.8, 1.25))
        bush = kit.cushion(2.3 * size, 1.3 * size, 1.7, 0.62, 8)
        wobble = rng.standard_normal((8, 3))
        points = bush.points + 0.09 * np.sin(bush.points @ wobble[:3].T * 2.5) @ wobble[3:6] * 0.6
        part.append(("Hedge", move(Mesh(points=points, faces=bush.faces, crease_deg=60.0), x, -0.75, z)))
    return part


def north_side(rng: np.random.Generator) -> Part:
    """The run of cupboards under the window, basin in its middle, wall cupboards and shelves beside the window."""
    front = NORTH + 0.62
    part: Part = []
    x = WEST + 0.63
    for width, kind in ((0.60, "doors"), (0.62, "drawers")):
        part += kit.moved(kit.base_cupboard(width, "Cabinet", kind), x, 0, front)
        x += width
    basin_x = -0.36
    part += kit.moved(kit.base_cupboard(basin_x - x, "Cabinet", "door"), x, 0, front)
    part += kit.moved(kit.basin(0.72), basin_x, 0.0, front)
    under = kit.moved(kit.door(0.36, 0.53, "Cabinet", 0.325, 0.45), basin_x, 0.105, front)
    under += kit.moved(kit.door(0.36, 0.53, "Cabinet", 0.035, 0.45), basin_x + 0.36, 0.105, front)
    under += [("Cabinet", between((basin_x + 0.002, 0.1, NORTH + 0.01), (basin_x + 0.718, 0.645, front - 0.001)))]
    under += [("Plinth", between((basin_x - 0.005, -0.01, NORTH), (basin_x + 0.725, 0.11, front - 0.05)))]
    part += under
    x = basin_x + 0.72
    for width, kind in ((0.62, "drawers"), (0.60, "doors"), (0.60, "drawers"), (EAST - x - 1.82, "doors")):
        part += kit.moved(kit.base_cupboard(width, "Cabinet", kind), x, 0, front)
        x += width
    part += [("Worktop", move(mesh, 0, 0, front)) for mesh in kit.worktop(WEST - 0.01, EAST + 0.01, (basin_x, basin_x + 0.72))]
    part += kit.moved(kit.tap(), basin_x + 0.36, 0.914, NORTH + 0.085)
    part.append(("WallTiles", between((WEST - 0.01, 0.905, NORTH - 0.01), (EAST + 0.01, 1.08, NORTH + 0.010))))
    part.append(("WallTiles", between((WEST - 0.01, 1.0795, NORTH - 0.01), (BASIN_WINDOW[0] - 0.06, 1.50, NORTH + 0.0098))))
    part.append(("WallTiles", between((BASIN_WINDOW[0] + BASIN_WINDOW[2] + 0.06, 1.0795, NORTH - 0.01), (EAST + 0.01, 1.50, NORTH + 0.0098))))
    part += kit.moved(kit.wall_cupboard(1.08, 0.78, "Cabinet"), -2.13, 1.50, NORTH + 0.33)
    return part + open_shelves(rng)


def open_shelves(rng: np.random.Generator) -> Part:
    """Three boards on iron brackets right of the window, full of plates, jars, cups and bottles."""
    part: Part = []
    x0, x1 = 1.16, 2.70
    for level, y in enumerate((1.46, 1.80, 2.12)):
        part.append(("Oak", between((x0, y, NORTH + 0.002), (x1, y + 0.028, NORTH + 0.25), 0.005)))
        for x in (x0 + 0.12, x1 - 0.12):
            part.append(("Iron", between((x, y - 0.16, NORTH + 0.001), (x + 0.02, y + 0.002, NORTH + 0.012))))
            part.append(("Iron", kit.rod((x + 0.01, y - 0.15, NORTH + 0.008), (x + 0.01, y + 0.004, NORTH + 0.2), 0.006)))
        x = x0 + 0.14
        while x < x1 - 0.12:
            kind = int(rng.integers(6))
            z = NORTH + 0.13 + float(rng.uniform(-0.02, 0.02))
            wide, thing = shelf_thing(rng, kind, level)
            if x + wide > x1 - 0.02:
                break
            part += kit.moved(thing, x + wide / 2 - 0.06, y + 0.0285, z, turn_y=float(rng.uniform(0, 360)))
            x += wide
    return part


def shelf_thing(rng: np.random.Generator, kind: int, level: int) -> tuple[float, Part]:
    """A thing for a shelf and the room it takes along it."""
    glaze = ("Porcelain", "Glaze", "GlazeGreen", "Cream")[int(rng.integers(4))]
    if kind == 0:
        return 0.28, kit.plate_stack(int(rng.integers(4, 9)), glaze, float(rng.uniform(0.8, 0.95)))
    if kind == 1:
        return 0.13, kit.cup(glaze)
    if kind == 2:
        bowls: Part = [(glaze, move(lathe(np.array(kit.BOWL) * 0.85, 22), 0, 0.028 * i)) for i in range(int(rng.integers(2, 5)))]
        return 0.20, bowls
    if kind == 3 and level < 2:
        return 0.10, kit.bottle(("Oil", "Vinegar", "GlazeGreen")[int(rng.integers(3))], float(rng.uniform(0.75, 0.92)))
    return 0.125, kit.jar(("Flour", "Lentils", "Peas", "Coffee")[int(rng.integers(4))], float(rng.uniform(0.8, 1.4)))


def west_side(rng: np.random.Generator) -> Part:
    """The cooker under its hood, cupboards beside it, the refrigerator; all look along +x."""

    def along(part: Part, z: float, y: float = 0.0) -> Part:
        """From a part whose left end is x = 0 to one that starts at z and runs towards -z."""
        return kit.moved(part, WEST + 0.62, y, z, turn_y=90)

    part = along(kit.base_cupboard(0.46, "Cabinet", "drawers"), -1.02) + along(kit.cooker(), -0.115)
    part += along(kit.base_cupboard(0.70, "Cabinet", "doors"), 0.60)
    part += along([("Worktop", m) for m in kit.worktop(0.0, 0.458)], -1.021)
    part += along([("Worktop", m) for m in kit.worktop(0.0, 0.71)], 0.60)
    part += along(kit.hood(1.02), -0.055, 1.52)
    part.append(("WallTiles", between((WEST - 0.01, 0.905, -1.47), (WEST + 0.010, 1.53, 0.60))))
    part += along(kit.fridge(), 1.40)
    part += along(kit.hanging(rng, 0.86), -0.13, 1.47)[:0]
    rail = kit.moved(kit.hanging(rng, 0.94), WEST + 0.01, 1.46, -0.10, turn_y=90)
    part += rail
    part += kit.moved(kit.wall_cupboard(0.62, 0.78, "Cabinet"), WEST + 0.33, 1.50, 0.60, turn_y=90)
    on_hob = [(kit.kettle(), -0.36, -0.29, 205.0), (kit.pan(0.10, 0.11, "Copper", True), -0.61, -0.56, 300.0),
              (kit.pan(0.12, 0.07, "Enamel", False), -0.38, -0.80, 250.0)]  # fmt: skip
    for thing, dx, z, angle in on_hob:
        part += kit.moved(thing, WEST + 0.62 + dx + 0.19, 0.9548, z, turn_y=angle)
    return part


def on_worktops(rng: np.random.Generator) -> Part:
    """What stands on the worktops and the window sill."""
    y = 0.9155
    back = NORTH + 0.2
    part: Part = []
    part += kit.moved(kit.toaster(), 1.62, y, NORTH + 0.30, turn_y=-14)
    part += kit.moved(kit.loaf(), 0.83, y, NORTH + 0.36, turn_y=12)
    part += kit.moved(kit.knife_block(), -0.62, y, NORTH + 0.17, turn_y=20)
    part += kit.moved(kit.board(0.26, 0.34, 11), -0.95, y, NORTH + 0.085)
    part += kit.moved(kit.board(0.20, 0.27, 14), -1.16, y, NORTH + 0.10)
    for x, content, height in ((2.12, "Flour", 1.5), (2.27, "Lentils", 1.2), (2.42, "Peas", 1.0), (2.56, "Coffee", 0.8)):
        part += kit.moved(kit.jar(content, height), x, y, back, turn_y=30)
    for x, z, kind, height in ((-1.62, 0.16, "Oil", 1.0), (-1.52, 0.22, "Vinegar", 0.9), (-1.72, 0.24, "Oil", 0.8)):
        part += kit.moved(kit.bottle(kind, height), x, y, NORTH + z)
    part += kit.moved(kit.basket(0.15, 0.13), -2.38, y, NORTH + 0.35)
    for i in range(7):
        egg = kit.cushion(0.07, 0.06, 0.06, 0.029, 6)
        part.append((("Apple", "Lemon", "Orange")[i % 3], move(egg, -2.38 + 0.07 * np.cos(i), y + 0.06 + 0.012 * i, NORTH + 0.35 + 0.07 * np.sin(i))))
    part += kit.moved(kit.plant(rng, 11, 0.20, "Terracotta"), -0.55, 1.0975, NORTH + 0.015)[:0]
    for x, n, size, pot in ((-0.56, 14, 0.20, "Terracotta"), (-0.34, 12, 0.15, "Glaze"), (0.52, 14, 0.22, "Terracotta")):
        part += kit.moved(kit.plant(rng, n, size, pot), x, 1.0985, NORTH + 0.005, turn_y=float(rng.uniform(0, 360)))
    part += kit.moved(kit.pan(0.11, 0.10, "Copper", True), WEST + 0.33, y, 0.25, turn_y=-35)
    part += kit.moved(kit.plate_stack(5, "Glaze"), WEST + 0.30, y, 0.48)
    for x, z in ((1.25, 0.40), (1.13, 0.30)):
        part += kit.moved(kit.cup("Glaze"), x, y, NORTH + z, turn_y=float(rng.uniform(0, 360)))
    part += kit.moved([("Gingham", kit.curtain(0.30, 0.42, 9, 5))], 0.42, 0.50, NORTH + 0.62 + 0.062)[:0]
    return part


def dining(rng: np.random.Generator) -> Part:
    """The table laid for a late breakfast, the rug, three lamps."""
    part = kit.moved(kit.table(1.75, 0.92), TABLE_X, 0, TABLE_Z)
    part.append(("RugWool", move(kit.rug(2.2, 1.65), TABLE_X - 0.05, 0, TABLE_Z)))
    y = 0.7505
    for x, z, angle in ((-0.45, -0.27, 0), (0.42, -0.27, 0), (-0.45, 0.27, 180), (0.42, 0.27, 180)):
        part += kit.moved(kit.plate_stack(1, "Porcelain", 1.0) + kit.moved(kit.plate_stack(1, "Glaze", 0.72), 0, 0.009), TABLE_X + x, y, TABLE_Z + z)
        part += kit.moved(kit.cup("Porcelain"), TABLE_X + x + 0.19, y, TABLE_Z + z - 0.03, turn_y=float(rng.uniform(0, 360)))
        knife = box(0.018, 0.003, 0.2, 0.001)
        part.append(("Chrome", move(turn(knife, "y", float(rng.uniform(-5, 5))), TABLE_X + x - 0.17, y - 0.0005, TABLE_Z + z)))
    part += kit.moved(kit.fruit_bowl(rng), TABLE_X - 0.02, y, TABLE_Z + 0.02)
    part += kit.moved(kit.tulips(rng), TABLE_X + 0.36, y, TABLE_Z + 0.03)
    part += kit.moved(kit.kettle(), TABLE_X - 0.33, y + 0.012, TABLE_Z - 0.02, turn_y=150)
    part.append(("Oak", move(lathe([(0.0, 0.0), (0.12, 0.0), (0.12, 0.013), (0.0, 0.013)], 28, 30.0), TABLE_X - 0.33, y - 0.0007, TABLE_Z - 0.02)))
    return part


def south_side(rng: np.random.Generator) -> Part:
    """A dresser with plates, a clock and pictures on the wall behind the camera's start."""
    part: Part = []
    cupboard: Part = []
    for i in range(3):
        cupboard += kit.moved(kit.base_cupboard(0.5, "Dresser", "door"), 0.5 * i, 0, 0)
    cupboard.append(("Worktop", between((-0.02, 0.872, -0.6), (1.52, 0.905, 0.03), 0.006)))
    for x in (0.0, 1.47):
        cupboard.append(("Dresser", between((x, 0.90, -0.6), (x + 0.03, 1.95, -0.36), 0.004)))
    for y in (1.22, 1.55, 1.93):
        cupboard.append(("Dresser", between((0.01, y, -0.599), (1.49, y + 0.022, -0.355), 0.004)))
        for x in np.arange(0.17, 1.4, 0.235) if y < 1.9 else ():
            dish = turn(lathe(np.array(kit.PLATE) * 0.95, 26), "x", 78)
            colour = ("Glaze", "Porcelain", "Cream")[int(rng.integers(3))]
            cupboard.append((colour, move(dish, float(x), y + 0.147, -0.575)))
    part += kit.moved(cupboard, 0.95, 0, SOUTH - 0.6, turn_y=180)
    part += kit.moved(kit.clock(), -1.1, 1.95, SOUTH, turn_y=180)
    part += kit.moved(kit.picture(0.62, 0.46, "Meadow"), 2.15, 1.42, SOUTH - 0.002, turn_y=180)
    part += kit.moved(kit.picture(0.34, 0.44, "Dusk"), 2.62, 1.42, SOUTH - 0.002, turn_y=180)
    part += kit.moved(kit.plant(rng, 16, 0.30, "Terracotta"), 0.68, 0.905, SOUTH - 0.30)
    part += kit.moved(kit.basket(0.19, 0.3), 2.45, 0.0, SOUTH - 0.28)
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
    model.add("lamp", kit.pendant(), [place(TABLE_X + dx, HEIGHT - 1.0, TABLE_Z) for dx in (-0.55, 0.0, 0.55)])
    seats = ((-0.42, -0.58, 4), (0.40, -0.66, -9), (-0.46, 0.62, 183), (0.44, 0.60, 172), (-1.10, 0.05, 97))
    for i, (x, z, angle) in enumerate(seats):
        model.add(f"chair-{i}", kit.chair(rng, "Cream" if i % 2 else "Dresser"), [place(TABLE_X + x, 0.0, TABLE_Z + z, angle)])
    return model


if __name__ == "__main__":
    write(build(), Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("kitchen.glb"))
