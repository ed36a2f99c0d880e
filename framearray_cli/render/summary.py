"""Summary of a render: images, time, rays and notes of this run and of all runs, for the user and the manifest."""

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

from framearray_cli.array.celltable import mixed_cells
from framearray_cli.array.images import mean_shares
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.record import ArrayRecords
from framearray_cli.base.platform import largest_size
from framearray_cli.engine.embree.library import packet_width
from framearray_cli.engine.images.standard_error import error_summary
from framearray_cli.engine.kernels.processor import processor
from framearray_cli.scene.paths.paths import Lights

from .prepare import Prepared


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Images, cost and notes of a render.

    Attributes:
        images: number written by this run; `there`: on disk; `total`: of the array.
        seconds: of this run so far; `stages`: seconds of its threads that trace and compose, by stage.
        rays: number traced by this run, by kind.
        pixels: number per image.
        hits: mean accepted hits per pixel and frame, native and outer.
        peak_memory: bytes.
        notes: messages for the user.
        standard_error: table for the manifest; empty unless the job asks for it.
        shares: of clipped and of black pixels among those on disk; None where runs did not count them.
        all_rays, all_seconds: of all runs.
        mixed_cells: what is wrong where images have light from different cells; else empty.
    """

    images: int
    there: int
    total: int
    seconds: float
    rays: dict[str, int]
    stages: dict[str, float]
    pixels: int
    hits: float
    peak_memory: int
    notes: tuple[str, ...]
    standard_error: dict[str, Any]
    shares: tuple[float, float] | None
    all_rays: dict[str, int]
    all_seconds: float
    mixed_cells: str = ""

    @property
    def rays_per_pixel_image(self) -> dict[str, float]:
        """Rays per pixel per image of this run, by kind."""
        return {kind: n / (self.pixels * max(self.images, 1)) for kind, n in self.rays.items()}


def summarize(
    prepared: Prepared,
    records: ArrayRecords,
    *,
    images: int,
    seconds: float,
    rays: Counter[str],
    stages: dict[str, float],
    notes: tuple[str, ...],
) -> Summary:
    """Combine this run with the records of all runs.

    Args:
        records: of what is on disk.
        images, seconds, rays, stages: of this run.
        notes: of the ambient light.
    """
    by_camera: dict[int, float] = {}
    errors: dict[tuple[int, int], tuple[float, float]] = {}
    there: set[tuple[int, int]] = set()
    for entry in records.entries:
        by_camera[entry.c] = entry.hits
        errors |= {(entry.c, l): error for l, error in entry.errors.items()}
        there |= {(entry.c, l) for l in range(*entry.lights)}
    width, height = prepared.job.camera.resolution
    found = dict.fromkeys(note for entry in sorted(records.entries, key=lambda e: e.c) for note in entry.notes)
    all_rays = sum((Counter(run.rays) for run in records.runs), Counter[str]())
    return Summary(
        images=images,
        there=len(there),
        total=prepared.n_cameras * prepared.n_lights,
        seconds=seconds,
        rays=dict(rays),
        stages=stages,
        pixels=width * height,
        hits=math.fsum(by_camera.values()) / max(len(by_camera), 1),
        peak_memory=largest_size(),
        notes=tuple(dict.fromkeys((*notes, *found, *_processor_notes(records)))),
        standard_error=_standard_error(prepared.lights, errors) if errors else {},
        shares=mean_shares(entry.shares for entry in records.entries for _ in range(*entry.lights) if entry.shares),
        all_rays=dict(all_rays) or dict(rays),
        all_seconds=sum(run.seconds for run in records.runs) or seconds,
        mixed_cells=mixed_cells(records.runs),
    )


def _processor_notes(records: ArrayRecords) -> list[str]:
    """Return a note if processors of several kinds worked on an array, as their kernels round differently."""
    kinds = sorted({run.processor for run in records.runs} | {processor()})
    if len(kinds) < 2:
        return []
    return [f"rendered on several kinds of processor, whose images may differ in the last bits: {', '.join(kinds)}"]


def _standard_error(lights: Lights, errors: dict[tuple[int, int], tuple[float, float]]) -> dict[str, Any]:
    """Return the manifest's table of standard errors; with groups, of planes lit by sources only."""
    lit = {p for p, plane in enumerate(lights.planes) if plane.lit}
    found: dict[str, Any] = error_summary({(c, p): error for (c, p), error in errors.items() if p in lit})
    for group in lights.groups:
        if found["light"] in group.positions:
            return found | {"light": found["light"] - group.positions.start, "group": group.name}
    return found


def with_summary(manifest: Manifest, summary: Summary) -> Manifest:
    """Return the manifest with the summary of what is on disk after a run."""
    per_image = summary.pixels * max(summary.there, 1)
    table = {
        "finished": summary.there == summary.total and not summary.mixed_cells,
        "ambient_paths": manifest.summary["ambient_paths"],
        "images": summary.there,
        "seconds": round(summary.all_seconds, 3),
        "hits_per_pixel": round(summary.hits, 3),
        "rays": summary.all_rays,
        "rays_per_pixel_image": {kind: round(n / per_image, 5) for kind, n in summary.all_rays.items()},
        "peak_memory": summary.peak_memory,
        "processor": processor(),
        "rays_together": packet_width(),
        "notes": list(summary.notes),
    }
    if summary.shares:
        table |= dict(zip(("clipped", "black"), (round(share, 4) for share in summary.shares), strict=True))
    if summary.standard_error:
        table["standard_error"] = summary.standard_error
    table |= {
        key: manifest.summary[key] for key in ("indirect", "automatic", "target", "warnings") if key in manifest.summary
    }
    return replace(manifest, summary=table)
