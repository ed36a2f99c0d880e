"""Furniture and things of the kitchen; each function returns a part that stands on y = 0."""

import numpy as np
from glb import Part
from shapes import (
    Array, Mesh, between, box, circle, curve, cushion, extrude, join, lathe, move, rod, rotation, surface, sweep, torus,
    turn,
)  # fmt: skip

GAP = 0.004  # between neighbouring doors


def moved(part: Part, x: float = 0.0, y: float = 0.0, z: float = 0.0, turn_y: float = 0.0) -> Part:
    """The part turned about y (degrees), then moved."""
    return [(material, move(turn(mesh, "y", turn_y), x, y, z)) for material, mesh in part]


# --- cupboards -------------------------------------------------------------------------------------------------------


def knob() -> Mesh:
    """A door knob that grows along +z."""
    profile = [(0.0, 0.0), (0.011, 0.0), (0.006, 0.006), (0.006, 0.014), (0.014, 0.02), (0.015, 0.026), (0.0, 0.031)]
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
    cup = surface(np.stack([np.c_[arch, np.full(9, z)] for z in (0.0, 0.016, 0.024)], axis=0) * [1, 1, 1])
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
    cornice = [(0.0, 0.0), (0.012, 0.0), (0.016, 0.02), (0.035, 0.035), (0.045, 0.055), (0.045, 0.065), (0.0, 0.065)]
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
    drain = lathe([(0.0, 0.004), (0.02, 0.003), (0.035, 0.006), (0.042, 0.002), (0.042, -0.01)], 16)
    return [*(("Porcelain", w) for w in walls), ("Chrome", move(drain, width / 2, 0.701, -0.22))]


def tap() -> Part:
    """A bridge tap with a swan neck towards +z, standing on y = 0."""
    neck = curve([(0, 0.0, 0), (0, 0.16, 0), (0, 0.27, 0.02), (0, 0.32, 0.09), (0, 0.28, 0.165), (0, 0.215, 0.178)], 6)
    foot = lathe([(0.0, 0.0), (0.028, 0.0), (0.028, 0.008), (0.018, 0.02), (0.014, 0.05), (0.0, 0.05)], 18)
    meshes = [sweep(neck, 0.0115, 14, up=(1, 0, 0)), foot, move(turn(torus(0.0115, 0.004, 14, 8), "x", 20), 0, 0.217, 0.178)]
    for s in (-1, 1):
        pillar = lathe([(0, 0), (0.026, 0.0), (0.026, 0.008), (0.016, 0.02), (0.013, 0.085), (0.018, 0.09), (0.0, 0.11)], 16)
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
    dial = turn(lathe([(0.0, 0.0), (0.028, 0.0), (0.026, 0.012), (0.019, 0.014), (0.017, 0.034), (0.0, 0.036)], 18), "x", 90)
    for i in range(6):
        part += [("Iron", move(dial, 0.12 + i * 0.132, 0.82, 0.029)),
                 ("Chrome", move(turn(torus(0.029, 0.003, 20, 6), "x", 90), 0.12 + i * 0.132, 0.82, 0.032))]
    for x in (0.2, 0.45, 0.7):
        for z in (-0.44, -0.17):
            burner = lathe([(0.0, 0.016), (0.03, 0.016), (0.034, 0.012), (0.05, 0.010), (0.052, 0.0)], 18)
            part.append(("Iron", move(burner, x, 0.922, z)))
            for angle in (0, 90):
                part.append(("Iron", move(turn(box(0.21, 0.008, 0.008), "y", angle), x, 0.946 + angle * 1e-5, z)))
            part += [("Iron", move(box(0.008, 0.03, 0.008), x + dx, 0.92, z + dz))
                     for dx, dz in ((0.1, 0), (-0.1, 0), (0, 0.1), (0, -0.1))]
    return part


def hood(width: float) -> Part:
    """A plastered chimney hood with a wooden mantel; its back at z = -0.6, its foot at y = 0."""
    outline = [(-0.6, 0.0), (-0.02, 0.0), (-0.06, 0.12), (-0.2, 0.45), (-0.26, 1.15), (-0.6, 1.15)]
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
        handle = curve([(0.60, y, 0.03), (0.60, y + 0.02, 0.085), (0.60, y + length - 0.02, 0.085), (0.60, y + length, 0.03)], 5)
        part.append(("Chrome", sweep(handle, 0.011, 10, up=(1, 0, 0))))
    return part


# --- table and chairs ------------------------------------------------------------------------------------------------


