"""Lamps of the theatre staircase: standards, chandeliers, wall lights."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import Mesh, move, scale, turn
from ..common.turned import ball, curve, lathe, polyline, sweep


def candelabrum(arms: int = 5) -> Part:
    """A gilded lamp standard 1.5 high: a figured stem, arms with globes, one globe on top."""
    stem = polyline(
        "0 0, 0.16 0, 0.16 0.03, 0.1 0.06, 0.06 0.12, 0.045 0.16, 0.075 0.24, 0.085 0.32, 0.05 0.42, "
        "0.028 0.5, 0.045 0.53, 0.026 0.56, 0.022 0.85, 0.05 0.89, 0.055 0.95, 0.03 1, 0.02 1.18, 0.05 1.22, "
        "0.04 1.25, 0 1.25"
    )
    globe = ball(0.085, 11, 6)
    part: Part = [("Gilding", lathe(stem, 14)), ("Globe", move(globe, 0, 1.335))]
    for i in range(arms):
        arm = curve(polyline("0.03 0.92 0, 0.15 0.86 0, 0.26 0.9 0, 0.29 0.99 0, 0.28 1.05 0"), 4)
        dish = lathe([(0.0, 0.0), (0.05, 0.015), (0.06, 0.03), (0.0, 0.03)], 12)
        for material, mesh in (
            ("Gilding", sweep(arm, 0.012, 6, up=(0, 0, 1))),
            ("Gilding", move(dish, 0.28, 1.04)),
            ("Globe", move(scale(globe, 0.8), 0.28, 1.13)),
        ):
            part.append((material, turn(mesh, "y", 360.0 * i / arms)))
    return part


def crystal(length: float) -> Mesh:
    """A cut drop that hangs from y = 0."""
    return lathe([(0.0, -length), (length * 0.28, -length * 0.6), (0.0, 0.0)], 6, 5.0)


def chandelier(tiers: list[tuple[int, float, float]], drop: float) -> Part:
    """A gilded chandelier with candles and crystal drops; tiers are (arms, radius, y); it hangs from y = drop."""
    stem = [
        (0.0, -0.30),
        (0.05, -0.26),
        (0.03, -0.20),
        (0.10, -0.10),
        (0.13, 0.0),
        (0.07, 0.10),
        (0.03, 0.20),
        (0.08, 0.34),
        (0.09, 0.42),
        (0.04, 0.52),
        (0.025, 0.75),
        (0.06, 0.84),
        (0.03, 0.95),
        (0.015, 1.0),
        (0.012, drop),
    ]
    part: Part = [("Gilding", lathe(stem, 18)), ("Crystal", move(scale(crystal(0.16), 1.2), 0, -0.29))]
    for n, radius, y in tiers:
        for i in range(n):
            arm = curve(
                [
                    (0.06, y, 0),
                    (0.35 * radius, y - 0.16, 0),
                    (0.75 * radius, y - 0.12, 0),
                    (radius, y + 0.08, 0),
                    (radius, y + 0.14, 0),
                ],
                3,
            )
            dish = lathe([(0.0, 0.0), (0.065, 0.02), (0.07, 0.03), (0.0, 0.024)], 10)
            candle = lathe([(0.017, 0.0), (0.017, 0.15), (0.0, 0.155)], 8)
            flame = lathe([(0.0, 0.0), (0.014, 0.02), (0.010, 0.045), (0.0, 0.075)], 8)
            things = [
                ("Gilding", sweep(arm, 0.013, 6, up=(0, 0, 1))),
                ("Gilding", move(dish, radius, y + 0.13)),
                ("Candle", move(candle, radius, y + 0.15)),
                ("Globe", move(flame, radius, y + 0.305)),
            ]
            things += [
                ("Crystal", move(crystal(0.085), radius + 0.06 * np.cos(a), y + 0.145, 0.06 * np.sin(a)))
                for a in np.arange(3) * 2.1
            ]
            things.append(("Crystal", move(crystal(0.10), 0.55 * radius, y - 0.155)))
            part += [(material, turn(mesh, "y", 360.0 * (i + 0.5 * (radius > 0.7)) / n)) for material, mesh in things]
        swag = 7 * n if n > 8 else 0
        for k in range(swag):
            a = 2 * np.pi * k / swag
            sag = 0.10 * (1 - np.abs(((k / 7.0) % 1) * 2 - 1) ** 2)
            part.append(
                (
                    "Crystal",
                    move(ball(0.016, 5, 3), 0.97 * radius * np.cos(a), y + 0.10 - sag, 0.97 * radius * np.sin(a)),
                )
            )
    return part


def sconce() -> Part:
    """A wall light with two candles on a wall that looks along +z, its plate around y = 0."""
    plate = turn(lathe(polyline("0 0.02, 0.05 0.03, 0.07 0.015, 0.1 0, 0.1 -0.01"), 16), "x", 90)
    part: Part = [("Gilding", scale(plate, 1.0, 1.7, 1.0))]
    for s in (-1, 1):
        arm = curve([(0, -0.04, 0.02), (s * 0.07, -0.10, 0.11), (s * 0.15, -0.06, 0.15), (s * 0.16, 0.02, 0.15)], 3)
        dish = lathe([(0.0, 0.0), (0.045, 0.016), (0.05, 0.026), (0.0, 0.02)], 10)
        candle = lathe([(0.016, 0.0), (0.016, 0.14), (0.0, 0.145)], 7)
        flame = lathe([(0.0, 0.0), (0.014, 0.02), (0.010, 0.045), (0.0, 0.075)], 6)
        part += [
            ("Gilding", sweep(arm, 0.011, 7)),
            ("Gilding", move(dish, s * 0.16, 0.01, 0.15)),
            ("Candle", move(candle, s * 0.16, 0.03, 0.15)),
            ("Globe", move(flame, s * 0.16, 0.177, 0.15)),
        ]
    return part
