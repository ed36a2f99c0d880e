"""Make cabin.glb: an airliner's cabin, ten rows of three and three seats, a galley in front (-z).

Run `python jobs/scenes/make_cabin.py [FILE]`. Needs numpy and Pillow. Metres, y up; the floor is y = 0, the aisle x = 0.
"""

import sys
from pathlib import Path

import cabin_parts as kit
import numpy as np
import textures as tex
from glb import Material, Model, Part, place, write
from kitchen_parts import curtain, moved
from shapes import Mesh, between, box, extrude, mirror_x, move, surface, sweep, turn

N_ROWS, PITCH, FIRST_Z = 10, 0.84, -3.55  # z of the first row's middle
FRONT, REAR, NOSE = -4.70, 5.05, -6.60  # bulkheads with the doorway, the wall behind the last row, the galley's end
AISLE = 0.27  # half of it, up to the first armrest's middle
PANEL, PANEL_LOW, PANEL_HIGH = 0.5, 0.62, 1.43  # wall panels: length, lower and upper edge
BIN_LENGTH = 1.0


def materials() -> dict[str, Material]:
    """Linear reflectivities, mostly 0.2 to 0.8."""
    white = (1.0, 1.0, 1.0)
    return {
        "Carpet": Material(colour=white, metres=0.6, texture=tex.pile([(0.22, 0.27, 0.40), (0.36, 0.42, 0.56), (0.54, 0.47, 0.30)], 1, 512)),
        "AisleCarpet": Material(colour=white, metres=0.5, texture=tex.lozenges((0.23, 0.28, 0.42), (0.54, 0.48, 0.35), (0.16, 0.19, 0.31), 2)),
        "SeatCloth": Material(colour=white, metres=0.10, texture=tex.cloth((0.28, 0.42, 0.66), 3, 256, 32, 0.4)),
        "SeatShell": Material(colour=(0.60, 0.60, 0.61)),
        "Antimacassar": Material(colour=(0.80, 0.78, 0.72)),
        "Trim": Material(colour=(0.24, 0.25, 0.28)),
        "Tray": Material(colour=(0.62, 0.61, 0.58)),
        "Net": Material(colour=(0.30, 0.33, 0.40)),
        "Magazine": Material(colour=(0.70, 0.26, 0.16)),
        "Leaflet": Material(colour=(0.76, 0.76, 0.72)),
        "Screen": Material(colour=white, texture=tex.landscape(4, (0.30, 0.42, 0.60), [(0.22, 0.24, 0.34), (0.16, 0.24, 0.16), (0.30, 0.24, 0.10)])),
        "Belt": Material(colour=(0.30, 0.30, 0.32)),
        "Pillow": Material(colour=(0.74, 0.72, 0.66)),
        "Blanket": Material(colour=white, metres=0.16, texture=tex.cloth((0.56, 0.20, 0.14), 5, 256, 24, 0.4)),
        "Metal": Material(colour=(0.58, 0.58, 0.58)),
        "Panel": Material(colour=(0.80, 0.78, 0.73)),
        "WindowRim": Material(colour=(0.72, 0.71, 0.68)),
        "Blind": Material(colour=(0.70, 0.68, 0.62)),
        "Dado": Material(colour=(0.52, 0.53, 0.55)),
        "Bin": Material(colour=(0.80, 0.79, 0.76)),
        "Ceiling": Material(colour=(0.83, 0.83, 0.82)),
        "Cove": Material(colour=(0.62, 0.70, 0.80)),
        "Lamp": Material(colour=(0.84, 0.82, 0.74)),
        "Sign": Material(colour=(0.28, 0.30, 0.34)),
        "ExitSign": Material(colour=(0.16, 0.60, 0.26)),
        "Guide": Material(colour=(0.70, 0.74, 0.52)),
        "Bulkhead": Material(colour=white, metres=1.4, texture=tex.wood((0.60, 0.45, 0.29), (0.42, 0.29, 0.17), 6, 512, 1)),
        "Curtain": Material(colour=white, metres=0.12, texture=tex.cloth((0.24, 0.32, 0.50), 7)),
        "Accent": Material(colour=(0.62, 0.20, 0.14)),
        "Steel": Material(colour=(0.60, 0.60, 0.60)),
        "Chrome": Material(colour=(0.78, 0.79, 0.80), mirror=True),
        "Mirror": Material(colour=(0.86, 0.88, 0.88), mirror=True),
    }  # fmt: skip