def table(length: float, width: float) -> Part:
    """A farmhouse table 0.75 high with turned legs."""
    top = move(box(length, 0.036, width, 0.008), 0, 0.714)
    rail_y, inset = 0.615, 0.09
    part: Part = [("TableTop", top)]
    for s in (-1, 1):
        part.append(("Cream", move(box(length - 2 * inset, 0.10, 0.024, 0.002), 0, rail_y, s * (width / 2 - inset))))
        part.append(("Cream", move(box(0.024, 0.0995, width - 2 * inset, 0.002), s * (length / 2 - inset), rail_y, 0)))
        for t in (-1, 1):
            x, z = s * (length / 2 - inset), t * (width / 2 - inset)
            profile = [(0.0, 0.0), (0.020, 0.0), (0.026, 0.03), (0.022, 0.06), (0.024, 0.09), (0.034, 0.30), (0.036, 0.44),
                       (0.027, 0.50), (0.038, 0.52), (0.030, 0.545), (0.032, 0.56)]
            part += [("Cream", move(lathe(profile, 14), x, 0, z)), ("Cream", move(box(0.074, 0.17, 0.074, 0.004), x, 0.548, z))]
    return part


def chair(rng: np.random.Generator, paint: str) -> Part:
    """A spindle-back chair that looks along +z, its seat at 0.45."""
    seat = move(cushion(0.43, 0.036, 0.42, 0.016, 8), 0, 0.428)
    seat = Mesh(points=seat.points * [1, 1, 1], faces=seat.faces, crease_deg=seat.crease_deg)
    meshes = [seat]
    for s in (-1, 1):
        for t in (-1, 1):
            foot, top = np.array([s * 0.205, 0.0, t * 0.20]), np.array([s * 0.15, 0.436, t * 0.15])
            at = np.linspace(0, 1, 7)[:, None]
            meshes.append(sweep(foot + at * (top - foot), 0.016, 10, radii=[0.7, 0.8, 1.0, 1.2, 1.0, 1.15, 0.8], up=(0, 0, 1)))
        meshes.append(rod((s * 0.19, 0.14, -0.187), (s * 0.19, 0.14, 0.187), 0.009))
        meshes.append(sweep(curve([(s * 0.17, 0.455, -0.17), (s * 0.185, 0.70, -0.215), (s * 0.195, 0.93, -0.275)], 4),
                            0.013, 10, up=(0, 0, 1)))
    meshes.append(rod((-0.19, 0.1405, 0.02), (0.19, 0.1405, 0.02), 0.009))
    for i in range(6):
        x = -0.12 + i * 0.048
        back = curve([(x, 0.455, -0.178), (x * 1.1, 0.70, -0.228), (x * 1.15, 0.90, -0.285)], 4)
        meshes.append(sweep(back, 0.0065, 8, radii=np.r_[np.linspace(0.9, 1.25, 5), np.linspace(1.2, 0.9, 4)], up=(0, 0, 1)))
    rail = curve([(-0.225, 0.93, -0.265), (0.0, 0.945, -0.31), (0.225, 0.93, -0.265)], 8)
    meshes.append(sweep(rail, [(-0.011, -0.035), (0.011, -0.035), (0.011, 0.03), (0.0, 0.042), (-0.011, 0.03)]))
    part: Part = [(paint, mesh) for mesh in meshes]
    pad = move(cushion(0.37, 0.035, 0.36, 0.017, 8, 0.012), rng.uniform(-0.01, 0.01), 0.465, rng.uniform(-0.01, 0.01))
    return [*part, ("Gingham", turn(pad, "y", float(rng.uniform(-4, 4))))]


def pendant() -> Part:
    """A hanging lamp: enamelled shade, bulb, flex; the shade's rim at y = 0, the ceiling at y = 1."""
    shade = [(0.165, 0.0), (0.160, 0.018), (0.12, 0.075), (0.06, 0.118), (0.036, 0.14), (0.034, 0.175), (0.0, 0.18)]
    inside = [(0.0, 0.172), (0.030, 0.168), (0.032, 0.138), (0.056, 0.113), (0.117, 0.070), (0.157, 0.016), (0.165, 0.0)]
    bulb = lathe([(0.0, 0.012), (0.022, 0.02), (0.032, 0.045), (0.026, 0.07), (0.013, 0.095), (0.013, 0.16)], 16)
    return [
        ("Enamel", lathe(shade, 28)), ("Porcelain", lathe(inside, 28)), ("Porcelain", bulb),
        ("Brass", move(lathe([(0.016, 0.0), (0.018, 0.02), (0.01, 0.045), (0.0, 0.05)], 12), 0, 0.176)),
        ("Iron", rod((0, 0.21, 0), (0, 1.01, 0), 0.0035, 6)),
        ("Brass", lathe([(0.0, 0.965), (0.03, 0.968), (0.045, 0.99), (0.045, 1.01)], 16)),
    ]  # fmt: skip


