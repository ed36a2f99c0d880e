"""The window of frames under way, and composing one frame from it.

What is kept of a frame is its list of hits, not sums: a hit with its irradiance under every light is stored once and
read by the 2 N_r + 1 frames that use it, where buffers of sums would be read and written once a frame that
contributes (docs/decisions/window.md). A frame is composed as soon as the last frame that can reach it is found, and
what no frame can need any more is dropped: never more than 2 N_r + 1 frames are held.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from time import perf_counter

import numpy as np

from framearray_cli.base.arrays import Float32, Images, Int32, Rgb

from ..frames.frame import FrameHits, fill_holes
from ..frames.records import BY_SAMPLE, INDIRECT, REFLECTIVITY, HitRecords, Placed
from ..frames.setup import FrameSetup
from ..frames.threads import Scratch, TracePool
from ..kernels.kernel import kernel
from ..terms.ambient.estimate import Ambient
from .band import Band, Finish, as_stored, empty_band
from .compose import (
    HitSource,
    Pixels,
    SourceList,
    Summands,
    accumulate,
    compose_differences,
    compose_pixels,
    weigh_halves,
)
from .composed import Composed, _layers
from .denoise import denoised
from .standard_error import fill_unknown, half_factors

# Pixels whose sums over all lights are held together: they fit a core's cache. And pixels of a task.
BAND_PIXELS, TASK_PIXELS = 256, 2048


class Window:
    """At most 2 N_r + 1 frames, and the threads that compose from them; `ready_frames` in loop.py fills it."""

    def __init__(self, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> None:
        """Open an empty window.

        Args:
            ambient: of all lights that `setup` computes.
        """
        self._setup = setup
        self._pool = pool
        # corrections of unbiased shadows may outweigh a dark pixel; cut at 0, their mean would be wrong
        lowest = -np.inf if setup.shadow_unbiased and setup.shadow_step > 1 else 0.0
        self._finish = Finish(
            colour=self._by_channel(setup.lights.colour),
            ambient=self._by_channel(ambient.intensity),
            light_independent_from=setup.light_independent_from,
            lowest=np.float32(lowest),
        )
        self._frames: dict[int, FrameHits] = {}
        self._holes: dict[int, list[tuple[Placed, HitRecords]]] = {}
        self._bands = [empty_band(BAND_PIXELS, len(setup.kept)) for _ in range(pool.threads)]

    def add(self, frame: FrameHits) -> None:
        """Take in the hits of the next frame of the path."""
        self._frames[frame.c] = frame

    def fill_holes(self, j: int) -> None:
        """Trace hits for the pixels of frame j that none of its hits reaches; all frames of its window are there."""
        self._holes[j] = self._trace_holes(j)

    def drop(self, j: int, needed: int) -> None:
        """Forget what only frame j and earlier ones show, and the frames before frame `needed`."""
        arrays = self._pool.arrays
        self._holes.pop(j, None)
        for k in [k for k in self._frames if k <= j or k < needed]:
            self._frames[k].forget_mirrors(arrays)
            if k < needed:
                self._frames.pop(k).put_back(arrays)

    def with_ambient(self, ambient: Ambient) -> "Window":
        """The same frames under another ambient light."""
        window = copy(self)
        window._finish = self._finish._replace(ambient=self._by_channel(ambient.intensity))
        return window

    def _by_channel(self, values: Rgb) -> Rgb:
        """Values of all lights, (n, 3), as those of the kept ones, (3, n_kept): the order of the sums."""
        kept = self._setup.kept
        return np.ascontiguousarray(values[kept.start : kept.stop].T)

    @contextmanager
    def _band(self) -> Iterator[Band]:
        """Sums for one task; the next task takes them over, whatever happens to this one."""
        band = self._bands.pop()
        try:
            yield band
        finally:
            self._bands.append(band)

    def compose(self, j: int, images: Images, eyes: Sequence[int] | None = None) -> Composed:
        """Compose frame j, once all frames of its window were added and its holes are filled.

        Args:
            images: (n_lights, height, width, 3), overwritten; float32, or float16 where that is how they are stored.
            eyes: only hits of these eyes are averaged, and pixels that none of them reaches stay black; None: of all.
        """
        setup = self._setup
        flat = as_stored(images.reshape(len(images), setup.n_pixels, 3))
        layered = setup.n_pixels if setup.layers else 0
        maps, own = np.empty((layered, 9), np.float32), np.empty((layered, 4), np.float32)
        samples = np.empty(setup.n_pixels, np.int32)
        holes = self._holes[j] if eyes is None else []
        mirror_scale = self._mirror_scale(j, holes)
        hits, mirrored = self._hits(j, holes[:1], eyes), self._mirrored(j, holes[1:], mirror_scale)
        smooth = (
            self._smooth_indirect(j, holes[:1], images.shape[1:3]) if setup.denoise else np.empty((0, 3), np.float32)
        )
        frame, out = self._frames[j], Pixels(flat, samples, maps)

        def some(first: int, scratch: Scratch) -> tuple[int, int, int, int]:
            started = perf_counter()
            n = min(TASK_PIXELS, setup.n_pixels - first)
            summands = Summands(hits.addresses, mirrored.addresses, setup.lights.channels, smooth)
            with self._band() as sums:
                found: tuple[int, int, int, int] = compose_pixels(sums, first, n, summands, self._finish, out)
            if layered:
                place = frame.places[j]
                average_native(place.start, place.order, frame.normal, frame.depth, first, n, own)
            scratch.seconds["compose"] += perf_counter() - started
            return found

        results = self._pool.run(some, range(0, setup.n_pixels, TASK_PIXELS))
        differences = self._differences(j, samples, images.shape) if setup.halves else None
        bad = sum(result[0] for result in results)
        shape = images.shape[1:3]
        return Composed(
            c=j,
            images=images,
            layers=_layers(maps, own, samples, shape) if layered else None,
            hits=samples,
            beyond=sum(result[3] for result in results),
            bad=bad,
            first_bad=next(((l, pixel) for count, l, pixel, _ in results if count), None),
            differences=differences,
        )

    def _differences(self, j: int, samples: Int32, shape: tuple[int, ...]) -> Float32:
        """What the halves of the hits of frame j differ by, (n_lights, height, width, 3); see standarderror.py."""
        setup, frame = self._setup, self._frames[j]
        images, weights = np.empty((len(setup.kept), setup.n_pixels, 3), np.float32), np.empty((2, setup.n_pixels))
        eyes = setup.frames_around(j, setup.n_r)
        own = np.array([setup.half_of(k) for k in eyes], np.int32)
        hits = self._hits(j, [])
        tasks = [(first, min(TASK_PIXELS, setup.n_pixels - first)) for first in range(0, setup.n_pixels, TASK_PIXELS)]
        self._pool.run(lambda task, _: weigh_halves(hits.addresses, own, task[0], task[1], weights), tasks)
        factors, parts = half_factors(weights), []
        for k, half in zip(eyes, own, strict=True):
            scales = (factors[0], factors[1]) if half == BY_SAMPLE else (factors[half],)
            parts.append(
                HitSource(self._frames[k].places[j], self._frames[k].records, self._frames[k].weights[j], *scales)
            )
        if frame.mirrored is not None and frame.mirror_places is not None:
            even, odd = half_factors(frame.mirror_hits)
            parts.append(HitSource(frame.mirror_places, frame.mirrored, scale=even, odd_scale=odd))
        listed, how = SourceList(parts), self._finish._replace(lowest=np.float32(-np.inf))

        def some(task: tuple[int, int], _scratch: Scratch) -> None:
            with self._band() as band:
                compose_differences(band, *task, listed.addresses, setup.lights.channels, how, images)

        self._pool.run(some, tasks)
        differences = images.reshape(shape)
        fill_unknown(differences, (weights > 0).all(axis=0).reshape(shape[1:3]), samples.reshape(shape[1:3]))
        return differences

    def _smooth_indirect(self, j: int, holes: list[tuple[Placed, HitRecords]], shape: tuple[int, ...]) -> Float32:
        """R W of every pixel of frame j with W denoised, (n_pixels, 3).

        W is R W over R, so that a pixel that only partly shows a surface has that surface's W.
        """
        n_pixels = self._setup.n_pixels
        indirect, reflectivity = np.empty((n_pixels, 3), np.float32), np.empty((n_pixels, 3), np.float32)
        own = np.empty((n_pixels, 4), np.float32)
        frame, hits = self._frames[j], self._hits(j, holes)

        def band(first: int, _scratch: Scratch) -> None:
            n = min(TASK_PIXELS, n_pixels - first)
            sums = empty_band(n, 0)
            accumulate(sums, first, n, hits.addresses, 1, 0, True)
            indirect[first : first + n] = sums.sums[:n, INDIRECT : INDIRECT + 3]
            reflectivity[first : first + n] = sums.sums[:n, REFLECTIVITY : REFLECTIVITY + 3]
            place = frame.places[j]
            average_native(place.start, place.order, frame.normal, frame.depth, first, n, own)

        self._pool.run(band, range(0, n_pixels, TASK_PIXELS))
        obscurance = np.divide(indirect, reflectivity, out=np.zeros_like(indirect), where=reflectivity > 0)
        images = (array.reshape(*shape, 3) for array in (obscurance, reflectivity, own[:, :3]))
        return reflectivity * denoised(*images).reshape(n_pixels, 3)

    def _trace_holes(self, j: int) -> list[tuple[Placed, HitRecords]]:
        """Hits for pixels of frame j that nobody reached; there are none where every pixel has hits of its own."""
        setup = self._setup
        if setup.fewest_hits(j) >= 1:
            return []
        reached = np.zeros(setup.n_pixels, np.int32)
        for k in setup.frames_around(j, setup.n_r):
            reached += np.diff(self._frames[k].places[j].start)
        missed = np.flatnonzero(reached[setup.order] == 0)
        return fill_holes(setup, j, setup.order[missed], self._pool) if len(missed) else []

    def _hits(self, j: int, holes: list[tuple[Placed, HitRecords]], eyes: Sequence[int] | None = None) -> SourceList:
        """All hits of frame j, or those of some eyes, for `accumulate`."""
        frames = [self._frames[k] for k in self._setup.frames_around(j, self._setup.n_r) if eyes is None or k in eyes]
        found = [HitSource(frame.places[j], frame.records, frame.weights[j]) for frame in frames]
        return SourceList(found + [HitSource(place, records) for place, records in holes])

    def _mirrored(self, j: int, holes: list[tuple[Placed, HitRecords]], scale: Float32) -> SourceList:
        """What the mirrors of frame j show, for `accumulate`: a mean over its native hits alone."""
        frame = self._frames[j]
        found = [HitSource(place, records, scale=scale) for place, records in holes]
        if frame.mirrored is not None and frame.mirror_places is not None:
            found.insert(0, HitSource(frame.mirror_places, frame.mirrored, scale=scale))
        return SourceList(found)

    def _mirror_scale(self, j: int, holes: list[tuple[Placed, HitRecords]]) -> Float32:
        """One over the native hits of each pixel of frame j, (n_pixels,); those that fill holes count."""
        even, odd = self._frames[j].mirror_hits
        own: Int32 = even + odd
        for place, _ in holes[:1] if len(own) else []:
            own += np.diff(place.start)
        return np.reciprocal(np.maximum(own, 1), dtype=np.float32)


@kernel
def average_native(
    start: Int32, order: Int32, normal: Float32, depth: Float32, first: int, n: int, out: Float32
) -> None:
    """Mean normal and depth of the native hits of pixels first to first + n - 1 that are on a surface.

    Args:
        start, order: native hits sorted by pixel; hits of other frames among them do not exist.
        out: (n_pixels, 4) written: normal, depth; 0 where no native hit is on a surface.
    """
    for pixel in range(first, first + n):
        for value in range(4):
            out[pixel, value] = 0.0
        found = 0
        for entry in range(start[pixel], start[pixel + 1]):
            hit = order[entry]
            if depth[hit] > 0.0:
                found += 1
                out[pixel, 3] += depth[hit]
                for axis in range(3):
                    out[pixel, axis] += normal[hit, axis]
        if found:
            for value in range(4):
                out[pixel, value] /= np.float32(found)
