"""The slow twin of alpha, positions, texture coordinates and mattes: sums over all hits of a frame.

alpha = sum of w over hits on surfaces / sum of w        coverage of a name = sum of its w / sum of w
position = sum of w P over hits on surfaces / sum of w over these
uv: those of the hit on a surface with the largest w
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from support import oracle_random as rnd
from support.area_twin import area_weights
from support.oracle import Oracle


@dataclass
class MarksTwin:
    """By pixel: alpha (n,), position (n, 3), uv (n, 2), and shares of objects and materials, (n, names) each."""

    alpha: Any
    position: Any
    uv: Any
    shares: dict[str, Any]


def marks_twin(oracle: Oracle, c: int) -> MarksTwin:
    """The layers of frame c."""
    scene, n = oracle.inputs.scene, oracle.n_pixels
    pixel, weight, surface, position, triangle, place = _weighed(oracle, c)
    total = np.bincount(pixel, weight, n)
    on, of = pixel[surface], weight[surface]
    covered = np.bincount(on, of, n)
    known = np.where(covered > 0, covered, 1)[:, None]
    mean = np.stack([np.bincount(on, of * position[surface, axis], n) for axis in range(3)], axis=1) / known
    uv = np.zeros((n, 2))
    first = np.lexsort((-of, on))  # by pixel; the largest weights first, of equal ones the first
    shown, at = np.unique(on[first], return_index=True)
    chosen = np.flatnonzero(surface)[first[at]]
    uv[shown] = oracle.model.mix(scene.uvs, triangle[chosen], place[chosen])
    shares = {}
    for kind, names, numbers in (
        ("object", scene.object_names, scene.object),
        ("material", scene.material_names, scene.material),
    ):
        table = np.zeros((n, len(names)))
        np.add.at(table, (on, numbers[triangle[surface]]), of)
        shares[kind] = table / total[:, None]
    position = np.where(covered[:, None] > 0, mean + scene.centre, 0)
    return MarksTwin(alpha=covered / total, position=position, uv=uv, shares=shares)


def _weighed(oracle: Oracle, c: int) -> Any:
    """Pixel, weight, whether on a surface, position, triangle and place of all hits that frame c shows."""
    found = []
    for k in oracle.window(c):
        hits = oracle.native(k)
        pixel, weight = oracle.use(c, k, hits)
        used = np.flatnonzero(pixel >= 0)
        found.append((pixel[used], weight[used], hits[used]))
    pixel, weight = (np.concatenate([part[i] for part in found]) for i in range(2))
    several = [part[2] for part in found]
    if oracle.job.reuse.weights == "area":
        parts = [oracle.parts(c, hits, p) for p, _, hits in found]
        column, row = (np.concatenate([part[i] for part in parts]) for i in range(2))
        by_pixel = list(area_weights(column, row, weight, (oracle.width, oracle.height)))
        entry = np.concatenate([near for _, near, _ in by_pixel])
        pixel = np.concatenate([np.full(len(near), p) for p, near, _ in by_pixel])
        weight = np.concatenate([of for _, _, of in by_pixel])
    else:
        entry = np.arange(len(pixel))
    arrays = [
        np.concatenate([getattr(hits, name) for hits in several])[entry]
        for name in ("surface", "position", "triangle", "place")
    ]
    missed = np.flatnonzero(np.bincount(pixel, minlength=oracle.n_pixels) == 0)
    holes = oracle.samples(c, missed, rnd.HOLE)
    more = [holes.surface, holes.position, holes.triangle, holes.place]
    joined = [np.concatenate(pair) for pair in zip(arrays, more, strict=True)]
    return np.concatenate([pixel, missed]), np.concatenate([weight, np.ones(len(missed))]), *joined
