"""One frame's share of the work: native hits, their terms, and where the frames around see them.

The hits of a frame are found in batches, each by one thread, each into its own slice of the frame's arrays; nothing
depends on which thread takes which batch.
"""

from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from .arrays import Float32, Int32
from .camera import Cameras
from .crew import Crew, Scratch, Shelf
from .eyehits import extra_hits, native_hits
from .hits import ESCAPED, SURFACE, Hits
from .mirrors import extra_mirror_hits, mirror_paths
from .plan import Pass
from .reuse import balance_weights, expect_hits, of_one_hit, outer_hits, sort_by_pixel
from .sampling import HOLE_SAMPLE
from .shading import estimate_terms
from .work import BY_SAMPLE, Placed, Records, Work, empty_records


@dataclass(slots=True, kw_only=True, eq=False)
class Frame:
    """The hits that eye c found.

    Attributes:
        records: of the native hits.
        places: frame j -> where its pixels see them.
        weights: frame j -> (n,) weight of each hit there, or (0,) where all weigh alike.
        mirrored, mirror_places: reflected hits of the frame's own mirror pixels; None in a scene without mirrors.
        mirror_hits: (2, n_pixels) native hits of each pixel whose mirrors were followed, of even and of odd sample
            numbers; (2, 0) without mirrors.
        normal, depth: (n, 3) and (n,) of native hits, for the layers; (0, 3) and (0,) without.
        kept: the large arrays of the above but those of mirrors, by name, for the shelf.
    """

    c: int
    records: Records
    places: dict[int, Placed]
    weights: dict[int, Float32]
    mirrored: Records | None
    mirror_places: Placed | None
    mirror_hits: Int32
    normal: Float32
    depth: Float32
    kept: dict[str, Any]

    def forget_mirrors(self, shelf: Shelf) -> None:
        """Give the memory of what the frame's own mirrors show to the next one, once the frame is composed."""
        if self.mirrored:
            for name, array in self.mirrored.arrays.items():
                shelf.give(f"mirrored {name}", array)
        self.mirrored = self.mirror_places = None

    def put_back(self, shelf: Shelf) -> None:
        """Give the frame's memory to the next one; the frame is of no use afterwards."""
        for name, array in self.kept.items():
            shelf.give(name, array)


def find_frame(work: Work, c: int, crew: Crew) -> Frame:
    """Find the native hits of eye c, estimate their terms, and place them in the frames that see them."""
    parts = work.passes(c)
    n = sum(part.n for part in parts)
    frames = work.frames_around(c, work.n_r)
    take = crew.shelf.take
    records = empty_records(work, n, take)
    pixel = take("pixel", (len(frames), n), np.int32)
    order = take("order", (len(frames), n), np.int32)
    weight = take("weight", (len(frames), n if work.balance else 0), np.float32)
    kept = n if work.layers or work.denoise else 0
    normal, depth = np.empty((kept, 3), np.float32), np.empty(kept, np.float32)

    def batch(task: tuple[Pass, int, int], scratch: Scratch) -> list[tuple[Int32, Records]]:
        part, first, m = task
        span = slice(part.first_hit + first, part.first_hit + first + m)
        _native(work, c, part, first, m, scratch)
        hits = scratch.hits
        if kept:
            normal[span], depth[span] = hits.shading[:m], _depths(work.cams, c, hits, m)
        estimate_terms(work, hits, m, scratch, records.part(span), "obscurance", "shadow")
        _place(work, c, m, scratch, frames, pixel[:, span], weight[:, span])
        return mirror_paths(work, hits, m, scratch) if work.depth else []

    tasks = [(part, first, m) for part in parts for first, m in crew.batches(part.n)]
    mirrored = [path for paths in crew.run(batch, tasks) for path in paths]
    mirror_hits = take("mirror_hits", (2, work.n_pixels if work.depth else 0), np.int32)
    if work.depth:
        mirrored += extra_mirror_hits(work, c, parts, crew, mirror_hits)
    places = dict(zip(frames, _sorted(pixel, work.n_pixels, order, crew), strict=True))
    crew.shelf.give("pixel", pixel)
    all_mirrored = _joined(work, mirrored, crew) if work.depth else None
    return Frame(
        c=c,
        records=records,
        places=places,
        weights={j: weight[row] for row, j in enumerate(frames)},
        kept={**records.arrays, "order": order, "weight": weight, "mirror_hits": mirror_hits},
        mirrored=all_mirrored[1] if all_mirrored else None,
        mirror_places=_placed(all_mirrored[0], work.n_pixels, crew) if all_mirrored else None,
        mirror_hits=mirror_hits,
        normal=normal,
        depth=depth,
    )


