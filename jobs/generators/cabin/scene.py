"""cabin.glb: an airliner's cabin, ten rows of three and three seats, a galley in front (-z).

Needs numpy and Pillow. Metres, y up.
The floor is y = 0, the middle of the aisle x = 0.
"""

import numpy as np

from ..common.furniture import curtain
from ..common.glb import Model, place
from ..common.parts import Part, mirrored, moved, reflected
from ..common.shapes import Mesh, between, mirror_x, move, turn
from ..common.turned import extrude, polyline, rod, surface, sweep
from .materials import materials
from .seats import SEAT_WIDTH, row, screen
from .walls import CEILING, WALL, along_z, bin_unit, oven, pot, trolley, wall_x, window_panel

N_ROWS, PITCH, FIRST_Z = 10, 0.84, -3.55  # z of the first row's middle
FRONT, REAR, NOSE = -4.70, 5.05, -6.60  # bulkheads with the doorway, the wall behind the last row, the galley's end
AISLE = 0.27  # half of it, up to the first armrest's middle
PANEL, PANEL_LOW, PANEL_HIGH = 0.5, 0.62, 1.43  # wall panels: length, lower and upper edge
BIN_LENGTH = 1.0


def shell() -> Part:
    """Floor, lower walls, ceiling."""
    z0, z1 = NOSE - 0.1, REAR + 0.1
    wall = WALL
    low = wall[wall[:, 1] < PANEL_LOW + 0.03] - [0.012, 0.0]
    high = wall[wall[:, 1] > PANEL_HIGH - 0.05] - [0.010, 0.0]
    dado = np.vstack([low, [[low[-1, 0] + 0.03, low[-1, 1] + 0.004]]])
    half = [
        ("Dado", along_z(dado, z0, z1)),
        (
            "Panel",
            along_z(np.vstack([[[high[0, 0] + 0.03, high[0, 1] - 0.004]], high, [[1.52, 1.75]]]), FRONT - 0.02, z1),
        ),
        ("Ceiling", along_z(CEILING[4:], z0, z1)),
        ("Cove", along_z(polyline("1.3 2.02, 1.12 2.05, 0.98 2.1, 0.84 2.14, 0.74 2.15"), z0, z1)),
        ("Trim", between((1.40, -0.01, z0), (1.72, 0.035, z1), 0.01)),
        ("Guide", between((AISLE - 0.035, -0.01, FRONT), (AISLE - 0.015, 0.006, REAR))),
    ]
    floor = surface(
        np.array([[[x, 0.004, z] for z in (REAR + 0.1, NOSE - 0.1)] for x in (-0.22, 0.22)]),
        np.array([[[u, v] for v in (0.0, (REAR - NOSE + 0.2) / 0.44)] for u in (0.0, 1.0)]) * 0.5,
    )
    return [*mirrored(half), ("Carpet", between((-1.9, -0.1, z0), (1.9, 0.0, z1))), ("AisleCarpet", floor)]


def wall_panels() -> list[Part]:
    """One panel of the right wall for each state of its blind."""
    return [window_panel(PANEL, PANEL_LOW, PANEL_HIGH, shade) for shade in (0.0, 0.35, 0.7, 1.0)]


def galley_walls() -> Part:
    """The bulkheads left and right of the doorway, the galley behind it, the wall at the rear end."""
    part: Part = []
    for z, name in ((FRONT, "Bulkhead"), (REAR, "Bulkhead")):
        outline = np.vstack([np.add(WALL, [0.06, 0.0]), [(1.75, 1.7), (1.75, 2.3), (0.34, 2.3), (0.34, -0.02)]])
        side = move(extrude(outline, 0.06), 0, 0, z - 0.06 if z < 0 else z)
        part += [(name, side), (name, mirror_x(side))]
        lintel = between(
            (-0.36, 1.96, z - 0.0595 if z < 0 else z + 0.0005), (0.36, 2.3, z - 0.0005 if z < 0 else z + 0.0595)
        )
        part.append((name, lintel))
    frame = [
        (0.34, -0.02, FRONT - 0.03),
        (0.34, 1.96, FRONT - 0.03),
        (-0.34, 1.96, FRONT - 0.03),
        (-0.34, -0.02, FRONT - 0.03),
    ]
    profile = polyline("-0.02 -0.045, 0.02 -0.045, 0.025 0, 0.02 0.045, -0.02 0.045")
    part.append(("Metal", sweep(frame, profile, up=(0, 0, 1), crease_deg=40.0)))
    part.append(("ExitSign", between((-0.15, 2.02, FRONT - 0.01), (0.15, 2.12, FRONT + 0.03), 0.008)))
    part.append(("Bin", between((-0.40, -0.1, REAR + 0.02), (0.40, 2.3, REAR + 0.1))))
    for s in (-1, 1):
        cloth = turn(curtain(0.20, 1.90, 5 + s, 5), "y", 90)
        part.append(("Curtain", move(cloth, s * 0.40, 0.03, FRONT + 0.30)))
    part.append(("Metal", rod((-0.66, 1.945, FRONT + 0.2), (0.66, 1.945, FRONT + 0.2), 0.012)))
    part += looking_glass(-1.36, -0.62, 0.78, 1.42)
    poster = screen(0.62, 0.46, 0.86, FRONT + 0.012)
    part.append(("Screen", move(poster, 1.02)))
    ring = [
        (0.71, 0.86, FRONT + 0.008),
        (1.33, 0.86, FRONT + 0.008),
        (1.33, 1.32, FRONT + 0.008),
        (0.71, 1.32, FRONT + 0.008),
    ]
    part.append(
        (
            "Metal",
            sweep(
                ring,
                [(-0.012, -0.01), (0.012, -0.01), (0.012, 0.014), (-0.012, 0.014)],
                closed=True,
                up=(0, 0, 1),
                crease_deg=30.0,
            ),
        )
    )
    return part


