"""Make stairs.glb: the grand stair of a theatre, lit through seven tall windows in the wall behind the visitor (+z).

Run `python jobs/scenes/make_stairs.py [FILE]`. Needs numpy and Pillow. Metres, y up; the floor is y = 0.
A flight of 16 steps leads to a landing with a great mirror, two more lead left and right to the galleries.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import stairs_parts as kit
import textures as tex
from glb import Material, Model, Part, place, write
from kitchen_parts import moved, picture
from shapes import Array, Mesh, between, box, extrude, mirror_x, move, rod, slab, surface, sweep, turn

HALF_WIDTH, BACK, FRONT, HEIGHT = 7.2, -4.8, 7.6, 7.8  # the hall's inner faces: x = +-7.2, z = -4.8 and 7.6
WALL = 0.32
RISE, TREAD = 0.16, 0.32
N_MAIN, N_SIDE = 16, 12  # risers of the main and of each side flight
FOOT, MAIN_HALF = 3.0, 1.9  # z of the first riser, half the width between the curbs
LANDING, LANDING_HALF = N_MAIN * RISE, 2.3
LANDING_Z = FOOT - (N_MAIN - 1) * TREAD  # front edge of the landing
SIDE_Z = -2.5  # front edge of the side flights
GALLERY = LANDING + N_SIDE * RISE
GALLERY_X = LANDING_HALF + (N_SIDE - 1) * TREAD  # inner edge of the galleries
WINDOW_X = np.arange(-3, 4) * 1.60
WINDOW_WIDTH, WINDOW_FOOT, WINDOW_SPRING = 1.32, 0.40, 5.85  # the spring line is that far above the foot
COLUMN_Z = (-1.7, 1.3, 4.3, 7.3)
RAIL_HEIGHT = 0.84  # of the rail's middle above the curb's top, at a baluster of 0.66 and more on the slope


def materials() -> dict[str, Material]:
    """Linear reflectivities, mostly 0.2 to 0.8."""
    white = (1.0, 1.0, 1.0)
    return {
        "FloorMarble": Material(colour=white, metres=1.6, texture=tex.marble((0.74, 0.70, 0.63), (0.45, 0.41, 0.37), 1, 768, (0.33, 0.26, 0.22))),
        "Marble": Material(colour=white, metres=1.7, texture=tex.marble((0.73, 0.69, 0.62), (0.50, 0.46, 0.41), 2)),
        "MarbleRose": Material(colour=white, metres=1.3, texture=tex.marble((0.64, 0.42, 0.34), (0.76, 0.64, 0.56), 3)),
        "Plaster": Material(colour=(0.80, 0.76, 0.67)),
        "WallSilk": Material(colour=white, metres=0.5, texture=tex.cloth((0.76, 0.66, 0.50), 4, 256, 32, 0.2)),
        "Ceiling": Material(colour=(0.82, 0.79, 0.72)),
        "CofferBlue": Material(colour=(0.44, 0.57, 0.68)),
        "Runner": Material(colour=white, texture=tex.lozenges((0.52, 0.05, 0.06), (0.70, 0.52, 0.24), (0.22, 0.03, 0.06), 5)),
        "Velvet": Material(colour=(0.44, 0.05, 0.07)),
        "Mahogany": Material(colour=white, metres=1.4, texture=tex.wood((0.30, 0.13, 0.07), (0.16, 0.06, 0.035), 6, 256, 1)),
        "RailWood": Material(colour=(0.26, 0.11, 0.06)),
        "Gilding": Material(colour=(0.74, 0.50, 0.18)),
        "Brass": Material(colour=(0.64, 0.46, 0.20)),
        "WindowPaint": Material(colour=(0.74, 0.71, 0.63)),
        "Globe": Material(colour=(0.86, 0.83, 0.76)),
        "Candle": Material(colour=(0.80, 0.76, 0.64)),
        "Crystal": Material(colour=(0.80, 0.84, 0.88), mirror=True),
        "Mirror": Material(colour=(0.86, 0.88, 0.87), mirror=True),
        "Leaf": Material(colour=(0.18, 0.34, 0.09)),
        "LeafDark": Material(colour=(0.09, 0.22, 0.07)),
        "Opera": Material(colour=white, texture=tex.landscape(7, (0.60, 0.46, 0.30), [(0.26, 0.22, 0.26), (0.20, 0.16, 0.10), (0.30, 0.16, 0.08)])),
        "Ballet": Material(colour=white, texture=tex.landscape(8, (0.42, 0.52, 0.60), [(0.30, 0.30, 0.38), (0.22, 0.28, 0.14), (0.36, 0.28, 0.12)])),
        "Facade": Material(colour=(0.52, 0.45, 0.36)),
        "Roof": Material(colour=(0.16, 0.15, 0.16)),
        "Street": Material(colour=white, metres=4.0, texture=tex.leaves([(0.22, 0.22, 0.22), (0.30, 0.29, 0.27)], 9, 256)),
    }  # fmt: skip


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
    for i, height in enumerate(heights):  # houses across the square, too low to take the sun away
        left = -36.0 + 6.0 * i
        part.append(("Facade" if i % 3 else "Plaster", between((left, -1.1, 50.0 - i % 2), (left + 5.99, height, 58.0))))
        part.append(("Roof", between((left - 0.1, height - 0.1, 49.6 - i % 2), (left + 6.08, height + 0.6, 58.2), 0.28)))
        for j in range(4):
            for k in range(2):
                low = (left + 0.55 + 1.4 * j, 0.6 + 2.1 * k, 49.9 - i % 2)
                part.append(("Roof", between(low, (low[0] + 0.8, low[1] + 1.3, low[2] + 0.3))))
    for c in WINDOW_X:
        part += moved(kit.arch_infill(WINDOW_WIDTH, WALL), c, WINDOW_FOOT + WINDOW_SPRING, FRONT + WALL)
        part += moved(kit.arched_window(WINDOW_WIDTH, WINDOW_SPRING), c, WINDOW_FOOT, FRONT + 0.22)
        part.append(("Plaster", move(kit.architrave(WINDOW_WIDTH, WINDOW_SPRING), c, WINDOW_FOOT, FRONT)))
        part.append(("Marble", between((c - half - 0.12, WINDOW_FOOT - 0.06, FRONT - 0.12), (c + half + 0.12, WINDOW_FOOT + 0.004, FRONT + 0.2), 0.012)))
    return part


def walls() -> Part:
    """Wainscot, pilasters, gilded fields, doors, pictures and the mirror."""
    part: Part = []
    skirting = [(-0.01, -0.02), (0.03, -0.02), (0.03, 0.16), (0.015, 0.20), (-0.01, 0.20)]
    inset = 0.0
    x, z0, z1 = HALF_WIDTH - inset, BACK + inset, FRONT - inset
    ring = [(x, 0, z1), (x, 0, z0), (-x, 0, z0), (-x, 0, z1)]
    part.append(("MarbleRose", sweep(ring, np.array(skirting) * [-1, 1], closed=True, crease_deg=20.0)))
    dado = [(-0.01, 0.92), (0.03, 0.92), (0.05, 0.95), (0.035, 0.985), (-0.01, 0.985)]
    part.append(("Marble", sweep([(x, 0, z1), (x, 0, z0), (-x, 0, z0), (-x, 0, z1)], np.array(dado) * [-1, 1], crease_deg=20.0)))
    for s, angle in ((-1, 90), (1, -90)):
        for z in (0.0, 5.6):
            part += moved(kit.double_door(), s * HALF_WIDTH, 0, z, turn_y=angle)
        for z in (-2.9, 2.7):
            part += moved(kit.panel_moulding(1.5, 2.5), s * HALF_WIDTH, 1.25, z + s * -0.75 * -1, turn_y=angle)
            part += moved(kit.sconce(), s * (HALF_WIDTH - 0.005), 2.5, z, turn_y=angle)
        for z in np.array(COLUMN_Z[:-1]) + 1.5:
            part += moved(kit.panel_moulding(1.9, 2.3), s * HALF_WIDTH, GALLERY + 0.55, z + s * 0.95, turn_y=angle)
            part += moved(kit.sconce(), s * (HALF_WIDTH - 0.005), GALLERY + 1.7, z, turn_y=angle)
        wide, high = 1.55, 1.25
        part += moved(picture(wide, high, "Opera" if s < 0 else "Ballet", "Gilding"), s * 3.55 - wide / 2, 4.95, BACK + 0.002)
        for dx in (2.02, 5.25):
            part += pilaster(s * dx)
        part += moved(kit.sconce(), s * 1.72, LANDING + 2.0, BACK + 0.005)
    return part + moved(kit.great_mirror(2.5, 3.3), -1.25, LANDING + 0.62, BACK)


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
    cornice = np.array([(-0.02, -0.62), (0.06, -0.62), (0.07, -0.54), (0.14, -0.46), (0.16, -0.34), (0.20, -0.32), (0.20, -0.26), (0.34, -0.22),
                        (0.40, -0.10), (0.44, -0.08), (0.44, 0.02), (-0.02, 0.02)])  # fmt: skip
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
        part.append(("Ceiling", between((beam - 0.17, HEIGHT - 0.22, BACK - 0.02), (beam + 0.17, HEIGHT + 0.05, FRONT + 0.02), 0.03)))
        part.append(("Gilding", between((beam - 0.05, HEIGHT - 0.232, BACK), (beam + 0.05, HEIGHT - 0.2 - 0.0001 * i, FRONT), 0.006)))
    for beam in zs[1:-1]:
        part.append(("Ceiling", between((-HALF_WIDTH - 0.02, HEIGHT - 0.215, beam - 0.17), (HALF_WIDTH + 0.02, HEIGHT + 0.05, beam + 0.17), 0.03)))
    for x0, x1 in zip(xs, xs[1:], strict=False):
        for z0, z1 in zip(zs, zs[1:], strict=False):
            mx, mz, hx, hz = (x0 + x1) / 2, (z0 + z1) / 2, (x1 - x0) / 2 - 0.32, (z1 - z0) / 2 - 0.32
            part.append(("CofferBlue", between((mx - hx, HEIGHT - 0.02, mz - hz), (mx + hx, HEIGHT + 0.05, mz + hz))))
            ring = [(mx - hx, HEIGHT - 0.01, mz - hz), (mx + hx, HEIGHT - 0.01, mz - hz), (mx + hx, HEIGHT - 0.01, mz + hz), (mx - hx, HEIGHT - 0.01, mz + hz)]
            part.append(("Gilding", sweep(ring, [(-0.03, -0.03), (0.03, -0.03), (0.03, 0.02), (-0.03, 0.02)], closed=True, crease_deg=30.0)))
            if not (abs(mx) < 0.5 and 0.5 < mz < 2.5):
                part += moved(kit.rosette(0.3), mx, HEIGHT - 0.018, mz)
    return part


def main_flight() -> Part:
    """Sixteen steps as layers that lie on each other, each with a rounded nosing; the first two are wider."""
    part: Part = []
    for k in range(N_MAIN):
        z, y = FOOT - k * TREAD, k * RISE
        half = MAIN_HALF + (0.62, 0.36)[k] if k < 2 else MAIN_HALF
        end = LANDING_Z - 0.4
        part.append(("MarbleRose", between((-half + 0.02, y - 0.05, end), (half - 0.02, y + RISE - 0.035, z))))
        if k < N_MAIN - 1:
            part.append(("Marble", between((-half, y + RISE - 0.04, z - TREAD - 0.05), (half, y + RISE, z + 0.035), 0.014)))
    back_half = LANDING_HALF
    part.append(("MarbleRose", between((-back_half, -0.05, BACK - 0.1), (back_half, LANDING - 0.035, LANDING_Z - 0.02))))
    part.append(("Marble", between((-back_half - 0.03, LANDING - 0.045, BACK - 0.1), (back_half + 0.03, LANDING, LANDING_Z + 0.035), 0.014)))
    return part


def side_flight() -> Part:
    """The flight from the landing to the right gallery, with its curb; the left one is its mirror image."""
    part: Part = []
    for k in range(N_SIDE):
        x, y = LANDING_HALF + k * TREAD, LANDING + k * RISE
        part.append(("MarbleRose", between((x, y - 0.05, BACK - 0.05), (GALLERY_X + 0.3, y + RISE - 0.035, SIDE_Z))))
        if k < N_SIDE - 1:
            part.append(("Marble", between((x - 0.035, y + RISE - 0.04, BACK - 0.05), (x + TREAD + 0.05, y + RISE, SIDE_Z - 0.01), 0.014)))
    part.append(("MarbleRose", between((LANDING_HALF - 0.1, -0.05, BACK - 0.05), (GALLERY_X + 0.3, LANDING - 0.02, SIDE_Z - 0.02))))
    slope = RISE / TREAD
    run = GALLERY_X - LANDING_HALF
    curb = [(-0.15, -0.25), (run + 0.3, -0.25 + slope * (run + 0.3) * 0), (run + 0.3, slope * run + 0.27), (run + 0.02, slope * run + 0.27), (-0.15, 0.20)]
    part.append(("Marble", move(extrude(curb, 0.24), LANDING_HALF, LANDING, SIDE_Z - 0.01)))
    return part


def runner() -> Part:
    """The carpet from the hall over every step to the mirror, held by brass rods."""
    half, lift = 1.15, 0.007
    path = [(4.6, lift)]
    rods: Part = []
    for k in range(N_MAIN):
        z, y = FOOT - k * TREAD, k * RISE
        path += [(z + lift, y + lift), (z + lift, y + RISE - 0.045), (z + 0.035 + lift, y + RISE - 0.035), (z + 0.035 + lift, y + RISE - 0.008), (z + 0.022, y + RISE + lift)]
        rods.append(("Brass", rod((-half - 0.09, y + 0.02, z + 0.018), (half + 0.09, y + 0.02, z + 0.018), 0.010, 8)))
    path.append((BACK + 0.1, LANDING + lift))
    p = np.array(path)
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]
    points = np.stack([np.stack([np.full(len(p), x), p[:, 1], p[:, 0]], axis=-1) for x in (-half, half)])
    uvs = np.stack([np.stack([np.full(len(p), u), length / (2 * half)], axis=-1) for u in (0.0, 1.0)])
    carpet = surface(points, uvs, 40.0)
    edges = [Mesh(points=np.vstack([points[i], points[i] - [0, lift, 0]]), faces=_strip(len(p)), uvs=np.vstack([uvs[i], uvs[i]]), crease_deg=40.0) for i in (0, 1)]
    return [("Runner", carpet), *(("Runner", edge) for edge in edges), *rods]


def _strip(n: int) -> np.ndarray:
    k = np.arange(n - 1)
    return np.concatenate([np.stack([k, k + 1, k + n], axis=-1), np.stack([k + 1, k + n + 1, k + n], axis=-1)])


def balusters_at() -> Iterator[Array]:
    """Places of all balusters."""
    for s in (-1, 1):
        for k in range(2 * (N_MAIN - 1) - 1):  # along the main flight, two a tread
            z = FOOT - 0.30 - k * TREAD / 2
            if k % 28 != 27:
                yield place(s * (MAIN_HALF + 0.12), main_curb_y(z) - 0.012, z)
        for z in np.arange(LANDING_Z - 0.42, SIDE_Z + 0.30, -0.165):
            yield place(s * (LANDING_HALF - 0.10), LANDING + 0.115, float(z))
        for x in np.arange(LANDING_HALF + 0.32, GALLERY_X - 0.25, TREAD / 2):
            yield place(s * float(x), LANDING + 0.215 + (float(x) - LANDING_HALF) * RISE / TREAD, SIDE_Z + 0.11)
        for z in np.arange(SIDE_Z + 0.55, FRONT - 0.1, 0.17):
            if min(abs(z - c) for c in COLUMN_Z) > 0.33:
                yield place(s * (GALLERY_X + 0.12), GALLERY + 0.095, float(z))


def main_curb_y(z: float) -> float:
    """Top of the main flight's curb."""
    return 0.30 + (FOOT - z) * RISE / TREAD


