"""Layers of marks: position, texture coordinates and mattes of pixels, with the weights that images have."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Float64, Int32, Real

from ..inputs.marks import COVERED, PAIR, PANE, POSITION, UV, Marks
from ..kernels.kernel import inlined, integer_at, kernel, real_at
from .accumulate import row_of, weight_of
from .sources import FRONT, MARKS, ORDER, START

# Objects of a pixel that are kept, those of the largest coverage; what Cryptomatte files usually have.
RANKS = 6
OBJECT, MATERIAL = "object", "material"
KINDS = (OBJECT, MATERIAL)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matte:
    """Objects or materials of a frame, ranked by coverage.

    Attributes:
        names: of all objects or materials of the scene.
        number: (height, width, RANKS) indices of names, -1 for none.
        coverage: (height, width, RANKS) share of the pixel, the largest first; 0 for none.
    """

    names: tuple[str, ...]
    number: Int32
    coverage: Float32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarkLayers:
    """Layers of marks.

    Attributes:
        position: (height, width, 3) mean over hits on surfaces, in the coordinates of the scene file; 0 where all
            escape. None unless wanted.
        uv: (height, width, 2) of the hit on a surface that counts most, v upwards; None unless wanted.
        mattes: by kind; empty unless wanted.
    """

    position: Float32 | None
    uv: Float32 | None
    mattes: Mapping[str, Matte] = field(default_factory=dict)


class MarkRoom:
    """The arrays of a frame that tasks write."""

    def __init__(self, marks: Marks, n_pixels: int) -> None:
        self._marks = marks
        self.places = np.empty((n_pixels if marks.places else 0, UV + 2 - POSITION), np.float64)
        ranked = (n_pixels if marks.mattes else 0, RANKS)
        self.number = [np.empty(ranked, np.int32) for _ in KINDS]
        self.coverage = [np.empty(ranked, np.float32) for _ in KINDS]

    def compose(self, sources: Addresses, first: int, n: int) -> None:
        """Compose pixels first to first + n - 1 from the hits of a `SourceList`."""
        marks = self._marks
        if marks.places:
            average_places(sources, first, n, marks.columns, self.places)
        for kind in range(len(KINDS) if marks.mattes else 0):
            shares, met = np.zeros(len(marks.names[kind])), np.empty(len(marks.names[kind]), np.int32)
            out = self.number[kind], self.coverage[kind]
            rank_mattes(sources, first, n, marks.columns, marks.number[kind], shares, met, *out)

    def layers(self, shape: tuple[int, ...]) -> MarkLayers:
        """The layers, of pictures of shape (height, width)."""
        marks, places = self._marks, self.places
        seen = np.isfinite(places[:, :1])
        centred = np.where(seen, places[:, :3] + marks.centre, 0.0).astype(np.float32)
        ranked = zip(KINDS, marks.names, self.number, self.coverage, strict=True) if marks.mattes else ()
        mattes = {
            kind: Matte(names=names, number=number.reshape(*shape, RANKS), coverage=coverage.reshape(*shape, RANKS))
            for kind, names, number, coverage in ranked
        }
        return MarkLayers(
            position=centred.reshape(*shape, 3) if marks.position else None,
            uv=places[:, 3:].astype(np.float32).reshape(*shape, 2) if marks.uv else None,
            mattes=mattes,
        )


@kernel
def average_places(sources: Addresses, first_pixel: int, n: int, columns: int, out: Float64) -> None:
    """Find positions and texture coordinates of pixels first_pixel to first_pixel + n - 1.

    Args:
        sources: of a `SourceList` with native and outer hits.
        columns: of their marks.
        out: (n_pixels, 5) overwritten in these pixels: mean position, infinite where no hit is on a surface; and
            texture coordinates of the hit of the largest weight, of several the first.
    """
    for pixel in range(first_pixel, first_pixel + n):
        # --- loop state ---
        weight: Real = 0.0  # sum of w over hits on surfaces
        most: Real = np.float32(-1.0)  # largest w of them
        for value in range(5):
            out[pixel, value] = 0.0

        for s in range(sources.shape[0]):
            listed = sources[s]
            if listed[START] == 0:  # no list, but a source of the one before
                continue
            for entry in range(integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)):
                hit = integer_at(listed[ORDER], entry)
                marks = sources[row_of(listed, s, entry)][MARKS] + 4 * columns * hit
                if real_at(marks, PAIR) < 0.0:
                    continue
                w = weight_of(listed, entry, hit)
                weight += w
                for axis in range(3):
                    out[pixel, axis] += w * np.float64(real_at(marks, POSITION + axis))
                if columns > UV and w > most:
                    out[pixel, 3], out[pixel, 4] = real_at(marks, UV), real_at(marks, UV + 1)
                    most = w

        for axis in range(3):
            out[pixel, axis] = out[pixel, axis] / weight if weight > 0.0 else np.inf


@kernel
def rank_mattes(
    sources: Addresses,
    first_pixel: int,
    n: int,
    columns: int,
    names: Int32,
    shares: Float64,
    met: Int32,
    number: Int32,
    coverage: Float32,
) -> None:
    """Rank the objects or the materials of pixels first_pixel to first_pixel + n - 1 by their shares of the pixel.

    Args:
        sources: of a `SourceList` with native and outer hits.
        columns, names: of their marks; (n_pairs,) the object or material of each pair.
        shares: (n_names,) zeros, and zeros again afterwards; met: (n_names,) scratch.
        number, coverage: (n_pixels, RANKS) overwritten in these pixels; see `Matte`.
    """
    for pixel in range(first_pixel, first_pixel + n):
        # --- loop state ---
        total = 0.0  # sum of w over all hits
        n_met = 0  # names that the pixel shows, in `met`, each with its sum of w in `shares`

        # 1. Sum the weights by name; a pane takes its part of the hit behind it.
        for s in range(sources.shape[0]):
            listed = sources[s]
            if listed[START] == 0:  # no list, but a source of the one before
                continue
            for entry in range(integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)):
                hit = integer_at(listed[ORDER], entry)
                source = sources[row_of(listed, s, entry)]
                w, left = np.float64(weight_of(listed, entry, hit)), 1.0
                total += w
                for layer in range(2):
                    share, pair = left, -1
                    if layer == 1:
                        pair = int(real_at(source[MARKS] + 4 * columns * hit, PAIR))
                    elif source[FRONT] != 0:
                        pair = int(real_at(source[FRONT] + 8 * hit, PANE))
                        share = np.float64(real_at(source[FRONT] + 8 * hit, COVERED))
                    if pair < 0 or share <= 0.0:
                        continue
                    name = names[pair]
                    if shares[name] == 0.0:
                        met[n_met] = name
                        n_met += 1
                    shares[name] += w * share
                    left -= share

        # 2. Take out the largest, one after the other; of equal ones that of the lower number.
        for rank in range(number.shape[1]):
            best = _largest(shares, met, n_met)
            found = best >= 0 and shares[best] > 0.0
            number[pixel, rank] = best if found else -1
            coverage[pixel, rank] = shares[best] / total if found else 0.0
            if found:
                shares[best] = 0.0
        for k in range(n_met):
            shares[met[k]] = 0.0


@inlined
def _largest(shares: Float64, met: Int32, n_met: int) -> int:
    """The first name of the largest share among n_met names; -1 of none."""
    best = -1
    for k in range(n_met):
        name = met[k]
        if best < 0 or shares[name] > shares[best] or (shares[name] == shares[best] and name < best):
            best = name
    return best