def looking_glass(x0: float, x1: float, y0: float, y1: float) -> Part:
    """A mirror with a chrome rim on the left bulkhead, seen from +z."""
    z = FRONT + 0.008
    glass = surface(np.array([[[x0, y0, z + 0.004], [x0, y1, z + 0.004]], [[x1, y0, z + 0.004], [x1, y1, z + 0.004]]]))
    ring = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    profile = polyline("-0.014 -0.012, 0.014 -0.012, 0.016 0.006, 0 0.018, -0.014 0.006")
    return [("Mirror", glass), ("Metal", sweep(ring, profile, closed=True, up=(0, 0, 1), crease_deg=30.0))]


def galley() -> Part:
    """The wall of ovens, boxes and trolleys visible through the doorway."""
    back = NOSE + 0.45
    part: Part = [
        ("Bulkhead", between((-1.9, -0.1, NOSE - 0.1), (1.9, 2.4, NOSE))),
        ("Steel", between((-1.7, 0.985, NOSE - 0.02), (1.7, 1.02, back + 0.02), 0.008)),
        ("Bin", between((-1.7, 1.42, NOSE - 0.02), (1.7, 2.3, back - 0.02))),
    ]
    for i in range(9):
        part += moved(trolley(), -1.26 + 0.315 * i, 0.0, back - 0.01)
    for i in range(6):
        part += moved(oven(0.5, 0.36), -1.5 + 0.5 * i, 1.44, back - 0.01)
        part += moved(oven(0.5, 0.30), -1.5 + 0.5 * i, 1.81, back - 0.01)
    for x, angle in ((-0.22, 30.0), (-0.05, 75.0), (0.16, 200.0)):
        part += moved(pot(), x, 1.0205, back - 0.16, turn_y=angle)
    return part


def rows(rng: np.random.Generator) -> list[tuple[Part, list[np.ndarray]]]:
    """Variants of a row of three seats with their places, right and left of the aisle."""
    variants = [row(rng, v) for v in range(4)]
    places: list[list[np.ndarray]] = [[] for _ in variants]
    for i in range(N_ROWS):
        z = FIRST_Z + i * PITCH
        places[int(rng.integers(4))].append(place(AISLE, 0, z))
        places[int(rng.integers(4))].append(place(-AISLE - 3 * SEAT_WIDTH, 0, z))
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
        model.add(f"panel-left-{state}", reflected(part), left)
    starts = [FRONT + k * BIN_LENGTH for k in range(int(np.ceil((REAR - FRONT) / BIN_LENGTH)))]
    unit = bin_unit(BIN_LENGTH)
    model.add("bin-right", unit, [place(0, 0, z) for z in starts])
    model.add("bin-left", reflected(unit), [place(0, 0, z) for z in starts])
    seam = [("Trim", _seam())]
    model.add("seam", mirrored(seam), [place(0, 0, FRONT - 0.06 + k * PANEL) for k in range(1, n_panels)])
    return model


def _seam() -> Mesh:
    """The dark joint between two wall panels of the right side."""
    y = np.linspace(PANEL_LOW, PANEL_HIGH, 12)
    path = np.stack([wall_x(y) + 0.001, y, 0 * y], axis=-1)
    return sweep(
        path, [(-0.004, -0.003), (0.004, -0.003), (0.004, 0.003), (-0.004, 0.003)], up=(0, 0, 1), crease_deg=30.0
    )
