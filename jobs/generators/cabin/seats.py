"""Seats of the aircraft cabin; z runs along the aisle, seats look towards -z."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import Mesh, between, box, cushion, move, turn
from ..common.turned import curve, lathe, polyline, rod, surface, sweep

SEAT_WIDTH = 0.49  # from one armrest's middle to the next


def seat(rng: np.random.Generator, recline_deg: float, tray_down: bool) -> Part:
    """One seat without armrests, centred in x; its cushion's front edge at z = -0.25."""
    back: Part = [
        ("SeatCloth", move(cushion(0.435, 0.50, 0.10, 0.045, 4, 0.016), 0, 0.02, 0.0)),
        ("SeatCloth", move(cushion(0.40, 0.20, 0.11, 0.05, 4, 0.012), 0, 0.505, -0.008)),
        ("SeatShell", move(cushion(0.445, 0.70, 0.055, 0.026, 4), 0, 0.0, 0.055)),
        ("Antimacassar", antimacassar(0.30)),
    ]
    for s in (-1, 1):  # the headrest's wings
        wing = turn(cushion(0.055, 0.185, 0.085, 0.026, 3), "y", 24.0 * s)
        back.append(("SeatCloth", move(wing, s * 0.205, 0.512, -0.045)))
    back += seat_rear(rng, tray_down)
    part: Part = [(material, move(turn(mesh, "x", recline_deg), 0, 0.44, 0.20)) for material, mesh in back]
    pan = move(turn(cushion(0.45, 0.12, 0.47, 0.05, 4, 0.014), "x", 3.0), 0, 0.335, 0.0)
    part += [("SeatCloth", pan), ("SeatShell", move(box(0.44, 0.05, 0.40, 0.01), 0, 0.30, 0.02))]
    buckle_z = float(rng.uniform(-0.10, 0.02))
    strap = curve(
        [
            (-0.20, 0.45, 0.13),
            (-0.10, 0.475, buckle_z + 0.06),
            (0.0, 0.478, buckle_z),
            (0.11, 0.472, buckle_z + 0.05),
            (0.20, 0.45, 0.13),
        ],
        2,
    )
    part += [
        ("Belt", sweep(strap, [(-0.022, -0.002), (0.022, -0.002), (0.022, 0.002), (-0.022, 0.002)], crease_deg=30.0)),
        ("Chrome", turn(move(box(0.06, 0.014, 0.045, 0.004), 0, 0.474, buckle_z), "y", float(rng.uniform(-6, 6)))),
    ]
    return part


def antimacassar(width: float) -> Mesh:
    """The white cloth over the headrest, in the frame of the seat's back."""
    drape = curve(polyline("0.535 -0.08, 0.62 -0.084, 0.69 -0.072, 0.716 -0.03, 0.716 0.04, 0.7 0.082, 0.64 0.0865"), 2)
    return surface(np.stack([np.c_[np.full(len(drape), x), drape] for x in (width / 2, -width / 2)]), crease_deg=70.0)


def seat_rear(rng: np.random.Generator, tray_down: bool) -> Part:
    """The rear of a seat: screen, tray, pocket with papers; in the frame of the seat's back."""
    z = 0.0825
    part: Part = [
        ("Trim", move(box(0.27, 0.175, 0.018, 0.007), 0, 0.475, z - 0.008)),
        ("Screen", screen(0.235, 0.142, 0.492, z + 0.0105)),
        ("Trim", move(box(0.36, 0.028, 0.016, 0.006), 0, 0.445, z - 0.005)),
    ]
    if tray_down:
        part.append(("Tray", move(turn(box(0.40, 0.018, 0.25, 0.006), "x", -12), 0, 0.225, z + 0.13)))
        part += [("Trim", rod((s * 0.185, 0.12, z - 0.01), (s * 0.185, 0.235, z + 0.16), 0.009, 6)) for s in (-1, 1)]
    else:
        part.append(("Tray", move(box(0.385, 0.235, 0.020, 0.008), 0, 0.205, z - 0.004)))
        part.append(
            ("Trim", turn(move(box(0.018, 0.05, 0.012, 0.004), 0, 0.425, z + 0.004), "z", float(rng.uniform(-1, 1))))
        )
    u, v = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(0, 1, 4), indexing="ij")
    sag = (1 - u**2) * (0.018 + 0.030 * v)
    pocket = np.stack([0.185 * u, -0.06 + 0.23 * v - 0.012 * (1 - u**2) * v, z - 0.004 + sag], axis=-1)
    part.append(("Net", surface(pocket)))
    for i, paper in enumerate(("Magazine", "Leaflet")):
        sheet = turn(box(0.21 - 0.03 * i, 0.23, 0.006), "z", float(rng.uniform(-5, 5)))
        part.append((paper, move(sheet, float(rng.uniform(-0.05, 0.05)), -0.035 - 0.02 * i, z + 0.006 + 0.010 * i)))
    return part


