"""Wall panels, overhead bins and galley things of the aircraft cabin; z runs along the aisle."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import Array, Mesh, between, box, move, turn
from ..common.turned import curve, extrude, lathe, polyline, rod, surface, sweep

# right half of the cross-section, from the floor up: side wall, then the bin's front, then the ceiling's middle
WALL = curve(polyline("1.6 -0.02, 1.7 0.2, 1.765 0.55, 1.78 0.85, 1.745 1.15, 1.65 1.42, 1.5 1.64"), 8)
CEILING = curve(polyline("1.12 2.03, 0.86 2.11, 0.56 2.16, 0.28 2.2, 0 2.21"), 5)
BIN = polyline(
    "1.66 1.5, 1.7 1.62, 1.62 2.12, 0.98 2.12, 0.86 2.07, 0.755 1.98, 0.695 1.87, 0.685 1.76, "
    "0.715 1.66, 0.775 1.585, 0.86 1.545, 0.98 1.53, 1.4 1.515"
)


def wall_x(y: Array) -> Array:
    """x of the side wall at height y."""
    return np.asarray(np.interp(y, WALL[:, 1], WALL[:, 0]))


def window_panel(width: float, low: float, high: float, shade: float) -> Part:
    """A panel of the right wall with an oval window, z from 0 to width; `shade` of it, 0 to 1, covered by the blind."""
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
        rings.append(
            np.stack([wall_x(flat[:, 1] + centre) + sink, flat[:, 1] + centre, flat[:, 0] + width / 2], axis=-1)
        )
    panel = surface(np.stack(rings), crease_deg=50.0)
    tube = [
        np.stack([wall_x(oval[:, 1] + centre) + out, oval[:, 1] * k + centre, oval[:, 0] * k + width / 2], axis=-1)
        for out, k in ((0.030, 1.0), (0.055, 0.93), (0.060, 0.88), (0.13, 0.86))
    ]
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
    body = extrude(BIN[::-1], length - 0.012, 35.0)
    part: Part = [("Bin", body)]
    part.append(("Trim", move(turn(box(0.03, 0.05, 0.13, 0.010), "z", 28), 0.722, 1.618, length / 2)))
    part.append(("Accent", move(turn(box(0.010, 0.022, length - 0.013), "z", 20), 0.700, 1.676, length / 2 - 0.006)))
    part.append(("Metal", between((0.800, 1.535, 0.0), (0.850, 1.565, length - 0.013), 0.008)))
    part.append(("Sign", between((0.686, 1.83, length * 0.45), (0.70, 1.87, length * 0.55), 0.002)))
    part.append(("Trim", between((0.90, 1.512, 0.08), (1.36, 1.535, length - 0.09), 0.006)))
    for i in range(3):
        x = 0.98 + 0.14 * i
        lamp = turn(lathe(polyline("0 0.008, 0.026 0.006, 0.036 0.016, 0.042 0, 0.042 -0.02"), 12), "x", 180)
        vent = turn(lathe(polyline("0 0.02, 0.012 0.02, 0.022 0.01, 0.03 0, 0.03 -0.02"), 12), "x", 180)
        part += [("Lamp", move(lamp, x, 1.513, length * 0.30)), ("Metal", move(vent, x, 1.513, length * 0.45))]
    part.append(("Sign", between((1.02, 1.507, length * 0.62), (1.26, 1.52, length * 0.78), 0.003)))
    return part


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
    ]


def pot() -> Part:
    """A coffee pot."""
    body = lathe(polyline("0 0, 0.06 0, 0.065 0.01, 0.055 0.14, 0.045 0.18, 0.048 0.19, 0 0.2"), 20)
    handle = curve([(0.05, 0.16, 0), (0.10, 0.16, 0), (0.11, 0.09, 0), (0.06, 0.05, 0)], 4)
    return [("Chrome", body), ("Trim", sweep(handle, 0.009, 6, up=(0, 0, 1)))]
