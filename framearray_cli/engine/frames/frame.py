"""The hits of one eye: native hits, their terms, and the frames around that see them as outer hits.

Threads find hits in batches. Each batch writes its own slice of the columns, so that no result depends on which thread
takes which batch.
"""

from collections.abc import Mapping
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Int32

from ..hits.native import PixelSamples, extra_hits, native_hits
from ..hits.outer import (
    balance_weights,
    divide_by_own_hits,
    find_subpixels,
    outer_hits,
    scale_by_expected_hits,
    sort_by_pixel,
)
from ..hits.row import BY_SAMPLE
from ..inputs.cameras import OUTSIDE
from ..inputs.random import HOLE_SAMPLE
from .bounces import NO_GLASS, TRANSMISSION, extra_mirror_hits, own_columns, reflected_hits, see
from .kept_light import ALL, LightStore, keep_reflected
from .passes import Pass
from .pool import TracePool
from .reach import needed_spans
from .records import (
    ArrayPool,
    FrameHits,
    HitRecords,
    HitsByPixel,
    Rare,
    empty_by_frame,
    empty_records,
    joined_numbers,
    rare_numbers,
    split_columns,
)
from .setup import Batch, FrameSetup, Scratch
from .shading import record, shade

Paths = list[tuple[Int32, HitRecords]]  # reflected hits
Found = tuple[Paths, dict[str, Rare]]  # of a batch


def find_frame(setup: FrameSetup, eye: int, pool: TracePool) -> FrameHits:
    """Find the native hits of an eye, estimate their terms, and find the pixels of the frames around that see them."""
    c, parts = setup.frame_of(eye), setup.passes(eye)
    follows = setup.follows and eye == c  # a frame shows the reflected hits of its own eye
    spans = [(part, *span) for part in parts for span in needed_spans(setup, eye, part, pool)]
    ends = np.cumsum([0, *(m for _, _, m in spans)])
    n = int(ends[-1])
    frames = setup.frames_around(eye, setup.n_r)  # row r of pixel, order and frame columns is of frame frames[r]
    take = pool.arrays.take
    records, stores = empty_records(setup.kept_columns(), n, take), _light_stores(setup, pool.arrays)
    pixel = take("pixel", (len(frames), n), np.int32)
    lists = {
        "start": take("start", (len(frames), setup.n_zone + 1), np.int32),
        "order": take("order", (len(frames), n), np.int32),
    }
    dense, rare = split_columns(setup.frame_columns())
    by_frame = empty_by_frame(dense, len(frames), n, take)

    def find_batch(task: tuple[tuple[Pass, int, int], int], scratch: Scratch) -> Found:
        (part, first, m), at = task
        span, samples = slice(at, at + m), drawn[part.first_hit]
        kept = records.part(span)
        loose = kept.with_light(scratch.light)
        batch = Batch(setup=setup, c=c, hits=scratch.hits, n=m, scratch=scratch, records=loose, smooth=True)
        _find_native(batch, samples, first)
        shade(batch)
        columns = {name: array[:, span] for name, array in by_frame.items()} | empty_by_frame(rare, len(frames), m)
        find_outer(batch, frames, pixel[:, span], columns)
        stores[0].keep(loose, kept, (pixel[:, span] != OUTSIDE).any(axis=0) if setup.strip else ALL)
        own = columns[TRANSMISSION][frames.index(c)] if follows and TRANSMISSION in columns else NO_GLASS[0]
        found = reflected_hits(batch, own) if follows else []
        return keep_reflected(found, stores[1], setup), rare_numbers(rare, columns, at)

    by_sample = setup.halves == BY_SAMPLE
    drawn = {
        part.first_hit: PixelSamples(setup.seed, part.pixels, part.per_pixel, part.first_sample, by_sample)
        for part in parts
    }
    tasks = zip(spans, ends[:-1].tolist(), strict=True)
    batches = pool.run(find_batch, tasks)
    mirrored = [path for paths, _ in batches for path in paths]
    mirror_hits = take("mirror_hits", (2, setup.n_zone if follows else 0), np.int32)
    if follows:
        mirrored += extra_mirror_hits(setup, c, parts, pool, mirror_hits, stores[1])
    places = dict(zip(frames, _sort_each(pixel, setup.n_zone, lists, pool), strict=True))
    pool.arrays.give("pixel", pixel)
    found = FrameHits(
        eye=eye,
        records=records,
        frames=frames,
        by_frame=by_frame,
        rare=joined_numbers([numbers for _, numbers in batches]),
        places=places,
        mirror_hits=mirror_hits,
        pooled={**records.arrays, **by_frame, **lists, "mirror_hits": mirror_hits},
        stores=stores,
    )
    if follows:
        _join_mirrored(setup, mirrored, pool, found, pool.arrays)
    return found


