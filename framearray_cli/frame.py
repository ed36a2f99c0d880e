"""One frame's share of the work: native hits, their terms, and where the frames around see them.

The hits of a frame are found in batches, each by one thread, each into its own slice of the frame's arrays; nothing
depends on which thread takes which batch.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import SimpleQueue
from time import perf_counter
from typing import Any

import numpy as np

from .arrays import Float32, Float64, Int32, Rgb
from .camera import Cameras
from .embree.packets import Tracer
from .hits import ESCAPED, SURFACE, Hits, empty_hits, extra_hits, native_hits, pilot_hits, pixel_order
from .lights import LightArrays
from .plan import Pass, flag_mirrors, passes
from .rays import room_for_hits, room_for_tests
from .reuse import balance_weights, outer_hits, sort_by_pixel
from .sampling import HOLE_SAMPLE
from .surface import Surfaces
from .terms.direct import direct
from .terms.direct_steps import direct_by_steps, room_for_steps
from .terms.obscurance import ObscuranceSettings, obscurance
from .terms.specular import count_mirrors, reflect

# Hits of a batch: large enough that calls cost nothing, small enough that all their arrays stay in a core's cache.
BATCH = 2048
# Rays traced together within a batch.
RAYS = 4096


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Work:
    """Everything that the terms of every frame need, as kernels take it.

    Attributes:
        per_pixel: (n_c,) native hits a pixel of every frame.
        mirror_hits: native hits of a pixel that sees a mirror, if more; 0 in a scene without mirrors.
        depth: mirror bounces that are followed; 0 in a scene without mirrors.
        balance: weights of hits by the balance heuristic, else all alike.
        background: (3,) radiance outside the scene.
        shadow_step, shadow_unbiased: see `terms/direct_steps.py`; step 1 tests every light position.
        layers: whether normals and depths are kept for the layers.
        denoise: whether W is denoised in composing.
    """

    cams: Cameras
    surfaces: Surfaces
    tracer: Tracer
    lights: LightArrays
    obscurance: ObscuranceSettings
    seed: int
    n_r: int
    per_pixel: Float64
    mirror_hits: int
    depth: int
    balance: bool
    background: Rgb
    shadow_step: int
    shadow_unbiased: bool
    layers: bool
    denoise: bool = False
    order: Int32 = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", pixel_order(self.cams.width, self.cams.height))

    @property
    def n_frames(self) -> int:
        return len(self.per_pixel)

    @property
    def n_pixels(self) -> int:
        return self.cams.width * self.cams.height

    @property
    def has_constant(self) -> bool:
        """Whether anything a pixel shows is the same under every light."""
        return bool(self.background.any())

    def frames_around(self, c: int, reach: int) -> range:
        """The frames of the path from c - reach to c + reach."""
        return range(max(c - reach, 0), min(c + reach, self.n_frames - 1) + 1)


@dataclass(slots=True, kw_only=True, eq=False)
class Records:
    """What composing needs of n hits: reflectivity, W, what is the same under every light, and E of every light."""

    reflectivity: Rgb
    obscurance: Rgb
    constant: Rgb
    irradiance: Float32


@dataclass(slots=True, kw_only=True, eq=False)
class Placed:
    """Hits sorted by the pixel of one frame that they fall into; see `sort_by_pixel`."""

    start: Int32
    order: Int32


@dataclass(slots=True, kw_only=True, eq=False)
class Frame:
    """The hits that eye c found.

    Attributes:
        records: of the native hits.
        places: frame j -> where its pixels see them.
        weights: frame j -> (n,) weight of each hit there, or (0,) where all weigh alike.
        mirrored, mirror_places: reflected hits of the frame's own mirror pixels; None in a scene without mirrors.
        mirror_hits: (n_pixels,) native hits of each pixel whose mirrors were followed; (0,) without mirrors.
        normal, depth: (n, 3) and (n,) of native hits, for the layers; (0, 3) and (0,) without.
        kept: the large arrays of the above, by name, for the shelf.
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

    def put_back(self, shelf: "Shelf") -> None:
        """Give the frame's memory to the next one; the frame is of no use afterwards."""
        for name, array in self.kept.items():
            shelf.give(name, array)


