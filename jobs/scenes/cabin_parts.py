"""Seats, bins, wall panels and galley things of the aircraft cabin; z runs along the aisle, seats look towards -z."""

import numpy as np
from glb import Part
from shapes import (
    Array, Mesh, between, box, curve, cushion, extrude, lathe, mirror_x, move, rod, surface, sweep, turn,
)  # fmt: skip

SEAT_WIDTH = 0.49  # from one armrest's middle to the next
# right half of the cross-section, from the floor up: side wall, then the bin's front, then the ceiling's middle
WALL = curve([(1.60, -0.02), (1.70, 0.20), (1.765, 0.55), (1.78, 0.85), (1.745, 1.15), (1.65, 1.42), (1.50, 1.64)], 8)
CEILING = curve([(1.12, 2.03), (0.86, 2.11), (0.56, 2.16), (0.28, 2.20), (0.0, 2.21)], 5)
BIN = [(1.66, 1.50), (1.70, 1.62), (1.62, 2.12), (0.98, 2.12), (0.86, 2.07), (0.755, 1.98), (0.695, 1.87), (0.685, 1.76), (0.715, 1.66),
       (0.775, 1.585), (0.86, 1.545), (0.98, 1.53), (1.40, 1.515)]  # fmt: skip


def wall_x(y: Array) -> Array:
    """x of the side wall at height y."""
    return np.asarray(np.interp(y, WALL[:, 1], WALL[:, 0]))


# --- seats -----------------------------------------------------------------------------------------------------------


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
    strap = curve([(-0.20, 0.45, 0.13), (-0.10, 0.475, buckle_z + 0.06), (0.0, 0.478, buckle_z), (0.11, 0.472, buckle_z + 0.05), (0.20, 0.45, 0.13)], 2)
    part += [("Belt", sweep(strap, [(-0.022, -0.002), (0.022, -0.002), (0.022, 0.002), (-0.022, 0.002)], crease_deg=30.0)),
             ("Chrome", turn(move(box(0.06, 0.014, 0.045, 0.004), 0, 0.474, buckle_z), "y", float(rng.uniform(-6, 6))))]
    return part


def antimacassar(width: float) -> Mesh:
    """The white cloth over the headrest, in the frame of the seat's back."""
    drape = curve([(0.535, -0.080), (0.62, -0.084), (0.69, -0.072), (0.716, -0.03), (0.716, 0.04), (0.70, 0.082), (0.64, 0.0865)], 2)
    return surface(np.stack([np.c_[np.full(len(drape), x), drape] for x in (width / 2, -width / 2)]), crease_deg=70.0)


def seat_rear(rng: np.random.Generator, tray_down: bool) -> Part:
    """What the passenger behind sees: screen, tray, pocket with papers; in the frame of the seat's back."""
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
        part.append(("Trim", turn(move(box(0.018, 0.05, 0.012, 0.004), 0, 0.425, z + 0.004), "z", float(rng.uniform(-1, 1)))))
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
    part: Part = [("Trim", sweep(np.c_[0 * outline[:, 0], outline[:, 1], outline[:, 0]],
                                 [(-0.024, -0.022), (0.024, -0.022), (0.027, 0.0), (0.020, 0.018), (-0.020, 0.018), (-0.027, 0.0)]))]
    part.append(("SeatShell", between((-0.016, 0.34, 0.10), (0.016, 0.61, 0.20), 0.008)))
    part.append(("Chrome", move(turn(lathe([(0.0, 0.0), (0.014, 0.0), (0.012, 0.006), (0.0, 0.007)], 8), "x", -90), 0, 0.615, -0.212)))
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


# --- walls, bins and ceiling -----------------------------------------------------------------------------------------


def window_panel(width: float, low: float, high: float, shade: float) -> Part:
    """A panel of the right wall with an oval window, z from 0 to width; `shade`: how far the blind is down, 0 to 1."""
    n, centre = 24, 1.075
    half = np.array([0.115, 0.165])
    angle = (np.arange(n + 1) + 0.5) * 2 * np.pi / n
    c, s = np.cos(angle), np.sin(angle)
    oval = np.stack([np.sign(c) * np.abs(c) ** 0.72 * half[0], np.sign(s) * np.abs(s) ** 0.72 * half[1]], axis=-1)
    border = np.stack([c, s], axis=-1) / np.maximum(np.abs(c), np.abs(s))[:, None]
    for sign_z in (-1, 1):  # the nearest two border points become a corner's neighbours: add the corners themselves
        for sign_y in (-1, 1):
            k = int(np.argmin(np.hypot(border[:-1, 0] - sign_z, border[:-1, 1] - sign_y)))
            border[k] = (sign_z, sign_y)
    border[-1] = border[0]
    top, bottom = high - centre, centre - low
    border = border * np.stack([np.full(n + 1, width / 2), np.where(border[:, 1] > 0, top, bottom)], axis=-1)
    rings = []
    for t, sink in ((0.0, 0.030), (0.10, 0.014), (0.26, 0.002), (0.55, 0.0), (1.0, 0.0)):
        flat = oval * (1.14 - 0.14 * (t == 0.0)) * (1 - t) + border * t if t < 1 else border
        rings.append(np.stack([wall_x(flat[:, 1] + centre) + sink, flat[:, 1] + centre, flat[:, 0] + width / 2], axis=-1))
    panel = surface(np.stack(rings), crease_deg=50.0)
    tube = [np.stack([wall_x(oval[:, 1] + centre) + out, oval[:, 1] * k + centre, oval[:, 0] * k + width / 2], axis=-1)
            for out, k in ((0.030, 1.0), (0.055, 0.93), (0.060, 0.88), (0.13, 0.86))]  # fmt: skip
    part: Part = [("Panel", panel), ("WindowRim", surface(np.stack(tube), crease_deg=50.0))]
    if shade > 0:
        y1 = centre + half[1] + 0.02
        y0 = y1 - shade * (2 * half[1] + 0.02)
        z = width / 2
        ys = np.linspace(y0, y1, 4)
        x = wall_x(ys) + 0.040
        blind = np.stack([np.stack([x, ys, np.full(4, z + e)], axis=-1) for e in (-0.13, 0.13)])
        part.append(("Blind", surface(blind)))
        part.append(("Blind", between((x[0] - 0.012, y0, z - 0.05), (x[0] + 0.004, y0 + 0.018, z + 0.05), 0.004)))
    return part


