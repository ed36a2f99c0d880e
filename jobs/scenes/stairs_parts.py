"""Stonework and furnishings of the theatre staircase; each function returns a part or a mesh that stands on y = 0."""

import numpy as np
from glb import Part
from shapes import (
    Array, Mesh, ball, between, box, curve, cushion, extrude, lathe, mirror_x, move, rod, rotation, scale, surface, sweep,
    torus, turn,
)  # fmt: skip

BALUSTER = [(0.050, 0.0), (0.048, 0.03), (0.030, 0.05), (0.052, 0.16), (0.050, 0.24), (0.030, 0.40), (0.022, 0.50), (0.036, 0.53),
            (0.024, 0.56), (0.046, 0.62), (0.046, 0.66)]  # fmt: skip
RAIL = [(-0.05, -0.045), (0.05, -0.045), (0.085, -0.015), (0.095, 0.015), (0.075, 0.045), (0.03, 0.06), (-0.03, 0.06),
        (-0.075, 0.045), (-0.095, 0.015), (-0.085, -0.015)]  # fmt: skip


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


def candelabrum(arms: int = 5) -> Part:
    """A gilded lamp standard 1.5 high: a figured stem, arms with globes, one globe on top."""
    stem = [(0.0, 0.0), (0.16, 0.0), (0.16, 0.03), (0.10, 0.06), (0.06, 0.12), (0.045, 0.16), (0.075, 0.24), (0.085, 0.32), (0.05, 0.42),
            (0.028, 0.50), (0.045, 0.53), (0.026, 0.56), (0.022, 0.85), (0.05, 0.89), (0.055, 0.95), (0.03, 1.0), (0.02, 1.18), (0.05, 1.22),
            (0.04, 1.25), (0.0, 1.25)]  # fmt: skip
    globe = ball(0.085, 11, 6)
    part: Part = [("Gilding", lathe(stem, 14)), ("Globe", move(globe, 0, 1.335))]
    for i in range(arms):
        arm = curve([(0.03, 0.92, 0), (0.15, 0.86, 0), (0.26, 0.90, 0), (0.29, 0.99, 0), (0.28, 1.05, 0)], 4)
        dish = lathe([(0.0, 0.0), (0.05, 0.015), (0.06, 0.03), (0.0, 0.03)], 12)
        for material, mesh in (("Gilding", sweep(arm, 0.012, 6, up=(0, 0, 1))), ("Gilding", move(dish, 0.28, 1.04)), ("Globe", move(scale(globe, 0.8), 0.28, 1.13))):
            part.append((material, turn(mesh, "y", 360.0 * i / arms)))
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
    shaft = np.stack([r * np.cos(angle)[:, None], np.broadcast_to(base_h + shaft_h * y, r.shape), -r * np.sin(angle)[:, None]], axis=-1)
    foot = np.array([(1.32, 0.30), (1.38, 0.42), (1.32, 0.52), (1.14, 0.56), (1.10, 0.68), (1.20, 0.76), (1.18, 0.86), (1.04, 0.92), (0.98, 1.02)])
    bell = np.array([(0.86, -0.03), (0.93, 0.0), (0.93, 0.05), (0.86, 0.07), (0.88, 0.35), (1.0, 0.62), (1.26, 0.82)])
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
        volute = np.stack([radius * 1.36 + reach * np.cos(spiral + 1.6), height - 0.36 * cap_h + reach * np.sin(spiral + 1.6), 0 * spiral], axis=-1)
        part.append(("Gilding", turn(sweep(volute, 0.045 * radius * 2, 5, up=(0, 0, 1)), "y", angle_deg)))
    return part