def shell() -> Part:
    """Floor, lower walls, ceiling."""
    z0, z1 = NOSE - 0.1, REAR + 0.1
    wall = kit.WALL
    low = wall[wall[:, 1] < PANEL_LOW + 0.03] - [0.012, 0.0]
    high = wall[wall[:, 1] > PANEL_HIGH - 0.05] - [0.010, 0.0]
    dado = np.vstack([low, [[low[-1, 0] + 0.03, low[-1, 1] + 0.004]]])
    half = [
        ("Dado", kit.along_z(dado, z0, z1)),
        ("Panel", kit.along_z(np.vstack([[[high[0, 0] + 0.03, high[0, 1] - 0.004]], high, [[1.52, 1.75]]]), FRONT - 0.02, z1)),
        ("Ceiling", kit.along_z(kit.CEILING[4:], z0, z1)),
        ("Cove", kit.along_z(np.array([(1.30, 2.02), (1.12, 2.05), (0.98, 2.10), (0.84, 2.14), (0.74, 2.15)]), z0, z1)),
        ("Trim", between((1.40, -0.01, z0), (1.72, 0.035, z1), 0.01)),
        ("Guide", between((AISLE - 0.035, -0.01, FRONT), (AISLE - 0.015, 0.006, REAR))),
    ]
    floor = surface(np.array([[[x, 0.004, z] for z in (REAR + 0.1, NOSE - 0.1)] for x in (-0.22, 0.22)]),
                    np.array([[[u, v] for v in (0.0, (REAR - NOSE + 0.2) / 0.44)] for u in (0.0, 1.0)]) * 0.5)  # fmt: skip
    return [*kit.both_sides(half), ("Carpet", between((-1.9, -0.1, z0), (1.9, 0.0, z1))), ("AisleCarpet", floor)]


def wall_panels() -> list[Part]:
    """One panel of the right wall for each state of its blind."""
    return [kit.window_panel(PANEL, PANEL_LOW, PANEL_HIGH, shade) for shade in (0.0, 0.35, 0.7, 1.0)]


def galley_walls() -> Part:
    """The bulkheads left and right of the doorway, the galley behind it, the wall at the rear end."""
    part: Part = []
    for z, name in ((FRONT, "Bulkhead"), (REAR, "Bulkhead")):
        outline = np.vstack([kit.WALL + [0.06, 0.0], [(1.75, 1.7), (1.75, 2.3), (0.34, 2.3), (0.34, -0.02)]])
        side = move(extrude(outline, 0.06), 0, 0, z - 0.06 if z < 0 else z)
        part += [(name, side), (name, mirror_x(side))]
        lintel = between((-0.36, 1.96, z - 0.0595 if z < 0 else z + 0.0005), (0.36, 2.3, z - 0.0005 if z < 0 else z + 0.0595))
        part.append((name, lintel))
    frame = [(0.34, -0.02, FRONT - 0.03), (0.34, 1.96, FRONT - 0.03), (-0.34, 1.96, FRONT - 0.03), (-0.34, -0.02, FRONT - 0.03)]
    profile = [(-0.02, -0.045), (0.02, -0.045), (0.025, 0.0), (0.02, 0.045), (-0.02, 0.045)]
    part.append(("Metal", sweep(frame, profile, up=(0, 0, 1), crease_deg=40.0)))
    part.append(("ExitSign", between((-0.15, 2.02, FRONT - 0.01), (0.15, 2.12, FRONT + 0.03), 0.008)))
    part.append(("Bin", between((-0.40, -0.1, REAR + 0.02), (0.40, 2.3, REAR + 0.1))))
    for s in (-1, 1):
        cloth = turn(curtain(0.20, 1.90, 5 + s, 5), "y", 90)
        part.append(("Curtain", move(cloth, s * 0.40, 0.03, FRONT + 0.30)))
    part.append(("Metal", kit.rod((-0.66, 1.945, FRONT + 0.2), (0.66, 1.945, FRONT + 0.2), 0.012)))
    part += looking_glass(-1.36, -0.62, 0.78, 1.42)
    poster = kit.screen(0.62, 0.46, 0.86, FRONT + 0.012)
    part.append(("Screen", move(poster, 1.02)))
    ring = [(0.71, 0.86, FRONT + 0.008), (1.33, 0.86, FRONT + 0.008), (1.33, 1.32, FRONT + 0.008), (0.71, 1.32, FRONT + 0.008)]
    part.append(("Metal", sweep(ring, [(-0.012, -0.01), (0.012, -0.01), (0.012, 0.014), (-0.012, 0.014)], closed=True, up=(0, 0, 1), crease_deg=30.0)))
    return part