# --- windows ---------------------------------------------------------------------------------------------------------


def window(width: float, height: float, columns: int, rows: int) -> Part:
    """A window frame in the x-y plane around z = 0, with glazing bars and no panes, an inner sill towards +z."""
    part: Part = []
    outer, bar = 0.055, 0.022

    def stile(x0: float, x1: float, y0: float, y1: float, depth: float) -> None:
        part.append(("WindowPaint", between((x0, y0, -depth), (x1, y1, depth), 0.005)))

    stile(-0.01, outer, -0.01, height + 0.01, 0.035)
    stile(width - outer, width + 0.01, -0.01, height + 0.01, 0.035)
    stile(outer - 0.002, width - outer + 0.002, height - outer, height + 0.009, 0.0345)
    stile(outer - 0.002, width - outer + 0.002, -0.009, outer, 0.0345)
    for i in range(1, columns):
        x = outer + (width - 2 * outer) * i / columns
        half = 0.03 if 2 * i == columns else bar / 2
        stile(x - half, x + half, outer - 0.002, height - outer + 0.002, 0.018 if half == bar / 2 else 0.03)
    for j in range(1, rows):
        y = outer + (height - 2 * outer) * j / rows
        stile(outer - 0.002, width - outer + 0.002, y - bar / 2, y + bar / 2, 0.017)
    part.append(("WindowPaint", between((-0.05, -0.035, 0.02), (width + 0.05, -0.003, 0.19), 0.008)))
    return part


