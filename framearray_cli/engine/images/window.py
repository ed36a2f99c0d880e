"""The window: the hits of at most 2 N_r + 1 eyes, from which one frame is composed at a time.

The window holds lists of hits, not sums. A hit with its irradiance under every light is stored once and read by the
2 N_r + 1 frames that show it; buffers of sums would be read and written once per frame that contributes
(docs/decisions/reuse.md).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from copy import copy
from itertools import accumulate as running_sums
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Addresses, Flags, Float32, Images, Int32, Rgb, with_room
from framearray_cli.base.memory import is_scarce, resident_memory

from ..frames.frame import fill_holes
from ..frames.pool import TracePool
from ..frames.records import FrameHits
from ..frames.setup import Composer, FrameSetup, PixelTask, Scratch
from ..hits.row import BY_SAMPLE
from ..inputs.cameras import viewpoint
from ..terms.ambient.intensity import Ambient
from .area import AreaWeights
from .band import NOTHING_SHINES, Band, Finish, as_stored, empty_band
from .compose import Composed, Pixels, Summands, compose_differences, compose_pixels, weigh_halves
from .gloss import GlossView, gloss_view
from .sourcelists import FIRST_LAYER, NO_SCALE, HitSource, SourceList
from .standard_error import fill_unknown, half_factors

# Pixels of a band, whose sums over all lights fit a core's cache, and pixels of a task.
BAND_PIXELS, TASK_PIXELS = 256, 2048


class Window:
    """The hits of at most 2 N_r + 1 eyes; composes frames from them. `ready_frames` in loop.py fills it."""

    def __init__(self, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> None:
        """Open an empty window.

        Args:
            ambient: of all lights.
        """
        self._setup = setup
        self._pool = pool
        self._finish = Finish(
            colour=self._by_channel(setup.lights.colour),
            ambient=self._ambient(ambient),
            light_independent_from=setup.light_independent_from,
            lowest=np.float32(0.0),
        )
        self._listed: tuple[Any, SourceList, SourceList] | None = None  # of the frame that is composed
        self._frames: dict[int, FrameHits] = {}
        self._holes: dict[int, FrameHits] = {}
        self._area = AreaWeights(setup.zone_size)
        self._strength, strength = _strengths(setup)
        self._gloss = gloss_view(setup)
        self._bands = [empty_band(BAND_PIXELS, setup.lights.n_lights, strength) for _ in range(pool.threads)]

    def _view(self, j: int) -> GlossView:
        """The view of eye j of glossy hits."""
        return self._gloss._replace(eye=viewpoint(self._setup.cams, j)[None]) if self._gloss.eye.size else self._gloss

    def add(self, frame: FrameHits) -> None:
        """Add the hits of the next eye of the path."""
        self._frames[frame.eye], self._listed = frame, None

    def fill_holes(self, j: int) -> None:
        """Trace hits for the pixels of frame j that no hit of its window reaches; all eyes of the window were added."""
        if (pixels := self._missed_pixels(j)).size:
            self._holes[j], self._listed = fill_holes(self._setup, j, pixels, self._pool), None

    def drop(self, j: int, needed: int) -> None:
        """Drop what only frames up to j show, holes and reflected hits, and all hits of eyes before `needed`."""
        arrays, self._listed = self._pool.arrays, None
        self._holes.pop(j, None)
        for c in [c for c in self._frames if c <= j or c < needed]:
            self._frames[c].forget_mirrors(arrays)
            if c < needed:
                self._frames.pop(c).put_back(arrays)
        if is_scarce(resident_memory()):
            arrays.release()

    def with_ambient(self, ambient: Ambient) -> "Window":
        """The same window under another ambient light."""
        window = copy(self)
        window._finish = self._finish._replace(ambient=self._ambient(ambient))
        return window

    def _by_channel(self, values: Rgb) -> Rgb:
        """Values of all lights, (n_lights, 3), as (3, n_lights) like the sums."""
        found: Rgb = with_room((3, len(values)), np.float32, fill=0)
        found[:] = values.T
        return found

    def _ambient(self, ambient: Ambient) -> Rgb:
        """I_A, (3, n_lights); 0 where hits have indirect light of their own."""
        intensity = ambient.intensity
        return self._by_channel(intensity if self._setup.indirect.ambient else np.zeros_like(intensity))

    @contextmanager
    def _band(self) -> Iterator[Band]:
        """Lend the sums of a band to a task; the next task gets them even if this one fails."""
        band = self._bands.pop()
        try:
            yield band
        finally:
            self._bands.append(band)

    @contextmanager
    def _weighed(
        self, hits: SourceList, listed: Addresses, origin: int, first: int, n: int
    ) -> Iterator[tuple[Addresses, Int32]]:
        """Lend the hits of pixels first to first + n - 1 with their weights; and by area, the number in each pixel.

        Args:
            listed: the addresses of `hits` from pixel `origin` on, from which pixels count.
        """
        if not self._setup.area:
            yield listed, np.empty(0, np.int32)
            return
        with self._area.weighed(hits, origin + first, n, origin=origin) as weighed:
            yield weighed.addresses, weighed.own

    def compose(self, j: int, images: Images, eyes: Sequence[int] | None = None, rows: range | None = None) -> Composed:
        """Compose frame j, after all eyes of its window were added and its holes filled.

        Args:
            images: (n_lights, len(rows), width, 3), overwritten; float32, or float16 if files store halves.
            eyes: average only the hits of these eyes, and leave pixels that none of them reaches black; None: of all.
            rows: compose only these, some of `FrameSetup.rows`; None: all of them.
        """
        setup, frame, width = self._setup, self._frames[j], self._setup.cams.width
        rows = setup.rows if rows is None else rows
        n_pixels, origin = len(rows) * width, (rows.start - setup.zone.start) * width
        shown = range(origin, origin + n_pixels)
        composers = [made for feature in setup.features if (made := feature.composer(frame, shown))]
        columns = np.array([column for composer in composers for column in composer.row], np.int32)
        out = Pixels(
            images=as_stored(images.reshape(len(images), n_pixels, 3)),
            samples=np.empty(n_pixels, np.int32),
            columns=columns,
            means=np.empty((n_pixels if len(columns) else 0, len(columns)), np.float32),
        )
        hits, mirrored = self._lists(j, eyes)
        ours, mirrors, view = hits.addresses_from(origin), mirrored.addresses_from(origin), self._view(j)

        def compose_task(first: int, scratch: Scratch) -> tuple[int, int, int, int]:
            started = perf_counter()
            n = min(TASK_PIXELS, n_pixels - first)
            with self._weighed(hits, ours, origin, first, n) as (listed, in_pixels), self._band() as band:
                summands = Summands(listed, mirrors, setup.lights.channels, view)
                found: tuple[int, int, int, int] = compose_pixels(band, first, n, summands, self._finish, out)
                if setup.area:
                    out.samples[first : first + n] = in_pixels
                for composer in composers:
                    composer.compose(PixelTask(listed, hits.columns, first, n))
            scratch.seconds["compose"] += perf_counter() - started
            return found

        results = self._pool.run(compose_task, range(0, n_pixels, TASK_PIXELS))
        layers = _layers_of(composers, out, images.shape[1:3])
        return Composed(
            c=j,
            rows=rows,
            images=images,
            alpha=layers.pop("alpha", None),
            layers=layers,
            hits=out.samples,
            beyond=sum(result[3] for result in results),
            bad=sum(result[0] for result in results),
            first_bad=next(((l, rows.start * width + pixel) for count, l, pixel, _ in results if count), None),
            differences=self._differences(j, out.samples, images.shape) if setup.halves else None,
        )

    def _differences(self, j: int, samples: Int32, shape: tuple[int, ...]) -> Float32:
        """D of the halves of the hits of frame j, (n_lights, height, width, 3); see `standard_error.py`."""
        setup, frame = self._setup, self._frames[j]
        images, known = (
            np.empty((setup.lights.n_lights, setup.n_pixels, 3), np.float32),
            np.empty(setup.n_pixels, np.bool_),
        )
        halves = np.array([setup.half_of(c) for c in setup.eyes_of(j)], np.int32)
        tasks = [(first, min(TASK_PIXELS, setup.n_pixels - first)) for first in range(0, setup.n_pixels, TASK_PIXELS)]
        hits, sources = self._hits(j, holes=False), [] if setup.area else self._halved_sources(j, halves, tasks, known)
        if frame.mirrored is not None and frame.mirror_places is not None:
            even, odd = half_factors(frame.mirror_hits)
            arrays = frame.mirrored.arrays
            sources.append(HitSource(frame.mirror_places, arrays, scale=even, odd_scale=odd, mirrored=True))
        listed, how = SourceList(sources), self._finish._replace(lowest=np.float32(-np.inf))
        view = self._view(j)

        def compose_task(task: tuple[int, int], _scratch: Scratch) -> None:
            by_area = self._area.halved(hits, halves, *task, known) if setup.area else nullcontext(None)
            with by_area as weighed, self._band() as band:
                # layers are not composed: the columns that kernels know by number suffice
                parts = [part[:, :FIRST_LAYER] for part in (weighed, listed.addresses) if part is not None]
                addresses = np.concatenate(parts)
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
        weights, hits = np.empty((2, self._setup.n_pixels)), self._hits(j, holes=False)
        self._pool.run(lambda task, _: weigh_halves(hits.addresses, halves, task[0], task[1], weights), tasks)
        known[:] = (weights > 0).all(axis=0)
        factors, sources = half_factors(weights), []
        for source, half in zip(hits.sources, halves, strict=True):
            even, odd = (factors[0], factors[1]) if half == BY_SAMPLE else (factors[half], NO_SCALE)
            sources.append(source._replace(scale=even, odd_scale=odd))
        return sources

    def _missed_pixels(self, j: int) -> Int32:
        """The pixels of frame j that no eye reached, in the order of tracing; none if all have native hits."""
        setup = self._setup
        if setup.fewest_hits(j) >= 1:
            return setup.order[:0]
        reached = np.zeros(setup.n_zone, np.int32)
        for c in setup.eyes_of(j):
            reached += np.diff(self._frames[c].places[j].start)
        pixels = np.concatenate(setup.tile_rows(setup.order))
        return pixels[reached[setup.in_zone(pixels)] == 0]

    def _lists(self, j: int, eyes: Sequence[int] | None) -> tuple[SourceList, SourceList]:
        """Hits and reflected hits of frame j, which are listed once for all of its rows."""
        which = j, None if eyes is None else tuple(eyes)
        if self._listed is None or self._listed[0] != which:
            self._listed = which, self._hits(j, eyes), self._mirrored(j, eyes)
        return self._listed[1:]

    def _hits(self, j: int, eyes: Sequence[int] | None = None, *, holes: bool = True) -> SourceList:
        """Native and outer hits of frame j, of its whole window or of some eyes, and those that fill holes."""
        setup = self._setup
        found = [self._frames[c] for c in setup.eyes_of(j) if eyes is None or c in eyes]
        sources = [
            self._source(hits, j, NO_SCALE if setup.balance else viewpoint(setup.cams, setup.frame_of(hits.eye)))
            for hits in found
        ]
        if holes and eyes is None and j in self._holes:
            sources.append(self._source(self._holes[j], j, NO_SCALE))
        return SourceList(sources)

    def _source(self, hits: FrameHits, j: int, eye: Float32) -> HitSource:
        """Native hits of an eye as frame j sees them."""
        for feature in self._setup.features:
            feature.show(hits, j)
        return HitSource(hits.places[j], {**hits.records.arrays, **hits.seen_in(j)}, eye=eye)

    def _mirrored(self, j: int, eyes: Sequence[int] | None) -> SourceList:
        """Reflected hits of frame j, with factors that make their sum a mean over its native hits only."""
        holes = [self._holes[j]] if eyes is None and j in self._holes else []
        even, odd = self._frames[j].mirror_hits
        n_native: Int32 = even + odd
        for hole in holes if len(n_native) else []:
            n_native += np.diff(hole.places[j].start)
        scale = np.reciprocal(np.maximum(n_native, 1), dtype=np.float32)
        return SourceList(
            HitSource(found.mirror_places, found.mirrored.arrays, scale=scale, mirrored=True)
            for found in (self._frames[j], *holes)
            if found.mirrored is not None and found.mirror_places is not None
        )


def _layers_of(composers: Sequence[Composer], out: Pixels, shape: tuple[int, ...]) -> dict[str, Any]:
    """The layers of all features."""
    ends = [0, *running_sums(len(composer.row) for composer in composers)]
    found: dict[str, Any] = {}
    for composer, (first, last) in zip(composers, pairwise(ends), strict=True):
        found |= composer.layers(out.means[:, first:last], out.samples, shape)
    return found


def _strengths(setup: FrameSetup) -> tuple[Float32, Addresses]:
    """The strengths of all sources, and the address of each one's; empty without area lights."""
    if not setup.lights.emitters.span.size:
        return np.empty(0, np.float32), NOTHING_SHINES
    found: Float32 = with_room(setup.lights.strength.shape, np.float32, fill=0)
    found[:] = setup.lights.strength
    return found, found.ctypes.data + found.strides[0] * np.arange(len(found), dtype=np.int64)
