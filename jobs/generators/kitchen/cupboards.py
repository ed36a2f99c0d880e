"""Cupboards of the kitchen, their doors and worktops; each function returns a part that stands on y = 0."""

import numpy as np

from ..common.parts import Part, moved
from ..common.shapes import Mesh, between, join, move, turn
from ..common.turned import extrude, lathe, polyline, surface

GAP = 0.004  # between neighbouring doors


def knob() -> Mesh:
    """A door knob that grows along +z."""
    profile = polyline("0 0, 0.011 0, 0.006 0.006, 0.006 0.014, 0.014 0.02, 0.015 0.026, 0 0.031")
    return turn(lathe(profile, 10), "x", 90)


def door(width: float, height: float, paint: str, knob_x: float, knob_y: float, rail: float = 0.065) -> Part:
    """A shaker door, its lower left corner at the origin, its back at z = 0: four rails, a sunk panel, a knob."""
    w, h = width - GAP, height - GAP
    frame = [
        between((0, 0, 0), (rail, h, 0.022), 0.003),
        between((w - rail, 0, 0), (w, h, 0.022), 0.003),
        between((rail - 0.001, h - rail, 0.0005), (w - rail + 0.001, h - 0.0005, 0.0215), 0.003),
        between((rail - 0.001, 0.0005, 0.0005), (w - rail + 0.001, rail, 0.0215), 0.003),
        between((rail - 0.01, rail - 0.01, 0.002), (w - rail + 0.01, h - rail + 0.01, 0.010)),
    ]
    part: Part = [(paint, mesh) for mesh in frame]
    return [*part, ("Brass", move(knob(), knob_x, knob_y, 0.0205))]


def drawer(width: float, height: float, paint: str) -> Part:
    """A drawer front with a cup handle, its lower left corner at the origin."""
    w, h = width - GAP, height - GAP
    angle = np.linspace(0, np.pi, 9)
    arch = np.stack([0.045 * np.cos(angle), 0.020 * np.sin(angle)], axis=-1)
    cup = surface(np.stack([np.c_[arch, np.full(9, z)] for z in (0.0, 0.016, 0.024)], axis=0))
    lid = np.stack([np.c_[arch * s, np.full(9, 0.024 + 0.004 * (1 - s))] for s in (1.0, 0.7, 0.25)], axis=0)
    return [
        (paint, between((0, 0, 0), (w, h, 0.022), 0.004)),
        ("Brass", move(join([cup, surface(lid)]), w / 2, h * 0.5, 0.021)),
    ]


def base_cupboard(width: float, paint: str, kind: str) -> Part:
    """A floor cupboard 0.6 deep, its front at z = 0, without worktop; kind: "doors", "drawers", "door"."""
    part: Part = [
        (paint, between((0.002, 0.10, -0.6), (width - 0.002, 0.872, -0.001))),
        ("Plinth", between((0.001, -0.01, -0.6), (width - 0.001, 0.11, -0.05))),
    ]
    if kind == "drawers":
        y = 0.105
        for height in (0.30, 0.25, 0.21):
            part += moved(drawer(width, height, paint), 0.002, y)
            y += height
        return part
    part += moved(drawer(width, 0.155, paint), 0.002, 0.71)
    n = 2 if kind == "doors" else 1
    w = width / n
    for i in range(n):
        knob_x = w - 0.035 if i == 0 and n == 2 else 0.035
        part += moved(door(w, 0.6, paint, knob_x, 0.52), 0.002 + i * w, 0.105)
    return part


def wall_cupboard(width: float, height: float, paint: str) -> Part:
    """A cupboard 0.33 deep for the wall, its front at z = 0, with a cornice and a light rail."""
    part: Part = [(paint, between((0.002, 0, -0.33), (width - 0.002, height, -0.001)))]
    n = max(1, round(width / 0.45))
    w = width / n
    for i in range(n):
        knob_x = w - 0.035 if i % 2 == 0 else 0.035
        part += moved(door(w, height - 0.01, paint, knob_x, 0.09), 0.002 + i * w, 0.005)
    cornice = polyline("0 0, 0.012 0, 0.016 0.02, 0.035 0.035, 0.045 0.055, 0.045 0.065, 0 0.065")
    part.append((paint, move(turn(extrude(cornice, width - 0.006), "y", -90), width - 0.003, height - 0.008, 0.02)))
    return part


def worktop(x0: float, x1: float, hole: tuple[float, float] | None = None) -> list[Mesh]:
    """A worktop 0.04 thick and 0.64 deep over z = -0.62 to 0.02, with a hole for a basin between two x."""
    if hole is None:
        return [between((x0, 0.875, -0.62), (x1, 0.915, 0.025), 0.006)]
    a, b = hole
    return [
        between((x0, 0.875, -0.62), (a, 0.915, 0.025), 0.006),
        between((b, 0.875, -0.62), (x1, 0.915, 0.025), 0.006),
        between((a - 0.004, 0.8755, -0.6195), (b + 0.004, 0.9145, -0.49), 0.0055),
        between((a - 0.004, 0.8755, -0.085), (b + 0.004, 0.9145, 0.0245), 0.0055),
    ]


def basin(width: float) -> Part:
    """A white farmhouse basin of the given width, 0.46 deep, its rim at y = 0.905, its front at z = 0.03."""
    t = 0.022
    walls = [
        between((0, 0.66, -0.48), (width, 0.905, -0.48 + t), 0.006),
        between((0, 0.64, 0.005), (width, 0.905, 0.055), 0.012),
        between((0.001, 0.66, -0.479), (t, 0.9045, 0.02), 0.006),
        between((width - t, 0.66, -0.479), (width - 0.001, 0.9045, 0.02), 0.006),
        between((0.002, 0.65, -0.478), (width - 0.002, 0.70, 0.03), 0.004),
    ]
    drain = lathe(polyline("0 0.004, 0.02 0.003, 0.035 0.006, 0.042 0.002, 0.042 -0.01"), 16)
    return [*(("Porcelain", w) for w in walls), ("Chrome", move(drain, width / 2, 0.701, -0.22))]
