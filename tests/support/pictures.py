"""Whole images of the tiny room, at any size and place, and the difference of two of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from support import tiny

SMALL = {"resolution": [96, 72]}


# In another unit of length or at another place a ray may pass an edge, or a corner of a texel, on its other side: one
# sample of a pixel, in less than one pixel of a hundred. All other values differ by roundings.
ROUNDING, FLIPPED = 1e-3, 0.01


def walk(size: float = 1.0, at: Any = (0.0, 0.0, 0.0), **changes: Any) -> Any:
    """The tiny job with all lengths and places changed: the picture must stay."""

    def placed(point: Any) -> list[float]:
        return [float(x) for x in size * np.array(point) + np.array(at)]

    keys = [key | {"eye": placed(key["eye"]), "target": placed(key["target"])} for key in tiny.WALK["keys"]]
    table = tiny.table(camera=tiny.WALK | SMALL | {"frames": 3, "keys": _at_frames(keys, 2)}, reuse={"n_r": 1})
    source = table["light"]["sources"][0]
    lamps = [
        key | {"position": placed(key["position"]), "intensity": [size**2 * x for x in key["intensity"]]}
        for key in source["keys"]
    ]
    light = table["light"] | {"sources": [source | {"keys": lamps}]}
    return tiny.job(camera=table["camera"], light=light, reuse={"n_r": 1}, obscurance={"range": 1.5 * size}, **changes)


def _at_frames(keys: Sequence[Any], last: int) -> list[Any]:
    return [keys[0] | {"frame": 0}, keys[1] | {"frame": last}]


def pictures(job: Any, scene: Any = None) -> Any:
    """(n_c, n_l, h, w, 3), and the proof that no value had to be replaced."""
    rendered = tiny.render_frames(tiny.prepared(job, scene))
    assert all(frame.bad == 0 for frame in rendered.composed)
    images = np.asarray(rendered.images, np.float64)
    assert np.isfinite(images).all() and (images >= 0).all()
    return images


def differing(a: Any, b: Any) -> float:
    """Share of pixels that differ by more than roundings."""
    return float((np.abs(a - b).max(axis=-1) > ROUNDING * b.mean()).mean())