def looking_glass(x0: float, x1: float, y0: float, y1: float) -> Part:
    """A mirror with a chrome rim on the left bulkhead, seen from +z."""
    z = FRONT + 0.008
    glass = surface(np.array([[[x0, y0, z + 0.004], [x0, y1, z + 0.004]], [[x1, y0, z + 0.004], [x1, y1, z + 0.004]]]))
    ring = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    profile = [(-0.014, -0.012), (0.014, -0.012), (0.016, 0.006), (0.0, 0.018), (-0.014, 0.006)]
    return [("Mirror", glass), ("Metal", sweep(ring, profile, closed=True, up=(0, 0, 1), crease_deg=30.0))]


def galley() -> Part:
    """The wall of ovens, boxes and trolleys that is seen through the doorway."""
    back = NOSE + 0.45
    part: Part = [
        ("Bulkhead", between((-1.9, -0.1, NOSE - 0.1), (1.9, 2.4, NOSE))),
        ("Steel", between((-1.7, 0.985, NOSE - 0.02), (1.7, 1.02, back + 0.02), 0.008)),
        ("Bin", between((-1.7, 1.42, NOSE - 0.02), (1.7, 2.3, back - 0.02))),
    ]
    for i in range(9):
        part += moved(kit.trolley(), -1.26 + 0.315 * i, 0.0, back - 0.01)
    for i in range(6):
        part += moved(kit.oven(0.5, 0.36), -1.5 + 0.5 * i, 1.44, back - 0.01)
        part += moved(kit.oven(0.5, 0.30), -1.5 + 0.5 * i, 1.81, back - 0.01)
    for x, angle in ((-0.22, 30.0), (-0.05, 75.0), (0.16, 200.0)):
        part += moved(kit.pot(), x, 1.0205, back - 0.16, turn_y=angle)
    return part


def rows(rng: np.random.Generator) -> list[tuple[Part, list[np.ndarray]]]:
    """The variants of a row of three seats with the places they stand in, right and left of the aisle."""
    variants = [kit.row(rng, v) for v in range(4)]
    places: list[list[np.ndarray]] = [[] for _ in variants]
    for i in range(N_ROWS):
        z = FIRST_Z + i * PITCH
        places[int(rng.integers(4))].append(place(AISLE, 0, z))
        places[int(rng.integers(4))].append(place(-AISLE - 3 * kit.SEAT_WIDTH, 0, z))
    return list(zip(variants, places, strict=True))


def build() -> Model:
    """The whole cabin."""
    rng = np.random.default_rng(747)
    model = Model(materials=materials())
    model.add("shell", shell())
    model.add("bulkheads", galley_walls())
    model.add("galley", galley())
    for i, (part, places) in enumerate(rows(rng)):
        model.add(f"row-{i}", part, places)
    n_panels = round((REAR - FRONT + 0.1) / PANEL) + 1
    shades = rng.choice(4, size=(2, n_panels), p=[0.6, 0.2, 0.12, 0.08])
    for state, part in enumerate(wall_panels()):
        at = [FRONT - 0.06 + k * PANEL for k in range(n_panels)]
        right = [place(0, 0, z) for k, z in enumerate(at) if shades[0, k] == state]
        left = [place(0, 0, z) for k, z in enumerate(at) if shades[1, k] == state]
        model.add(f"panel-right-{state}", part, right)
        model.add(f"panel-left-{state}", [(m, mirror_x(mesh)) for m, mesh in part], left)
    starts = [FRONT + k * BIN_LENGTH for k in range(int(np.ceil((REAR - FRONT) / BIN_LENGTH)))]
    unit = kit.bin_unit(BIN_LENGTH)
    model.add("bin-right", unit, [place(0, 0, z) for z in starts])
    model.add("bin-left", [(m, mirror_x(mesh)) for m, mesh in unit], [place(0, 0, z) for z in starts])
    seam = [("Trim", _seam())]
    model.add("seam", [*seam, *[(m, mirror_x(mesh)) for m, mesh in seam]], [place(0, 0, FRONT - 0.06 + k * PANEL) for k in range(1, n_panels)])
    return model


def _seam() -> Mesh:
    """The dark joint between two wall panels of the right side."""
    y = np.linspace(PANEL_LOW, PANEL_HIGH, 12)
    path = np.stack([kit.wall_x(y) + 0.001, y, 0 * y], axis=-1)
    return sweep(path, [(-0.004, -0.003), (0.004, -0.003), (0.004, 0.003), (-0.004, 0.003)], up=(0, 0, 1), crease_deg=30.0)


if __name__ == "__main__":
    write(build(), Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("cabin.glb"))
