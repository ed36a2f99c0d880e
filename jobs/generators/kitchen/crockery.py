"""Plates, cups, jars, bottles, fruit and bread; each function returns a part that stands on y = 0."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import box, cushion, move, turn
from ..common.turned import curve, extrude, lathe, polyline, rod, sweep, torus

PLATE = polyline(
    "0 0.004, 0.07 0.004, 0.085 0.007, 0.13 0.02, 0.133 0.023, 0.128 0.0235, 0.085 0.0115, 0.07 0.009, 0 0.009"
)
BOWL = polyline(
    "0 0, 0.04 0, 0.042 0.008, 0.075 0.03, 0.1 0.075, 0.104 0.085, 0.099 0.085, 0.07 0.035, 0.038 0.014, 0 0.012"
)
CUP = polyline("0 0, 0.026 0, 0.028 0.006, 0.038 0.03, 0.041 0.075, 0.042 0.08, 0.038 0.08, 0.035 0.03, 0 0.01")
JAR = polyline("0 0, 0.045 0, 0.05 0.006, 0.05 0.12, 0.042 0.138, 0.04 0.146, 0 0.146")
LID = polyline("0 0.14, 0.046 0.14, 0.048 0.146, 0.046 0.162, 0.012 0.166, 0.014 0.178, 0 0.184")
BOTTLE = polyline(
    "0 0, 0.036 0, 0.038 0.006, 0.038 0.17, 0.03 0.205, 0.014 0.235, 0.013 0.29, 0.016 0.295, 0.015 0.31, 0 0.31"
)


def plate_stack(n: int, material: str, size: float = 1.0) -> Part:
    return [(material, move(lathe(PLATE * [size, 1], 26), 0, 0.009 * i)) for i in range(n)]


def cup(material: str) -> Part:
    handle = curve(polyline("0.036 0.065 0, 0.06 0.066 0, 0.065 0.04 0, 0.05 0.022 0, 0.034 0.02 0"), 4)
    return [(material, lathe(CUP, 20)), (material, sweep(handle, 0.0045, 6, up=(0, 0, 1)))]


def jar(content: str, height: float = 1.0) -> Part:
    return [
        (content, lathe(JAR * [1, height], 20)),
        ("Oak", move(lathe(LID - [0, 0.14], 20), 0, 0.14 * height)),
    ]


def bottle(material: str, height: float = 1.0) -> Part:
    return [(material, lathe(BOTTLE * [1, height], 18))]


def fruit_bowl(rng: np.random.Generator) -> Part:
    """A wooden bowl of apples, lemons and oranges."""
    part: Part = [("Walnut", lathe(BOWL * [1.5, 1.05], 32))]
    kinds = ["Apple", "Lemon", "Orange", "Apple", "Lime"]
    spots = [
        (0.0, 0.055, 0.0),
        *[(0.075 * np.cos(a), 0.068, 0.075 * np.sin(a)) for a in np.arange(6) * np.pi / 3],
        (0.035, 0.115, 0.02),
        (-0.038, 0.115, 0.012),
        (0.0, 0.117, -0.045),
    ]
    for i, (x, y, z) in enumerate(spots):
        kind = kinds[i % len(kinds)]
        angle = np.linspace(-np.pi / 2, np.pi / 2, 11)
        r = rng.uniform(0.034, 0.039)
        dent = (
            0.25 * np.exp(-((np.abs(angle) - np.pi / 2) ** 2) * 10)
            if kind == "Apple"
            else -0.12 * np.exp(-((np.abs(angle) - np.pi / 2) ** 2) * 30)
        )
        profile = np.stack([r * np.cos(angle).round(9), r * (1 - dent) * np.sin(angle)], axis=-1)
        fruit = turn(turn(lathe(profile, 16, 80.0), "x", float(rng.uniform(0, 70))), "y", float(rng.uniform(0, 360)))
        part.append((kind, move(fruit, x, y, z)))
        if i == 0:
            part.append(("Walnut", move(rod((0, 0, 0), (0.004, 0.02, 0), 0.0015, 5), x, y + r * 0.75, z)))
    return part


def loaf() -> Part:
    """A loaf of bread on a board."""
    bread = move(cushion(0.24, 0.10, 0.11, 0.05, 10, 0.012), 0, 0.022)
    cuts = [move(turn(cushion(0.02, 0.014, 0.10, 0.007, 4), "y", 25), x, 0.128, 0) for x in (-0.06, 0.0, 0.06)]
    return [("Oak", box(0.38, 0.02, 0.22, 0.006)), ("Crust", bread), *(("Crumb", c) for c in cuts)]


def knife_block() -> Part:
    block = turn(move(box(0.10, 0.22, 0.14, 0.008), 0, 0.0, 0), "x", -14)
    part: Part = [("Walnut", move(block, 0, 0.012, 0))]
    for i in range(5):
        handle = turn(
            move(box(0.016, 0.09, 0.024, 0.004), -0.03 + 0.03 * (i % 3), 0.218, -0.03 + 0.055 * (i // 3)), "x", -14
        )
        part.append(("Iron", move(handle, 0, 0.012, 0)))
    return part


def board(width: float, height: float, lean_deg: float) -> Part:
    """A chopping board that leans back against a wall behind it."""
    angle = np.radians(np.linspace(0, 180, 9))
    outline = np.vstack(
        [
            [(-width / 2, 0), (width / 2, 0)],
            np.stack([width / 2 * np.cos(angle), height + 0.25 * width * np.sin(angle)], axis=-1),
        ]
    )
    return [("Oak", turn(extrude(outline[[0, 1, *range(2, 11)]], 0.018), "x", -lean_deg))]


def basket(radius: float, height: float) -> Part:
    """A round basket of woven rings."""
    part: Part = []
    for i in range(int(height / 0.016)):
        r = radius * (0.82 + 0.18 * np.sin(i * 0.016 / height * np.pi / 1.6))
        part.append(("Wicker", move(torus(r, 0.0095, 28, 6), 0, 0.01 + 0.016 * i)))
    part.append(("Wicker", lathe([(0.0, 0.006), (radius * 0.8, 0.006)], 20)))
    return part
