"""Divide a render into parts that fit into memory: strips of rows, and blocks of light positions.

A strip finds the hits that its rows show, and some around; a block finds all hits again. So strips come first, and
blocks only where the thinnest strip does not fit.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.stripfiles import remove_strips
from framearray_cli.base.arrays import Flags, Float64, Int32
from framearray_cli.base.units import counted, gibibytes
from framearray_cli.engine.frames.bounces import (
    NO_GLASS,
    TRANSMISSION,
    WHOLE_SHARE,
    mirror_flags,
    own_columns,
    reflected_hits,
)
from framearray_cli.engine.frames.kept_light import NO_LIGHT
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.reach import is_needed, reached_rows
from framearray_cli.engine.frames.records import HitRecords
from framearray_cli.engine.frames.setup import FrameSetup, Scratch, Strip
from framearray_cli.engine.hits.native import TILE, PixelSamples
from framearray_cli.engine.hits.row import LIT, LIT_BITS
from framearray_cli.engine.images.dwa import CODED
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.cells.gather import LEVEL

from .automatic import evenly_from_end_to_end
from .cells import cells_digest
from .errortarget import pilot_batch
from .events import Report, Warned, note
from .memory import (
    WHOLE,
    LightShare,
    PilotHits,
    Share,
    copied_cells,
    light_blocks,
    memory_limit,
    program_memory,
    window_memory,
)
from .prepare import Prepared
from .rows import Strips, slices_of, strips_key
from .session import RenderSession
from .writer import array_target

# Eyes of pilots; of each the chunks whose frames are found, and the places where some hits are shaded.
PILOT_FRAMES, PILOT_CHUNKS, PLACES, PILOT_HITS = 8, 256, 48, 256
PILOT_GROUP = 2 * LANES  # hits of a chunk that lie together
SLOW = 2.0  # times the hits of a render that is not divided
PILOT_BITS = 3  # of packets of light positions
COUNTED = ("lit", "gathered", "packed")  # of hits
MARGIN = 1.15  # as few hits are counted


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
            f"find {self.hits:.2g} times the hits" if self.is_slow else f"find {100 * (self.hits - 1):.0f} % more hits"
        )
        return f"rendered in {' and '.join(parts)}, which {more}; whole with {gibibytes(self.undivided)} of memory"

    @property
    def is_slow(self) -> bool:
        """True if most of the work is only done because memory is short."""
        return self.hits >= SLOW


@dataclass(frozen=True, slots=True, eq=False)
class RenderPart:
    """A part of a render: some cameras at some light positions, whole frames or a strip of them.

    Attributes:
        setup: for these light positions, `lights`, and the rows of the strip.
        wanted: cameras.
        slices: rows that are composed together.
        strips: of which one is rendered.
    """

    setup: FrameSetup
    lights: range
    wanted: Sequence[int]
    slices: Sequence[range]
    strips: Strips


def find_parts(
    session: RenderSession, setup: FrameSetup, report: Report, finished: Sequence[range] = ()
) -> list[RenderPart]:
    """Divide what is missing into parts that fit into memory, and remove strips of earlier runs that none can use.

    Args:
        finished: the first strips, of all cameras, which keep their rows.
    """
    prepared, found, kept = session.prepared, list[RenderPart](), set[Path]()
    target, cells = array_target(prepared), cells_digest(setup.indirect.cells)
    division = divide(prepared, setup, finished)
    if division.is_slow:
        report(Warned(text=f"frames are {division.text}"))
    elif division.text:
        note(report, [f"frames are {division.text}"])
    for block in division.blocks:
        wanted, of_block = session.on_disk.missing(session.chosen, block), setup.for_block(block)
        key = strips_key(target.format, session.identity.fingerprint, cells, block)
        reached: dict[tuple[int, int], Int32] = {}
        for now, rows in enumerate(division.strips):
            strips = Strips(all=division.strips, now=now, key=key, directory=target.directory, still=prepared.still)
            kept |= strips.files(wanted)
            if cameras := strips.missing(wanted):
                strip = Strip(rows=rows, reached=reached) if len(division.strips) > 1 else None
                slices = slices_of(prepared.job, rows, len(block))
                found.append(RenderPart(replace(of_block, strip=strip), block, cameras, slices, strips))
    _remove_unusable(session, kept)
    return found


def _remove_unusable(session: RenderSession, kept: Set[Path]) -> None:
    """Remove the strips of another division or of other cells, which no part of this run can use.

    Only the run that has locked a camera reads and writes its strips, and this run has locked `session.chosen`; so no
    other run, part or worker needs them. All runs share the only frame of a still camera: its strips stay while another
    run goes on.
    """
    directory, folder = session.prepared.job.output.directory, session.folder
    if not session.prepared.still:
        remove_strips(directory, session.chosen, kept)
        return
    with folder.exclusive():
        if not folder.other_locks():
            remove_strips(directory, [0], kept)


def divide(prepared: Prepared, setup: FrameSetup, finished: Sequence[range] = (), *, exact: bool = False) -> Division:
    """Divide a render into as few strips as the memory limit allows, and the thinnest strips into blocks if they must.

    Args:
        setup: with cells, see `memory_limit`; it may have a few light positions only.
        finished: the first strips, which keep their rows.
        exact: look at hits, too, where even the most that they may need fits into memory.

    Raises:
        JobError: as `light_blocks`.
    """
    n, limit = prepared.n_lights, memory_limit(prepared, setup)
    height, whole = setup.cams.height, (range(setup.cams.height),)
    per_pixel = None if setup.allotment is None else setup.per_pixel
    bounces = setup.depth + sum(feature.follows for feature in setup.features)  # of each hit, if all are followed
    most_hits = PilotHits(reflected=bounces * (float(setup.per_pixel.max()) + setup.mirror_hits))
    most = window_memory(prepared, n, most_hits, per_pixel)
    if most <= limit and not (exact or finished):
        return Division(blocks=[range(n)], strips=whole, memory=most, undivided=program_memory() + most, hits=1.0)
    look = look_at_hits(setup, prepared.threads)
    undivided = program_memory() + window_memory(prepared, n, look, per_pixel)

    def memory(size: int, share: Share) -> int:
        return window_memory(prepared, size, look, per_pixel, share) + copied_cells(setup, n, size)

    def division(blocks: list[range], strips: tuple[range, ...], shares: list[Share]) -> Division:
        largest = max(len(block) for block in blocks)
        most = max(memory(largest, share) for share in shares)
        hits = len(blocks) * sum(share.hits for share in shares)
        return Division(blocks=blocks, strips=strips, memory=most, undivided=undivided, hits=hits)

    if (memory(n, WHOLE) <= limit and not finished) or setup.halves or height <= CODED:
        return division(light_blocks(prepared, look, None, per_pixel, setup), whole, [WHOLE])
    reached, cuts = _pilot_reach(setup, prepared.threads), [0, *(rows.stop for rows in finished)]
    for last in range(cuts[-1] + CODED, height, CODED):
        longer = range(cuts[-1], min(last + CODED, height))
        if memory(n, _share(setup, longer, reached, look)) > limit:
            cuts.append(last)
    strips = tuple(range(first, last) for first, last in pairwise([*cuts, height]))
    shares = [_share(setup, rows, reached, look) for rows in strips]
    largest = max(shares[len(finished) :], key=lambda share: memory(n, share))
    return division(light_blocks(prepared, look, None, per_pixel, setup, largest), strips, shares)


def look_at_hits(setup: FrameSetup, threads: int) -> PilotHits:
    """Find reflected hits and lit packets of a part of some frames, at some light positions; the most of any window."""
    few, flagged = setup.without_layers().at(_some_bits(setup.lights.n_lights)), np.zeros(1)
    size = _positions_of_bit(setup.lights.n_lights)
    together = size // _positions_of_bit(few.lights.n_lights)
    tile_row, n_rows = np.arange(setup.n_pixels) // (setup.cams.width * TILE), -(-setup.cams.height // TILE)
    # each row has a place
    every = PILOT_HITS * max(setup.n_pixels // (PILOT_HITS * max(PLACES, 3 * n_rows // 2)), 1)
    eyes, firsts = evenly_from_end_to_end(setup.n_frames, PILOT_FRAMES), range(0, setup.n_pixels, every)
    samples = PixelSamples(setup.seed, setup.order, 1, 0)

    def look(task: tuple[int, int], scratch: Scratch) -> tuple[Float64, Float64]:
        c, first = task
        batch, records = pilot_batch(few, c, samples, first, min(PILOT_HITS, setup.n_pixels - first), scratch)
        found, row = np.zeros(1 + len(COUNTED)), tile_row[batch.hits.pixel[: batch.n]]
        by_row = np.zeros((6, n_rows))
        passed = own_columns(batch).get(TRANSMISSION, NO_GLASS)[0]
        behind = (passed != WHOLE_SHARE).any(axis=1) if len(passed) else np.zeros(batch.n)
        for k, weights in enumerate((None, *_light_counts(few, records, together), behind)):
            by_row[k] = np.bincount(row, weights, n_rows)
        for pixels, reflected in reflected_hits(batch, passed) if setup.follows else ():
            found += (len(pixels), *(n.sum() for n in _light_counts(few, reflected, together, mirrored=True)))
            by_row[5] += np.bincount(tile_row[pixels], minlength=n_rows)
        return found, by_row

    with TracePool(few, threads) as pool:
        looks = pool.run(look, [(c, first) for c in eyes for first in firsts])
        for c in eyes if setup.mirror_hits else ():
            flags = mirror_flags(few, c, pool)
            flagged = np.maximum(flagged, np.bincount(tile_row, flags, n_rows) / np.bincount(tile_row))
    n_bits, in_window = -(-few.lights.n_lights // size), np.abs(np.subtract.outer(eyes, eyes)) <= setup.n_r
    found, by_row = (
        np.tensordot(in_window, np.array(seen).reshape(len(eyes), len(firsts), *seen[0].shape).sum(axis=1), 1)
        for seen in zip(*looks, strict=True)
    )  # of the eyes in the window of each
    shares = by_row[:, 1:] / np.maximum(by_row[:, :1], 1)
    share = shares[:, -1]
    shares[:, -1] = MARGIN * share * float(setup.per_pixel.max()) + flagged * setup.mirror_hits * (1 + share)
    means = np.average(shares, axis=2, weights=np.bincount(tile_row)).max(axis=0)
    return PilotHits(
        reflected=float(means[-1]),
        of_native=_light_share(n_bits, *means[:3]),
        of_reflected=_light_share(n_bits, *(found[:, 1:] / np.maximum(found[:, :1], 1)).max(axis=0)),
        behind=min(MARGIN * float(means[3]), 1.0),
        by_row=shares / np.maximum(means, 1e-9)[:, None],
    )


def _light_counts(setup: FrameSetup, records: HitRecords, together: int, *, mirrored: bool = False) -> tuple[Any, ...]:
    """Count what hits keep of COUNTED: bits of LIT, indirect light, and a packed column."""
    column = setup.packed_column(mirrored=mirrored)
    packed = records[column.name][:, 0] > 0 if column else np.zeros(len(records.row), np.bool_)
    return _lit_bits(records, together), _gathered(records), packed


def _light_share(n_bits: int, lit: float, *shares: float) -> LightShare:
    return LightShare(*(min(MARGIN * float(share), 1.0) for share in (lit / n_bits, *shares)))


def _positions_of_bit(n_lights: int) -> int:
    """Return how many light positions share a bit of LIT, see `lit_bit`."""
    last, together = -(-n_lights // LANES) - 1, 1
    while last // together >= LIT_BITS:
        together *= 2
    return LANES * together


def _some_bits(n_lights: int) -> list[int]:
    """Choose the light positions of some bits of LIT."""
    size = _positions_of_bit(n_lights)
    chosen = evenly_from_end_to_end(-(-n_lights // size), PILOT_BITS)
    return [l for bit in chosen for l in range(size * bit, min(size * (bit + 1), n_lights))]


def _lit_bits(records: HitRecords, together: int) -> Int32:
    """Count the bits of LIT of each hit, so many of the pilot's as one."""
    lit = np.ascontiguousarray(records.row[:, LIT].astype("<i4")).view(np.uint8).reshape(-1, 4)
    bits = np.unpackbits(lit, axis=1, count=LIT_BITS, bitorder="little")
    found: Int32 = bits.reshape(len(lit), -1, together).any(axis=2).sum(axis=1, dtype=np.int32)
    return found


