"""The samples of cells: where gather rays will land, and one ray from each to what lights it.

Walks start at eyes of the whole camera path and leave what those see diffusely. Their first vertices are the samples.
From each sample one ray of density cos(theta) / pi goes on: a link to the cell that it meets.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Bytes, Directions, Float32, Int32, Points, Rgb, with_room
from framearray_cli.base.threads import TaskPool

from ...hits.hits import SURFACE, World
from ...inputs.cameras import Cameras
from ...inputs.lights import LightArrays
from ..ambient.estimate import BATCH, Workspace, choose_steps
from ..ambient.from_eyes import DiffuseSteps, start_at_eyes, walk_to_first_vertices
from ..ambient.walks import DIFFUSE, END, MAX_BOUNCES, MIRROR
from .table import write_sides


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """Samples of cells, one row each, and the ends y of their links.

    Attributes:
        position, geometric, shading, offset, side: of the sample x; see `Hits` and `side_of`.
        end, end_normal, end_side: (n, 3) point y, its geometric normal, and the direction that it faces.
        length: (n,) of the way from x to y; inf if there is no y.
        reflectivity: (n, 3) R(y), tinted by mirrors on the way; for a ray that left the scene only that tint.
        first_length: (n,) of the ray that found x.
    """

    position: Points
    geometric: Directions
    shading: Directions
    offset: Float32
    side: Bytes
    end: Points
    end_normal: Directions
    end_side: Bytes
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
    """Where walks start, and what they meet; arguments of `draw_samples`.

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
        start_at_eyes(self.cams, self.seed, first, n, self.world, work.hit_packets, work.hits[0], work.walkers[0])
        steps = DiffuseSteps(
            reflectivity=np.zeros((n, 3), np.float32),
            position=np.zeros((n, 3), np.float32),
            distance=np.full(n, np.nan, np.float32),
        )
        work.rays += n
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
        return Samples(**here, side=sides(here["geometric"]), first_length=length, **more)

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
            "end_side": sides(normal),
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


def sides(normal: Float32) -> Bytes:
    """The direction that each normal faces."""
    sides = np.empty(len(normal), np.uint8)
    write_sides(np.ascontiguousarray(normal), sides)
    return sides
