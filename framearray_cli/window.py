"""The window of frames under way, and composing one frame from it.

What is kept of a frame is its list of hits, not sums: a hit with its irradiance under every light is stored once and
read by the 2 N_r + 1 frames that use it, where buffers of sums would be read and written once a frame that
contributes (docs/decisions/window.md). A frame is composed as soon as the last frame that can reach it is found, and
what no frame can need any more is dropped: never more than 2 N_r + 1 frames are held.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from .arrays import Float32, Images, Int32
from .compose import INDIRECT, OBSCURANCE, Band, accumulate, as_stored, begin, empty_band, finish, normalise
from .crew import Crew, Scratch
from .denoise import denoised
from .frame import Frame, fill_holes
from .kernel import kernel
from .terms.ambient import Ambient
from .work import Placed, Records, Work

# Pixels composed together: their sums over all lights fit a core's cache.
BAND_PIXELS = 1024
_NOTHING = np.empty(0, np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layers:
    """What a frame shows whatever the light, per pixel; (height, width, channels) or (height, width).

    Attributes:
        obscurance, indirect, reflectivity: W, R W and R, averaged over all hits.
        normal, depth: shading normal and distance along the optical axis, averaged over native hits; 0 if all escape.
        samples: hits that the pixel rests on, native and outer.
    """

    obscurance: Float32
    indirect: Float32
    reflectivity: Float32
    normal: Float32
    depth: Float32
    samples: Float32


@dataclass(slots=True, kw_only=True, eq=False)
class Composed:
    """One finished frame.

    Attributes:
        images: (n_lights, height, width, 3) radiance.
        layers: None unless the job keeps them.
        hits: (n_pixels,) number of hits that each pixel rests on, native and outer.
        beyond: number of values beyond the largest half; where images are halves, such values were cut to it.
        bad: number of values that were not finite or negative; each was replaced by 0.
        first_bad: light index and pixel of the first of them, or None.
    """

    c: int
    images: Images
    layers: Layers | None
    hits: Int32
    beyond: int
    bad: int
    first_bad: tuple[int, int] | None


class Window:
    """At most 2 N_r + 1 frames, and the crew that composes from them."""

    def __init__(self, work: Work, ambient: Ambient, crew: Crew, first: int = 0) -> None:
        """Make ready to compose frames `first`, `first` + 1, ...

        Args:
            ambient: of all lights that `work` computes.
        """
        self._work = work
        # by channel, as the sums are
        kept = slice(work.kept.start, work.kept.stop)
        self._colour = np.ascontiguousarray(work.lights.colour[kept].T)
        self._ambient = np.ascontiguousarray(ambient.intensity[kept].T)
        self._crew = crew
        # corrections of unbiased shadows may outweigh a dark pixel; cut at 0, their mean would be wrong
        self._lowest = np.float32(-np.inf if work.shadow_unbiased and work.shadow_step > 1 else 0.0)
        self._frames: dict[int, Frame] = {}
        self._next = first
        self._bands = [empty_band(BAND_PIXELS, len(work.kept)) for _ in range(crew.threads)]

    def add(self, frame: Frame) -> None:
        """Take in the hits of the next frame of the path."""
        self._frames[frame.c] = frame

    def complete(self) -> Iterator[int]:
        """Frames that can be composed now, one after another; what no later frame needs is dropped in between."""
        last = max(self._frames)
        while self._next < self._work.n_frames and self._work.frames_around(self._next, self._work.n_r)[-1] <= last:
            yield self._next
            passed = self._frames.pop(self._next - self._work.n_r, None)
            if passed is not None:
                passed.put_back(self._crew.shelf)
            self._next += 1

    def compose(self, j: int, images: Images) -> Composed:
        """Compose frame j, once all frames of its window were added.

        Args:
            images: (n_lights, height, width, 3), overwritten; float32, or float16 where that is how they are stored.
        """
        work = self._work
        flat = as_stored(images.reshape(len(images), work.n_pixels, 3))
        maps = np.empty((work.n_pixels, 9), np.float32) if work.layers else None
        own = np.empty((work.n_pixels, 4), np.float32) if work.layers else None
        samples = np.empty(work.n_pixels, np.int32)
        holes = self._holes(j)
        mirror_scale = self._mirror_scale(j, holes)
        smooth = self._smooth_indirect(j, holes[:1], images.shape[1:3]) if work.denoise else None

        def band(first: int, scratch: Scratch) -> tuple[int, int, int, int]:
            started = perf_counter()
            n = min(BAND_PIXELS, work.n_pixels - first)
            sums = self._bands.pop()
            try:
                self._sum_hits(j, first, n, sums, holes[:1])
                samples[first : first + n] = sums.hits[:n]
                if smooth is not None:
                    sums.rest[:n, INDIRECT : INDIRECT + 3] = smooth[first : first + n]
                if maps is not None and own is not None:
                    maps[first : first + n, :3] = sums.rest[:n, OBSCURANCE : OBSCURANCE + 3]
                    maps[first : first + n, 3:6] = sums.rest[:n, INDIRECT : INDIRECT + 3]
                    maps[first : first + n, 6:] = sums.reflectivity[:n]
                    frame = self._frames[j]
                    place = frame.places[j]
                    average_native(place.start, place.order, frame.normal, frame.depth, first, n, own)
                self._sum_mirrored(j, first, n, sums, holes[1:], mirror_scale)
                bad = finish(sums, first, n, self._colour, self._ambient, self._lowest, flat)
            finally:
                self._bands.append(sums)
            scratch.seconds["compose"] += perf_counter() - started
            return bad

        results = self._crew.run(band, range(0, work.n_pixels, BAND_PIXELS))
        bad = sum(result[0] for result in results)
        shape = images.shape[1:3]
        return Composed(
            c=j,
            images=images,
            layers=_layers(maps, own, samples, shape) if maps is not None and own is not None else None,
            hits=samples,
            beyond=sum(result[3] for result in results),
            bad=bad,
            first_bad=next(((l, pixel) for count, l, pixel, _ in results if count), None),
        )

    def _smooth_indirect(self, j: int, holes: list[tuple[Placed, Records]], shape: tuple[int, ...]) -> Float32:
        """R W of every pixel of frame j with W denoised, (n_pixels, 3).

        W is R W over R, so that a pixel that only partly shows a surface has that surface's W.
        """
        n_pixels = self._work.n_pixels
        indirect, reflectivity = np.empty((n_pixels, 3), np.float32), np.empty((n_pixels, 3), np.float32)
        own = np.empty((n_pixels, 4), np.float32)
        frame = self._frames[j]

        def band(first: int, _scratch: Scratch) -> None:
            n = min(BAND_PIXELS, n_pixels - first)
            sums = empty_band(n, 0)
            self._sum_hits(j, first, n, sums, holes, lit=False)
            indirect[first : first + n] = sums.rest[:n, INDIRECT : INDIRECT + 3]
            reflectivity[first : first + n] = sums.reflectivity[:n]
            place = frame.places[j]
            average_native(place.start, place.order, frame.normal, frame.depth, first, n, own)

        self._crew.run(band, range(0, n_pixels, BAND_PIXELS))
        obscurance = np.divide(indirect, reflectivity, out=np.zeros_like(indirect), where=reflectivity > 0)
        images = (array.reshape(*shape, 3) for array in (obscurance, reflectivity, own[:, :3]))
        return reflectivity * denoised(*images).reshape(n_pixels, 3)

    def _holes(self, j: int) -> list[tuple[Placed, Records]]:
        """Hits for pixels of frame j that nobody reached; there are none where every pixel has hits of its own."""
        work = self._work
        if work.per_pixel[j] >= 1:
            return []
        reached = np.zeros(work.n_pixels, np.int32)
        for k in work.frames_around(j, work.n_r):
            reached += np.diff(self._frames[k].places[j].start)
        missed = np.flatnonzero(reached[work.order] == 0)
        return fill_holes(work, j, work.order[missed], self._crew) if len(missed) else []

    def _sum_hits(
        self, j: int, first: int, n: int, sums: Band, holes: list[tuple[Placed, Records]], lit: bool = True
    ) -> None:
        """Weighed means over all hits of frame j in a band; without direct light unless `lit`."""
        begin(sums, n)
        for k in self._work.frames_around(j, self._work.n_r):
            frame = self._frames[k]
            _add(sums, first, n, frame.places[j], frame.records, frame.weights[j], _NOTHING, lit)
        for place, records in holes:
            _add(sums, first, n, place, records, _NOTHING, _NOTHING, lit)
        normalise(sums, n)

    def _mirror_scale(self, j: int, holes: list[tuple[Placed, Records]]) -> Float32:
        """One over the native hits of each pixel of frame j, (n_pixels,); those that fill holes count."""
        own = self._frames[j].mirror_hits
        for place, _ in holes[:1] if len(own) else []:
            own = own + np.diff(place.start)
        return (1.0 / np.maximum(own, 1)).astype(np.float32)

    def _sum_mirrored(
        self, j: int, first: int, n: int, sums: Band, holes: list[tuple[Placed, Records]], scale: Float32
    ) -> None:
        """Add what the mirrors of frame j show: a mean over its native hits alone."""
        frame = self._frames[j]
        if frame.mirrored is not None and frame.mirror_places is not None:
            _add(sums, first, n, frame.mirror_places, frame.mirrored, _NOTHING, scale)
        for place, records in holes:
            _add(sums, first, n, place, records, _NOTHING, scale)


def _add(
    sums: Band,
    first: int,
    n: int,
    place: Placed,
    records: Records,
    weight: Float32,
    scale: Float32,
    lit: bool = True,
) -> None:
    irradiance = records.irradiance if lit else np.empty((len(records.irradiance), 1, 0), np.float32)
    accumulate(
        sums, first, n, place.start, place.order, weight, scale,
        records.reflectivity, records.obscurance, records.constant, irradiance,
    )  # fmt: skip


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


def _layers(maps: Float32, own: Float32, samples: Int32, shape: tuple[int, ...]) -> Layers:
    return Layers(
        obscurance=maps[:, :3].reshape(*shape, 3),
        indirect=maps[:, 3:6].reshape(*shape, 3),
        reflectivity=maps[:, 6:].reshape(*shape, 3),
        normal=own[:, :3].reshape(*shape, 3),
        depth=own[:, 3].reshape(shape),
        samples=samples.astype(np.float32).reshape(shape),
    )
