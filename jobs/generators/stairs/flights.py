"""Flights, balustrades, galleries and the carpet of the theatre staircase."""

from collections.abc import Iterator

import numpy as np

from ..common.glb import place
from ..common.parts import Part, moved
from ..common.shapes import Array, Mesh, between, move, turn
from ..common.turned import extrude, rod, surface
from .plan import (
    BACK,
    COLUMN_Z,
    FOOT,
    FRONT,
    GALLERY,
    GALLERY_X,
    HALF_WIDTH,
    HEIGHT,
    LANDING,
    LANDING_HALF,
    LANDING_Z,
    MAIN_HALF,
    N_MAIN,
    N_SIDE,
    RISE,
    SIDE_Z,
    TREAD,
)
from .stonework import newel, rail


def main_flight() -> Part:
    """Sixteen steps as stacked layers, each with a rounded nosing; the first two are wider."""
    part: Part = []
    for k in range(N_MAIN):
        z, y = FOOT - k * TREAD, k * RISE
        half = MAIN_HALF + (0.62, 0.36)[k] if k < 2 else MAIN_HALF
        end = LANDING_Z - 0.4
        part.append(("MarbleRose", between((-half + 0.02, y - 0.05, end), (half - 0.02, y + RISE - 0.035, z))))
        if k < N_MAIN - 1:
            part.append(
                ("Marble", between((-half, y + RISE - 0.04, z - TREAD - 0.05), (half, y + RISE, z + 0.035), 0.014))
            )
    back_half = LANDING_HALF
    part.append(
        ("MarbleRose", between((-back_half, -0.05, BACK - 0.1), (back_half, LANDING - 0.035, LANDING_Z - 0.02)))
    )
    part.append(
        (
            "Marble",
            between(
                (-back_half - 0.03, LANDING - 0.045, BACK - 0.1), (back_half + 0.03, LANDING, LANDING_Z + 0.035), 0.014
            ),
        )
    )
    return part


def side_flight() -> Part:
    """The flight from the landing to the right gallery, with its curb; the left one is its mirror image."""
    part: Part = []
    for k in range(N_SIDE):
        x, y = LANDING_HALF + k * TREAD, LANDING + k * RISE
        part.append(("MarbleRose", between((x, y - 0.05, BACK - 0.05), (GALLERY_X + 0.3, y + RISE - 0.035, SIDE_Z))))
        if k < N_SIDE - 1:
            part.append(
                (
                    "Marble",
                    between(
                        (x - 0.035, y + RISE - 0.04, BACK - 0.05), (x + TREAD + 0.05, y + RISE, SIDE_Z - 0.01), 0.014
                    ),
                )
            )
    part.append(
        (
            "MarbleRose",
            between((LANDING_HALF - 0.1, -0.05, BACK - 0.05), (GALLERY_X + 0.3, LANDING - 0.02, SIDE_Z - 0.02)),
        )
    )
    slope = RISE / TREAD
    run = GALLERY_X - LANDING_HALF
    curb = [
        (-0.15, -0.25),
        (run + 0.3, -0.25),
        (run + 0.3, slope * run + 0.27),
        (run + 0.02, slope * run + 0.27),
        (-0.15, 0.20),
    ]
    part.append(("Marble", move(extrude(curb, 0.24), LANDING_HALF, LANDING, SIDE_Z - 0.01)))
    return part


def runner() -> Part:
    """The carpet from the hall over every step to the mirror, held by brass rods."""
    half, lift = 1.15, 0.007
    path = [(4.6, lift)]
    rods: Part = []
    for k in range(N_MAIN):
        z, y = FOOT - k * TREAD, k * RISE
        path += [
            (z + lift, y + lift),
            (z + lift, y + RISE - 0.045),
            (z + 0.035 + lift, y + RISE - 0.035),
            (z + 0.035 + lift, y + RISE - 0.008),
            (z + 0.022, y + RISE + lift),
        ]
        rods.append(("Brass", rod((-half - 0.09, y + 0.02, z + 0.018), (half + 0.09, y + 0.02, z + 0.018), 0.010, 8)))
    path.append((BACK + 0.1, LANDING + lift))
    p = np.array(path)
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]
    points = np.stack([np.stack([np.full(len(p), x), p[:, 1], p[:, 0]], axis=-1) for x in (-half, half)])
    uvs = np.stack([np.stack([np.full(len(p), u), length / (2 * half)], axis=-1) for u in (0.0, 1.0)])
    carpet = surface(points, uvs, 40.0)
    edges = [
        Mesh(
            points=np.vstack([points[i], points[i] - [0, lift, 0]]),
            faces=_strip(len(p)),
            uvs=np.vstack([uvs[i], uvs[i]]),
            crease_deg=40.0,
        )
        for i in (0, 1)
    ]
    return [("Runner", carpet), *(("Runner", edge) for edge in edges), *rods]


def _strip(n: int) -> np.ndarray:
    k = np.arange(n - 1)
    return np.concatenate([np.stack([k, k + 1, k + n], axis=-1), np.stack([k + 1, k + n + 1, k + n], axis=-1)])