def balustrades() -> Part:
    """Curbs, rails and pedestals of the right half."""
    part: Part = []
    x = MAIN_HALF + 0.12
    z_end = LANDING_Z - 0.12
    curb = [(-(FOOT + 0.05), -0.03), (-z_end, -0.03), (-z_end, main_curb_y(z_end)), (-(FOOT + 0.05), main_curb_y(FOOT + 0.05))]
    part.append(("Marble", move(turn(extrude(curb, 0.26), "y", 90), x - 0.13, 0, 0)))
    rise = 0.70
    part.append(("RailWood", kit.rail([(x, main_curb_y(FOOT + 0.1) + rise, FOOT + 0.1), (x, main_curb_y(z_end) + rise, z_end)])))
    part += moved(kit.newel(1.15), x, 0, FOOT + 0.25)
    part += moved(kit.newel(1.25), LANDING_HALF - 0.10, LANDING, LANDING_Z - 0.14)
    part += moved(kit.newel(1.3), LANDING_HALF - 0.02, LANDING, SIDE_Z + 0.11)
    part.append(("Marble", between((LANDING_HALF - 0.23, LANDING - 0.3, SIDE_Z), (LANDING_HALF + 0.03, LANDING + 0.12, LANDING_Z - 0.1), 0.01)))
    xl = LANDING_HALF - 0.10
    part.append(("RailWood", kit.rail([(xl, LANDING + 0.83, LANDING_Z - 0.2), (xl, LANDING + 0.83, SIDE_Z + 0.2)])))
    slope = RISE / TREAD
    z, x0, x1 = SIDE_Z + 0.11, LANDING_HALF + 0.1, GALLERY_X + 0.05
    part.append(("RailWood", kit.rail([(x0, LANDING + 0.93 + (x0 - LANDING_HALF) * slope, z), (x1, LANDING + 0.93 + (x1 - LANDING_HALF) * slope, z)])))
    part += moved(kit.newel(1.2), GALLERY_X + 0.12, GALLERY, SIDE_Z + 0.15)
    xg = GALLERY_X + 0.12
    part.append(("Marble", between((xg - 0.13, GALLERY - 0.05, SIDE_Z), (xg + 0.13, GALLERY + 0.10, FRONT + 0.02), 0.01)))
    part.append(("RailWood", kit.rail([(xg, GALLERY + 0.80, SIDE_Z + 0.3), (xg, GALLERY + 0.80, FRONT + 0.02)])))
    return part