def along_z(outline: Array, z0: float, z1: float, crease_deg: float = 40.0) -> Mesh:
    """A curved sheet: an outline (k, 2) in x and y, drawn out from z0 to z1."""
    points = np.stack([np.c_[outline, np.full(len(outline), z)] for z in (z0, z1)])
    return surface(points, crease_deg=crease_deg)


def bin_unit(length: float) -> Part:
    """A closed overhead bin of the right side, z from 0 to length, with its latch and the service panel below it."""
    body = extrude(np.array(BIN)[::-1], length - 0.012, 35.0)
    part: Part = [("Bin", body)]
    part.append(("Trim", move(turn(box(0.03, 0.05, 0.13, 0.010), "z", 28), 0.722, 1.618, length / 2)))
    part.append(("Accent", move(turn(box(0.010, 0.022, length - 0.013), "z", 20), 0.700, 1.676, length / 2 - 0.006)))
    part.append(("Metal", between((0.800, 1.535, 0.0), (0.850, 1.565, length - 0.013), 0.008)))
    part.append(("Sign", between((0.686, 1.83, length * 0.45), (0.70, 1.87, length * 0.55), 0.002)))
    part.append(("Trim", between((0.90, 1.512, 0.08), (1.36, 1.535, length - 0.09), 0.006)))
    for i in range(3):
        x = 0.98 + 0.14 * i
        lamp = turn(lathe([(0.0, 0.008), (0.026, 0.006), (0.036, 0.016), (0.042, 0.0), (0.042, -0.02)], 12), "x", 180)
        vent = turn(lathe([(0.0, 0.020), (0.012, 0.020), (0.022, 0.010), (0.030, 0.0), (0.030, -0.02)], 12), "x", 180)
        part += [("Lamp", move(lamp, x, 1.513, length * 0.30)), ("Metal", move(vent, x, 1.513, length * 0.45))]
    part.append(("Sign", between((1.02, 1.507, length * 0.62), (1.26, 1.52, length * 0.78), 0.003)))
    return part


def both_sides(part: Part) -> Part:
    """A part of the right half together with its mirror image."""
    return part + [(material, mirror_x(mesh)) for material, mesh in part]


# --- galley ----------------------------------------------------------------------------------------------------------


def trolley() -> Part:
    """A service trolley 0.3 x 1.03 x 0.4, its front towards +z at z = 0."""
    part: Part = [
        ("Bin", move(box(0.295, 0.92, 0.40, 0.012), 0, 0.07, -0.20)),
        ("Metal", move(box(0.30, 0.03, 0.41, 0.008), 0, 0.985, -0.20)),
        ("Trim", move(box(0.25, 0.80, 0.014, 0.006), 0, 0.12, 0.0)),
        ("Chrome", move(box(0.10, 0.05, 0.02, 0.008), 0, 0.88, 0.008)),
        ("Accent", move(box(0.252, 0.05, 0.016, 0.004), 0, 0.60, 0.0005)),
    ]
    wheel = turn(lathe([(0.0, -0.012), (0.035, -0.012), (0.035, 0.012), (0.0, 0.012)], 12), "z", 90)
    return part + [("Trim", move(wheel, x, 0.034, z)) for x in (-0.10, 0.10) for z in (-0.06, -0.34)]


def oven(width: float, height: float) -> Part:
    """A galley oven or box front with a latch, in the x-y plane, seen from +z; lower left corner at the origin."""
    return [
        ("Steel", between((0.006, 0.006, -0.05), (width - 0.006, height - 0.006, 0.012), 0.006)),
        ("Trim", between((0.05, 0.05, 0.0), (width - 0.05, 0.075, 0.018), 0.004)),
        ("Chrome", rod((width * 0.25, height - 0.07, 0.035), (width * 0.75, height - 0.07, 0.035), 0.010, 8)),
        ("Accent", between((width - 0.075, height - 0.06, 0.0), (width - 0.035, height - 0.035, 0.016), 0.003)),
    ]  # fmt: skip


def pot() -> Part:
    """A coffee pot."""
    body = lathe([(0.0, 0.0), (0.06, 0.0), (0.065, 0.01), (0.055, 0.14), (0.045, 0.18), (0.048, 0.19), (0.0, 0.20)], 20)
    handle = curve([(0.05, 0.16, 0), (0.10, 0.16, 0), (0.11, 0.09, 0), (0.06, 0.05, 0)], 4)
    return [("Chrome", body), ("Trim", sweep(handle, 0.009, 6, up=(0, 0, 1)))]