def balusters_at() -> Iterator[Array]:
    """Places of all balusters."""
    for s in (-1, 1):
        for k in range(2 * (N_MAIN - 1) - 2):  # along the main flight, two per tread
            z = FOOT - 0.30 - k * TREAD / 2
            yield place(s * (MAIN_HALF + 0.12), main_curb_y(z) - 0.012, z)
        for z in np.arange(LANDING_Z - 0.42, SIDE_Z + 0.30, -0.165):
            yield place(s * (LANDING_HALF - 0.10), LANDING + 0.115, float(z))
        for x in np.arange(LANDING_HALF + 0.32, GALLERY_X - 0.25, TREAD / 2):
            yield place(s * float(x), LANDING + 0.215 + (float(x) - LANDING_HALF) * RISE / TREAD, SIDE_Z + 0.11)
        for z in np.arange(SIDE_Z + 0.55, FRONT - 0.1, 0.17):
            if min(abs(z - c) for c in COLUMN_Z) > 0.33:
                yield place(s * (GALLERY_X + 0.12), GALLERY + 0.095, float(z))


def main_curb_y(z: float) -> float:
    """Top of the main flight's curb."""
    return 0.30 + (FOOT - z) * RISE / TREAD


def balustrades() -> Part:
    """Curbs, rails and pedestals of the right half."""
    part: Part = []
    x = MAIN_HALF + 0.12
    z_end = LANDING_Z - 0.12
    curb = [
        (-(FOOT + 0.05), -0.03),
        (-z_end, -0.03),
        (-z_end, main_curb_y(z_end)),
        (-(FOOT + 0.05), main_curb_y(FOOT + 0.05)),
    ]
    part.append(("Marble", move(turn(extrude(curb, 0.26), "y", 90), x - 0.13, 0, 0)))
    rise = 0.70
    part.append(
        ("RailWood", rail([(x, main_curb_y(FOOT + 0.1) + rise, FOOT + 0.1), (x, main_curb_y(z_end) + rise, z_end)]))
    )
    part += moved(newel(1.15), x, 0, FOOT + 0.25)
    part += moved(newel(1.25), LANDING_HALF - 0.10, LANDING, LANDING_Z - 0.14)
    part += moved(newel(1.3), LANDING_HALF - 0.02, LANDING, SIDE_Z + 0.11)
    part.append(
        (
            "Marble",
            between(
                (LANDING_HALF - 0.23, LANDING - 0.3, SIDE_Z),
                (LANDING_HALF + 0.03, LANDING + 0.12, LANDING_Z - 0.1),
                0.01,
            ),
        )
    )
    xl = LANDING_HALF - 0.10
    part.append(("RailWood", rail([(xl, LANDING + 0.83, LANDING_Z - 0.2), (xl, LANDING + 0.83, SIDE_Z + 0.2)])))
    slope = RISE / TREAD
    z, x0, x1 = SIDE_Z + 0.11, LANDING_HALF + 0.1, GALLERY_X + 0.05
    part.append(
        (
            "RailWood",
            rail(
                [
                    (x0, LANDING + 0.93 + (x0 - LANDING_HALF) * slope, z),
                    (x1, LANDING + 0.93 + (x1 - LANDING_HALF) * slope, z),
                ]
            ),
        )
    )
    part += moved(newel(1.2), GALLERY_X + 0.12, GALLERY, SIDE_Z + 0.15)
    xg = GALLERY_X + 0.12
    part.append(
        ("Marble", between((xg - 0.13, GALLERY - 0.05, SIDE_Z), (xg + 0.13, GALLERY + 0.10, FRONT + 0.02), 0.01))
    )
    part.append(("RailWood", rail([(xg, GALLERY + 0.80, SIDE_Z + 0.3), (xg, GALLERY + 0.80, FRONT + 0.02)])))
    return part


def gallery() -> Part:
    """The right gallery's floor with its entablature below, on columns, and the beam over the upper columns."""
    x0, x1 = GALLERY_X - 0.02, HALF_WIDTH + 0.05
    part: Part = [
        ("Ceiling", between((x0 + 0.04, GALLERY - 0.42, SIDE_Z - 0.02), (x1, GALLERY - 0.035, FRONT + 0.05))),
        ("Marble", between((x0, GALLERY - 0.045, BACK - 0.05), (x1, GALLERY, FRONT + 0.05), 0.01)),
        ("Plaster", between((GALLERY_X + 0.28, -0.05, BACK - 0.05), (x1, GALLERY - 0.03, SIDE_Z - 0.01))),
        (
            "Plaster",
            between((x0 - 0.05, GALLERY - 0.11, SIDE_Z - 0.025), (x0 + 0.2, GALLERY - 0.04, FRONT + 0.05), 0.02),
        ),
        (
            "Gilding",
            between((x0 + 0.015, GALLERY - 0.30, SIDE_Z - 0.02), (x0 + 0.2, GALLERY - 0.26, FRONT + 0.05), 0.01),
        ),
        (
            "Plaster",
            between(
                (GALLERY_X - 0.06, HEIGHT - 0.75, COLUMN_Z[0] - 0.6),
                (GALLERY_X + 0.34, HEIGHT + 0.02, FRONT + 0.05),
                0.02,
            ),
        ),
        (
            "Gilding",
            between(
                (GALLERY_X - 0.075, HEIGHT - 0.60, COLUMN_Z[0] - 0.59),
                (GALLERY_X + 0.1, HEIGHT - 0.56, FRONT + 0.05),
                0.01,
            ),
        ),
    ]
    for z in np.arange(SIDE_Z + 0.1, FRONT, 0.26):
        part.append(("Plaster", between((x0 - 0.02, GALLERY - 0.20, z), (x0 + 0.1, GALLERY - 0.105, z + 0.12), 0.008)))
    for z in COLUMN_Z:
        part.append(
            (
                "Marble",
                between(
                    (GALLERY_X - 0.06, GALLERY - 0.02, z - 0.21), (GALLERY_X + 0.36, GALLERY + 0.96, z + 0.21), 0.015
                ),
            )
        )
    return part
