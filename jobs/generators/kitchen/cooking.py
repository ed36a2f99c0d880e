"""Kitchen equipment: tap, range, hood, refrigerator, pans; each stands on y = 0."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import between, box, cushion, move, turn
from ..common.turned import curve, extrude, lathe, polyline, rod, sweep, torus


def tap() -> Part:
    """A bridge tap with a swan neck towards +z, standing on y = 0."""
    neck = curve(polyline("0 0 0, 0 0.16 0, 0 0.27 0.02, 0 0.32 0.09, 0 0.28 0.165, 0 0.215 0.178"), 6)
    foot = lathe(polyline("0 0, 0.028 0, 0.028 0.008, 0.018 0.02, 0.014 0.05, 0 0.05"), 18)
    meshes = [
        sweep(neck, 0.0115, 14, up=(1, 0, 0)),
        foot,
        move(turn(torus(0.0115, 0.004, 14, 8), "x", 20), 0, 0.217, 0.178),
    ]
    for s in (-1, 1):
        pillar = lathe(polyline("0 0, 0.026 0, 0.026 0.008, 0.016 0.02, 0.013 0.085, 0.018 0.09, 0 0.11"), 16)
        meshes += [move(pillar, s * 0.1), rod((s * 0.1, 0.065, 0), (0, 0.065, 0), 0.009, 12)]
        for angle in (25, 115):
            bar = move(turn(rod((-0.03, 0, 0), (0.03, 0, 0), 0.005, 8), "y", angle), s * 0.1, 0.112 + 0.0001 * angle)
            meshes.append(bar)
    return [("Chrome", mesh) for mesh in meshes]


def cooker() -> Part:
    """A range cooker 0.9 wide, its front at z = 0: two oven doors, a rail, knobs, a hob with pan supports."""
    part: Part = [
        ("Enamel", between((0.0, 0.09, -0.6), (0.9, 0.915, -0.001), 0.006)),
        ("Plinth", between((0.03, -0.01, -0.58), (0.87, 0.1, -0.04))),
        ("Iron", between((0.012, 0.905, -0.59), (0.888, 0.922, -0.02), 0.004)),
    ]
    for i in range(2):
        x = 0.014 + i * 0.438
        part += [
            ("Enamel", between((x, 0.12, 0), (x + 0.434, 0.73, 0.028), 0.008)),
            ("OvenGlass", between((x + 0.07, 0.24, 0.02), (x + 0.364, 0.60, 0.031), 0.003)),
            ("Chrome", rod((x + 0.03, 0.68, 0.062), (x + 0.404, 0.68, 0.062), 0.010, 12)),
        ]
        part += [("Chrome", rod((x + p, 0.68, 0.02), (x + p, 0.68, 0.064), 0.007, 8)) for p in (0.06, 0.374)]
    part.append(("Enamel", between((0.0, 0.745, 0), (0.9, 0.895, 0.03), 0.008)))
    dial = turn(lathe(polyline("0 0, 0.028 0, 0.026 0.012, 0.019 0.014, 0.017 0.034, 0 0.036"), 18), "x", 90)
    for i in range(6):
        part += [
            ("Iron", move(dial, 0.12 + i * 0.132, 0.82, 0.029)),
            ("Chrome", move(turn(torus(0.029, 0.003, 20, 6), "x", 90), 0.12 + i * 0.132, 0.82, 0.032)),
        ]
    for x in (0.2, 0.45, 0.7):
        for z in (-0.44, -0.17):
            burner = lathe(polyline("0 0.016, 0.03 0.016, 0.034 0.012, 0.05 0.01, 0.052 0"), 18)
            part.append(("Iron", move(burner, x, 0.922, z)))
            for angle in (0, 90):
                part.append(("Iron", move(turn(box(0.21, 0.008, 0.008), "y", angle), x, 0.946 + angle * 1e-5, z)))
            part += [
                ("Iron", move(box(0.008, 0.03, 0.008), x + dx, 0.92, z + dz))
                for dx, dz in ((0.1, 0), (-0.1, 0), (0, 0.1), (0, -0.1))
            ]
    return part


def hood(width: float) -> Part:
    """A plastered chimney hood with a wooden mantel; its back at z = -0.6, its foot at y = 0."""
    outline = polyline("-0.6 0, -0.02 0, -0.06 0.12, -0.2 0.45, -0.26 1.15, -0.6 1.15")
    body = move(turn(extrude(outline, width), "y", -90), width, 0.06, 0.0)
    return [("Plaster", body), ("Oak", between((-0.03, 0, -0.6), (width + 0.03, 0.085, 0.03), 0.008))]


def fridge() -> Part:
    """A round-shouldered refrigerator 0.7 wide, its front at z = 0."""
    part: Part = [
        ("Pastel", move(cushion(0.70, 1.62, 0.60, 0.055, 10), 0.35, 0.05, -0.32)),
        ("Pastel", move(cushion(0.685, 1.12, 0.09, 0.035, 10, 0.012), 0.35, 0.08, 0.0)),
        ("Pastel", move(cushion(0.685, 0.44, 0.09, 0.035, 10, 0.012), 0.35, 1.21, 0.0)),
        ("Plinth", between((0.05, -0.01, -0.55), (0.65, 0.08, -0.06))),
    ]
    for y, length in ((0.92, 0.24), (1.26, 0.16)):
        handle = curve(
            [(0.60, y, 0.03), (0.60, y + 0.02, 0.085), (0.60, y + length - 0.02, 0.085), (0.60, y + length, 0.03)], 5
        )
        part.append(("Chrome", sweep(handle, 0.011, 10, up=(1, 0, 0))))
    return part


def pan(radius: float, height: float, material: str, lid: bool) -> Part:
    """A saucepan with a long handle along +x."""
    t = 0.004
    wall = [
        (0.0, 0.0),
        (radius - 0.01, 0.0),
        (radius, 0.01),
        (radius, height),
        (radius + 0.004, height + 0.003),
        (radius - t, height),
        (radius - t, 0.012),
        (0.0, 0.008),
    ]
    handle = curve([(radius - 0.002, height * 0.8, 0), (radius + 0.08, height * 0.9, 0), (radius + 0.2, height, 0)], 4)
    part: Part = [
        (material, lathe(wall, 28)),
        ("Iron", sweep(handle, [(-0.010, -0.004), (0.010, -0.004), (0.010, 0.004), (-0.010, 0.004)])),
    ]
    if lid:
        top = [
            (radius + 0.003, 0.0),
            (radius * 0.9, 0.010),
            (radius * 0.3, 0.024),
            (0.008, 0.026),
            (0.008, 0.036),
            (0.016, 0.044),
            (0.014, 0.052),
            (0.0, 0.054),
        ]
        part.append((material, move(lathe(top, 28), 0, height + 0.002)))
    return part


def kettle() -> Part:
    """A whistling kettle with a bow handle."""
    body = polyline("0 0, 0.095 0, 0.108 0.01, 0.112 0.03, 0.105 0.075, 0.08 0.115, 0.045 0.135, 0.042 0.14, 0 0.148")
    bow = curve(polyline("-0.075 0.115 0, -0.085 0.19 0, -0.04 0.235 0, 0.04 0.235 0, 0.085 0.19 0, 0.075 0.115 0"), 5)
    spout = curve([(0.09, 0.05, 0), (0.135, 0.075, 0), (0.155, 0.125, 0)], 4)
    return [
        ("Chrome", lathe(body, 36)),
        ("Iron", sweep(bow, 0.007, 10, up=(0, 0, 1))),
        ("Chrome", sweep(spout, 0.017, 12, radii=np.linspace(1.2, 0.7, 9), up=(0, 0, 1))),
        ("Iron", move(lathe(polyline("0.006 0, 0.006 0.012, 0.014 0.018, 0.012 0.03, 0 0.034"), 14), 0, 0.144)),
    ]


def toaster() -> Part:
    slots: Part = [("Iron", move(box(0.2, 0.012, 0.026), 0, 0.178, z)) for z in (-0.035, 0.035)]
    return [
        ("Chrome", move(cushion(0.30, 0.17, 0.17, 0.05, 12), 0, 0.015)),
        ("Iron", move(box(0.27, 0.03, 0.15, 0.006), 0, 0.0)),
        *slots,
    ]


def hanging(rng: np.random.Generator, width: float) -> Part:
    """A rail along x with ladles, spoons and small copper pans on hooks; the rail at y = 0, z = 0.05."""
    part: Part = [("Iron", rod((0, 0, 0.05), (width, 0, 0.05), 0.006, 8))]
    part += [("Iron", rod((x, 0, -0.01), (x, 0, 0.05), 0.005, 6)) for x in (0.04, width - 0.04)]
    n = int(width / 0.11)
    for i in range(n):
        x = 0.07 + i * (width - 0.14) / (n - 1)
        length = float(rng.uniform(0.17, 0.24))
        part.append(("Iron", rod((x, 0.008, 0.055), (x, -0.03, 0.057), 0.0025, 5)))
        if i % 3 == 2:
            dish = turn(lathe(polyline("0 -0.035, 0.05 -0.033, 0.06 0, 0.057 0, 0.047 -0.029, 0 -0.031"), 20), "x", 90)
            part += [
                ("Copper", move(dish, x, -length - 0.03, 0.045)),
                ("Iron", move(box(0.012, length - 0.03, 0.004), x, -length + 0.025, 0.055)),
            ]
        else:
            part.append(
                ("Chrome" if i % 3 else "Oak", move(box(0.012, length - 0.02, 0.004, 0.001), x, -length, 0.055))
            )
            spoon = turn(lathe(polyline("0 -0.018, 0.018 -0.012, 0.027 0, 0.024 0, 0 -0.014"), 16), "x", 90)
            part.append(("Chrome" if i % 3 else "Oak", move(spoon, x, -length - 0.02, 0.055)))
    return part
