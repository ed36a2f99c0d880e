"""Columns, balusters, arches, mouldings and windows of the theatre staircase; each stands on y = 0."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import Mesh, between, box, move, scale, turn
from ..common.turned import ball, extrude, lathe, polyline, surface, sweep, torus

BALUSTER = polyline(
    "0.05 0, 0.048 0.03, 0.03 0.05, 0.052 0.16, 0.05 0.24, 0.03 0.4, 0.022 0.5, 0.036 0.53, 0.024 0.56, "
    "0.046 0.62, 0.046 0.66"
)
RAIL = polyline(
    "-0.05 -0.045, 0.05 -0.045, 0.085 -0.015, 0.095 0.015, 0.075 0.045, 0.03 0.06, -0.03 0.06, "
    "-0.075 0.045, -0.095 0.015, -0.085 -0.015"
)


def baluster() -> Part:
    """A turned marble baluster 0.66 high."""
    return [("Marble", lathe(BALUSTER, 8))]


def rail(path: list[tuple[float, float, float]]) -> Mesh:
    """A moulded handrail along a path."""
    return sweep(path, RAIL)


def newel(height: float) -> Part:
    """A square pedestal for the end of a balustrade, with a base, a sunk field on each side and a cap."""
    part: Part = [
        ("Marble", move(box(0.46, 0.14, 0.46, 0.012), 0, -0.01)),
        ("Marble", move(box(0.36, height - 0.14, 0.36, 0.008), 0, 0.08)),
        ("Marble", move(box(0.42, 0.05, 0.42, 0.015), 0, height - 0.075)),
        ("Marble", move(box(0.48, 0.055, 0.48, 0.02), 0, height - 0.03)),
    ]
    for angle in (0, 90, 180, 270):
        field = move(box(0.22, height - 0.42, 0.012, 0.004), 0, 0.22, 0.182)
        part.append(("MarbleRose", turn(field, "y", angle)))
    return part


def column(height: float, radius: float, flutes: int = 16) -> Part:
    """A fluted column with base, swelling shaft, leafy capital and abacus."""
    base_h, cap_h = 0.42 * radius * 2, 0.55 * radius * 2
    y = np.linspace(0, 1, 5)
    swell = 1.0 - 0.14 * y**1.8
    angle = np.linspace(0, 2 * np.pi, 2 * flutes + 1)
    flute = np.where(np.arange(2 * flutes + 1) % 2 == 0, 1.0, 0.93)
    r = radius * swell[None, :] * flute[:, None]
    shaft_h = height - base_h - cap_h
    shaft = np.stack(
        [r * np.cos(angle)[:, None], np.broadcast_to(base_h + shaft_h * y, r.shape), -r * np.sin(angle)[:, None]],
        axis=-1,
    )
    foot = polyline("1.32 0.3, 1.38 0.42, 1.32 0.52, 1.14 0.56, 1.1 0.68, 1.2 0.76, 1.18 0.86, 1.04 0.92, 0.98 1.02")
    bell = polyline("0.86 -0.03, 0.93 0, 0.93 0.05, 0.86 0.07, 0.88 0.35, 1 0.62, 1.26 0.82")
    part: Part = [
        ("Marble", surface(shaft, crease_deg=40.0)),
        ("MarbleRose", move(box(2.9 * radius, 0.34 * base_h, 2.9 * radius, 0.01), 0, -0.01)),
        ("Marble", lathe(foot * [radius, base_h], 18)),
        ("Gilding", move(lathe(bell * [radius, cap_h], 16), 0, height - cap_h)),
        ("Marble", move(box(2.7 * radius, 0.20 * cap_h, 2.7 * radius, 0.012), 0, height - 0.19 * cap_h)),
    ]
    for tier, (n, up, out) in enumerate(((8, 0.42, 0.30), (8, 0.72, 0.48))):
        for i in range(n):
            t = np.linspace(0, 1, 4)
            x = radius * (0.90 + out * t**3 + 0.05 * np.sin(np.pi * t))
            rise = cap_h * (0.06 + up * (t - 0.28 * t**4))
            half = radius * 0.30 * np.array([0.9, 1.0, 0.8, 0.25])
            rows = [np.stack([x - (0.03 * radius if s else 0.0), rise, s * half], axis=-1) for s in (-1, 0, 1)]
            blade = turn(surface(np.stack(rows)), "y", 360.0 * (i + 0.5 * tier) / n)
            part.append(("Gilding", move(blade, 0, height - cap_h)))
    for angle_deg in (45, 135, 225, 315):
        spiral = np.linspace(0, 2.2 * np.pi, 11)
        reach = radius * 0.17 * (1 - spiral / 10)
        volute = np.stack(
            [
                radius * 1.36 + reach * np.cos(spiral + 1.6),
                height - 0.36 * cap_h + reach * np.sin(spiral + 1.6),
                0 * spiral,
            ],
            axis=-1,
        )
        part.append(("Gilding", turn(sweep(volute, 0.045 * radius * 2, 5, up=(0, 0, 1)), "y", angle_deg)))
    return part


def arch_infill(width: float, depth: float) -> Part:
    """The part of a square head above a half circle; the spring line at y = 0, from z = -depth to 0."""
    radius, edge = width / 2, width / 2 + 0.02
    angle = np.linspace(np.pi, 0, 19)
    arc = np.stack([radius * np.cos(angle), radius * np.sin(angle).round(9)], axis=-1)
    outline = np.vstack([[(edge, 0.0), (edge, edge), (-edge, edge), (-edge, 0.0)], arc])
    return [("Plaster", move(extrude(outline, depth - 0.006, 20.0), 0, 0, -depth + 0.003))]


def arched_window(width: float, spring: float) -> Part:
    """A tall frame with glazing bars and a fan light, without panes; its foot at y = 0, centred in x, around z = 0."""
    radius = width / 2
    angle = np.linspace(0, np.pi, 19)
    inner = radius - 0.03
    outline = np.vstack(
        [[(inner, 0.0)], np.stack([inner * np.cos(angle), spring + inner * np.sin(angle)], axis=-1), [(-inner, 0.0)]]
    )
    path = np.c_[outline, np.zeros(len(outline))]
    frame = sweep(path, [(-0.045, -0.04), (0.045, -0.04), (0.045, 0.04), (-0.045, 0.04)], up=(0, 0, 1), crease_deg=30.0)
    bar = [(-0.014, -0.02), (0.014, -0.02), (0.014, 0.02), (-0.014, 0.02)]
    part: Part = [
        ("WindowPaint", frame),
        ("WindowPaint", between((-inner, -0.01, -0.039), (inner, 0.07, 0.039), 0.008)),
    ]
    part.append(("WindowPaint", between((-inner, spring - 0.035, -0.036), (inner, spring + 0.035, 0.036), 0.008)))
    part.append(("WindowPaint", between((-0.028, 0.05, -0.03), (0.028, spring - 0.03, 0.03), 0.006)))
    n = max(2, round(spring / 0.62))
    for i in range(1, n):
        y = spring * i / n
        part.append(("WindowPaint", sweep([(-inner, y, 0), (inner, y, 0)], bar, up=(0, 0, 1), crease_deg=30.0)))
    for x in (-inner / 2, inner / 2):
        part.append(
            ("WindowPaint", sweep([(x, 0.05, 0.0005), (x, spring, 0.0005)], bar, up=(0, 0, 1), crease_deg=30.0))
        )
    for a in np.radians([36, 72, 108, 144]):
        tip = (inner * np.cos(a), spring + inner * np.sin(a), 0.0)
        start = (0.17 * np.cos(a), spring + 0.17 * np.sin(a), 0.0)
        part.append(("WindowPaint", sweep([start, tip], bar, up=(0, 0, 1), crease_deg=30.0)))
    half = np.stack([0.17 * np.cos(angle), spring + 0.17 * np.sin(angle), 0 * angle], axis=-1)
    part.append(("WindowPaint", sweep(half, 0.014, 6, up=(0, 0, 1))))
    return part


def architrave(width: float, spring: float) -> Mesh:
    """A moulding around an arched opening, on a wall that looks along -z, its foot at y = 0."""
    radius = width / 2 + 0.02
    angle = np.linspace(0, np.pi, 19)
    outline = np.vstack(
        [
            [(radius, 0.0)],
            np.stack([radius * np.cos(angle), spring + radius * np.sin(angle)], axis=-1),
            [(-radius, 0.0)],
        ]
    )
    moulding = polyline("-0.13 -0.01, -0.13 0.03, -0.1 0.05, -0.03 0.05, 0 0.03, 0 -0.01")
    return sweep(np.c_[outline, np.zeros(len(outline))], np.array(moulding) * [1, -1], up=(0, 0, 1), crease_deg=30.0)


def panel_moulding(width: float, height: float, material: str = "Gilding") -> Part:
    """A raised rectangular moulding on a wall that looks along +z, its lower left corner at the origin."""
    ring = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], dtype=float)
    profile = polyline("-0.03 -0.005, 0.03 -0.005, 0.026 0.012, 0.012 0.026, -0.012 0.022, -0.03 0.01")
    return [(material, sweep(ring, profile, closed=True, up=(0, 0, 1), crease_deg=40.0))]


def rosette(radius: float) -> Part:
    """A plaster ceiling rose that hangs down from y = 0."""
    profile = polyline(
        "0 -0.16, 0.1 -0.15, 0.16 -0.08, 0.3 -0.06, 0.4 -0.11, 0.46 -0.05, 0.8 -0.03, 0.88 -0.08, 0.96 -0.05, 1 0.01"
    )
    part: Part = [("Plaster", lathe(profile * [radius, 1.0], 40))]
    if radius < 0.5:
        return [("Gilding", lathe((profile * [radius, 1.0])[[0, 2, 3, 5, 6, 7, 9]], 16, 30.0))]
    for i in range(16):
        petal = scale(ball(1.0, 10, 7), 0.17 * radius, 0.035, 0.055 * radius)
        part.append(("Gilding", turn(move(petal, 0.62 * radius, -0.045), "y", 22.5 * i)))
    part.append(("Gilding", move(torus(0.92 * radius, 0.022, 40, 8), 0, -0.075)))
    return part
