"""Divide a render into parts that fit into memory: strips of rows, and blocks of light positions.

A strip finds the hits that its rows show, and some around; a block finds all hits again. So strips come
first, and blocks only where the thinnest strip does not fit.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from framearray_cli.base.arrays import Int32
from framearray_cli.base.units import counted, gibibytes
from framearray_cli.engine.frames.bounces import NO_GLASS, TRANSMISSION, mirror_flags, own_columns, reflected_hits
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.reach import is_needed, reached_rows
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch, Strip
from framearray_cli.engine.frames.shading import record, shade
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.engine.images.dwa import CODED
from framearray_cli.engine.terms.obscurance import HITS_TOGETHER

from .memory import (
    WHOLE,
    Share,
    copied_cells,
    light_blocks,
    memory_limit,
    program_memory,
    window_memory,
)
from .prepare import Prepared

# Eyes of pilots; of each the chunks whose frames are found, and those that are shaded.
PILOT_FRAMES, PILOT_CHUNKS, REFLECTED_CHUNKS = 8, 256, 12
MARGIN = 1.15  # of reflected hits, as few are counted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Division:
    """Parts of a render, each of which fits into memory.

    Attributes:
        blocks: of light positions; strips: rows of frames, from top to bottom.
        memory: bytes of the largest part; `undivided`: of the program, if there were only one.
        hits: number of hits that are found, over the number in a render that is not divided.
    """

    blocks: list[range]
    strips: tuple[range, ...]
    memory: int
    undivided: int
    hits: float

    @property
    def text(self) -> str:
        """Say what is done and what it costs; empty for one part."""
        parts = [counted(len(self.strips), "strip of rows", "strips of rows")] if len(self.strips) > 1 else []
        if len(self.blocks) > 1:
            parts.append(counted(len(self.blocks), "block") + " of light positions")
        if not parts:
            return ""
        more = (
            f"find {self.hits:.2g} times the hits"
            if self.hits >= 2
            else f"find {100 * (self.hits - 1):.0f} % more hits"
        )
        return f"rendered in {' and '.join(parts)}, which {more}; in one with {gibibytes(self.undivided)}"


def divide(prepared: Prepared, setup: FrameSetup) -> Division:
    """Divide a render into as few parts as the memory limit allows: strips, and only of the thinnest light positions.

    Args:
        setup: with cells, see `memory_limit`; it may have a few light positions only.

    Raises:
        JobError: as `light_blocks`.
    """
    n, mirrored, limit, per_pixel = (
        prepared.n_lights,
        reflected_per_pixel(setup, prepared.threads),
        memory_limit(prepared, setup),
        setup.per_pixel,
    )
    height, whole = setup.cams.height, (range(setup.cams.height),)
    units, undivided = -(-height // CODED), program_memory() + window_memory(prepared, n, mirrored, per_pixel)

    def memory(size: int, share: Share) -> int:
        return window_memory(prepared, size, mirrored, per_pixel, share) + copied_cells(setup, n, size)

    def division(blocks: list[range], strips: tuple[range, ...], shares: list[Share]) -> Division:
        largest = max(len(block) for block in blocks)
        most = max(memory(largest, share) for share in shares)
        hits = len(blocks) * sum(share.hits for share in shares)
        return Division(blocks=blocks, strips=strips, memory=most, undivided=undivided, hits=hits)

    if memory(n, WHOLE) <= limit or setup.halves or units == 1:
        return division(light_blocks(prepared, mirrored, None, per_pixel, setup), whole, [WHOLE])
    reached = _pilot_reach(setup, prepared.threads)
    for count in range(2, units + 1):
        cuts = [CODED * (k * units // count) for k in range(count)]
        strips = tuple(range(first, last) for first, last in pairwise([*cuts, height]))
        shares = [_share(setup, rows, reached) for rows in strips]
        if max(memory(n, share) for share in shares) <= limit:
            return division([range(n)], strips, shares)
    largest = max(shares, key=lambda share: memory(n, share))
    return division(light_blocks(prepared, mirrored, None, per_pixel, setup, largest), strips, shares)


def reflected_per_pixel(setup: FrameSetup, threads: int) -> float:
    """Estimate the most reflected hits per pixel of a frame, from a part of some frames."""
    if not setup.follows:
        return 0.0
    few, found, flagged = setup.without_layers().at([0]), 0, 0.0
    with TracePool(few, threads) as pool:

        def reflect(task: tuple[int, int], scratch: Scratch) -> int:
            c, first = task
            n = min(HITS_TOGETHER, setup.n_pixels - first)
            samples = PixelSamples(setup.seed, setup.order, 1, 0)
            packets, hits = scratch.hit_rays.packets, scratch.hits
            native_hits(few.cams, c, samples, first, n, few.world, few.depth > 0, packets, hits)
            batch = Batch(setup=few, c=c, hits=hits, n=n, scratch=scratch, records=few.empty_records(n), pilot=True)
            record(batch)
            shade(batch)
            passed = own_columns(batch).get(TRANSMISSION, NO_GLASS)[0]
            return sum(len(pixels) for pixels, _ in reflected_hits(batch, passed))

        every = HITS_TOGETHER * max(setup.n_pixels // (HITS_TOGETHER * REFLECTED_CHUNKS), 1)
        eyes, firsts = _pilot_eyes(setup), range(0, setup.n_pixels, every)
        looked = len(eyes) * sum(min(HITS_TOGETHER, setup.n_pixels - first) for first in firsts)
        found = sum(pool.run(reflect, [(c, first) for c in eyes for first in firsts]))
        for c in eyes if setup.mirror_hits else ():
            flagged = max(flagged, float(mirror_flags(few, c, pool).mean()))
    native: float = setup.per_pixel.max()
    return MARGIN * native * found / looked + flagged * setup.mirror_hits


def _pilot_eyes(setup: FrameSetup) -> list[int]:
    """Choose some eyes, evenly along the path."""
    found: list[int] = np.unique(np.linspace(0, setup.n_frames - 1, PILOT_FRAMES).astype(int)).tolist()
    return found


def _pilot_reach(setup: FrameSetup, threads: int) -> tuple[Int32, ...]:
    """Find the rows in which frames show the hits of some eyes, see `reached_rows`."""
    few, found = setup.without_layers().at([0]), []
    with TracePool(few, threads) as pool:
        for c in _pilot_eyes(setup):
            found.append(np.concatenate([reached_rows(few, c, part, pool, PILOT_CHUNKS) for part in setup.passes(c)]))
    return tuple(found)


def _share(setup: FrameSetup, rows: range, reached: tuple[Int32, ...]) -> Share:
    """Return the share of a strip; of hits the largest of some eyes."""
    zone = replace(setup, strip=Strip(rows=rows)).zone
    return Share(len(rows) / setup.cams.height, max(float(is_needed(found, zone).mean()) for found in reached))