class Shelf:
    """Arrays of frames that were dropped, for the next frame to use: fresh memory costs the system a page at a time."""

    def __init__(self) -> None:
        self._kept: dict[str, list[Any]] = {}

    def take(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        """An array of a shape, contents arbitrary; kept ones of that name and another shape are let go."""
        kept = self._kept.get(name, [])
        while kept:
            array = kept.pop()
            if array.shape == shape:
                return array
        return np.empty(shape, dtype)

    def give(self, name: str, array: Any) -> None:
        """Put an array back that nobody reads any more."""
        self._kept.setdefault(name, []).append(array)


class Scratch:
    """One thread's arrays, kept from batch to batch."""

    def __init__(self, work: Work) -> None:
        n_eyes = 4 * work.n_r + 1
        rays = max(RAYS, work.obscurance.n_rays)
        self.hit_rays = room_for_hits(rays)
        self.test_rays = room_for_tests(RAYS, work.lights.n_lights)
        self.hits = empty_hits(BATCH)
        self.reflected = [empty_hits(BATCH), empty_hits(BATCH)] if work.depth else []
        self.throughput = [np.empty((BATCH, 3), np.float32) for _ in self.reflected]
        self.steps = room_for_steps(work.lights.n_lights) if work.shadow_step > 1 else None
        self.pixel = np.empty((n_eyes, BATCH), np.int32)
        self.density = np.empty((n_eyes, BATCH), np.float64)
        self.skylight = np.empty((BATCH if work.obscurance.sky else 0, 3), np.float32)
        self.rays: Counter[str] = Counter()
        self.seconds: defaultdict[str, float] = defaultdict(float)


class Crew:
    """The threads that work on a frame, and their scratch arrays."""

    def __init__(self, work: Work, threads: int) -> None:
        self.threads = threads
        self.shelf = Shelf()
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="trace")
        self._scratch: SimpleQueue[Scratch] = SimpleQueue()
        self._all = [Scratch(work) for _ in range(threads)]
        for scratch in self._all:
            self._scratch.put(scratch)

    def run(self, task: Callable[[Any, Scratch], Any], items: Iterable[Any]) -> list[Any]:
        """`task(item, scratch)` for every item, in any order on all threads; results in the order of the items."""

        def with_scratch(item: Any) -> Any:
            scratch = self._scratch.get()
            try:
                return task(item, scratch)
            finally:
                self._scratch.put(scratch)

        futures: list[Future[Any]] = [self._pool.submit(with_scratch, item) for item in items]
        try:
            return [future.result() for future in futures]
        except BaseException:
            for future in futures:
                future.cancel()
            raise

    def rays(self) -> Counter[str]:
        """Rays traced so far, by kind."""
        return sum((scratch.rays for scratch in self._all), Counter())

    def seconds(self) -> dict[str, float]:
        """Thread seconds spent so far, by stage."""
        stages = dict.fromkeys(stage for scratch in self._all for stage in scratch.seconds)
        return {stage: sum(scratch.seconds[stage] for scratch in self._all) for stage in stages}

    def close(self) -> None:
        """Wait for running tasks and end the threads."""
        self._pool.shutdown(wait=True, cancel_futures=True)


def find_frame(work: Work, c: int, crew: Crew) -> Frame:
    """Find the native hits of eye c, estimate their terms, and place them in the frames that see them."""
    parts = passes(work.order, work.cams.width, c, float(work.per_pixel[c]))
    n = sum(part.n for part in parts)
    frames = work.frames_around(c, work.n_r)
    take = crew.shelf.take
    irradiance = take("irradiance", (n, work.lights.channels, work.lights.n_lights), np.float32)
    records = _empty_records(work, n, irradiance)
    pixel = take("pixel", (len(frames), n), np.int32)
    order = take("order", (len(frames), n), np.int32)
    weight = take("weight", (len(frames), n if work.balance else 0), np.float32)
    kept = n if work.layers or work.denoise else 0
    normal, depth = np.empty((kept, 3), np.float32), np.empty(kept, np.float32)

    def batch(task: tuple[Pass, int], scratch: Scratch) -> list[tuple[Int32, Records]]:
        part, first = task
        m = min(BATCH, part.n - first)
        span = slice(part.first_hit + first, part.first_hit + first + m)
        _native(work, c, part, first, m, scratch)
        hits = scratch.hits
        if kept:
            normal[span], depth[span] = hits.shading[:m], _depths(work.cams, c, hits, m)
        _terms(work, hits, m, scratch, _slice(records, span), "obscurance", "shadow")
        _place(work, c, m, scratch, frames, pixel[:, span], weight[:, span])
        return _mirror_paths(work, hits, m, scratch) if work.depth else []

    tasks = [(part, first) for part in parts for first in range(0, part.n, BATCH)]
    mirrored = [path for paths in crew.run(batch, tasks) for path in paths]
    mirror_hits = np.empty(0, np.int32)
    if work.depth:
        extra, mirror_hits = _extra_mirror_hits(work, c, parts, crew)
        mirrored += extra

    def sort(row: int, _scratch: Scratch) -> Placed:
        return _placed(pixel[row], work.n_pixels, order[row])

    places = dict(zip(frames, crew.run(sort, range(len(frames))), strict=True))
    crew.shelf.give("pixel", pixel)
    all_mirrored = _joined(work, mirrored) if work.depth else None
    return Frame(
        c=c,
        records=records,
        places=places,
        weights={j: weight[row] for row, j in enumerate(frames)},
        kept={"irradiance": irradiance, "order": order, "weight": weight},
        mirrored=all_mirrored[1] if all_mirrored else None,
        mirror_places=_placed(all_mirrored[0], work.n_pixels) if all_mirrored else None,
        mirror_hits=mirror_hits,
        normal=normal,
        depth=depth,
    )