def arch_infill(width: float, depth: float) -> Part:
    """What is left of a square head above a half circle; the spring line at y = 0, from z = -depth to 0."""
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
    outline = np.vstack([[(inner, 0.0)], np.stack([inner * np.cos(angle), spring + inner * np.sin(angle)], axis=-1), [(-inner, 0.0)]])
    path = np.c_[outline, np.zeros(len(outline))]
    frame = sweep(path, [(-0.045, -0.04), (0.045, -0.04), (0.045, 0.04), (-0.045, 0.04)], up=(0, 0, 1), crease_deg=30.0)
    bar = [(-0.014, -0.02), (0.014, -0.02), (0.014, 0.02), (-0.014, 0.02)]
    part: Part = [("WindowPaint", frame), ("WindowPaint", between((-inner, -0.01, -0.039), (inner, 0.07, 0.039), 0.008))]
    part.append(("WindowPaint", between((-inner, spring - 0.035, -0.036), (inner, spring + 0.035, 0.036), 0.008)))
    part.append(("WindowPaint", between((-0.028, 0.05, -0.03), (0.028, spring - 0.03, 0.03), 0.006)))
    n = max(2, round(spring / 0.62))
    for i in range(1, n):
        y = spring * i / n
        part.append(("WindowPaint", sweep([(-inner, y, 0), (inner, y, 0)], bar, up=(0, 0, 1), crease_deg=30.0)))
    for x in (-inner / 2, inner / 2):
        part.append(("WindowPaint", sweep([(x, 0.05, 0.0005), (x, spring, 0.0005)], bar, up=(0, 0, 1), crease_deg=30.0)))
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
    outline = np.vstack([[(radius, 0.0)], np.stack([radius * np.cos(angle), spring + radius * np.sin(angle)], axis=-1), [(-radius, 0.0)]])
    moulding = [(-0.13, -0.01), (-0.13, 0.03), (-0.10, 0.05), (-0.03, 0.05), (0.0, 0.03), (0.0, -0.01)]
    return sweep(np.c_[outline, np.zeros(len(outline))], np.array(moulding) * [1, -1], up=(0, 0, 1), crease_deg=30.0)


def panel_moulding(width: float, height: float, material: str = "Gilding") -> Part:
    """A raised rectangular moulding on a wall that looks along +z, its lower left corner at the origin."""
    ring = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], dtype=float)
    profile = [(-0.03, -0.005), (0.03, -0.005), (0.026, 0.012), (0.012, 0.026), (-0.012, 0.022), (-0.03, 0.01)]
    return [(material, sweep(ring, profile, closed=True, up=(0, 0, 1), crease_deg=40.0))]


def great_mirror(width: float, height: float) -> Part:
    """A mirror in a gilded frame with a crest, on a wall that looks along +z; lower left corner at the origin."""
    glass = np.array([[[0, 0, 0.05], [0, height, 0.05]], [[width, 0, 0.05], [width, height, 0.05]]])
    ring = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], dtype=float)
    outer = [(-0.02, 0.0), (-0.02, 0.07), (0.02, 0.10), (0.06, 0.085), (0.10, 0.11), (0.15, 0.13), (0.19, 0.10), (0.22, 0.04), (0.22, 0.0)]
    part: Part = [("Mirror", surface(glass)), ("Gilding", sweep(ring, outer, closed=True, up=(0, 0, 1), crease_deg=40.0))]
    pearl = ball(0.018, 6, 4)
    for along, fixed, vertical in ((width, -0.02, False), (width, height + 0.02, False), (height, -0.02, True), (height, width + 0.02, True)):
        n = int(along / 0.09)
        for i in range(n):
            at = along * (i + 0.5) / n
            part.append(("Gilding", move(pearl, fixed if vertical else at, at if vertical else fixed, 0.10)))
    shell_angle = np.radians(np.linspace(20, 160, 9))
    for i, a in enumerate(shell_angle):
        ray = rod((0.06 * np.cos(a), 0.06 * np.sin(a), 0.08), (0.34 * np.cos(a), 0.06 + 0.34 * np.sin(a), 0.10 + 0.004 * i), 0.036, 8)
        part.append(("Gilding", move(ray, width / 2, height + 0.10)))
        part.append(("Gilding", move(ball(0.045, 10, 7), width / 2 + 0.36 * np.cos(a), height + 0.17 + 0.35 * np.sin(a), 0.105)))
    for s in (-1, 1):
        scroll_angle = np.linspace(0, 3.2 * np.pi, 26)
        reach = 0.20 * (1 - scroll_angle / 13)
        scroll = np.stack([s * (0.62 - reach * np.cos(scroll_angle)), 0.14 + reach * np.sin(scroll_angle), 0.09 + 0 * reach], axis=-1)
        part.append(("Gilding", move(sweep(scroll, 0.034, 8, up=(0, 0, 1), radii=np.linspace(1.2, 0.6, 26)), width / 2, height + 0.12)))
        tail = curve([(s * 0.80, 0.16, 0.09), (s * 1.0, 0.30, 0.09), (s * 1.2, 0.22, 0.09), (s * 1.32, 0.08, 0.09)], 5)
        part.append(("Gilding", move(sweep(tail, 0.03, 8, up=(0, 0, 1), radii=np.linspace(1.1, 0.4, 16)), width / 2, height + 0.10)))
    return part


def crystal(length: float) -> Mesh:
    """A cut drop that hangs from y = 0."""
    return lathe([(0.0, -length), (length * 0.28, -length * 0.6), (0.0, 0.0)], 6, 5.0)