def gallery() -> Part:
    """The right gallery's floor with its entablature below, on columns, and the beam over the upper columns."""
    x0, x1 = GALLERY_X - 0.02, HALF_WIDTH + 0.05
    part: Part = [
        ("Ceiling", between((x0 + 0.04, GALLERY - 0.42, SIDE_Z - 0.02), (x1, GALLERY - 0.035, FRONT + 0.05))),
        ("Marble", between((x0, GALLERY - 0.045, BACK - 0.05), (x1, GALLERY, FRONT + 0.05), 0.01)),
        ("Plaster", between((GALLERY_X + 0.28, -0.05, BACK - 0.05), (x1, GALLERY - 0.03, SIDE_Z - 0.01))),
        ("Plaster", between((x0 - 0.05, GALLERY - 0.11, SIDE_Z - 0.025), (x0 + 0.2, GALLERY - 0.04, FRONT + 0.05), 0.02)),
        ("Gilding", between((x0 + 0.015, GALLERY - 0.30, SIDE_Z - 0.02), (x0 + 0.2, GALLERY - 0.26, FRONT + 0.05), 0.01)),
        ("Plaster", between((GALLERY_X - 0.06, HEIGHT - 0.75, COLUMN_Z[0] - 0.6), (GALLERY_X + 0.34, HEIGHT + 0.02, FRONT + 0.05), 0.02)),
        ("Gilding", between((GALLERY_X - 0.075, HEIGHT - 0.60, COLUMN_Z[0] - 0.59), (GALLERY_X + 0.1, HEIGHT - 0.56, FRONT + 0.05), 0.01)),
    ]
    for z in np.arange(SIDE_Z + 0.1, FRONT, 0.26):
        part.append(("Plaster", between((x0 - 0.02, GALLERY - 0.20, z), (x0 + 0.1, GALLERY - 0.105, z + 0.12), 0.008)))
    for z in COLUMN_Z:
        part.append(("Marble", between((GALLERY_X - 0.06, GALLERY - 0.02, z - 0.21), (GALLERY_X + 0.36, GALLERY + 0.96, z + 0.21), 0.015)))
    return part