def _empty_records(work: Work, n: int, irradiance: Float32 | None = None) -> Records:
    if irradiance is None:
        irradiance = np.empty((n, work.lights.channels, work.lights.n_lights), np.float32)
    return Records(
        reflectivity=np.empty((n, 3), np.float32),
        obscurance=np.empty((n, 3), np.float32),
        constant=np.empty((n if work.has_constant else 0, 3), np.float32),
        irradiance=irradiance,
    )


def _slice(records: Records, span: slice) -> Records:
    return Records(
        reflectivity=records.reflectivity[span],
        obscurance=records.obscurance[span],
        constant=records.constant[span],
        irradiance=records.irradiance[span],
    )


def fill_holes(work: Work, c: int, pixels: Int32, crew: Crew) -> list[tuple[Placed, Records]]:
    """One native hit for each of some pixels of eye c that nothing else reaches; then what mirrors show there."""
    n = len(pixels)
    records = _empty_records(work, n)

    def batch(first: int, scratch: Scratch) -> list[tuple[Int32, Records]]:
        m = min(BATCH, n - first)
        extra_hits(
            work.cams, c, work.seed, pixels, HOLE_SAMPLE, 1, first, m, work.surfaces, work.tracer,
            scratch.hit_rays.packets, scratch.hits,
        )  # fmt: skip
        scratch.rays["native"] += m
        _terms(work, scratch.hits, m, scratch, _slice(records, slice(first, first + m)), "obscurance", "shadow")
        return _mirror_paths(work, scratch.hits, m, scratch) if work.depth else []

    mirrored = [path for paths in crew.run(batch, range(0, n, BATCH)) for path in paths]
    found = [(_placed(pixels, work.n_pixels), records)]
    if mirrored:
        where, reflected = _joined(work, mirrored)
        found.append((_placed(where, work.n_pixels), reflected))
    return found


def _native(work: Work, c: int, part: Pass, first: int, n: int, scratch: Scratch) -> None:
    started = perf_counter()
    native_hits(
        work.cams, c, work.seed, part.pixels, part.per_pixel, part.first_sample, first, n, work.surfaces, work.tracer,
        work.depth > 0, scratch.hit_rays.packets, scratch.hits,
    )  # fmt: skip
    scratch.rays["native"] += n
    scratch.seconds["native"] += perf_counter() - started


def _depths(cams: Cameras, c: int, hits: Hits, n: int) -> Float32:
    """Distance along the optical axis of eye c; 0 for escaped rays."""
    depth: Float32 = (hits.position[:n] - cams.position[c]) @ cams.forward[c]
    hits.shading[:n][hits.kind[:n] == ESCAPED] = 0.0
    return np.where(hits.kind[:n] == SURFACE, depth, np.float32(0.0))


def _terms(
    work: Work, hits: Hits, n: int, scratch: Scratch, out: Records, obscurance_kind: str, shadow_kind: str
) -> None:
    """Estimate W, the constant part and E[l] of hits 0 to n - 1."""
    started = perf_counter()
    scratch.rays[obscurance_kind] += obscurance(
        hits, n, work.obscurance, work.surfaces, work.tracer, scratch.hit_rays, out.obscurance, scratch.skylight
    )
    middle = perf_counter()
    if scratch.steps is None:
        rays = direct(hits, n, work.lights, work.tracer, scratch.test_rays, out.irradiance)
    else:
        rays = direct_by_steps(
            hits, n, work.lights, work.shadow_step, work.shadow_unbiased, work.tracer, scratch.test_rays,
            scratch.steps, out.irradiance,
        )  # fmt: skip
    scratch.rays[shadow_kind] += rays
    out.reflectivity[:n] = hits.reflectivity[:n]
    if work.has_constant:
        seen = (hits.kind[:n, None] == ESCAPED) * work.background
        out.constant[:n] = seen + hits.reflectivity[:n] * scratch.skylight[:n] if work.obscurance.sky else seen
    scratch.seconds[obscurance_kind] += middle - started
    scratch.seconds[shadow_kind] += perf_counter() - middle


