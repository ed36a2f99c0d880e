"""Plants in pots and jugs; each function returns a part that stands on y = 0."""

import numpy as np

from .parts import Part
from .shapes import Mesh, move, rotation, turn
from .turned import curve, lathe, polyline, surface, sweep


def leaf(length: float, width: float, droop: float) -> Mesh:
    """A leaf that grows from the origin along +x and bends down."""
    t = np.linspace(0, 1, 7)
    half = width / 2 * np.sin(np.pi * t**0.75) ** 0.9
    y = 0.35 * length * t - droop * length * t**2
    rows = [
        np.stack([length * t * np.cos(0.4 * t), y + lift, side * half], axis=-1)
        for side, lift in ((-1, 0.15 * half), (0, 0 * half), (1, 0.15 * half))
    ]
    return surface(np.stack(rows))


def plant(rng: np.random.Generator, n: int, size: float, pot: str) -> Part:
    """A leafy plant in a pot; `size` is about the height of its leaves."""
    profile = polyline("0 0, 0.045 0, 0.062 0.1, 0.07 0.1, 0.072 0.125, 0.064 0.125, 0.06 0.11, 0 0.105")
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
            part.append(
                (
                    ("Leaf", "LeafDark")[int(rng.integers(2))],
                    move(turn(blade, "y", around + lean + rng.uniform(-30, 30)), *tip),
                )
            )
    return part


def tulips(rng: np.random.Generator) -> Part:
    """A jug of tulips."""
    jug = polyline(
        "0 0, 0.045 0, 0.062 0.03, 0.066 0.07, 0.045 0.13, 0.04 0.17, 0.052 0.2, 0.048 0.2, 0.036 0.17, 0 0.16"
    )
    part: Part = [("Porcelain", lathe(jug, 28))]
    for i in range(13):
        around, out, height = i * 137.5, rng.uniform(0.02, 0.14), rng.uniform(0.30, 0.42)
        way = rotation("y", around) @ np.array([1.0, 0, 0])
        stem = curve([(0, 0.12, 0), 0.03 * way + [0, 0.21, 0], out * way + [0, height, 0]], 3)
        part.append(("Stem", sweep(stem, 0.003, 5)))
        bud = lathe(polyline("0 0, 0.016 0.006, 0.021 0.025, 0.017 0.045, 0.008 0.054, 0 0.05"), 10)
        part.append(
            (
                ("Tulip", "TulipPale")[i % 2],
                move(turn(bud, "z", float(-out * 150 * way[0])), *(out * way + [0, height - 0.004, 0])),
            )
        )
        if i % 2:
            part.append(
                ("Leaf", move(turn(leaf(0.16, 0.035, 0.35), "y", around + 40), 0.03 * way[0], 0.19, 0.03 * way[2]))
            )
    return part


def palm(rng: np.random.Generator) -> Part:
    """A feather palm in a stone urn, about 2 m high."""
    urn = polyline(
        "0 0, 0.2 0, 0.2 0.05, 0.11 0.09, 0.1 0.15, 0.2 0.26, 0.29 0.42, 0.3 0.52, 0.27 0.56, 0.33 0.6, "
        "0.33 0.64, 0.27 0.64, 0.25 0.56, 0 0.55"
    )
    part: Part = [("MarbleRose", lathe(urn, 24))]
    for i in range(10):
        around = i * 137.5 + float(rng.uniform(-15, 15))
        lean, length = float(rng.uniform(0.25, 0.95)), float(rng.uniform(0.9, 1.35))
        spine = curve(
            [
                (0.02, 0.55, 0),
                (0.10 + 0.25 * lean, 0.55 + 0.55 * length, 0),
                (0.9 * lean * length, 0.62 + length * (1.0 - 0.25 * lean), 0),
                (1.25 * lean * length, 0.60 + length * (0.95 - 0.75 * lean), 0),
            ],
            5,
        )
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
