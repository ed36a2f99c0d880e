"""The hits of one eye: native hits, their terms, and the frames around that see them as outer hits.

Threads find hits in batches. Each batch writes its own slice of the arrays, so that no result depends on which thread
takes which batch.
"""

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Int32

from ..hits.hits import ESCAPED, SURFACE, Hits
from ..hits.native import Samples, extra_hits, native_hits
from ..hits.outer import balance_weights, divide_by_own_hits, outer_hits, scale_by_expected_hits, sort_by_pixel
from ..hits.places import find_places
from ..inputs.cameras import Cameras, depths_of
from ..inputs.random import HOLE_SAMPLE
from .array_pool import ArrayPool
from .glass import find_through, hide_behind, own_view
from .mirror_paths import extra_mirror_hits, mirror_paths
from .passes import Pass
from .records import BY_SAMPLE, HitRecords, HitsByPixel
from .scratch import Scratch
from .setup import FrameSetup
from .shading import estimate_terms, find_marks, find_shine
from .threads import TracePool


@dataclass(slots=True, kw_only=True, eq=False)
class FrameHits:
    """The hits that eye c found.

    Attributes:
        records: of the native hits.
        places: frame j -> the hits by the pixel of j that sees them.
        weights: frame j -> (n,) weight w of each hit there, or (0,) where all weigh 1.
        through: frame j -> (n, 3) the share of the light of each hit that passes the glass before it; (0, 3) without.
        front: frame j -> (n, 2) the pane before each hit, see `inputs/marks.py`; (0, 2) unless mattes name panes.
        within: frame j -> (n,) where in its pixel each hit lies, see `hits/places.py`; (0,) unless weights are by area.
        mirrored, mirror_places: reflected hits of mirror pixels of frame c; None in a scene without mirrors.
        mirror_hits: (2, n_pixels) the number of native hits of each pixel whose mirrors were followed, with even and
            with odd sample numbers; (2, 0) without mirrors.
        normal, depth: (n, 3) and (n,) of native hits, for layers; (0, 3) and (0,) without.
        pooled: the large arrays of the above, but those of mirrors, by their name in the pool.
    """

    c: int
    records: HitRecords
    places: dict[int, HitsByPixel]
    weights: dict[int, Float32]
    within: dict[int, Bytes]
    through: dict[int, Float32]
    front: dict[int, Float32]
    mirrored: HitRecords | None
    mirror_places: HitsByPixel | None
    mirror_hits: Int32
    normal: Float32
    depth: Float32
    pooled: dict[str, Any]

    def forget_mirrors(self, arrays: ArrayPool) -> None:
        """Return the arrays of reflected hits to the pool; frame c itself cannot be composed afterwards."""
        if self.mirrored:
            for name, array in self.mirrored.arrays.items():
                arrays.give(f"mirrored {name}", array)
        self.mirrored = self.mirror_places = None

    def put_back(self, arrays: ArrayPool) -> None:
        """Return all other arrays to the pool; the hits must not be read afterwards."""
        for name, array in self.pooled.items():
            arrays.give(name, array)