def _place(work: Work, c: int, n: int, scratch: Scratch, frames: range, pixel: Int32, weight: Float32) -> None:
    """Find the pixel of every frame around that sees each native hit, and the hit's weight there."""
    if work.n_r == 0:  # nothing to project: a hit belongs to its own pixel
        pixel[0] = scratch.hits.pixel[:n]
        weight[:] = 1.0
        return
    started = perf_counter()
    eyes = work.frames_around(c, 2 * work.n_r) if work.balance else frames
    seen, density = scratch.pixel[: len(eyes)], scratch.density[: len(eyes)]
    scratch.rays["visibility"] += outer_hits(
        work.cams, c, eyes.start, scratch.hits, n, work.tracer, scratch.test_rays, seen, density
    )
    first = frames.start - eyes.start
    pixel[:] = seen[first : first + len(frames), :n]
    if work.balance:
        balance_weights(work.per_pixel, work.n_r, eyes.start, frames.start, n, seen, density, weight)
    scratch.seconds["visibility"] += perf_counter() - started


def _mirror_paths(work: Work, hits: Hits, n: int, scratch: Scratch) -> list[tuple[Int32, Records]]:
    """Follow the mirrors among hits 0 to n - 1; a (pixels, records) pair a bounce."""
    found: list[tuple[Int32, Records]] = []
    started = perf_counter()
    throughput = np.ones((n, 3), np.float32)
    for bounce in range(work.depth):
        m = count_mirrors(hits, n)
        if m == 0:
            break
        reflected, next_throughput = scratch.reflected[bounce % 2], scratch.throughput[bounce % 2]
        reflect(hits, n, throughput, work.surfaces, work.tracer, scratch.hit_rays.packets, reflected, next_throughput)
        scratch.rays["mirror"] += m
        hits, n, throughput = reflected, m, next_throughput
        records = _empty_records(work, m)
        _terms(work, hits, m, scratch, records, "mirror obscurance", "mirror shadow")
        records.reflectivity *= throughput[:m]
        records.constant *= throughput[:m] if work.has_constant else 1.0
        found.append((hits.pixel[:m].copy(), records))
    scratch.seconds["mirror"] += perf_counter() - started
    return found


def _extra_mirror_hits(
    work: Work, c: int, parts: tuple[Pass, ...], crew: Crew
) -> tuple[list[tuple[Int32, Records]], Int32]:
    """Follow the native hits that only mirror pixels have; returns them and the number of native hits of each pixel."""
    most = sum(part.per_pixel for part in parts)
    least = int(work.per_pixel[c])
    extra = max(work.mirror_hits - least, 0)
    flags = np.zeros(work.n_pixels, np.uint8)

    def look(first: int, scratch: Scratch) -> None:
        n = min(BATCH, work.n_pixels - first)
        hits = scratch.hits
        pilot_hits(work.cams, c, work.order, first, n, work.surfaces, work.tracer, scratch.hit_rays.packets, hits)
        scratch.rays["pilot"] += n
        flag_mirrors(hits, n, work.cams.width, work.cams.height, flags)

    def follow(first: int, scratch: Scratch) -> list[tuple[Int32, Records]]:
        n = min(BATCH, len(pixels) * extra - first)
        extra_hits(
            work.cams, c, work.seed, pixels, most, extra, first, n, work.surfaces, work.tracer,
            scratch.hit_rays.packets, scratch.hits,
        )  # fmt: skip
        scratch.rays["mirror"] += n
        return _mirror_paths(work, scratch.hits, n, scratch)

    if extra:
        crew.run(look, range(0, work.n_pixels, BATCH))
    pixels = work.order[flags[work.order] > 0]
    found = crew.run(follow, range(0, len(pixels) * extra, BATCH)) if extra else []
    own = extra * flags.astype(np.int32)
    for part in parts:
        own[part.pixels] += part.per_pixel
    return [path for batch in found for path in batch], own


def _joined(work: Work, parts: list[tuple[Int32, Records]]) -> tuple[Int32, Records]:
    """One list of reflected hits from those of all batches, in their order."""
    if not parts:
        return np.empty(0, np.int32), _empty_records(work, 0)
    pixels, records = zip(*parts, strict=True)
    return np.concatenate(pixels), Records(
        reflectivity=np.concatenate([r.reflectivity for r in records]),
        obscurance=np.concatenate([r.obscurance for r in records]),
        constant=np.concatenate([r.constant for r in records]),
        irradiance=np.concatenate([r.irradiance for r in records]),
    )


def _placed(pixel: Int32, n_pixels: int, order: Int32 | None = None) -> Placed:
    if order is None:
        order = np.empty(len(pixel), np.int32)
    placed = Placed(start=np.empty(n_pixels + 1, np.int32), order=order)
    sort_by_pixel(pixel, n_pixels, placed.start, placed.order)
    return placed
