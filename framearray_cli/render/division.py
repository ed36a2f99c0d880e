"""Divide a render into parts that fit into memory: strips of rows, and blocks of light positions.

A strip finds the hits that its rows show, and some around; a block finds all hits again. So strips come first, and
blocks only where the thinnest strip does not fit.
"""

from collections import Counter
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from framearray_cli.array.stripfiles import remove_strips
from framearray_cli.base.arrays import Int32
from framearray_cli.base.units import counted, gibibytes
from framearray_cli.engine.frames.bounces import NO_GLASS, TRANSMISSION, mirror_flags, own_columns, reflected_hits
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.reach import is_needed, reached_rows
from framearray_cli.engine.frames.records import HitRecords
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch, Strip
from framearray_cli.engine.frames.shading import record, shade
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.engine.hits.row import LIT, LIT_BITS
from framearray_cli.engine.images.dwa import CODED
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.obscurance import HITS_TOGETHER

from .cells import cells_digest
from .events import Report, Warned, note
from .memory import (
    WHOLE,
    PilotHits,
    Share,
    copied_cells,
    light_blocks,
    memory_limit,
    program_memory,
    window_memory,
)
from .prepare import Prepared
from .session import RenderSession
from .strips import Strips, strips_key
from .writer import array_target

# Eyes of pilots; of each the chunks whose frames are found, and those that are shaded.
PILOT_FRAMES, PILOT_CHUNKS, SHADED_CHUNKS = 8, 256, 6
SLOW = 2.0  # times the hits of a render that is not divided
PILOT_PACKETS = 3  # of light positions
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
    """

    setup: FrameSetup
    lights: range
    wanted: Sequence[int]
    strips: Strips | None = None


def find_parts(session: RenderSession, setup: FrameSetup, report: Report) -> list[RenderPart]:
    """Divide what is missing into parts that fit into memory, and remove strips of earlier runs that none can use."""
    prepared, found, kept = session.prepared, list[RenderPart](), set[Path]()
    target, cells = array_target(prepared), cells_digest(setup.indirect.cells)
    division = divide(prepared, setup)
    if division.is_slow:
        report(Warned(text=f"frames are {division.text}"))
    elif division.text:
        note(report, [f"frames are {division.text}"])
    for block in division.blocks:
        wanted, of_block = session.on_disk.missing(session.chosen, block), setup.for_block(block)
        if not wanted or len(division.strips) == 1:
            found += [RenderPart(of_block, block, wanted)] if wanted else []
            continue
        key = strips_key(target, session.identity.fingerprint, cells, block)
        reached: dict[tuple[int, int], Int32] = {}
        for now, rows in enumerate(division.strips):
            strips = Strips(all=division.strips, now=now, key=key, directory=target.directory, still=prepared.still)
            kept |= strips.files(wanted)
            if cameras := strips.missing(wanted):
                strip = Strip(rows=rows, reached=reached)
                found.append(RenderPart(replace(of_block, strip=strip), block, cameras, strips))
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


def divide(prepared: Prepared, setup: FrameSetup) -> Division:
    """Divide a render into as few strips as the memory limit allows, and the thinnest strips into blocks if they must.

    Args:
        setup: with cells, see `memory_limit`; it may have a few light positions only.

    Raises:
        JobError: as `light_blocks`.
    """
    n, look, limit, per_pixel = (
        prepared.n_lights,
        look_at_hits(setup, prepared.threads),
        memory_limit(prepared, setup),
        setup.per_pixel,
    )
    height, whole = setup.cams.height, (range(setup.cams.height),)
    units, undivided = -(-height // CODED), program_memory() + window_memory(prepared, n, look, per_pixel)

    def memory(size: int, share: Share) -> int:
        return window_memory(prepared, size, look, per_pixel, share) + copied_cells(setup, n, size)

    def division(blocks: list[range], strips: tuple[range, ...], shares: list[Share]) -> Division:
        largest = max(len(block) for block in blocks)
        most = max(memory(largest, share) for share in shares)
        hits = len(blocks) * sum(share.hits for share in shares)
        return Division(blocks=blocks, strips=strips, memory=most, undivided=undivided, hits=hits)

    if memory(n, WHOLE) <= limit or setup.halves or units == 1:
        return division(light_blocks(prepared, look, None, per_pixel, setup), whole, [WHOLE])
    reached = _pilot_reach(setup, prepared.threads)
    for count in range(2, units + 1):
        cuts = [CODED * (k * units // count) for k in range(count)]
        strips = tuple(range(first, last) for first, last in pairwise([*cuts, height]))
        shares = [_share(setup, rows, reached) for rows in strips]
        if max(memory(n, share) for share in shares) <= limit:
            return division([range(n)], strips, shares)
    largest = max(shares, key=lambda share: memory(n, share))
    return division(light_blocks(prepared, look, None, per_pixel, setup, largest), strips, shares)


def look_at_hits(setup: FrameSetup, threads: int) -> PilotHits:
    """Find reflected hits and lit packets of a part of some frames, at some light positions."""
    few, flagged = setup.without_layers().at(_some_packets(setup.lights.n_lights)), 0.0
    every = HITS_TOGETHER * max(setup.n_pixels // (HITS_TOGETHER * SHADED_CHUNKS), 1)
    eyes, firsts = _pilot_eyes(setup), range(0, setup.n_pixels, every)
    samples = PixelSamples(setup.seed, setup.order, 1, 0)

    def look(task: tuple[int, int], scratch: Scratch) -> Counter[str]:
        c, first = task
        n, packets, hits = min(HITS_TOGETHER, setup.n_pixels - first), scratch.hit_rays.packets, scratch.hits
        native_hits(few.cams, c, samples, first, n, few.world, few.depth > 0, packets, hits)
        records = few.empty_records(n)
        batch = Batch(setup=few, c=c, hits=hits, n=n, scratch=scratch, records=records, pilot=True)
        record(batch)
        shade(batch)
        found = Counter(native=n, lit=_lit_packets(records))
        passed = own_columns(batch).get(TRANSMISSION, NO_GLASS)[0] if setup.follows else None
        for pixels, reflected in [] if passed is None else reflected_hits(batch, passed):
            found += Counter(reflected=len(pixels), lit_reflected=_lit_packets(reflected))
        return found

    with TracePool(few, threads) as pool:
        found = sum(pool.run(look, [(c, first) for c in eyes for first in firsts]), Counter[str]())
        for c in eyes if setup.mirror_hits else ():
            flagged = max(flagged, float(mirror_flags(few, c, pool).mean()))
    n_bits = min(-(-few.lights.n_lights // LANES), LIT_BITS)
    share = found["reflected"] / found["native"]
    return PilotHits(
        reflected=MARGIN * share * float(setup.per_pixel.max()) + flagged * setup.mirror_hits * (1 + share),
        lit=min(MARGIN * found["lit"] / (n_bits * found["native"]), 1.0),
        lit_reflected=min(MARGIN * found["lit_reflected"] / (n_bits * max(found["reflected"], 1)), 1.0),
    )


def _some_packets(n_lights: int) -> list[int]:
    """Choose the light positions of some packets."""
    n_packets = -(-n_lights // LANES)
    chosen = np.unique(np.linspace(0, n_packets - 1, PILOT_PACKETS).astype(int)).tolist()
    return [l for packet in chosen for l in range(LANES * packet, min(LANES * (packet + 1), n_lights))]


def _lit_packets(records: HitRecords) -> int:
    """Count the packets that light hits."""
    lit = records.row[:, LIT].astype(np.int32)
    return int(np.unpackbits(np.ascontiguousarray(lit).view(np.uint8)).sum())


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