def screen(width: float, height: float, y: float, z: float) -> Mesh:
    """A flat picture in the x-y plane that its texture fills once; seen from +z."""
    x = width / 2
    points = np.array([[[-x, y, z], [-x, y + height, z]], [[x, y, z], [x, y + height, z]]])
    return surface(points, np.array([[[0.0, 1.0], [0.0, 0.0]], [[1.0, 1.0], [1.0, 0.0]]]))


def armrest() -> Part:
    """An armrest in the plane x = 0."""
    outline = curve([(-0.21, 0.615), (0.02, 0.635), (0.20, 0.625)], 2)
    part: Part = [
        (
            "Trim",
            sweep(
                np.c_[0 * outline[:, 0], outline[:, 1], outline[:, 0]],
                polyline("-0.024 -0.022, 0.024 -0.022, 0.027 0, 0.02 0.018, -0.02 0.018, -0.027 0"),
            ),
        )
    ]
    part.append(("SeatShell", between((-0.016, 0.34, 0.10), (0.016, 0.61, 0.20), 0.008)))
    part.append(
        (
            "Chrome",
            move(turn(lathe([(0.0, 0.0), (0.014, 0.0), (0.012, 0.006), (0.0, 0.007)], 8), "x", -90), 0, 0.615, -0.212),
        )
    )
    return part


def row(rng: np.random.Generator, variant: int) -> Part:
    """Three seats side by side on their frame, x from 0 to 3 seats; some trays down, some pillows and blankets left."""
    part: Part = []
    for i in range(3):
        x = (i + 0.5) * SEAT_WIDTH
        recline = 12.0 + float(rng.choice([0.0, 0.0, 5.0])) + float(rng.uniform(-0.7, 0.7))
        place = seat(rng, recline, tray_down=(variant, i) in ((1, 1), (3, 0)))
        part += [(material, move(mesh, x)) for material, mesh in place]
        if (variant, i) in ((0, 2), (2, 1)):
            pillow = turn(turn(cushion(0.34, 0.10, 0.25, 0.05, 5, 0.03), "x", 62.0), "y", float(rng.uniform(-20, 20)))
            part.append(("Pillow", move(pillow, x + 0.02, 0.52, 0.10)))
        if (variant, i) in ((2, 1), (3, 2)):
            blanket = turn(cushion(0.30, 0.055, 0.24, 0.027, 5, 0.01), "y", float(rng.uniform(-15, 15)))
            part.append(("Blanket", move(blanket, x, 0.472, -0.05)))
    for i in range(4):
        part += [(material, move(mesh, i * SEAT_WIDTH)) for material, mesh in armrest()]
    length = 3 * SEAT_WIDTH
    for z in (-0.14, 0.15):
        part.append(("Metal", rod((0.02, 0.305, z), (length - 0.02, 0.305, z), 0.018, 8)))
    for x in (0.25, length - 0.28):
        part.append(("Metal", sweep([(x, -0.01, -0.15), (x, 0.29, -0.11)], 0.016, 6, up=(1, 0, 0))))
        part.append(("Metal", sweep([(x, -0.01, 0.22), (x, 0.29, 0.13)], 0.016, 6, up=(1, 0, 0))))
        part.append(("Metal", between((x - 0.02, -0.01, -0.19), (x + 0.02, 0.018, 0.26), 0.004)))
    return part
