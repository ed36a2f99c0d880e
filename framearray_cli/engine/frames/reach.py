"""The hits that a strip needs: all chunks of which any frame around shows a hit in its rows.

What is found of a hit may depend on the hits of its chunk, but on nothing else. So a strip takes chunks as a whole,
and its images have the same bits as those rows of whole frames.
"""

from itertools import groupby

import numpy as np

from framearray_cli.base.arrays import Flags, Float64, Int32

from ..hits.native import PixelSamples, native_hits
from ..hits.outer import outer_hits
from ..terms.obscurance import HITS_TOGETHER
from .passes import Pass
from .pool import TracePool
from .setup import FrameSetup, Scratch

NOWHERE = np.iinfo(np.int32).max, -1  # rows of hits that no frame sees
_NO_DENSITY: Float64 = np.empty((0, 0), np.float64)


def reached_rows(
    setup: FrameSetup, eye: int, part: Pass, pool: TracePool, most: int | None = None, size: int = HITS_TOGETHER
) -> Int32:
    """The first and the last row in which any of the frames around shows a hit of each chunk, (n_chunks, n_groups, 2).

    Nothing is tested for what lies in between, so that fewer rows than these may show the chunk.

    Args:
        most: number of chunks to look at, evenly spaced; None: all.
        size: hits of a group, of which a chunk has one or more.
    """
    c, frames, width = setup.frame_of(eye), setup.frames_around(eye, setup.n_r), setup.cams.width
    samples = PixelSamples(setup.seed, part.pixels, part.per_pixel, part.first_sample)
    n_chunks = -(-part.n // HITS_TOGETHER)
    chunks = range(0, n_chunks, -(-n_chunks // (most or n_chunks)))
    found = np.full((len(chunks), HITS_TOGETHER // size, 2), NOWHERE, np.int32)

    def find(k: int, scratch: Scratch) -> None:
        first, hits, seen = chunks[k] * HITS_TOGETHER, scratch.hits, scratch.pixel[: len(frames)]
        n = min(HITS_TOGETHER, part.n - first)
        packets, tracer = scratch.hit_rays.packets, setup.world.tracer
        native_hits(setup.cams, c, samples, first, n, setup.world, False, packets, hits)
        outer_hits(setup.cams, c, frames.start, hits, n, tracer, scratch.test_rays, seen, _NO_DENSITY, False)
        scratch.rays["pilot"] += n
        seen, groups = seen[:, :n], np.arange(0, n, size)
        for end, extreme in enumerate((np.minimum, np.maximum)):
            rows = extreme.reduce(np.where(seen >= 0, seen // width, NOWHERE[end]))
            found[k, : len(groups), end] = extreme.reduceat(rows, groups)

    pool.run(find, range(len(found)))
    return found


def is_needed(reached: Int32, zone: range) -> Flags:
    """True for groups of which any frame shows hits in some rows, (n_chunks, n_groups); see `reached_rows`."""
    found: Flags = (reached[..., 0] < zone.stop) & (reached[..., 1] >= zone.start)
    return found


def needed_spans(setup: FrameSetup, eye: int, part: Pass, pool: TracePool) -> list[tuple[int, int]]:
    """The hits of a pass that the setup's strip needs, as batches (first, number); of whole frames all."""
    if setup.strip is None:
        return pool.batches(part.n)
    key = eye, part.first_hit
    if key not in setup.strip.reached:
        setup.strip.reached[key] = reached_rows(setup, eye, part, pool)
    needed, found = is_needed(setup.strip.reached[key], setup.zone)[:, 0], []
    for wanted, run in groupby(range(len(needed)), key=lambda chunk: bool(needed[chunk])):
        if wanted:
            chunks = list(run)
            end = min((chunks[-1] + 1) * HITS_TOGETHER, part.n)
            starts = range(chunks[0] * HITS_TOGETHER, end, pool.batch)
            found += [(first, min(pool.batch, end - first)) for first in starts]
    return found