def _gathered(records: HitRecords) -> Flags:
    """True for hits that have indirect light of their own."""
    indirect = records.arrays.get("indirect", NO_LIGHT)
    return indirect[:, LEVEL] > 0 if len(indirect) else np.zeros(len(records.row), np.bool_)


def _pilot_reach(setup: FrameSetup, threads: int) -> tuple[Int32, ...]:
    """Find the rows in which frames show the hits of some eyes, see `reached_rows`."""
    few, eyes = setup.without_layers().at([0]), evenly_from_end_to_end(setup.n_frames, PILOT_FRAMES)
    with TracePool(few, threads) as pool:
        each = ([reached_rows(few, c, part, pool, PILOT_CHUNKS, PILOT_GROUP) for part in setup.passes(c)] for c in eyes)
        return tuple(map(np.concatenate, each))


def _share(setup: FrameSetup, rows: range, reached: tuple[Int32, ...], look: PilotHits) -> Share:
    """Return the share of a strip, of hits the largest of some eyes."""
    zone = replace(setup, strip=Strip(rows=rows)).zone
    needed = [is_needed(found, zone) for found in reached]
    hits, shown = (max(float(some.mean()) for some in found) for found in ((n.any(axis=1) for n in needed), needed))
    of_rows = look.by_row[:, :, zone.start // TILE : -(-zone.stop // TILE)].mean(axis=2).max(axis=0)
    return Share(len(rows) / setup.cams.height, hits, shown / max(hits, 1e-9), *of_rows.tolist())
