"""The great mirror, doors and benches of the theatre staircase."""

import numpy as np

from ..common.parts import Part
from ..common.shapes import between, box, cushion, move
from ..common.turned import ball, curve, extrude, lathe, polyline, rod, surface, sweep
from .stonework import panel_moulding


def great_mirror(width: float, height: float) -> Part:
    """A mirror in a gilded frame with a crest, on a wall that looks along +z; lower left corner at the origin."""
    glass = np.array([[[0, 0, 0.05], [0, height, 0.05]], [[width, 0, 0.05], [width, height, 0.05]]])
    ring = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], dtype=float)
    outer = polyline("-0.02 0, -0.02 0.07, 0.02 0.1, 0.06 0.085, 0.1 0.11, 0.15 0.13, 0.19 0.1, 0.22 0.04, 0.22 0")
    part: Part = [
        ("Mirror", surface(glass)),
        ("Gilding", sweep(ring, outer, closed=True, up=(0, 0, 1), crease_deg=40.0)),
    ]
    pearl = ball(0.018, 6, 4)
    for along, fixed, vertical in (
        (width, -0.02, False),
        (width, height + 0.02, False),
        (height, -0.02, True),
        (height, width + 0.02, True),
    ):
        n = int(along / 0.09)
        for i in range(n):
            at = along * (i + 0.5) / n
            part.append(("Gilding", move(pearl, fixed if vertical else at, at if vertical else fixed, 0.10)))
    shell_angle = np.radians(np.linspace(20, 160, 9))
    for i, a in enumerate(shell_angle):
        ray = rod(
            (0.06 * np.cos(a), 0.06 * np.sin(a), 0.08),
            (0.34 * np.cos(a), 0.06 + 0.34 * np.sin(a), 0.10 + 0.004 * i),
            0.036,
            8,
        )
        part.append(("Gilding", move(ray, width / 2, height + 0.10)))
        part.append(
            ("Gilding", move(ball(0.045, 10, 7), width / 2 + 0.36 * np.cos(a), height + 0.17 + 0.35 * np.sin(a), 0.105))
        )
    for s in (-1, 1):
        scroll_angle = np.linspace(0, 3.2 * np.pi, 26)
        reach = 0.20 * (1 - scroll_angle / 13)
        scroll = np.stack(
            [s * (0.62 - reach * np.cos(scroll_angle)), 0.14 + reach * np.sin(scroll_angle), 0.09 + 0 * reach], axis=-1
        )
        part.append(
            (
                "Gilding",
                move(sweep(scroll, 0.034, 8, up=(0, 0, 1), radii=np.linspace(1.2, 0.6, 26)), width / 2, height + 0.12),
            )
        )
        tail = curve([(s * 0.80, 0.16, 0.09), (s * 1.0, 0.30, 0.09), (s * 1.2, 0.22, 0.09), (s * 1.32, 0.08, 0.09)], 5)
        part.append(
            (
                "Gilding",
                move(sweep(tail, 0.03, 8, up=(0, 0, 1), radii=np.linspace(1.1, 0.4, 16)), width / 2, height + 0.10),
            )
        )
    return part


def bench() -> Part:
    """A velvet bench 1.5 long with turned gilded legs."""
    part: Part = [
        ("Velvet", move(cushion(1.5, 0.14, 0.48, 0.05, 10, 0.015), 0, 0.38)),
        ("Gilding", move(box(1.46, 0.07, 0.44, 0.012), 0, 0.33)),
    ]
    leg = lathe(polyline("0 0, 0.018 0, 0.028 0.03, 0.016 0.06, 0.034 0.25, 0.028 0.29, 0.04 0.31, 0.04 0.36"), 12)
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
    profile = polyline("-0.02 -0.03, 0.16 -0.03, 0.16 0.03, 0.12 0.07, 0.04 0.06, -0.02 0.09")
    part.append(("Marble", sweep(frame, np.array(profile) * [-1, 1], up=(0, 0, 1), crease_deg=40.0)))
    head = extrude(polyline("-1.2 0, 1.2 0, 1.25 0.08, 0 0.55, -1.25 0.08"), 0.16)
    part.append(("Marble", move(head, 0, 3.2, -0.02)))
    part.append(("Gilding", move(ball(0.09, 14, 9), 0, 3.42, 0.15)))
    return part
