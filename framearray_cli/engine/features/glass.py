"""Thin glass in front of eyes: it dims the hits behind it, mirrors others, and bends rays if it is solid."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Int32, Rgb

from ..frames.bounces import TRANSMISSION, WHOLE_SHARE, bounce, passed_shares, spans
from ..frames.records import Column, HitRecords
from ..frames.setup import Batch, Feature, Reflected
from ..hits.aiming import ray_origins
from ..hits.glass import transmission_to_eyes
from ..hits.hits import Hits, trace_hits
from ..hits.row import CLEAR, INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY
from ..inputs.panes import bends_rays
from ..kernels.bundle import rows_from
from ..terms.bounces import FACES, Fronts, bend, reflect_at_panes, write_bent
from .emission import TEXTURE


class Glass(Feature):
    """The panes of a scene, as eyes see them; what else they dim follows from `World.panes`."""

    name = "glass"

    def frame_columns(self) -> tuple[Column, ...]:
        return (Column(TRANSMISSION, (3,), np.uint16),)

    def see(self, batch: Batch, frames: range, pixel: Int32, columns: Mapping[str, Any]) -> None:
        setup, n, rays = batch.setup, batch.n, batch.scratch.hit_rays
        seen, found = np.ascontiguousarray(pixel), np.empty((len(frames), n, 3), np.float32)
        traced = transmission_to_eyes(setup.cams, frames.start, batch.hits, n, seen, setup.world.panes, rays, found)
        columns[TRANSMISSION][:] = found * WHOLE_SHARE + np.float32(0.5)
        batch.scratch.rays["glass"] += traced

    def seen(self, records: HitRecords, columns: Mapping[str, Any]) -> HitRecords:
        """Transmission of the glass in front of hits."""
        stored = columns[TRANSMISSION]
        behind = np.flatnonzero((stored != WHOLE_SHARE).any(axis=1))
        if not len(behind):
            return records
        dimmed, row, arrays = passed_shares(stored[behind]), records.row.copy(), dict(records.arrays)
        for column in (INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY):
            row[behind, column : column + 3] *= dimmed
        row[behind, CLEAR] *= dimmed.mean(axis=1)
        arrays["row"] = row
        if "emission" in records:
            arrays["emission"] = records["emission"].copy()
            arrays["emission"][behind, TEXTURE:] *= dimmed
        return HitRecords(arrays)

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
        bent = bend(hits, n, eye, world.panes, world.tracer, packets)
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