def fill_holes(work: Work, c: int, pixels: Int32, crew: Crew) -> list[tuple[Placed, Records]]:
    """One native hit for each of some pixels of eye c that nothing else reaches; then what mirrors show there."""
    n = len(pixels)
    records = empty_records(work, n)

    def batch(first: int, scratch: Scratch) -> list[tuple[Int32, Records]]:
        m = min(crew.batch, n - first)
        extra_hits(
            work.cams, c, work.seed, pixels, HOLE_SAMPLE, 1, first, m, work.surfaces, work.tracer,
            scratch.hit_rays.packets, scratch.hits,
        )  # fmt: skip
        scratch.rays["native"] += m
        estimate_terms(work, scratch.hits, m, scratch, records.part(slice(first, first + m)), "obscurance", "shadow")
        return mirror_paths(work, scratch.hits, m, scratch) if work.depth else []

    mirrored = [path for paths in crew.run(batch, range(0, n, crew.batch)) for path in paths]
    found = [(_placed(pixels, work.n_pixels, crew), records)]
    if mirrored:
        where, reflected = _joined(work, mirrored, crew)
        found.append((_placed(where, work.n_pixels, crew), reflected))
    return found


def _joined(work: Work, parts: list[tuple[Int32, Records]], crew: Crew) -> tuple[Int32, Records]:
    """One list of reflected hits from those of all batches, in their order."""
    ends = np.cumsum([0, *(len(pixels) for pixels, _ in parts)])
    n = int(ends[-1])

    def take(name: str, *shape_and_type: Any) -> Any:
        return crew.shelf.take(f"mirrored {name}", *shape_and_type)

    pixel, whole = np.empty(n, np.int32), empty_records(work, n, take)

    def copy(first: int, _scratch: Scratch) -> None:
        for part in range(first, len(parts), crew.threads):
            span = slice(ends[part], ends[part + 1])
            pixel[span] = parts[part][0]
            for name, array in parts[part][1].arrays.items():
                whole.arrays[name][span] = array

    crew.run(copy, range(crew.threads))
    return pixel, whole


def _placed(pixel: Int32, n_pixels: int, crew: Crew) -> Placed:
    """Sort hits by the pixel that they fall into."""
    return _sorted(pixel[None], n_pixels, np.empty((1, len(pixel)), np.int32), crew)[0]


def _sorted(pixel: Int32, n_pixels: int, order: Int32, crew: Crew) -> list[Placed]:
    """Hits sorted by the pixels of every frame, (n_frames, n); a few frames are cut into ranges, one a thread."""
    places = [Placed(start=np.empty(n_pixels + 1, np.int32), order=row) for row in order]
    parts = -(-crew.threads // len(places))
    cuts = [n_pixels * part // parts for part in range(parts + 1)]

    def sort(task: tuple[int, int, int], _scratch: Scratch) -> None:
        row, first, last = task
        sort_by_pixel(pixel[row], first, last, places[row].start, places[row].order)

    crew.run(sort, [(row, *span) for row in range(len(places)) for span in pairwise(cuts)])
    return places


def _native(work: Work, c: int, part: Pass, first: int, n: int, scratch: Scratch) -> None:
    started = perf_counter()
    native_hits(
        work.cams, c, work.seed, part.pixels, part.per_pixel, part.first_sample, first, n, work.surfaces, work.tracer,
        work.depth > 0, scratch.hit_rays.packets, scratch.hits, work.halves == BY_SAMPLE,
    )  # fmt: skip
    scratch.rays["native"] += n
    scratch.seconds["native"] += perf_counter() - started


def _depths(cams: Cameras, c: int, hits: Hits, n: int) -> Float32:
    """Distance along the optical axis of eye c; 0 for escaped rays."""
    depth: Float32 = (hits.position[:n] - cams.position[c]) @ cams.forward[c]
    hits.shading[:n][hits.kind[:n] == ESCAPED] = 0.0
    return np.where(hits.kind[:n] == SURFACE, depth, np.float32(0.0))


def _place(work: Work, c: int, n: int, scratch: Scratch, frames: range, pixel: Int32, weight: Float32) -> None:
    """Find the pixel of every frame around that sees each native hit, and the hit's weight there."""
    if work.n_r == 0:  # nothing to project: a hit belongs to its own pixel
        pixel[0] = scratch.hits.pixel[:n]
        weight[:] = 1.0
        return
    started = perf_counter()
    eyes = work.frames_around(c, 2 * work.n_r) if work.balance else frames
    seen = scratch.pixel[: len(eyes)]
    density = scratch.density[: len(eyes)]
    scratch.rays["visibility"] += outer_hits(
        work.cams, c, eyes.start, scratch.hits, n, work.tracer, scratch.test_rays, seen, density
    )
    first = frames.start - eyes.start
    pixel[:] = seen[first : first + len(frames), :n]
    if work.balance:
        per_pixel = work.per_pixel
        if work.allotment is not None:
            of_pixel, hits = work.allotment.blocks.of_pixel, work.allotment.hits
            expect_hits(hits, of_pixel, eyes.start, n, seen, density)
            per_pixel = np.ones_like(per_pixel)
        balance_weights(per_pixel, work.n_r, eyes.start, frames.start, n, seen, density, weight)
        if work.allotment is not None:
            of_one_hit(hits, of_pixel, frames.start, n, pixel, weight)
    scratch.seconds["visibility"] += perf_counter() - started
