"""Layers that every array with layers has, and coverage: what images show of surfaces apart from light."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..frames.records import Column, FrameHits, StoredLight
from ..frames.setup import Batch, Composer, Feature, PixelTask
from ..hits.hits import ESCAPED, SURFACE
from ..hits.row import CLEAR, INDIRECT, LIT, OBSCURANCE, REFLECTIVITY
from ..inputs.cameras import depths_of
from ..kernels.kernel import kernel

NORMAL, DEPTH = "normal", "depth"


class SurfaceLayers(Feature):
    """W, R W, R, number of hits, shading normal and depth of pixels."""

    name = "surface"
    is_layer = True
    layer_bytes = 4 * 14

    def columns(self, light: StoredLight, *, mirrored: bool) -> tuple[Column, ...]:
        return () if mirrored else (Column(NORMAL, (3,)), Column(DEPTH))

    def record(self, batch: Batch) -> None:
        """Write shading normals of hits, and their depths from the eye; 0 for escaped rays."""
        if not batch.owns(NORMAL):
            return
        hits, n = batch.hits, batch.n
        depth = depths_of(batch.setup.cams, batch.c, hits.position[:n])
        hits.shading[:n][hits.kind[:n] == ESCAPED] = 0.0
        batch.column(NORMAL)[:] = hits.shading[:n]
        batch.column(DEPTH)[:] = np.where(hits.kind[:n] == SURFACE, depth, np.float32(0.0))

    def composer(self, frame: FrameHits, shown: range) -> Composer:
        return _SurfaceComposer(frame, shown)


class _SurfaceComposer(Composer):
    """Means over all hits, and of normal and depth over native hits."""

    row = tuple(first + channel for first in (OBSCURANCE, INDIRECT, REFLECTIVITY) for channel in range(3))

    def __init__(self, frame: FrameHits, shown: range) -> None:
        native = frame.places[frame.eye]
        self._start, self._order, self._records = native.start[shown.start :], native.order, frame.records
        self._own = np.empty((len(shown), 4), np.float32)  # normal and depth

    def compose(self, task: PixelTask) -> None:
        normal, depth = self._records[NORMAL], self._records[DEPTH]
        average_native(self._start, self._order, normal, depth, task.first, task.n, self._own)

    def layers(self, means: Float32, samples: Int32, shape: tuple[int, ...]) -> Mapping[str, Any]:
        return {
            DEPTH: self._own[:, 3].reshape(shape),
            "samples": samples.astype(np.float32).reshape(shape),
            "obscurance": means[:, :3].reshape(*shape, 3),
            "indirect": means[:, 3:6].reshape(*shape, 3),
            "reflectivity": means[:, 6:].reshape(*shape, 3),
            NORMAL: self._own[:, :3].reshape(*shape, 3),
        }


class Alpha(Feature):
    """Coverage of pixels: what lies outside the scene is left out of images where eyes see it."""

    name = "alpha"
    layer_bytes = 4

    def shade(self, batch: Batch) -> None:
        if batch.mirrored:
            return
        away = batch.hits.kind[: batch.n] == ESCAPED
        batch.column("irradiance")[: batch.n][away] = 0.0
        batch.column("row")[: batch.n, INDIRECT : LIT + 1][away] = 0.0
        batch.hits.reflectivity[: batch.n][away] = 0.0  # nothing reflects there

    def composer(self, frame: FrameHits, shown: range) -> Composer:
        return _AlphaComposer()


class _AlphaComposer(Composer):
    """The share of each pixel that the scene covers."""

    row = (CLEAR,)

    def layers(self, means: Float32, samples: Int32, shape: tuple[int, ...]) -> Mapping[str, Any]:
        return {Alpha.name: 1 - means[:, 0].reshape(shape)}


@kernel
def average_native(
    start: Int32, order: Int32, normal: Float32, depth: Float32, first: int, n: int, out: Float32
) -> None:
    """Average the normals and depths of the native hits of pixels first to first + n - 1 that are on a surface.

    Args:
        start, order: the native hits of each pixel, see `HitsByPixel`.
        normal, depth: (n_hits, 3) and (n_hits,) of native hits; depth is 0 where the ray escaped.
        out: (n_pixels, 4) overwritten in these pixels: normal, depth; 0 where no native hit is on a surface.
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