def find_frame(setup: FrameSetup, c: int, pool: TracePool) -> FrameHits:
    """Find the native hits of eye c, estimate their terms, and find the pixels of the frames around that see them."""
    parts = setup.passes(c)
    n = sum(part.n for part in parts)
    frames = setup.frames_around(c, setup.n_r)  # row r of pixel, order and weight is of frame frames[r]
    take = pool.arrays.take
    records = setup.empty_records(n, take)
    pixel = take("pixel", (len(frames), n), np.int32)
    order = take("order", (len(frames), n), np.int32)
    weight = take("weight", (len(frames), n if setup.balance else 0), np.float32)
    within = take("within", (len(frames), n if setup.area else 0), np.uint8)
    through = take("through", (len(frames), n if setup.has_glass else 0, 3), np.float32)
    front = take("front", (len(frames), n if setup.names_panes else 0, 2), np.float32)
    n_normals = n if setup.layers else 0
    normal, depth = np.empty((n_normals, 3), np.float32), np.empty(n_normals, np.float32)

    def find_batch(task: tuple[Pass, int, int], scratch: Scratch) -> list[tuple[Int32, HitRecords]]:
        part, first, m = task
        span = slice(part.first_hit + first, part.first_hit + first + m)
        _find_native(setup, c, part, first, m, scratch)
        find_marks(setup, scratch, m, records.marks[span])
        hits = scratch.hits
        if n_normals:
            normal[span], depth[span] = _normals_and_depths(setup.cams, c, hits, m)
        estimate_terms(setup, hits, m, scratch, records.part(span), "obscurance", "shadow", smooth=True)
        find_outer(setup, c, m, scratch, frames, pixel[:, span], weight[:, span], within[:, span])
        find_through(setup, frames, hits, m, scratch, pixel[:, span], through[:, span], front[:, span])
        own = through[frames.index(c), span]
        return mirror_paths(setup, c, hits, m, scratch, own, smooth=True) if setup.follows else []

    tasks = [(part, first, m) for part in parts for first, m in pool.batches(part.n)]
    mirrored = [path for paths in pool.run(find_batch, tasks) for path in paths]
    mirror_hits = take("mirror_hits", (2, setup.n_pixels if setup.follows else 0), np.int32)
    if setup.follows:
        mirrored += extra_mirror_hits(setup, c, parts, pool, mirror_hits)
    places = dict(zip(frames, _sort_each(pixel, setup.n_pixels, order, pool), strict=True))
    pool.arrays.give("pixel", pixel)
    reflected = _join(setup, mirrored, pool) if setup.follows else None
    return FrameHits(
        c=c,
        records=records,
        places=places,
        weights={j: weight[row] for row, j in enumerate(frames)},
        within={j: within[row] for row, j in enumerate(frames)},
        through={j: through[row] for row, j in enumerate(frames)},
        front={j: front[row] for row, j in enumerate(frames)},
        pooled=records.arrays
        | {"through": through, "front": front, "order": order, "weight": weight}
        | {"within": within, "mirror_hits": mirror_hits},
        mirrored=reflected[1] if reflected else None,
        mirror_places=_sort_one(reflected[0], setup.n_pixels, pool) if reflected else None,
        mirror_hits=mirror_hits,
        normal=normal,
        depth=depth,
    )


def fill_holes(setup: FrameSetup, c: int, pixels: Int32, pool: TracePool) -> list[tuple[HitsByPixel, HitRecords]]:
    """Find one native hit for each of the pixels of eye c that no other hit reaches; then what mirrors show there."""
    n, samples = len(pixels), Samples(setup.seed, pixels, per_pixel=1, first=HOLE_SAMPLE)
    records = setup.empty_records(n)

    def find_batch(first: int, scratch: Scratch) -> list[tuple[Int32, HitRecords]]:
        m = min(pool.batch, n - first)
        extra_hits(setup.cams, c, samples, first, m, setup.world, scratch.hit_rays.packets, scratch.hits)
        find_shine(setup, scratch.hits, scratch, 0, m)
        find_marks(setup, scratch, m, records.marks[first : first + m])
        scratch.rays["native"] += m
        estimate_terms(setup, scratch.hits, m, scratch, records.part(slice(first, first + m)), "obscurance", "shadow")
        own, front = own_view(setup, c, scratch.hits, m, scratch)
        _dim_records(records.part(slice(first, first + m)), own)
        hide_behind(front, records.marks[first : first + m])
        return mirror_paths(setup, c, scratch.hits, m, scratch, own) if setup.follows else []

    mirrored = [path for paths in pool.run(find_batch, range(0, n, pool.batch)) for path in paths]
    found = [(_sort_one(pixels, setup.n_pixels, pool), records)]
    if mirrored:
        pixel, reflected = _join(setup, mirrored, pool)
        found.append((_sort_one(pixel, setup.n_pixels, pool), reflected))
    return found


def _join(setup: FrameSetup, parts: list[tuple[Int32, HitRecords]], pool: TracePool) -> tuple[Int32, HitRecords]:
    """Join the pixels and records of the reflected hits of all batches, in their order."""
    ends = np.cumsum([0, *(len(pixels) for pixels, _ in parts)])
    n = int(ends[-1])

    def take(name: str, *shape_and_type: Any) -> Any:
        return pool.arrays.take(f"mirrored {name}", *shape_and_type)

    pixel, whole = np.empty(n, np.int32), setup.empty_records(n, take, mirrored=True)

    def copy(first: int, _scratch: Scratch) -> None:
        for part in range(first, len(parts), pool.threads):
            span = slice(ends[part], ends[part + 1])
            pixel[span] = parts[part][0]
            for name, array in parts[part][1].arrays.items():
                whole.arrays[name][span] = array

    pool.run(copy, range(pool.threads))
    return pixel, whole


def _sort_one(pixel: Int32, n_pixels: int, pool: TracePool) -> HitsByPixel:
    """Sort hits by the pixel that they fall into."""
    return _sort_each(pixel[None], n_pixels, np.empty((1, len(pixel)), np.int32), pool)[0]