def fill_holes(setup: FrameSetup, c: int, pixels: Int32, pool: TracePool) -> FrameHits:
    """Find one native hit for each of the pixels of eye c that no other hit reaches, and what mirrors show there."""
    n, parts = len(pixels), setup.tile_rows(pixels)
    records, arrays = empty_records(setup.kept_columns(), n), ArrayPool()
    stores = _light_stores(setup, arrays)
    dense, rare = split_columns(setup.feature_columns())
    by_frame = empty_by_frame(dense, 1, n)
    before = np.cumsum([0, *map(len, parts)]).tolist()

    def find_batch(task: tuple[int, int], scratch: Scratch) -> Found:
        part, first = task
        m = min(pool.batch, len(parts[part]) - first)
        span = slice(before[part] + first, before[part] + first + m)
        samples = PixelSamples(setup.seed, parts[part], per_pixel=1, first=HOLE_SAMPLE)
        kept = records.part(span)
        loose = kept.with_light(scratch.light)
        batch = Batch(setup=setup, c=c, hits=scratch.hits, n=m, scratch=scratch, records=loose)
        extra_hits(setup.cams, c, samples, first, m, setup.world, scratch.hit_rays.packets, scratch.hits)
        record(batch)
        scratch.rays["native"] += m
        shade(batch)
        stores[0].keep(loose, kept)
        own = own_columns(batch)
        for name, array in by_frame.items():
            array[:, span] = own[name]
        found = reflected_hits(batch, own.get(TRANSMISSION, NO_GLASS)[0]) if setup.follows else []
        return keep_reflected(found, stores[1], setup), rare_numbers(rare, own, span.start)

    tasks = [(part, first) for part, some in enumerate(parts) for first in range(0, len(some), pool.batch)]
    batches = pool.run(find_batch, tasks)
    mirrored = [path for paths, _ in batches for path in paths]
    places = {c: _sort_one(setup.in_zone(pixels), setup.n_zone, pool, arrays)}
    found = FrameHits(
        eye=c,
        records=records,
        frames=range(c, c + 1),
        by_frame=by_frame,
        rare=joined_numbers([numbers for _, numbers in batches]),
        places=places,
        stores=stores,
    )
    if mirrored:
        _join_mirrored(setup, mirrored, pool, found, arrays)
    return found


def _light_stores(setup: FrameSetup, arrays: ArrayPool) -> tuple[LightStore, LightStore]:
    """The light of native and of reflected hits, to come."""
    native, reflected = (LightStore(arrays, setup.stored, setup.packed_column(mirrored=m)) for m in (False, True))
    return native, reflected


def _join_mirrored(setup: FrameSetup, parts: Paths, pool: TracePool, found: FrameHits, arrays: ArrayPool) -> None:
    """Join the pixels and records of the reflected hits of all batches, in their order.

    Args:
        found: whose reflected hits these are; changed.
        arrays: where memory comes from.
    """
    ends = np.cumsum([0, *(len(pixels) for pixels, _ in parts)])
    n = int(ends[-1])
    taken = {}

    def take(name: str, *shape_and_type: Any) -> Any:
        taken[f"mirrored {name}"] = array = arrays.take(f"mirrored {name}", *shape_and_type)
        return array

    pixel, whole = np.empty(n, np.int32), empty_records(setup.kept_columns(mirrored=True), n, take)

    def copy(first: int, _scratch: Scratch) -> None:
        for part in range(first, len(parts), pool.threads):
            span = slice(ends[part], ends[part + 1])
            pixel[span] = setup.in_zone(parts[part][0])
            for name, array in parts[part][1].arrays.items():
                whole.arrays[name][span] = array

    pool.run(copy, range(pool.threads))
    lists = {"start": take("start", (1, setup.n_zone + 1), np.int32), "order": take("order", (1, n), np.int32)}
    found.mirrored, found.pooled_mirrors = whole, taken
    found.mirror_places = _sort_each(pixel[None], setup.n_zone, lists, pool)[0]


