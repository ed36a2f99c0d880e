"""The irradiance of polygons that shine."""

from typing import Any

import numpy as np


def lambert(corners: Any) -> float:
    """Irradiance of a floor at the origin by a polygon of radiance 1 above it, by Lambert's formula (1760).

    Half the sum over edges of the angle under which the edge is seen, times the height of the unit normal of the plane
    through it and the origin.
    """
    below = corners[:, 1] < 0  # cut the polygon at the horizon
    kept: list[Any] = []
    for v, w, v_below, w_below in zip(corners, np.roll(corners, -1, 0), below, np.roll(below, -1), strict=True):
        kept += [] if v_below else [v]
        kept += [v + (w - v) * v[1] / (v[1] - w[1])] if v_below != w_below else []
    if not kept:
        return 0.0
    v = np.array(kept)
    w = np.roll(v, -1, 0)
    across = np.cross(v, w)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (v * w).sum(axis=1))
    heights = np.divide(across[:, 1], sine, out=np.zeros_like(sine), where=sine > 0)
    return abs(float((angle * heights).sum())) / 2