def curtain(width: float, height: float, seed: int, folds: float) -> Mesh:
    """Cloth that hangs from y = height, gathered in folds along x, a little wider at its foot."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, 1, int(folds * 10) + 1), np.linspace(0, 1, 9), indexing="ij")
    phase = 2 * np.pi * folds * (u + 0.02 * np.sin(9 * u + rng.uniform(0, 6))) + 0.5 * (1 - v) * np.sin(5 * u)
    depth = (0.018 + 0.020 * (1 - v)) * np.sin(phase)
    spread = 1 + 0.10 * (1 - v) ** 2
    x = width * ((u - 0.5) * spread + 0.5) + 0.25 * depth * np.cos(phase)
    return surface(np.stack([x, height * v, depth], axis=-1))


# --- small things ----------------------------------------------------------------------------------------------------

PLATE = [(0.0, 0.004), (0.07, 0.004), (0.085, 0.007), (0.13, 0.020), (0.133, 0.023), (0.128, 0.0235), (0.085, 0.0115),
         (0.07, 0.009), (0.0, 0.009)]  # fmt: skip
BOWL = [(0.0, 0.0), (0.04, 0.0), (0.042, 0.008), (0.075, 0.03), (0.10, 0.075), (0.104, 0.085), (0.099, 0.085), (0.070, 0.035),
        (0.038, 0.014), (0.0, 0.012)]  # fmt: skip
CUP = [(0.0, 0.0), (0.026, 0.0), (0.028, 0.006), (0.038, 0.03), (0.041, 0.075), (0.042, 0.080), (0.038, 0.080), (0.035, 0.03),
       (0.0, 0.010)]  # fmt: skip
JAR = [(0.0, 0.0), (0.045, 0.0), (0.05, 0.006), (0.05, 0.12), (0.042, 0.138), (0.040, 0.146), (0.0, 0.146)]
LID = [(0.0, 0.140), (0.046, 0.140), (0.048, 0.146), (0.046, 0.162), (0.012, 0.166), (0.014, 0.178), (0.0, 0.184)]
BOTTLE = [(0.0, 0.0), (0.036, 0.0), (0.038, 0.006), (0.038, 0.17), (0.030, 0.205), (0.014, 0.235), (0.013, 0.29), (0.016, 0.295),
          (0.015, 0.31), (0.0, 0.31)]  # fmt: skip


def plate_stack(n: int, material: str, size: float = 1.0) -> Part:
    return [(material, move(lathe(np.array(PLATE) * [size, 1], 26), 0, 0.009 * i)) for i in range(n)]


def cup(material: str) -> Part:
    handle = curve([(0.036, 0.065, 0), (0.06, 0.066, 0), (0.065, 0.04, 0), (0.05, 0.022, 0), (0.034, 0.02, 0)], 4)
    return [(material, lathe(CUP, 20)), (material, sweep(handle, 0.0045, 6, up=(0, 0, 1)))]


def jar(content: str, height: float = 1.0) -> Part:
    return [(content, lathe(np.array(JAR) * [1, height], 20)),
            ("Oak", move(lathe(np.array(LID) - [0, 0.14], 20), 0, 0.14 * height))]


def bottle(material: str, height: float = 1.0) -> Part:
    return [(material, lathe(np.array(BOTTLE) * [1, height], 18))]


def pan(radius: float, height: float, material: str, lid: bool) -> Part:
    """A saucepan with a long handle along +x."""
    t = 0.004
    wall = [(0.0, 0.0), (radius - 0.01, 0.0), (radius, 0.01), (radius, height), (radius + 0.004, height + 0.003),
            (radius - t, height), (radius - t, 0.012), (0.0, 0.008)]  # fmt: skip
    handle = curve([(radius - 0.002, height * 0.8, 0), (radius + 0.08, height * 0.9, 0), (radius + 0.2, height, 0)], 4)
    part: Part = [(material, lathe(wall, 28)), ("Iron", sweep(handle, [(-0.010, -0.004), (0.010, -0.004), (0.010, 0.004), (-0.010, 0.004)]))]
    if lid:
        top = [(radius + 0.003, 0.0), (radius * 0.9, 0.010), (radius * 0.3, 0.024), (0.008, 0.026), (0.008, 0.036), (0.016, 0.044),
               (0.014, 0.052), (0.0, 0.054)]  # fmt: skip
        part.append((material, move(lathe(top, 28), 0, height + 0.002)))
    return part


def kettle() -> Part:
    """A whistling kettle with a bow handle."""
    body = [(0.0, 0.0), (0.095, 0.0), (0.108, 0.010), (0.112, 0.03), (0.105, 0.075), (0.080, 0.115), (0.045, 0.135), (0.042, 0.14),
            (0.0, 0.148)]  # fmt: skip
    bow = curve([(-0.075, 0.115, 0), (-0.085, 0.19, 0), (-0.04, 0.235, 0), (0.04, 0.235, 0), (0.085, 0.19, 0), (0.075, 0.115, 0)], 5)
    spout = curve([(0.09, 0.05, 0), (0.135, 0.075, 0), (0.155, 0.125, 0)], 4)
    return [
        ("Chrome", lathe(body, 36)), ("Iron", sweep(bow, 0.007, 10, up=(0, 0, 1))),
        ("Chrome", sweep(spout, 0.017, 12, radii=np.linspace(1.2, 0.7, 9), up=(0, 0, 1))),
        ("Iron", move(lathe([(0.006, 0.0), (0.006, 0.012), (0.014, 0.018), (0.012, 0.03), (0.0, 0.034)], 14), 0, 0.144)),
    ]  # fmt: skip


def toaster() -> Part:
    slots: Part = [("Iron", move(box(0.2, 0.012, 0.026), 0, 0.178, z)) for z in (-0.035, 0.035)]
    return [("Chrome", move(cushion(0.30, 0.17, 0.17, 0.05, 12), 0, 0.015)), ("Iron", move(box(0.27, 0.03, 0.15, 0.006), 0, 0.0)), *slots]


def fruit_bowl(rng: np.random.Generator) -> Part:
    """A wooden bowl of apples, lemons and oranges."""
    part: Part = [("Walnut", lathe(np.array(BOWL) * [1.5, 1.05], 32))]
    kinds = ["Apple", "Lemon", "Orange", "Apple", "Lime"]
    spots = [(0.0, 0.055, 0.0), *[(0.075 * np.cos(a), 0.068, 0.075 * np.sin(a)) for a in np.arange(6) * np.pi / 3],
             (0.035, 0.115, 0.02), (-0.038, 0.115, 0.012), (0.0, 0.117, -0.045)]  # fmt: skip
    for i, (x, y, z) in enumerate(spots):
        kind = kinds[int(rng.integers(len(kinds)))]
        angle = np.linspace(-np.pi / 2, np.pi / 2, 11)
        r = rng.uniform(0.034, 0.039)
        dent = 0.25 * np.exp(-((np.abs(angle) - np.pi / 2) ** 2) * 10) if kind == "Apple" else -0.12 * np.exp(-((np.abs(angle) - np.pi / 2) ** 2) * 30)
        profile = np.stack([r * np.cos(angle).round(9), r * (1 - dent) * np.sin(angle)], axis=-1)
        fruit = turn(turn(lathe(profile, 16, 80.0), "x", float(rng.uniform(0, 70))), "y", float(rng.uniform(0, 360)))
        part.append((kind, move(fruit, x, y, z)))
        if i == 0:
            part.append(("Walnut", move(rod((0, 0, 0), (0.004, 0.02, 0), 0.0015, 5), x, y + r * 0.75, z)))
    return part


def leaf(length: float, width: float, droop: float) -> Mesh:
    """A leaf that grows from the origin along +x and bends down."""
    t = np.linspace(0, 1, 7)
    half = width / 2 * np.sin(np.pi * t**0.75) ** 0.9
    y = 0.35 * length * t - droop * length * t**2
    rows = [np.stack([length * t * np.cos(0.4 * t), y + lift, side * half], axis=-1) for side, lift in ((-1, 0.15 * half), (0, 0 * half), (1, 0.15 * half))]
    return surface(np.stack(rows))


def plant(rng: np.random.Generator, n: int, size: float, pot: str) -> Part:
    """A leafy plant in a pot; `size` is about the height of its leaves."""
    profile = [(0.0, 0.0), (0.045, 0.0), (0.062, 0.10), (0.070, 0.10), (0.072, 0.125), (0.064, 0.125), (0.060, 0.11), (0.0, 0.105)]
    part: Part = [(pot, lathe(profile, 24))]
    for _ in range(n):
        around = float(rng.uniform(0, 360))
        height, out = rng.uniform(0.25, 1.0) * size, rng.uniform(0.1, 0.45) * size
        way = rotation("y", around) @ np.array([1.0, 0, 0])
        stem = curve([(0, 0.10, 0), 0.4 * out * way + [0, 0.1 + 0.6 * height, 0], out * way + [0, 0.1 + height, 0]], 3)
        part.append(("Stem", sweep(stem, 0.0022, 4)))
        for at, lean in ((1.0, 0.0), (0.65, 50.0)):
            blade = leaf(size * rng.uniform(0.3, 0.5), size * rng.uniform(0.16, 0.26), rng.uniform(0.5, 0.9))
            tip = stem[int(at * (len(stem) - 1))]
            part.append((("Leaf", "LeafDark")[int(rng.integers(2))], move(turn(blade, "y", around + lean + rng.uniform(-30, 30)), *tip)))
    return part


def tulips(rng: np.random.Generator) -> Part:
    """A jug of tulips."""
    jug = [(0.0, 0.0), (0.045, 0.0), (0.062, 0.03), (0.066, 0.07), (0.045, 0.13), (0.040, 0.17), (0.052, 0.20), (0.048, 0.20), (0.036, 0.17), (0.0, 0.16)]
    part: Part = [("Porcelain", lathe(jug, 28))]
    for i in range(13):
        around, out, height = i * 137.5, rng.uniform(0.02, 0.14), rng.uniform(0.30, 0.42)
        way = rotation("y", around) @ np.array([1.0, 0, 0])
        stem = curve([(0, 0.12, 0), 0.03 * way + [0, 0.21, 0], out * way + [0, height, 0]], 3)
        part.append(("Stem", sweep(stem, 0.003, 5)))
        bud = lathe([(0.0, 0.0), (0.016, 0.006), (0.021, 0.025), (0.017, 0.045), (0.008, 0.054), (0.0, 0.05)], 10)
        part.append((("Tulip", "TulipPale")[i % 2], move(turn(bud, "z", float(-out * 150 * way[0])), *(out * way + [0, height - 0.004, 0]))))
        if i % 2:
            part.append(("Leaf", move(turn(leaf(0.16, 0.035, 0.35), "y", around + 40), 0.03 * way[0], 0.19, 0.03 * way[2])))
    return part


def clock() -> Part:
    """A wall clock that looks along +z."""
    ring = turn(lathe([(0.155, 0.0), (0.16, 0.02), (0.15, 0.035), (0.138, 0.03), (0.135, 0.012)], 40), "x", 90)
    face = turn(lathe([(0.137, 0.012), (0.0, 0.0125)], 40), "x", 90)
    part: Part = [("Walnut", ring), ("Porcelain", face)]
    for hour in range(12):
        mark = move(box(0.006, 0.022, 0.004), 0, 0.105, 0.0145)
        part.append(("Iron", turn(mark, "z", 30.0 * hour)))
    part.append(("Iron", turn(move(box(0.007, 0.075, 0.003), 0, -0.01, 0.018), "z", 55)))
    part.append(("Iron", turn(move(box(0.005, 0.11, 0.003), 0, -0.015, 0.022), "z", -60)))
    return part


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
            dish = turn(lathe([(0.0, -0.035), (0.05, -0.033), (0.06, 0.0), (0.057, 0.0), (0.047, -0.029), (0.0, -0.031)], 20), "x", 90)
            part += [("Copper", move(dish, x, -length - 0.03, 0.045)), ("Iron", move(box(0.012, length - 0.03, 0.004), x, -length + 0.025, 0.055))]
        else:
            part.append(("Chrome" if i % 3 else "Oak", move(box(0.012, length - 0.02, 0.004, 0.001), x, -length, 0.055)))
            spoon = turn(lathe([(0.0, -0.018), (0.018, -0.012), (0.027, 0.0), (0.024, 0.0), (0.0, -0.014)], 16), "x", 90)
            part.append(("Chrome" if i % 3 else "Oak", move(spoon, x, -length - 0.02, 0.055)))
    return part


def picture(width: float, height: float, view: str, frame: str = "Walnut") -> Part:
    """A framed picture in the x-y plane that looks along +z; its texture fills it once."""
    corners = np.array([[[0, 0, 0.008], [width, 0, 0.008]], [[0, height, 0.008], [width, height, 0.008]]], dtype=float)
    canvas = surface(corners.transpose(1, 0, 2), np.array([[[0, 1], [1, 1]], [[0, 0], [1, 0]]], dtype=float).transpose(1, 0, 2))
    ring = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], dtype=float)
    moulding = [(-0.012, 0.0), (0.028, 0.0), (0.028, 0.018), (0.012, 0.024), (-0.006, 0.012), (-0.012, 0.012)]
    return [(view, canvas), (frame, sweep(ring, moulding, closed=True, up=(0, 0, 1), crease_deg=30.0))]


def rug(width: float, depth: float) -> Mesh:
    """A rug with fringes is too fine to see; this one is flat with a rounded rim."""
    return move(box(width, 0.012, depth, 0.005), 0, 0.001)


def loaf() -> Part:
    """A loaf of bread on a board."""
    bread = move(cushion(0.24, 0.10, 0.11, 0.05, 10, 0.012), 0, 0.022)
    cuts = [move(turn(cushion(0.02, 0.014, 0.10, 0.007, 4), "y", 25), x, 0.128, 0) for x in (-0.06, 0.0, 0.06)]
    return [("Oak", box(0.38, 0.02, 0.22, 0.006)), ("Crust", bread), *(("Crumb", c) for c in cuts)]


def knife_block() -> Part:
    block = turn(move(box(0.10, 0.22, 0.14, 0.008), 0, 0.0, 0), "x", -14)
    part: Part = [("Walnut", move(block, 0, 0.012, 0))]
    for i in range(5):
        handle = turn(move(box(0.016, 0.09, 0.024, 0.004), -0.03 + 0.03 * (i % 3), 0.218, -0.03 + 0.055 * (i // 3)), "x", -14)
        part.append(("Iron", move(handle, 0, 0.012, 0)))
    return part


def board(width: float, height: float, lean_deg: float) -> Part:
    """A chopping board that leans back against a wall behind it."""
    angle = np.radians(np.linspace(0, 180, 9))
    outline = np.vstack([[(-width / 2, 0), (width / 2, 0)], np.stack([width / 2 * np.cos(angle), height + 0.25 * width * np.sin(angle)], axis=-1)])
    return [("Oak", turn(extrude(outline[[0, 1, *range(2, 11)]], 0.018), "x", -lean_deg))]


def basket(radius: float, height: float) -> Part:
    """A round basket of woven rings."""
    part: Part = []
    for i in range(int(height / 0.016)):
        r = radius * (0.82 + 0.18 * np.sin(i * 0.016 / height * np.pi / 1.6))
        part.append(("Wicker", move(torus(r, 0.0095, 28, 6), 0, 0.01 + 0.016 * i)))
    part.append(("Wicker", lathe([(0.0, 0.006), (radius * 0.8, 0.006)], 20)))
    return part


def flat_ring(radius: float, n: int) -> Array:
    """n points (n, 3) of a level circle."""
    c = circle(radius, n)
    return np.stack([c[:, 0], np.zeros(n), c[:, 1]], axis=-1)
