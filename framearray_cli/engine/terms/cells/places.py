"""Which samples make up which cells, and what keeps cells from leaking through walls.

Two sides of a thin wall may lie in one cell. So a sample joins the first slot of its cell only if it sees the cell's
guard, a point above the cell's first sample; the others join a second slot, or a coarser cell if they are few. A ray
that reads a cell with such samples pays one ray to the guard.

Levels are built from the coarsest to the finest. All choices follow the order of the samples.
"""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Addresses, Flags, Float32, Int32
from framearray_cli.base.threads import TaskPool

from ...embree.packets import Tracer
from ...hits.rays import room_for_tests
from .guards import GUARD_COLUMNS, GUARD_HEIGHT, HEIGHT, see_guards
from .samples import Samples
from .table import ALL, FEWEST_SAMPLES, LEVELS, NOWHERE, Grid, empty_slots, fill_slots, write_keys

# Samples per task of visibility rays.
_BATCH = 1 << 15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """The cells, and their samples.

    Attributes:
        slots, other, guard: see `Cells`.
        level: (n_cells,) of each cell; -1 for the cell of all surfaces.
        first, sample: see `Members`.
        rays: number of visibility rays.
    """

    slots: Addresses
    other: Int32
    guard: Float32
    level: Int32
    first: Addresses
    sample: Int32
    rays: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Level:
    """The cells of one level: keys of first slots; then second slots, which have none."""

    keys: Addresses
    sizes: Addresses
    sample: Int32
    other: Int32
    guard: Float32
    own: Int32
    rays: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceWork:
    """What places are found of."""

    grid: Grid
    samples: Samples
    tracer: Tracer
    pool: TaskPool

    def keys(self, level: int) -> Addresses:
        """The key of each sample's cell of a level."""
        keys = np.empty(self.samples.n, np.int64)
        write_keys(self.grid, level, self.samples.position, self.samples.side, keys)
        return keys

    def see(self, rows: Int32, guards: Float32) -> Flags:
        """Whether each of some samples sees a guard, (n, GUARD_COLUMNS)."""
        seen = np.ones(len(rows), np.uint8)

        def test(first: int) -> None:
            span = slice(first, first + _BATCH)
            see_guards(
                self.samples.position, self.samples.geometric, rows[span], guards[span], self.tracer,
                room_for_tests(4096, 1), seen[span],
            )  # fmt: skip

        list(self.pool.map(test, range(0, len(rows), _BATCH)))
        return seen.astype(bool)

    def guards(self, level: int, rows: Int32) -> Float32:
        """The guards above some samples, (n, GUARD_COLUMNS), as if all samples saw them."""
        height = np.float32(GUARD_HEIGHT * self.grid.edge * 2**level)
        found = np.zeros((len(rows), GUARD_COLUMNS), np.float32)
        found[:, :3] = self.samples.position[rows] + height * self.samples.geometric[rows]
        found[:, HEIGHT] = height
        return found


def find_places(work: PlaceWork) -> Places:
    """Find the cells of all levels."""
    if work.samples.n == 0:
        return _nowhere()
    own = np.full(work.samples.n, ALL, np.int32)
    empty = np.zeros(1, np.int64)
    levels: list[_Level] = []
    base = ALL + 1
    for level in reversed(range(LEVELS)):
        levels.append(_find_level(work, level, base, own))
        own, base = levels[-1].own, base + len(levels[-1].sizes)
    slots = empty_slots(base)
    start = ALL + 1
    for found in levels:
        fill_slots(found.keys, start, slots)
        start += len(found.sizes)
    sizes = np.concatenate([empty, *(found.sizes for found in levels)])
    return Places(
        slots=slots,
        other=np.concatenate([np.full(1, NOWHERE, np.int32), *(found.other for found in levels)]),
        guard=np.concatenate([np.zeros((1, GUARD_COLUMNS), np.float32), *(found.guard for found in levels)]),
        level=np.repeat(
            np.array([-1, *reversed(range(LEVELS))], np.int32), [1, *(len(found.sizes) for found in levels)]
        ),
        first=np.concatenate([empty, np.cumsum(sizes)]),
        sample=np.concatenate([found.sample for found in levels]),
        rays=sum(found.rays for found in levels),
    )


def _nowhere() -> Places:
    """The places of no samples: the cell of all surfaces only."""
    return Places(
        slots=empty_slots(1), other=np.full(1, NOWHERE, np.int32), guard=np.zeros((1, GUARD_COLUMNS), np.float32),
        level=np.full(1, -1, np.int32), first=np.zeros(2, np.int64), sample=np.zeros(0, np.int32), rays=0,
    )  # fmt: skip


def _find_level(work: PlaceWork, level: int, base: int, coarser: Int32) -> _Level:
    """Find the cells of a level, numbered from `base` on.

    Args:
        coarser: (n_samples,) the cell of the next coarser level that each sample joined.
    """
    keys = work.keys(level)
    order = np.argsort(keys, kind="stable").astype(np.int32)
    key = keys[order]
    start = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    size = np.diff(start, append=len(order))
    group = np.repeat(np.arange(len(start)), size)
    guard = work.guards(level, order[start])
    seen = work.see(order, guard[group])
    rays = len(order)
    # a guard that few samples see gives way to one above the first of the others
    few = np.add.reduceat(seen, start, dtype=np.int64) * 2 < size
    rows = np.flatnonzero(few[group])
    if len(rows):
        unseen = np.where(seen, len(order), np.arange(len(order)))
        guard[few] = work.guards(level, order[np.minimum.reduceat(unseen, start)[few]])
        seen[rows] = work.see(order[rows], guard[group[rows]])
        rays += len(rows)
    in_first = np.add.reduceat(seen, start, dtype=np.int64)
    kept = in_first >= FEWEST_SAMPLES
    both = kept & (size - in_first >= FEWEST_SAMPLES)
    # numbers of the slots of each group
    one = np.where(kept, base + np.cumsum(kept) - 1, NOWHERE)
    two = np.where(both, base + int(kept.sum()) + np.cumsum(both) - 1, NOWHERE)
    number = np.where(seen, one[group], two[group])
    own = coarser.copy()
    own[order] = np.where(number != NOWHERE, number, coarser[order])
    joined = np.flatnonzero(number != NOWHERE)
    joined = joined[np.argsort(number[joined], kind="stable")]
    sizes = np.bincount(number[joined] - base, minlength=int(kept.sum() + both.sum()))
    # what a ray reads that does not see the guard
    other = np.full(len(sizes), NOWHERE, np.int32)
    aside = np.flatnonzero(~seen & kept[group])[::-1]  # the first of a group wins
    other[one[group[aside]] - base] = own[order[aside]]
    guards = np.zeros((len(sizes), GUARD_COLUMNS), np.float32)
    guards[: int(kept.sum())] = guard[kept]
    return _Level(
        keys=key[start[kept]], sizes=sizes, sample=order[joined], other=other, guard=guards, own=own, rays=rays
    )
