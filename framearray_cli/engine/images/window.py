"""The window: the hits of at most 2 N_r + 1 eyes, from which one frame is composed at a time.

The window holds lists of hits, not sums. A hit with its irradiance under every light is stored once and read by the
2 N_r + 1 frames that show it; buffers of sums would be read and written once per frame that contributes
(docs/decisions/reuse.md).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from copy import copy
from time import perf_counter

import numpy as np

from framearray_cli.base.arrays import Addresses, Flags, Float32, Images, Int32, Rgb, with_room

from ..frames.frame import FrameHits, fill_holes
from ..frames.records import BY_SAMPLE, INDIRECT, REFLECTIVITY, HitRecords, HitsByPixel
from ..frames.scratch import Scratch
from ..frames.setup import FrameSetup
from ..frames.threads import TracePool
from ..inputs.cameras import viewpoint
from ..terms.ambient.estimate import Ambient
from .accumulate import accumulate
from .area_weights import AreaWeights
from .band import Band, Finish, as_stored, empty_band
from .compose import Pixels, Summands, average_native, compose_differences, compose_pixels, weigh_halves
from .composed import Composed, layers_of
from .denoise import denoise_obscurance
from .gloss_view import GlossView, gloss_view
from .marks import MarkRoom
from .sources import NO_SCALE, NO_SOURCES, HitSource, SourceList
from .standard_error import fill_unknown, half_factors
from .strengths import strengths
from .sun_hours import average_sun_hours, sun_layers

# Pixels of a band, whose sums over all lights fit a core's cache, and pixels of a task.
BAND_PIXELS, TASK_PIXELS = 256, 2048


class Window:
    """The hits of at most 2 N_r + 1 eyes; composes frames from them. `ready_frames` in loop.py fills it."""

    def __init__(self, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> None:
        """Open an empty window.

        Args:
            ambient: of all lights that `setup` computes.
        """
        self._setup = setup
        self._pool = pool
        # corrections of unbiased shadows may make a dark pixel negative; cut at 0, their mean would be biased
        lowest = -np.inf if setup.shadow_unbiased and setup.shadow_step > 1 else 0.0
        self._finish = Finish(
            colour=self._by_channel(setup.lights.colour),
            ambient=self._ambient(ambient),
            light_independent_from=setup.light_independent_from,
            lowest=np.float32(lowest),
        )
        self._frames: dict[int, FrameHits] = {}
        self._holes: dict[int, list[tuple[HitsByPixel, HitRecords]]] = {}
        self._area = AreaWeights((setup.cams.width, setup.cams.height))
        self._strength, strength = strengths(setup)
        self._gloss = gloss_view(setup)
        self._bands = [empty_band(BAND_PIXELS, len(setup.kept), strength) for _ in range(pool.threads)]

    def _view(self, j: int) -> GlossView:
        """How eye j sees glossy hits."""
        return self._gloss._replace(eye=viewpoint(self._setup.cams, j)[None]) if self._setup.shiny else self._gloss

    def add(self, frame: FrameHits) -> None:
        """Add the hits of the next eye of the path."""
        self._frames[frame.c] = frame

    def fill_holes(self, j: int) -> None:
        """Trace hits for the pixels of frame j that no hit of its window reaches; all eyes of the window were added."""
        self._holes[j] = self._trace_holes(j)

    def drop(self, j: int, needed: int) -> None:
        """Drop what only frames up to j show, holes and reflected hits, and all hits of eyes before `needed`."""
        arrays = self._pool.arrays
        self._holes.pop(j, None)
        for c in [c for c in self._frames if c <= j or c < needed]:
            self._frames[c].forget_mirrors(arrays)
            if c < needed:
                self._frames.pop(c).put_back(arrays)

    def with_ambient(self, ambient: Ambient) -> "Window":
        """The same window under another ambient light."""
        window = copy(self)
        window._finish = self._finish._replace(ambient=self._ambient(ambient))
        return window

    def _by_channel(self, values: Rgb) -> Rgb:
        """Values of the kept lights, (3, n_kept) as the sums, from those of all lights, (n_lights, 3)."""
        kept = self._setup.kept
        found: Rgb = with_room((3, len(kept)), np.float32, fill=0)
        found[:] = values[kept.start : kept.stop].T
        return found

    def _ambient(self, ambient: Ambient) -> Rgb:
        """I_A of the kept lights, (3, n_kept); 0 where cells take its place."""
        intensity = ambient.intensity
        return self._by_channel(intensity if self._setup.cells is None else np.zeros_like(intensity))

    @contextmanager
    def _band(self) -> Iterator[Band]:
        """Lend the sums of a band to a task; the next task gets them even if this one fails."""
        band = self._bands.pop()
        try:
            yield band
        finally:
            self._bands.append(band)

    @contextmanager
    def _weighed(self, hits: SourceList, first: int, n: int) -> Iterator[tuple[Addresses, Int32]]:
        """Lend the hits of pixels first to first + n - 1 with their weights; and by area, the number in each pixel."""
        if not self._setup.area:
            yield hits.addresses, np.empty(0, np.int32)
            return
        with self._area.weighed(hits, first, n) as weighed:
            yield weighed.addresses, weighed.own

    def compose(self, j: int, images: Images, eyes: Sequence[int] | None = None) -> Composed:
        """Compose frame j, after all eyes of its window were added and its holes filled.

        Args:
            images: (n_lights, height, width, 3), overwritten; float32, or float16 if files store halves.
            eyes: average only the hits of these eyes, and leave pixels that none of them reaches black; None: of all.
        """
        setup = self._setup
        flat = as_stored(images.reshape(len(images), setup.n_pixels, 3))
        layered = setup.n_pixels if setup.layers else 0
        maps, own = np.empty((layered, 9), np.float32), np.empty((layered, 4), np.float32)
        samples, days = np.empty(setup.n_pixels, np.int32), setup.sun.days if setup.sun else ()
        sun_hours = np.empty((setup.n_pixels if days else 0, len(days)), np.float32)
        marks = MarkRoom(setup.marks, setup.n_pixels) if setup.marks else None
        clear = np.empty(setup.n_pixels if setup.alpha else 0, np.float32)
        holes = self._holes[j] if eyes is None else []
        mirror_scale = self._mirror_scale(j, holes)
        hits, mirrored = self._hits(j, holes[:1], eyes), self._mirrored(j, holes[1:], mirror_scale)
        smooth = (
            self._smooth_indirect(j, holes[:1], images.shape[1:3]) if setup.denoise else np.empty((0, 3), np.float32)
        )
        frame, out, view = self._frames[j], Pixels(flat, samples, maps, clear), self._view(j)

        def compose_task(first: int, scratch: Scratch) -> tuple[int, int, int, int]:
            started = perf_counter()
            n = min(TASK_PIXELS, setup.n_pixels - first)
            with self._weighed(hits, first, n) as (listed, in_pixels), self._band() as band:
                summands = Summands(listed, mirrored.addresses, setup.lights.channels, smooth, view)
                found: tuple[int, int, int, int] = compose_pixels(band, first, n, summands, self._finish, out)
                if setup.area:
                    samples[first : first + n] = in_pixels
                if days:
                    average_sun_hours(listed, first, n, sun_hours)
                if marks:
                    marks.compose(listed, first, n)
            if layered:
                native = frame.places[j]
                average_native(native.start, native.order, frame.normal, frame.depth, first, n, own)
            scratch.seconds["compose"] += perf_counter() - started
            return found

        results = self._pool.run(compose_task, range(0, setup.n_pixels, TASK_PIXELS))
        differences = self._differences(j, samples, images.shape) if setup.halves else None
        bad = sum(result[0] for result in results)
        shape = images.shape[1:3]
        return Composed(
            c=j,
            images=images,
            layers=layers_of(
                maps, own, samples, shape, sun_layers(days, sun_hours, shape), marks.layers(shape) if marks else None
            )
            if layered
            else None,
            hits=samples,
            beyond=sum(result[3] for result in results),
            bad=bad,
            first_bad=next(((l, pixel) for count, l, pixel, _ in results if count), None),
            differences=differences,
            alpha=1 - clear.reshape(shape) if setup.alpha else None,
        )

    def _differences(self, j: int, samples: Int32, shape: tuple[int, ...]) -> Float32:
        """D of the halves of the hits of frame j, (n_lights, height, width, 3); see `standard_error.py`."""
        setup, frame = self._setup, self._frames[j]
        images, known = np.empty((len(setup.kept), setup.n_pixels, 3), np.float32), np.empty(setup.n_pixels, np.bool_)
        halves = np.array([setup.half_of(c) for c in setup.eyes_of(j)], np.int32)
        tasks = [(first, min(TASK_PIXELS, setup.n_pixels - first)) for first in range(0, setup.n_pixels, TASK_PIXELS)]
        hits, sources = self._hits(j, []), [] if setup.area else self._halved_sources(j, halves, tasks, known)
        if frame.mirrored is not None and frame.mirror_places is not None:
            even, odd = half_factors(frame.mirror_hits)
            sources.append(HitSource(frame.mirror_places, frame.mirrored, scale=even, odd_scale=odd))
        listed, how = SourceList(sources), self._finish._replace(lowest=np.float32(-np.inf))
        view = self._view(j)

        def compose_task(task: tuple[int, int], _scratch: Scratch) -> None:
            by_area = self._area.halved(hits, halves, *task, known) if setup.area else nullcontext(NO_SOURCES)
            with by_area as addresses, self._band() as band:
                addresses = np.concatenate([addresses, listed.addresses])
                compose_differences(band, *task, addresses, setup.lights.channels, how, images, view)

        self._pool.run(compose_task, tasks)
        differences = images.reshape(shape)
        fill_unknown(differences, known.reshape(shape[1:3]), samples.reshape(shape[1:3]))
        return differences

    def _halved_sources(self, j: int, halves: Int32, tasks: Sequence[tuple[int, int]], known: Flags) -> list[HitSource]:
        """The hits of frame j with their factors in D, by their weights W_A and W_B.

        Args:
            halves: of the eyes of its window, see `weigh_halves`.
            tasks: first pixel and number of pixels of each.
            known: (n_pixels,) overwritten: whether a pixel has hits of both halves.
        """
        weights, hits = np.empty((2, self._setup.n_pixels)), self._hits(j, [])
        self._pool.run(lambda task, _: weigh_halves(hits.addresses, halves, task[0], task[1], weights), tasks)
        known[:] = (weights > 0).all(axis=0)
        factors, sources = half_factors(weights), []
        for source, half in zip(hits.sources, halves, strict=True):
            even, odd = (factors[0], factors[1]) if half == BY_SAMPLE else (factors[half], NO_SCALE)
            sources.append(source._replace(scale=even, odd_scale=odd))
        return sources

    def _smooth_indirect(self, j: int, holes: list[tuple[HitsByPixel, HitRecords]], shape: tuple[int, ...]) -> Float32:
        """R W of every pixel of frame j, (n_pixels, 3), with W denoised.

        W is R W over R, so that a pixel that a surface covers only in part has the W of that surface.
        """
        n_pixels = self._setup.n_pixels
        indirect, reflectivity = np.empty((n_pixels, 3), np.float32), np.empty((n_pixels, 3), np.float32)
        own = np.empty((n_pixels, 4), np.float32)
        frame, hits = self._frames[j], self._hits(j, holes)

        def average(first: int, _scratch: Scratch) -> None:
            n = min(TASK_PIXELS, n_pixels - first)
            band = empty_band(n, 0)
            with self._weighed(hits, first, n) as (listed, _):
                accumulate(band, first, n, listed, 1, 0, True)
            indirect[first : first + n] = band.sums[:n, INDIRECT : INDIRECT + 3]
            reflectivity[first : first + n] = band.sums[:n, REFLECTIVITY : REFLECTIVITY + 3]
            native = frame.places[j]
            average_native(native.start, native.order, frame.normal, frame.depth, first, n, own)

        self._pool.run(average, range(0, n_pixels, TASK_PIXELS))
        obscurance = np.divide(indirect, reflectivity, out=np.zeros_like(indirect), where=reflectivity > 0)
        images = (array.reshape(*shape, 3) for array in (obscurance, reflectivity, own[:, :3]))
        return reflectivity * denoise_obscurance(*images).reshape(n_pixels, 3)

    def _trace_holes(self, j: int) -> list[tuple[HitsByPixel, HitRecords]]:
        """Trace hits for the pixels of frame j that no eye reached; none where every pixel has native hits."""
        setup = self._setup
        if setup.fewest_hits(j) >= 1:
            return []
        reached = np.zeros(setup.n_pixels, np.int32)
        for c in setup.eyes_of(j):
            reached += np.diff(self._frames[c].places[j].start)
        missed = np.flatnonzero(reached[setup.order] == 0)
        return fill_holes(setup, j, setup.order[missed], self._pool) if len(missed) else []

    def _hits(
        self, j: int, holes: list[tuple[HitsByPixel, HitRecords]], eyes: Sequence[int] | None = None
    ) -> SourceList:
        """Native and outer hits of frame j, of its whole window or of some eyes, and those that fill holes."""
        setup = self._setup
        window = [self._frames[c] for c in setup.eyes_of(j) if eyes is None or c in eyes]
        sources = [
            HitSource(
                found.places[j],
                found.records.through(found.through[j]),
                found.weights[j],
                place=found.within[j],
                eye=NO_SCALE if setup.balance else viewpoint(setup.cams, found.c),
                front=found.front[j],
            )
            for found in window
        ]
        return SourceList(sources + [HitSource(by_pixel, records) for by_pixel, records in holes])

    def _mirrored(self, j: int, holes: list[tuple[HitsByPixel, HitRecords]], scale: Float32) -> SourceList:
        """Reflected hits of frame j; `scale` makes their sum a mean over its native hits only."""
        frame = self._frames[j]
        sources = [HitSource(by_pixel, records, scale=scale) for by_pixel, records in holes]
        if frame.mirrored is not None and frame.mirror_places is not None:
            sources.insert(0, HitSource(frame.mirror_places, frame.mirrored, scale=scale))
        return SourceList(sources)

    def _mirror_scale(self, j: int, holes: list[tuple[HitsByPixel, HitRecords]]) -> Float32:
        """1 / n_native of each pixel of frame j, (n_pixels,), with the hits that fill holes."""
        even, odd = self._frames[j].mirror_hits
        n_native: Int32 = even + odd
        for by_pixel, _ in holes[:1] if len(n_native) else []:
            n_native += np.diff(by_pixel.start)
        return np.reciprocal(np.maximum(n_native, 1), dtype=np.float32)