def chandelier(tiers: list[tuple[int, float, float]], drop: float) -> Part:
    """A gilded chandelier with candles and crystal drops; tiers are (arms, radius, y); it hangs from y = drop."""
    stem = [(0.0, -0.30), (0.05, -0.26), (0.03, -0.20), (0.10, -0.10), (0.13, 0.0), (0.07, 0.10), (0.03, 0.20), (0.08, 0.34), (0.09, 0.42),
            (0.04, 0.52), (0.025, 0.75), (0.06, 0.84), (0.03, 0.95), (0.015, 1.0), (0.012, drop)]  # fmt: skip
    part: Part = [("Gilding", lathe(stem, 18)), ("Crystal", move(scale(crystal(0.16), 1.2), 0, -0.29))]
    for n, radius, y in tiers:
        for i in range(n):
            arm = curve([(0.06, y, 0), (0.35 * radius, y - 0.16, 0), (0.75 * radius, y - 0.12, 0), (radius, y + 0.08, 0), (radius, y + 0.14, 0)], 3)
            dish = lathe([(0.0, 0.0), (0.065, 0.02), (0.07, 0.03), (0.0, 0.024)], 10)
            candle = lathe([(0.017, 0.0), (0.017, 0.15), (0.0, 0.155)], 8)
            flame = lathe([(0.0, 0.0), (0.014, 0.02), (0.010, 0.045), (0.0, 0.075)], 8)
            things = [("Gilding", sweep(arm, 0.013, 6, up=(0, 0, 1))), ("Gilding", move(dish, radius, y + 0.13)),
                      ("Candle", move(candle, radius, y + 0.15)), ("Globe", move(flame, radius, y + 0.305))]
            things += [("Crystal", move(crystal(0.085), radius + 0.06 * np.cos(a), y + 0.145, 0.06 * np.sin(a))) for a in np.arange(3) * 2.1]
            things.append(("Crystal", move(crystal(0.10), 0.55 * radius, y - 0.155)))
            part += [(material, turn(mesh, "y", 360.0 * (i + 0.5 * (radius > 0.7)) / n)) for material, mesh in things]
        swag = 7 * n if n > 8 else 0
        for k in range(swag):
            a = 2 * np.pi * k / swag
            sag = 0.10 * (1 - np.abs(((k / 7.0) % 1) * 2 - 1) ** 2)
            part.append(("Crystal", move(ball(0.016, 5, 3), 0.97 * radius * np.cos(a), y + 0.10 - sag, 0.97 * radius * np.sin(a))))
    return part


def sconce() -> Part:
    """A wall light with two candles on a wall that looks along +z, its plate around y = 0."""
    plate = turn(lathe([(0.0, 0.02), (0.05, 0.03), (0.07, 0.015), (0.10, 0.0), (0.10, -0.01)], 16), "x", 90)
    part: Part = [("Gilding", scale(plate, 1.0, 1.7, 1.0))]
    for s in (-1, 1):
        arm = curve([(0, -0.04, 0.02), (s * 0.07, -0.10, 0.11), (s * 0.15, -0.06, 0.15), (s * 0.16, 0.02, 0.15)], 3)
        dish = lathe([(0.0, 0.0), (0.045, 0.016), (0.05, 0.026), (0.0, 0.02)], 10)
        candle = lathe([(0.016, 0.0), (0.016, 0.14), (0.0, 0.145)], 7)
        flame = lathe([(0.0, 0.0), (0.014, 0.02), (0.010, 0.045), (0.0, 0.075)], 6)
        part += [("Gilding", sweep(arm, 0.011, 7)), ("Gilding", move(dish, s * 0.16, 0.01, 0.15)),
                 ("Candle", move(candle, s * 0.16, 0.03, 0.15)), ("Globe", move(flame, s * 0.16, 0.177, 0.15))]  # fmt: skip
    return part


