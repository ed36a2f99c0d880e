"""stairs.glb: the grand stair of a theatre, lit through seven tall windows in the wall behind the visitor (+z).

Needs numpy and Pillow. Metres, y up; the floor is y = 0.
A flight of 16 steps leads to a landing with a great mirror, two more lead left and right to the galleries.
"""

import numpy as np

from ..common.glb import Model, place
from ..common.parts import mirrored
from ..common.plants import palm
from .chandeliers import candelabrum, chandelier
from .flights import balusters_at, balustrades, gallery, main_flight, runner, side_flight
from .furnishings import bench
from .hall import ceiling, shell, walls
from .materials import materials
from .plan import (
    COLUMN_Z,
    FOOT,
    GALLERY,
    GALLERY_X,
    HALF_WIDTH,
    HEIGHT,
    LANDING,
    LANDING_HALF,
    LANDING_Z,
    MAIN_HALF,
)
from .stonework import baluster, column, rosette


def build() -> Model:
    """The whole staircase."""
    rng = np.random.default_rng(1875)
    model = Model(materials=materials())
    model.add("shell", shell())
    model.add("walls", walls())
    model.add("ceiling", ceiling())
    model.add("rose", rosette(0.9), [place(0, HEIGHT - 0.018, 1.4)])
    model.add("main-flight", main_flight())
    model.add("side-flights", mirrored(side_flight()))
    model.add("runner", runner())
    model.add("balustrades", mirrored(balustrades()))
    model.add("baluster", baluster(), balusters_at())
    model.add("galleries", mirrored(gallery()))
    cx = GALLERY_X + 0.15
    model.add("column", column(GALLERY - 0.40, 0.20), [place(s * cx, 0, z) for s in (-1, 1) for z in COLUMN_Z])
    upper = HEIGHT - 0.74 - GALLERY - 0.95
    model.add(
        "upper-column", column(upper, 0.16), [place(s * cx, GALLERY + 0.95, z) for s in (-1, 1) for z in COLUMN_Z]
    )
    lamp_x = MAIN_HALF + 0.12
    model.add(
        "candelabrum",
        candelabrum(),
        [place(s * lamp_x, 1.17, FOOT + 0.25, 30 * s) for s in (-1, 1)]
        + [place(s * (LANDING_HALF - 0.10), LANDING + 1.27, LANDING_Z - 0.14, 12 * s) for s in (-1, 1)],
    )
    model.add("chandelier", chandelier([(14, 1.05, 0.0), (9, 0.65, 0.42)], 2.1), [place(0, HEIGHT - 2.25, 1.4)])
    small = chandelier([(8, 0.5, 0.05)], 1.35)
    model.add("small-chandelier", small, [place(s * 6.75, HEIGHT - 1.4, z, 20 * z) for s in (-1, 1) for z in (2.8,)])
    model.add(
        "palm",
        palm(rng),
        [
            place(-3.3, 0, -1.7, 0, 1.1),
            place(3.3, 0, -1.7, 130, 1.1),
            place(-4.9, 0, 7.05, 75, 0.95),
            place(4.9, 0, 7.0, 220),
        ],
    )
    model.add("bench", bench(), [place(s * (HALF_WIDTH - 0.32), 0, 2.75, 90) for s in (-1, 1)])
    return model
