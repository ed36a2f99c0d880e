"""AOVs of hits: position, texture coordinates, and object and material as mattes, with the weights that images have."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, CornerUvs, Float32, Float64, Int32, Points, Real

from ..embree.packets import MISS, Tracer, U, V, hit_triangle
from ..frames.bounces import TRANSMISSION, passed_shares
from ..frames.records import Column, FrameHits, StoredLight
from ..frames.setup import Batch, Composer, Feature, PixelTask
from ..hits.glass import panes_before
from ..images.accumulate import row_of, weight_of
from ..images.sourcelists import ORDER, START
from ..inputs.aov import COVERED, PAIR, PANE, POSITION, UV, AovTables
from ..kernels.bundle import bundle
from ..kernels.kernel import inlined, integer_at, kernel, real_at
from ..kernels.simd import width_of_packets

# Objects of a pixel that are kept, by coverage; the usual number of Cryptomatte files.
RANKS = 6
OBJECT, MATERIAL = "object", "material"
KINDS = (OBJECT, MATERIAL)
AOVS = {"position", "uv", *KINDS}  # layers
PANES = "panes"  # column of the pane before each hit


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

    def __getitem__(self, rows: slice) -> "Matte":
        """The same in some rows."""
        return replace(self, number=self.number[rows], coverage=self.coverage[rows])


class Aov(Feature):
    """AOVs of a job.

    Attributes:
        tables: that AOVs are read from.
        panes: True if mattes name panes of glass.
    """

    name = "aov"
    is_layer = True

    def __init__(self, tables: AovTables, *, glass: bool) -> None:
        self.tables, self.panes = tables, glass and tables.mattes
        # positions are summed in float64; both kinds of mattes have a number and a coverage for each rank
        self.layer_bytes = 8 * 5 + 8 * 2 * RANKS * len(KINDS) * tables.mattes

    def columns(self, light: StoredLight, *, mirrored: bool) -> tuple[Column, ...]:
        return () if mirrored else (Column(self.name, (self.tables.columns,)),)

    def frame_columns(self) -> tuple[Column, ...]:
        return (Column(PANES, (2,)),) if self.panes else ()

    def record(self, batch: Batch) -> None:
        if batch.owns(self.name):
            tracer, packets = batch.setup.world.tracer, batch.scratch.hit_rays.packets
            out, pair, uvs = batch.column(self.name), self.tables.pair, self.tables.uvs
            record_aov(pair, uvs, tracer, packets, batch.n, batch.hits.position, out)

    def see(self, batch: Batch, frames: range, pixel: Int32, columns: Mapping[str, Any]) -> None:
        if not self.panes:
            return
        setup, n, rays = batch.setup, batch.n, batch.scratch.hit_rays
        seen, passed = np.ascontiguousarray(pixel), passed_shares(columns[TRANSMISSION])
        found = np.empty((len(frames), n, 2), np.float32)
        batch.scratch.rays["glass"] += panes_before(
            setup.cams, frames.start, batch.hits, n, seen, setup.world.panes, rays, passed, self.tables.panes, found
        )
        columns[PANES][:] = found

    def composer(self, frame: FrameHits, shown: range) -> Composer:
        return _AovComposer(self.tables, len(shown))


class _AovComposer(Composer):
    """The arrays of a frame that tasks write."""

    def __init__(self, tables: AovTables, n_pixels: int) -> None:
        self._tables = tables
        self.places = np.empty((n_pixels if tables.places else 0, UV + 2 - POSITION), np.float64)
        ranked = (n_pixels if tables.mattes else 0, RANKS)
        self.number = [np.empty(ranked, np.int32) for _ in KINDS]
        self.coverage = [np.empty(ranked, np.float32) for _ in KINDS]

    def compose(self, task: PixelTask) -> None:
        tables = self._tables
        at = AovColumns(task.columns[Aov.name], tables.columns, task.columns.get(PANES, -1))
        if tables.places:
            average_places(task.hits, task.first, task.n, at, self.places)
        for kind in range(len(KINDS) if tables.mattes else 0):
            shares, met = np.zeros(len(tables.names[kind])), np.empty(len(tables.names[kind]), np.int32)
            out = self.number[kind], self.coverage[kind]
            rank_mattes(task.hits, task.first, task.n, at, tables.number[kind], shares, met, *out)

    def layers(self, means: Float32, samples: Int32, shape: tuple[int, ...]) -> Mapping[str, Any]:
        tables, places, found = self._tables, self.places, dict[str, Any]()
        seen = np.isfinite(places[:, :1])
        centred = np.where(seen, places[:, :3] + tables.centre, 0.0).astype(np.float32)
        if tables.position:
            found["position"] = centred.reshape(*shape, 3)
        if tables.uv:
            found["uv"] = places[:, 3:].astype(np.float32).reshape(*shape, 2)
        ranked = zip(KINDS, tables.names, self.number, self.coverage, strict=True) if tables.mattes else ()
        for kind, names, number, coverage in ranked:
            found[kind] = Matte(
                names=names, number=number.reshape(*shape, RANKS), coverage=coverage.reshape(*shape, RANKS)
            )
        return found


@bundle
class AovColumns(NamedTuple):
    """Addresses of AOVs for composing: column of addresses, number of columns of a hit, and column of panes, or -1."""

    address: int
    n: int
    panes: int


@kernel
def record_aov(
    pair: Int32, uvs: CornerUvs, tracer: Tracer, packets: Float32, n: int, position: Points, out: Float32
) -> None:
    """Write the AOVs of what traced rays 0 to n - 1 met.

    Args:
        pair, uvs: of `AovTables`; uvs may be empty: texture coordinates are 0.
        position: (>= n, 3) of the hits.
        out: (n, columns) overwritten.
    """
    width = width_of_packets()
    for i in range(n):
        for column in range(out.shape[1]):
            out[i, column] = 0.0
        triangle = hit_triangle(tracer, packets, i)
        if triangle == MISS:
            out[i, PAIR] = -1.0
            continue
        out[i, PAIR] = pair[triangle]
        if out.shape[1] > POSITION:
            for axis in range(3):
                out[i, POSITION + axis] = position[i, axis]
        if out.shape[1] > UV and uvs.shape[0] > 0:
            u, v = packets[i // width, U, i % width], packets[i // width, V, i % width]
            w = np.float32(1.0) - u - v
            for axis in range(2):
                a, b, c = uvs[triangle, 0, axis], uvs[triangle, 1, axis], uvs[triangle, 2, axis]
                out[i, UV + axis] = w * a + u * b + v * c


@kernel
def average_places(sources: Addresses, first_pixel: int, n: int, at: AovColumns, out: Float64) -> None:
    """Find positions and texture coordinates of pixels first_pixel to first_pixel + n - 1.

    Args:
        sources: of a `SourceList` with native and outer hits.
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
                aov = sources[row_of(listed, s, entry)][at.address] + 4 * at.n * hit
                if real_at(aov, PAIR) < 0.0:
                    continue
                w = weight_of(listed, entry, hit)
                weight += w
                for axis in range(3):
                    out[pixel, axis] += w * np.float64(real_at(aov, POSITION + axis))
                if at.n > UV and w > most:
                    out[pixel, 3], out[pixel, 4] = real_at(aov, UV), real_at(aov, UV + 1)
                    most = w

        for axis in range(3):
            out[pixel, axis] = out[pixel, axis] / weight if weight > 0.0 else np.inf


@kernel
def rank_mattes(
    sources: Addresses,
    first_pixel: int,
    n: int,
    at: AovColumns,
    names: Int32,
    shares: Float64,
    met: Int32,
    number: Int32,
    coverage: Float32,
) -> None:
    """Rank the objects or the materials of pixels first_pixel to first_pixel + n - 1 by their shares of the pixel.

    Args:
        sources: of a `SourceList` with native and outer hits.
        names: (n_pairs,) the object or material of each pair.
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
                        pair = int(real_at(source[at.address] + 4 * at.n * hit, PAIR))
                    elif at.panes >= 0 and source[at.panes] != 0:
                        pair = int(real_at(source[at.panes] + 8 * hit, PANE))
                        share = np.float64(real_at(source[at.panes] + 8 * hit, COVERED))
                    if pair < 0 or share <= 0.0:
                        continue
                    name = names[pair]
                    if shares[name] == 0.0:
                        met[n_met] = name
                        n_met += 1
                    shares[name] += w * share
                    left -= share

        # 2. Take out the largest, one after the other; of equal ones the lower number.
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