def _sort_each(pixel: Int32, n_pixels: int, order: Int32, pool: TracePool) -> list[HitsByPixel]:
    """Sort hits by their pixels in each frame, (n_frames, n); threads beyond one per frame share its pixels."""
    places = [HitsByPixel(start=np.empty(n_pixels + 1, np.int32), order=row) for row in order]
    parts = -(-pool.threads // len(places))
    cuts = [n_pixels * part // parts for part in range(parts + 1)]

    def sort(task: tuple[int, int, int], _scratch: Scratch) -> None:
        row, first, last = task
        sort_by_pixel(pixel[row], first, last, places[row].start, places[row].order)

    pool.run(sort, [(row, *span) for row in range(len(places)) for span in pairwise(cuts)])
    return places


def _find_native(setup: FrameSetup, c: int, part: Pass, first: int, n: int, scratch: Scratch) -> None:
    """Find native hits first to first + n - 1 of a pass."""
    started = perf_counter()
    samples = Samples(setup.seed, part.pixels, part.per_pixel, part.first_sample, setup.halves == BY_SAMPLE)
    packets = scratch.hit_rays.packets
    native_hits(setup.cams, c, samples, first, n, setup.world, setup.depth > 0, packets, scratch.hits)
    find_shine(setup, scratch.hits, scratch, 0, n)
    scratch.rays["native"] += n
    scratch.seconds["native"] += perf_counter() - started


def _normals_and_depths(cams: Cameras, c: int, hits: Hits, n: int) -> tuple[Float32, Float32]:
    """Shading normals of hits 0 to n - 1, and their depths from eye c; 0 for escaped rays."""
    depth = depths_of(cams, c, hits.position[:n])
    hits.shading[:n][hits.kind[:n] == ESCAPED] = 0.0
    return hits.shading[:n], np.where(hits.kind[:n] == SURFACE, depth, np.float32(0.0))


def find_outer(
    setup: FrameSetup, c: int, n: int, scratch: Scratch, frames: range, pixel: Int32, weight: Float32, within: Bytes
) -> None:
    """Find the pixel of each frame that sees native hits 0 to n - 1 of eye c, and the weights and places of the hits.

    Args:
        pixel, weight, within: (n_frames, n) overwritten; row r is of frame frames[r].
    """
    if setup.n_r == 0:  # nothing to project: a hit belongs to its own pixel
        pixel[0] = scratch.pixel[0, :n] = scratch.hits.pixel[:n]
        weight[:] = 1.0
        _find_within(setup, n, scratch, frames, scratch.pixel[:1], within)
        return
    started = perf_counter()
    # balance needs p_k of all eyes k of the windows of these frames; row r of seen and density is of eye eyes[r]
    eyes = setup.frames_around(c, 2 * setup.n_r) if setup.balance else frames
    seen = scratch.pixel[: len(eyes)]
    density = scratch.density[: len(eyes)]
    scratch.rays["visibility"] += outer_hits(
        setup.cams, c, eyes.start, scratch.hits, n, setup.world.tracer, scratch.test_rays, seen, density
    )
    first_row = eyes.index(frames.start)
    pixel[:] = seen[first_row : first_row + len(frames), :n]
    if setup.balance:
        per_pixel = setup.per_pixel
        if setup.allotment is not None:
            of_pixel, hits = setup.allotment.blocks.of_pixel, setup.allotment.hits
            scale_by_expected_hits(hits, of_pixel, eyes.start, n, seen, density)
            per_pixel = np.ones_like(per_pixel)
        found = scratch.weight[: len(frames)]
        balance_weights(per_pixel, setup.n_r, eyes.start, frames.start, n, seen, density, found)
        weight[:] = found[:, :n]
        if setup.allotment is not None:
            divide_by_own_hits(hits, of_pixel, frames.start, n, pixel, weight)
    _find_within(setup, n, scratch, frames, seen[first_row : first_row + len(frames)], within)
    scratch.seconds["visibility"] += perf_counter() - started


def _dim_records(records: HitRecords, shares: Float32) -> None:
    """Dim hits in place by the glass before them; see `HitRecords.through`."""
    dimmed = records.through(shares)
    records.row[:], records.emission[:] = dimmed.row, dimmed.emission


def _find_within(setup: FrameSetup, n: int, scratch: Scratch, frames: range, pixel: Int32, within: Bytes) -> None:
    """Find where hits 0 to n - 1 lie in their pixels of each frame, if weights are by area."""
    if setup.area:
        place = scratch.place[: len(frames)]
        find_places(setup.cams, frames.start, scratch.hits, n, pixel, place)
        within[:] = place[:, :n]
