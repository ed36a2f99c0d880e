"""Table, chairs, lamps, windows, pictures and clocks; each function returns a part around the origin."""

import numpy as np

from .parts import Part
from .shapes import Mesh, between, box, cushion, move, turn
from .turned import curve, lathe, polyline, rod, surface, sweep


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
            profile = polyline(
                "0 0, 0.02 0, 0.026 0.03, 0.022 0.06, 0.024 0.09, 0.034 0.3, 0.036 0.44, 0.027 0.5, 0.038 0.52, "
                "0.03 0.545, 0.032 0.56"
            )
            part += [
                ("Cream", move(lathe(profile, 14), x, 0, z)),
                ("Cream", move(box(0.074, 0.17, 0.074, 0.004), x, 0.548, z)),
            ]
    return part


def chair(rng: np.random.Generator, paint: str) -> Part:
    """A spindle-back chair that looks along +z, its seat at 0.45."""
    seat = move(cushion(0.43, 0.036, 0.42, 0.016, 8), 0, 0.428)
    meshes = [seat]
    for s in (-1, 1):
        for t in (-1, 1):
            foot, top = np.array([s * 0.205, 0.0, t * 0.20]), np.array([s * 0.15, 0.436, t * 0.15])
            at = np.linspace(0, 1, 7)[:, None]
            meshes.append(
                sweep(foot + at * (top - foot), 0.016, 10, radii=[0.7, 0.8, 1.0, 1.2, 1.0, 1.15, 0.8], up=(0, 0, 1))
            )
        meshes.append(rod((s * 0.19, 0.14, -0.187), (s * 0.19, 0.14, 0.187), 0.009))
        meshes.append(
            sweep(
                curve([(s * 0.17, 0.455, -0.17), (s * 0.185, 0.70, -0.215), (s * 0.195, 0.93, -0.275)], 4),
                0.013,
                10,
                up=(0, 0, 1),
            )
        )
    meshes.append(rod((-0.19, 0.1405, 0.02), (0.19, 0.1405, 0.02), 0.009))
    for i in range(6):
        x = -0.12 + i * 0.048
        back = curve([(x, 0.455, -0.178), (x * 1.1, 0.70, -0.228), (x * 1.15, 0.90, -0.285)], 4)
        meshes.append(
            sweep(back, 0.0065, 8, radii=np.r_[np.linspace(0.9, 1.25, 5), np.linspace(1.2, 0.9, 4)], up=(0, 0, 1))
        )
    rail = curve([(-0.225, 0.93, -0.265), (0.0, 0.945, -0.31), (0.225, 0.93, -0.265)], 8)
    meshes.append(sweep(rail, polyline("-0.011 -0.035, 0.011 -0.035, 0.011 0.03, 0 0.042, -0.011 0.03")))
    part: Part = [(paint, mesh) for mesh in meshes]
    pad = move(cushion(0.37, 0.035, 0.36, 0.017, 8, 0.012), rng.uniform(-0.01, 0.01), 0.465, rng.uniform(-0.01, 0.01))
    return [*part, ("Gingham", turn(pad, "y", float(rng.uniform(-4, 4))))]


def pendant() -> Part:
    """A hanging lamp: enamelled shade, bulb, flex; the shade's rim at y = 0, the ceiling at y = 1."""
    shade = polyline("0.165 0, 0.16 0.018, 0.12 0.075, 0.06 0.118, 0.036 0.14, 0.034 0.175, 0 0.18")
    inside = polyline("0 0.172, 0.03 0.168, 0.032 0.138, 0.056 0.113, 0.117 0.07, 0.157 0.016, 0.165 0")
    bulb = lathe(polyline("0 0.012, 0.022 0.02, 0.032 0.045, 0.026 0.07, 0.013 0.095, 0.013 0.16"), 16)
    return [
        ("Enamel", lathe(shade, 28)),
        ("Porcelain", lathe(inside, 28)),
        ("Porcelain", bulb),
        ("Brass", move(lathe([(0.016, 0.0), (0.018, 0.02), (0.01, 0.045), (0.0, 0.05)], 12), 0, 0.176)),
        ("Iron", rod((0, 0.21, 0), (0, 1.01, 0), 0.0035, 6)),
        ("Brass", lathe([(0.0, 0.965), (0.03, 0.968), (0.045, 0.99), (0.045, 1.01)], 16)),
    ]


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


def clock() -> Part:
    """A wall clock that looks along +z."""
    ring = turn(lathe(polyline("0.155 0, 0.16 0.02, 0.15 0.035, 0.138 0.03, 0.135 0.012"), 40), "x", 90)
    face = turn(lathe([(0.137, 0.012), (0.0, 0.0125)], 40), "x", 90)
    part: Part = [("Walnut", ring), ("Porcelain", face)]
    for hour in range(12):
        mark = move(box(0.006, 0.022, 0.004), 0, 0.105, 0.0145)
        part.append(("Iron", turn(mark, "z", 30.0 * hour)))
    part.append(("Iron", turn(move(box(0.007, 0.075, 0.003), 0, -0.01, 0.018), "z", 55)))
    part.append(("Iron", turn(move(box(0.005, 0.11, 0.003), 0, -0.015, 0.022), "z", -60)))
    return part


def picture(width: float, height: float, view: str, frame: str = "Walnut") -> Part:
    """A framed picture in the x-y plane that looks along +z; its texture fills it once."""
    corners = np.array([[[0, 0, 0.008], [width, 0, 0.008]], [[0, height, 0.008], [width, height, 0.008]]], dtype=float)
    canvas = surface(
        corners.transpose(1, 0, 2), np.array([[[0, 1], [1, 1]], [[0, 0], [1, 0]]], dtype=float).transpose(1, 0, 2)
    )
    ring = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], dtype=float)
    moulding = polyline("-0.012 0, 0.028 0, 0.028 0.018, 0.012 0.024, -0.006 0.012, -0.012 0.012")
    return [(view, canvas), (frame, sweep(ring, moulding, closed=True, up=(0, 0, 1), crease_deg=30.0))]


def rug(width: float, depth: float) -> Mesh:
    """A flat rug with a bevelled rim."""
    return move(box(width, 0.012, depth, 0.005), 0, 0.001)
