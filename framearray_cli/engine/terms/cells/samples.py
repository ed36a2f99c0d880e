"""The samples of cells, and the cells that they join.

Gather rays will land where samples lie. Walks start at eyes of the whole camera path and leave diffusely from visible
surfaces. Their first vertices are the samples. From each sample one ray of density cos(theta) / pi goes on: a link to
the cell that it meets.

Two sides of a thin wall may lie in one cell. So a sample joins the first slot of its cell only if it sees the cell's
guard, a point above the cell's first sample; the others join a second slot, or a coarser cell if they are few. A ray
that reads a cell with such samples needs one more ray, to the guard.

Levels are built from the coarsest to the finest. All choices follow the order of the samples.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Addresses, Directions, Flags, Float32, Int32, Points, Rgb, with_room
from framearray_cli.base.threads import TaskPool

from ...embree.packets import Tracer
from ...hits.glass import BEFORE, transmission_along
from ...hits.hits import SURFACE, World
from ...hits.rays import room_for_tests
from ...inputs.cameras import Cameras
from ...inputs.lights import LightArrays
from ...inputs.panes import PaneArrays
from ..ambient.from_eyes import DiffuseSteps, start_at_eyes, walk_to_first_vertices
from ..ambient.intensity import BATCH, DIFFUSE, END, MAX_BOUNCES, MIRROR, Workspace, choose_steps
from .lookup import (
    ALL,
    FEWEST_SAMPLES,
    GUARD_COLUMNS,
    GUARD_HEIGHT,
    HEIGHT,
    LEVELS,
    NOWHERE,
    Grid,
    empty_slots,
    fill_slots,
    see_guards,
    write_keys,
)

NEARLY = 1e-3  # a way whose length differs by more from the length of its link went through mirrors
# Samples per task of visibility rays.
_BATCH = 1 << 15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """Samples of cells, one row each, and the ends y of their links.

    Attributes:
        position, geometric, shading, offset: of the sample x; see `Hits`.
        end, end_normal: (n, 3) point y and its geometric normal.
        length: (n,) of the way from x to y; inf if there is no y.
        reflectivity: (n, 3) R(y), tinted by mirrors on the way; for a ray that left the scene only that tint.
        first_length: (n,) of the ray that found x.
    """

    position: Points
    geometric: Directions
    shading: Directions
    offset: Float32
    end: Points
    end_normal: Directions
    length: Float32
    reflectivity: Rgb
    first_length: Float32

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.offset)

    def rows(self, order: Int32) -> "Samples":
        """The samples in another order, in arrays with room behind them."""
        return Samples(**{f.name: _roomy([getattr(self, f.name)[order]]) for f in fields(self)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampleWalks:
    """Walks that draw samples; arguments of `draw_samples`.

    Attributes:
        depth: most mirrors that gather rays follow; 0 in a scene without mirrors.
    """

    cams: Cameras
    seed: int
    world: World
    lights: LightArrays
    depth: int = 0

    def batch(self, work: Workspace, first: int, n: int) -> Samples:
        """Draw the samples of walks first to first + n - 1."""
        start_at_eyes(self.cams, self.seed, first, n, self.world, work)
        steps = DiffuseSteps.of(n)
        left = walk_to_first_vertices(work, n, self.world, steps)
        left = self._pass_mirrors(work, left, steps.distance)
        hits, walkers = work.hits[0], work.walkers[0]
        length = steps.distance[walkers.walk[:left]]
        here: dict[str, Any] = {
            name: getattr(hits, name)[:left].copy() for name in ("position", "geometric", "shading", "offset")
        }
        walkers.throughput[:left] = 1.0
        walkers.step[:left] = DIFFUSE
        walkers.walk[:left] = np.arange(left)
        more = self._links(work, left, here["position"])
        return Samples(**here, first_length=length, **more)

    def _pass_mirrors(self, work: Workspace, n: int, distance: Float32) -> int:
        """Move the n current walks through mirrors as gather rays go; return the number of those that meet a surface.

        Args:
            distance: (n_walks,) length of the way of each walk, with that between mirrors.
        """
        ends: list[list[Any]] = []
        for bounce in range(self.depth + 1 if self.depth else 0):
            hits, walkers = work.hits[0], work.walkers[0]
            choose_steps(hits, walkers, n, True)
            goes_on = (walkers.step[:n] == MIRROR) & (bounce < self.depth)
            ends.append([array[:n][~goes_on & (hits.kind[:n] == SURFACE)] for array in (*hits, *walkers)])
            walkers.step[:n][~goes_on] = END
            start = hits.position[:n][goes_on]
            n = work.advance(n, self.world)
            away = np.linalg.norm(work.hits[0].position[:n] - start, axis=1)
            distance[work.walkers[0].walk[:n]] += away
        if ends:
            for target, *parts in zip((*work.hits[0], *work.walkers[0]), *ends, strict=True):
                n = sum(len(part) for part in parts)
                np.concatenate(parts, out=target[:n])
        return n

    def _links(self, work: Workspace, n: int, position: Points) -> dict[str, Any]:
        """Follow the links of the n current hits through mirrors to what they meet."""
        end, normal = np.zeros((n, 3), np.float32), np.ones((n, 3), np.float32)
        length, reflectivity = np.zeros(n, np.float32), np.zeros((n, 3), np.float32)
        start = position.copy()
        for _ in range(MAX_BOUNCES):
            n = work.advance(n, self.world)
            hits, walkers = work.hits[0], work.walkers[0]
            walk, surface = walkers.walk[:n], hits.kind[:n] == SURFACE
            away = np.linalg.norm(hits.position[:n] - start[walk], axis=1)
            length[walk] = np.where(surface, length[walk] + away, np.inf)
            start[walk] = hits.position[:n]
            end[walk], normal[walk] = hits.position[:n], hits.geometric[:n]
            reflectivity[walk] = walkers.throughput[:n]
            choose_steps(hits, walkers, n, True)
            self._tint(work, n, reflectivity)
            walkers.step[:n][walkers.step[:n] == DIFFUSE] = END
            n_left = int((walkers.step[:n] == MIRROR).sum())
            if n_left == 0:
                break
        return {
            "end": end,
            "end_normal": normal,
            "length": length,
            "reflectivity": reflectivity,
        }

    def _tint(self, work: Workspace, n: int, reflectivity: Rgb) -> None:
        """Multiply by R, or go on with the throughput of a mirror, divided by the probability of that choice."""
        hits, walkers = work.hits[0], work.walkers[0]
        walk, r, s = walkers.walk[:n], hits.reflectivity[:n], hits.specular[:n]
        diffuse, mirror = r.max(axis=1), s.max(axis=1)
        surface = hits.kind[:n] == SURFACE
        total = np.where(surface & (diffuse + mirror > 0), diffuse + mirror, np.float32(1.0))
        by_mirror = walkers.step[:n] == MIRROR
        kept = np.where(by_mirror, mirror, np.where(mirror > 0, diffuse, total)) / total
        part = np.where(by_mirror[:, None], s, r) / np.maximum(kept, np.float32(1e-6))[:, None]
        value = np.where(surface[:, None], walkers.throughput[:n] * part, walkers.throughput[:n])
        reflectivity[walk] = value
        walkers.throughput[:n] = value


def draw_samples(walks: SampleWalks, count: int, threads: int) -> tuple[Samples, int]:
    """Draw the samples of walks 0 to count - 1, in their order; return them and the number of rays."""
    one = walks.lights.at([0])
    free = [Workspace(one) for _ in range(threads)]

    def draw(first: int) -> Samples:
        work = free.pop()
        try:
            return walks.batch(work, first, min(BATCH, count - first))
        finally:
            free.append(work)

    works = list(free)
    with TaskPool(threads, thread_name_prefix="cells") as pool:
        parts = list(pool.map(draw, range(0, count, BATCH)))
    joined = {f.name: _roomy([getattr(part, f.name) for part in parts]) for f in fields(Samples)}
    return Samples(**joined), sum(work.rays for work in works)


def _roomy(parts: list[Any]) -> Any:
    """Join arrays into one with room behind it."""
    shape = (sum(len(part) for part in parts), *parts[0].shape[1:])
    room = with_room(shape, parts[0].dtype, fill=1)
    np.concatenate(parts, out=room)
    return room


def dim_links(samples: Samples, panes: PaneArrays) -> int:
    """Dim the light of the links of samples by the glass on their ways, except on ways through mirrors.

    Args:
        samples: changes `reflectivity`.

    Returns:
        number of rays.
    """
    start = samples.position + samples.offset[:, None] * samples.geometric
    open_sky = np.isinf(samples.length)
    way = np.where(open_sky[:, None], samples.end, samples.end - start)
    reach = np.where(open_sky, np.float32(np.inf), BEFORE).astype(np.float32)
    share, rays = transmission_along(start, way, reach, panes)
    direct = open_sky | (np.abs(np.linalg.norm(way, axis=1) - samples.length) <= NEARLY * samples.length)
    samples.reflectivity[direct] *= share[direct]
    return rays


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
    """Arguments of `find_places`."""

    grid: Grid
    samples: Samples
    tracer: Tracer
    pool: TaskPool

    def keys(self, level: int) -> Addresses:
        """The key of each sample's cell of a level."""
        keys = np.empty(self.samples.n, np.int64)
        write_keys(self.grid, level, self.samples.position, self.samples.geometric, keys)
        return keys

    def see(self, rows: Int32, guards: Float32) -> Flags:
        """Flags of the samples that see their guards, (n, GUARD_COLUMNS)."""
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
    numbers = [-1, *reversed(range(LEVELS))] if work.samples.n else [-1]
    levels, starts = [_all_surfaces(work.samples.n)], [ALL, ALL + 1]
    for level in numbers[1:]:
        levels.append(_find_level(work, level, starts[-1], levels[-1].own))
        starts.append(starts[-1] + len(levels[-1].sizes))
    slots = empty_slots(starts[-1])
    for found, start in zip(levels, starts, strict=False):
        fill_slots(found.keys, start, slots)
    sizes = np.concatenate([found.sizes for found in levels])
    return Places(
        slots=slots,
        other=np.concatenate([found.other for found in levels]),
        guard=np.concatenate([found.guard for found in levels]),
        level=np.repeat(np.array(numbers, np.int32), [len(found.sizes) for found in levels]),
        first=np.concatenate([[0], np.cumsum(sizes)]),
        sample=np.concatenate([found.sample for found in levels]),
        rays=sum(found.rays for found in levels),
    )


def _all_surfaces(n_samples: int) -> _Level:
    """The cell of all surfaces, which has no key and lists no samples."""
    return _Level(
        keys=np.empty(0, np.int64), sizes=np.zeros(1, np.int64), sample=np.empty(0, np.int32),
        other=np.full(1, NOWHERE, np.int32), guard=np.zeros((1, GUARD_COLUMNS), np.float32),
        own=np.full(n_samples, ALL, np.int32), rays=0,
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
