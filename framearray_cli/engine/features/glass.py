"""Thin glass in front of eyes: it dims the hits behind it, mirrors others, and bends rays if it is solid."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Int32, Rgb

from ..frames.bounces import TRANSMISSION, WHOLE_SHARE, bounce, passed_shares, spans
from ..frames.records import Column, FrameHits, HitRecords
from ..frames.setup import Batch, Feature, Reflected
from ..hits.aiming import ray_origins
from ..hits.glass import transmission_to_eyes
from ..hits.hits import Hits, trace_hits
from ..hits.row import CLEAR, INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY
from ..inputs.panes import bends_rays
from ..kernels.bundle import rows_from
from ..terms.bounces import FACES, Fronts, bend, reflect_at_panes, write_bent
from .emission import TEXTURE

# Columns that glass before a hit dims: three channels each, and CLEAR by their mean.
_IN_ROW = [first + channel for first in (INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY) for channel in range(3)]
DIMMED = {"row": np.array([*_IN_ROW, CLEAR]), "emission": np.array([TEXTURE, TEXTURE + 1, TEXTURE + 2])}
UNDIMMED_BYTES = 4 * sum(map(len, DIMMED.values())) + 4  # of a hit behind glass, with its number


class Glass(Feature):
    """The panes of a scene, as eyes see them; what else they dim follows from `World.panes`."""

    name = "glass"

    def frame_columns(self) -> tuple[Column, ...]:
        return (Column(TRANSMISSION, (3,), np.uint16, usual=int(WHOLE_SHARE)),)

    def see(self, batch: Batch, frames: range, pixel: Int32, columns: Mapping[str, Any]) -> None:
        setup, n, rays = batch.setup, batch.n, batch.scratch.hit_rays
        seen, found = np.ascontiguousarray(pixel), np.empty((len(frames), n, 3), np.float32)
        traced = transmission_to_eyes(setup.cams, frames.start, batch.hits, n, seen, setup.world.panes, rays, found)
        columns[TRANSMISSION][:] = found * WHOLE_SHARE + np.float32(0.5)
        batch.scratch.rays["glass"] += traced

    def show(self, hits: FrameHits, j: int) -> None:
        """Dim the hits that are behind glass in frame j."""
        if TRANSMISSION not in hits.rare or not len(hits.rare[TRANSMISSION].hits):
            return
        behind, values = hits.rare[TRANSMISSION]
        lit = {name: columns for name, columns in DIMMED.items() if name in hits.records}
        at = behind[:, None]
        if not hits.undimmed:
            hits.undimmed = {name: hits.records[name][at, columns] for name, columns in lit.items()}
        passed = passed_shares(values[hits.frames.index(j)])
        shares = np.concatenate([passed, passed, passed, passed.mean(axis=1, keepdims=True)], axis=1)
        for name, columns in lit.items():
            hits.records[name][at, columns] = hits.undimmed[name] * shares[:, : len(columns)]

    def bounces(self, batch: Batch, passed: Rgb, ends: list[int]) -> Iterator[Reflected]:
        for k, (first, last) in enumerate(pairwise(ends)):
            hits, n = rows_from(batch.hits, first), last - first
            eye = ray_origins(batch.setup.cams, batch.c, hits, n)
            yield from ((k, *found) for found in _faces(batch, hits, n, eye))
            if bends_rays(batch.setup.world.panes):
                yield from ((k, *found) for found in _refracted(batch, hits, n, eye))


def _faces(batch: Batch, hits: Hits, n: int, eye: Rgb) -> Iterator[tuple[Int32, HitRecords]]:
    """Reflections of glass between an eye and hits, face by face."""
    world, fronts = batch.setup.world, Fronts(n)

    def way(_first: int, _last: int, to: Hits, tint: Rgb) -> int:
        return reflect_at_panes(hits, n, eye, fronts, world.panes, world, batch.scratch.hit_rays, to, tint)

    for _ in range(FACES):
        bounced = bounce(batch, [0, n], way)
        if bounced is None:
            break
        yield from (found[1:] for found in spans(*bounced))


def _refracted(batch: Batch, hits: Hits, n: int, eye: Rgb) -> Iterator[tuple[Int32, HitRecords]]:
    """Refracted hits, instead of hits behind solid glass."""
    world, packets = batch.setup.world, batch.scratch.hit_rays.packets

    def way(_first: int, _last: int, to: Hits, tint: Rgb) -> int:
        bent = bend(hits, n, eye, world.panes, world.eyes, packets)
        batch.scratch.rays["glass"] += bent.rays
        m = len(bent.hit)
        if m:
            write_bent(bent, hits, packets, to)
            trace_hits(world, packets, m, coherent=False, near=0.0, mirrors=True, hits=to)
            tint[:m] = bent.passed
        return m

    bounced = bounce(batch, [0, n], way, dimmed=False)
    if bounced is not None:
        yield from (found[1:] for found in spans(*bounced))