def _sort_one(pixel: Int32, n_pixels: int, pool: TracePool, arrays: ArrayPool) -> HitsByPixel:
    """Sort hits by the pixel that they fall into."""
    sizes = {"start": n_pixels + 1, "order": len(pixel)}
    lists = {name: arrays.take(name, (1, size), np.int32) for name, size in sizes.items()}
    return _sort_each(pixel[None], n_pixels, lists, pool)[0]


def _sort_each(pixel: Int32, n_pixels: int, lists: Mapping[str, Int32], pool: TracePool) -> list[HitsByPixel]:
    """Sort hits by their pixels in each frame, (n_frames, n); threads beyond one per frame share its pixels.

    Args:
        lists: "start" and "order" of each frame, overwritten.
    """
    places = [HitsByPixel(start=start, order=order) for start, order in zip(*lists.values(), strict=True)]
    parts = -(-pool.threads // len(places))
    cuts = [n_pixels * part // parts for part in range(parts + 1)]

    def sort(task: tuple[int, int, int], _scratch: Scratch) -> None:
        row, first, last = task
        sort_by_pixel(pixel[row], first, last, places[row].start, places[row].order)

    pool.run(sort, [(row, *span) for row in range(len(places)) for span in pairwise(cuts)])
    return places


def _find_native(batch: Batch, samples: PixelSamples, first: int) -> None:
    """Find the native hits of a batch, which begins with hit `first` of the samples."""
    started = perf_counter()
    setup, scratch = batch.setup, batch.scratch
    packets = scratch.hit_rays.packets
    native_hits(setup.cams, batch.c, samples, first, batch.n, setup.world, setup.depth > 0, packets, batch.hits)
    record(batch)
    scratch.rays["native"] += batch.n
    scratch.seconds["native"] += perf_counter() - started


def find_outer(batch: Batch, frames: range, pixel: Int32, columns: Mapping[str, Any]) -> None:
    """Find the pixel of each frame that sees native hits, and the frame columns of the hits.

    Args:
        pixel: (n_frames, n) overwritten; row r is of frame frames[r].
        columns: (n_frames, n, *shape) overwritten.
    """
    started = perf_counter()
    setup, scratch, n = batch.setup, batch.scratch, batch.n
    if setup.n_r == 0:  # nothing to project: a hit belongs to its own pixel
        seen = scratch.pixel[:1]
        seen[0, :n] = batch.hits.pixel[:n]
    else:
        seen = _find_pixels(batch, frames, columns)
    pixel[:] = setup.in_zone(seen[:, :n])
    if setup.area:
        found = scratch.subpixel[: len(frames)]
        find_subpixels(setup.cams, frames.start, batch.hits, n, seen, found)
        columns["subpixel"][:] = found[:, :n]
    scratch.seconds["visibility"] += perf_counter() - started
    see(batch, frames, pixel, columns)


def _find_pixels(batch: Batch, frames: range, columns: Mapping[str, Any]) -> Int32:
    """Find the pixels of frames that see native hits, (n_frames, >= n), and the weights of the hits."""
    # balance needs p_k of all eyes k of the windows of these frames; row r of seen and density is of eye eyes[r]
    setup, scratch, c, n = batch.setup, batch.scratch, batch.c, batch.n
    n_r = setup.n_r
    eyes = range(max(frames[0] - n_r, 0), min(frames[-1] + n_r + 1, setup.n_frames)) if setup.balance else frames
    seen, density = scratch.pixel[: len(eyes)], scratch.density[: len(eyes)]
    world, tests = setup.world, scratch.test_rays
    scratch.rays["visibility"] += outer_hits(
        setup.cams, c, eyes.start, batch.hits, n, world.eyes, tests, seen, density, True
    )
    first_row = eyes.index(frames.start)
    around: Int32 = seen[first_row : first_row + len(frames)]
    if setup.balance:
        weight = columns["weight"]
        if setup.allotment is not None:
            of_pixel, hits = setup.allotment.blocks.of_pixel, setup.allotment.hits
            scale_by_expected_hits(hits, of_pixel, eyes.start, n, seen, density)
        found = scratch.weight[: len(frames)]
        counts = setup.hits_in(frames, eyes)
        balance_weights(counts, n_r, eyes.start, frames.start, n, seen, density, found)
        if setup.allotment is not None:
            divide_by_own_hits(hits, of_pixel, frames.start, n, around, found)
        weight[:] = found[:, :n]
    return around