def mirrored(part: Part) -> Part:
    """A part of the right half together with its mirror image."""
    return part + [(material, mirror_x(mesh)) for material, mesh in part]


def build() -> Model:
    """The whole staircase."""
    rng = np.random.default_rng(1875)
    model = Model(materials=materials())
    model.add("shell", shell())
    model.add("walls", walls())
    model.add("ceiling", ceiling())
    model.add("rose", kit.rosette(0.9), [place(0, HEIGHT - 0.018, 1.4)])
    model.add("main-flight", main_flight())
    model.add("side-flights", mirrored(side_flight()))
    model.add("runner", runner())
    model.add("balustrades", mirrored(balustrades()))
    model.add("baluster", kit.baluster(), balusters_at())
    model.add("galleries", mirrored(gallery()))
    cx = GALLERY_X + 0.15
    model.add("column", kit.column(GALLERY - 0.40, 0.20), [place(s * cx, 0, z) for s in (-1, 1) for z in COLUMN_Z])
    upper = HEIGHT - 0.74 - GALLERY - 0.95
    model.add("upper-column", kit.column(upper, 0.16), [place(s * cx, GALLERY + 0.95, z) for s in (-1, 1) for z in COLUMN_Z])
    lamp_x = MAIN_HALF + 0.12
    model.add("candelabrum", kit.candelabrum(), [place(s * lamp_x, 1.17, FOOT + 0.25, 30 * s) for s in (-1, 1)]
              + [place(s * (LANDING_HALF - 0.10), LANDING + 1.27, LANDING_Z - 0.14, 12 * s) for s in (-1, 1)])  # fmt: skip
    model.add("chandelier", kit.chandelier([(14, 1.05, 0.0), (9, 0.65, 0.42)], 2.1), [place(0, HEIGHT - 2.25, 1.4)])
    small = kit.chandelier([(8, 0.5, 0.05)], 1.35)
    model.add("small-chandelier", small, [place(s * 6.75, HEIGHT - 1.4, z, 20 * z) for s in (-1, 1) for z in (2.8,)])
    model.add("palm", kit.palm(rng), [place(-3.3, 0, -1.7, 0, 1.1), place(3.3, 0, -1.7, 130, 1.1), place(-4.9, 0, 7.05, 75, 0.95), place(4.9, 0, 7.0, 220)])
    model.add("bench", kit.bench(), [place(s * (HALF_WIDTH - 0.32), 0, 2.75, 90) for s in (-1, 1)])
    return model


if __name__ == "__main__":
    write(build(), Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("stairs.glb"))