def palm(rng: np.random.Generator) -> Part:
    """A feather palm in a stone urn, about 2 m high."""
    urn = [(0.0, 0.0), (0.20, 0.0), (0.20, 0.05), (0.11, 0.09), (0.10, 0.15), (0.20, 0.26), (0.29, 0.42), (0.30, 0.52), (0.27, 0.56),
           (0.33, 0.60), (0.33, 0.64), (0.27, 0.64), (0.25, 0.56), (0.0, 0.55)]  # fmt: skip
    part: Part = [("MarbleRose", lathe(urn, 24))]
    for i in range(10):
        around = i * 137.5 + float(rng.uniform(-15, 15))
        lean, length = float(rng.uniform(0.25, 0.95)), float(rng.uniform(0.9, 1.35))
        spine = curve([(0.02, 0.55, 0), (0.10 + 0.25 * lean, 0.55 + 0.55 * length, 0), (0.9 * lean * length, 0.62 + length * (1.0 - 0.25 * lean), 0),
                       (1.25 * lean * length, 0.60 + length * (0.95 - 0.75 * lean), 0)], 5)  # fmt: skip
        blades: list[Mesh] = [sweep(spine, 0.009, 5, up=(0, 0, 1), radii=np.linspace(1.2, 0.3, len(spine)))]
        for k in range(3, len(spine)):
            at, way = spine[k], spine[k] - spine[k - 1]
            way /= np.linalg.norm(way)
            for s in (-1, 1):
                reach = 0.34 * np.sin(np.pi * (0.25 + 0.65 * k / len(spine)))
                out = 0.55 * way + [0, -0.25, s * 0.85]
                t = np.linspace(0, 1, 3)[:, None]
                middle = at + reach * t * out + [0, -0.10, 0] * t**2 * reach * 2
                wide = 0.017 * np.sin(np.pi * (0.15 + 0.85 * t)) * way
                blades.append(surface(np.stack([middle - wide, middle + wide])))
        part += [("Leaf" if (i + j) % 3 else "LeafDark", turn(mesh, "y", around)) for j, mesh in enumerate(blades)]
    return part


def bench() -> Part:
    """A velvet bench 1.5 long with turned gilded legs."""
    part: Part = [("Velvet", move(cushion(1.5, 0.14, 0.48, 0.05, 10, 0.015), 0, 0.38)), ("Gilding", move(box(1.46, 0.07, 0.44, 0.012), 0, 0.33))]
    leg = lathe([(0.0, 0.0), (0.018, 0.0), (0.028, 0.03), (0.016, 0.06), (0.034, 0.25), (0.028, 0.29), (0.04, 0.31), (0.04, 0.36)], 12)
    part += [("Gilding", move(leg, x, 0, z)) for x in (-0.66, 0.0, 0.66) for z in (-0.17, 0.17)]
    return part


def double_door() -> Part:
    """A panelled double door 1.7 x 3.0 in its frame, on a wall that looks along +z, centred in x."""
    part: Part = []
    for s in (-1, 1):
        x0, x1 = (-0.85, -0.004) if s < 0 else (0.004, 0.85)
        part.append(("Mahogany", between((x0, -0.01, -0.02), (x1, 2.98, 0.05), 0.006)))
        for y0, y1 in ((0.22, 0.85), (1.05, 2.75)):
            part += [(m, move(mesh, x0 + 0.12, y0, 0.052)) for m, mesh in panel_moulding(x1 - x0 - 0.24, y1 - y0)]
            part.append(("Mahogany", between((x0 + 0.20, y0 + 0.08, 0.045), (x1 - 0.20, y1 - 0.08, 0.068), 0.012)))
        part.append(("Gilding", move(ball(0.035, 12, 8), s * 0.07, 0.98, 0.10)))
    frame = [(-0.9, 0.0, 0), (-0.9, 3.05, 0), (0.9, 3.05, 0), (0.9, 0.0, 0)]
    profile = [(-0.02, -0.03), (0.16, -0.03), (0.16, 0.03), (0.12, 0.07), (0.04, 0.06), (-0.02, 0.09)]
    part.append(("Marble", sweep(frame, np.array(profile) * [-1, 1], up=(0, 0, 1), crease_deg=40.0)))
    head = extrude([(-1.2, 0), (1.2, 0), (1.25, 0.08), (0.0, 0.55), (-1.25, 0.08)], 0.16)
    part.append(("Marble", move(head, 0, 3.2, -0.02)))
    part.append(("Gilding", move(ball(0.09, 14, 9), 0, 3.42, 0.15)))
    return part


def rosette(radius: float) -> Part:
    """A plaster ceiling rose that hangs down from y = 0."""
    profile = np.array([(0.0, -0.16), (0.10, -0.15), (0.16, -0.08), (0.30, -0.06), (0.40, -0.11), (0.46, -0.05), (0.80, -0.03), (0.88, -0.08), (0.96, -0.05), (1.0, 0.01)])
    part: Part = [("Plaster", lathe(profile * [radius, 1.0], 40))]
    if radius < 0.5:
        return [("Gilding", lathe((profile * [radius, 1.0])[[0, 2, 3, 5, 6, 7, 9]], 16, 30.0))]
    for i in range(16):
        petal = scale(ball(1.0, 10, 7), 0.17 * radius, 0.035, 0.055 * radius)
        part.append(("Gilding", turn(move(petal, 0.62 * radius, -0.045), "y", 22.5 * i)))
    part.append(("Gilding", move(torus(0.92 * radius, 0.022, 40, 8), 0, -0.075)))
    return part


def around_y(vector: Array, angle_deg: float) -> Array:
    return rotation("y", angle_deg) @ vector
