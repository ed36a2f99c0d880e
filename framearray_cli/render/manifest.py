"""Manifest of a render, with everything that other programs need, and the summary of its runs, also for the user."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from framearray_cli import __version__
from framearray_cli.array.celltable import mixed_cells
from framearray_cli.array.folder import Identity
from framearray_cli.array.images import mean_shares
from framearray_cli.array.manifest import (
    BACKGROUND,
    FILE_NAME,
    Manifest,
    ManifestGroup,
    ManifestLight,
    manifest_camera,
    matrix_rows,
)
from framearray_cli.array.record import ArrayRecords
from framearray_cli.base.arrays import Float64
from framearray_cli.base.platform import largest_size
from framearray_cli.engine.embree.library import packet_width
from framearray_cli.engine.images.standard_error import error_summary
from framearray_cli.engine.kernels.processor import processor
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import Lights, Plane

from .automatic import AutoSettings
from .errortarget import Target
from .events import RenderResult
from .prepare import Prepared
from .writer import AMBIENT, ArrayNames, array_names


def initial_manifest(
    prepared: Prepared,
    ambient: Ambient,
    identity: Identity,
    settings: AutoSettings | None,
    target: Target | None,
    warnings: Sequence[str] = (),
) -> Manifest:
    """Return the manifest of a render that has not begun."""
    job, report = prepared.job, prepared.scene.report
    origin = prepared.scene.position_origin if job.output.position else np.zeros(3)
    files = array_names(job, prepared.n_cameras, prepared.lights)
    summary: dict[str, Any] = {"finished": False, "images": 0, "ambient_paths": ambient.paths}
    summary |= {"notes": list(ambient.notes)}
    known = {"indirect": ambient.accuracy, "automatic": settings, "target": target}
    summary |= {name: found.table() for name, found in known.items() if found}
    summary |= {"warnings": list(warnings)} if warnings else {}
    return Manifest(
        version=__version__,
        name=job.name,
        fingerprint=identity.fingerprint,
        layers=files.layers if job.output.layers else "",
        resolution=job.camera.resolution,
        fps=job.output.fps,
        cameras=tuple(
            manifest_camera(matrix_rows(matrix), lens)
            for matrix, lens in zip(prepared.eyes.world_from_camera, prepared.eyes.lenses, strict=True)
        ),
        job=identity.job,
        scene={
            "triangles": report.triangles,
            "materials": report.materials,
            "textures": report.textures,
            "dropped": report.dropped,
            "notes": [*report.notes, *prepared.lights.notes],
            "fingerprint": identity.scene,
            **({"position_origin": origin.tolist()} if origin.any() else {}),
        },
        summary=summary,
        directory=job.output.directory,
        **_images(prepared, ambient, files),
    )


def _images(prepared: Prepared, ambient: Ambient, files: ArrayNames) -> dict[str, Any]:
    """Return the file patterns of the images, and their lights."""
    lights = prepared.lights
    if prepared.job.indirect.method != "obscurance":  # all light is in the images
        ambient = replace(
            ambient,
            intensity=np.zeros_like(ambient.intensity),
            standard_error=np.zeros_like(ambient.standard_error),
        )
    i_a = ambient.intensity.astype(np.float64)
    if not lights.groups:
        return {"images": files.pattern(""), "lights": _lights(range(lights.n), lights.sources, i_a, ambient)}
    dark = i_a[lights.planes.index(Plane.INDIRECT)]  # no source shines there: the background only
    groups = tuple(
        ManifestGroup(
            name=group.name,
            axis=group.axis,
            images=files.pattern(group.name),
            lights=_lights(group.positions, [lights.sources[i] for i in group.sources], i_a - dark, ambient),
        )
        for group in lights.groups
    )
    return {
        "groups": groups,
        "ambient_images": files.pattern(AMBIENT),
        "background_images": files.pattern(BACKGROUND),
        "background_ambient": tuple(dark.tolist()),
    }


def _lights(
    positions: range, sources: Sequence[LightPath], i_a: Float64, ambient: Ambient
) -> tuple[ManifestLight, ...]:
    """Return sources and I_A, (n_lights, 3), at some light positions."""
    return tuple(
        ManifestLight(
            ambient=tuple(i_a[l].tolist()),
            ambient_error=tuple((i_a[l] * float(ambient.standard_error[l])).tolist()),
            sources=tuple(source.table(l) for source in sources if source.part_of is None),
        )
        for l in positions
    )


NOTHING: Mapping[str, Any] = {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary(RenderResult):
    """The result of a render, with figures for messages and the manifest.

    Attributes:
        rays: number traced by this run, by kind; `all_rays`: by all runs.
        notes: messages for the user.
        mixed_cells: what is wrong where images have light from different cells; else empty.
    """

    rays: dict[str, int]
    all_rays: dict[str, int]
    notes: tuple[str, ...]
    mixed_cells: str

    def result(self, compile_seconds: float) -> RenderResult:
        """Return the result alone, of a run that spent that much of its time compiling."""
        found = {field.name: getattr(self, field.name) for field in fields(RenderResult)}
        return RenderResult(**found | {"compile_seconds": compile_seconds})


def summarize(
    prepared: Prepared,
    records: ArrayRecords,
    *,
    images: int = 0,
    seconds: float,
    rays: Mapping[str, int] = NOTHING,
    stages: Mapping[str, float] = NOTHING,
    notes: tuple[str, ...],
) -> Summary:
    """Combine this run with the records of all runs.

    Args:
        records: of what is on disk.
        images, seconds, rays, stages: of this run.
        notes: of the ambient light.
    """
    by_camera = {entry.c: entry.hits for entry in records.entries}
    errors = {(entry.c, l): error for entry in records.entries for l, error in entry.errors.items()}
    there = {(entry.c, l) for entry in records.entries for l in range(*entry.lights)}
    (width, height), folder = prepared.job.camera.resolution, prepared.job.output.directory
    clipped, black = mean_shares(
        entry.shares for entry in records.entries for _ in range(*entry.lights) if entry.shares
    ) or (None, None)
    total, mixed = prepared.n_cameras * prepared.n_lights, mixed_cells(records.runs)
    found = dict.fromkeys(note for entry in sorted(records.entries, key=lambda e: e.c) for note in entry.notes)
    all_rays = sum((Counter(run.rays) for run in records.runs), Counter[str]())
    return Summary(
        directory=str(folder),
        manifest=str(folder / FILE_NAME),
        finished=len(there) == total and not mixed,
        written=images,
        there=len(there),
        images=total,
        seconds=seconds,
        compile_seconds=0.0,
        array_seconds=sum(run.seconds for run in records.runs) or seconds,
        stage_seconds=dict(stages),
        clipped=clipped,
        black=black,
        rays_per_pixel_image={kind: n / (width * height * max(images, 1)) for kind, n in rays.items()},
        hits_per_pixel=math.fsum(by_camera.values()) / max(len(by_camera), 1),
        peak_memory_bytes=largest_size(),
        standard_error=_standard_error(prepared.lights, errors) if errors else None,
        rays=dict(rays),
        all_rays=dict(all_rays) or dict(rays),
        notes=tuple(dict.fromkeys((*notes, *found, *_processor_notes(records)))),
        mixed_cells=mixed,
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
    per_image = math.prod(manifest.resolution) * max(summary.there, 1)
    table = {
        "finished": summary.finished,
        "ambient_paths": manifest.summary["ambient_paths"],
        "images": summary.there,
        "seconds": round(summary.array_seconds, 3),
        "hits_per_pixel": round(summary.hits_per_pixel, 3),
        "rays": summary.all_rays,
        "rays_per_pixel_image": {kind: round(n / per_image, 5) for kind, n in summary.all_rays.items()},
        "peak_memory": summary.peak_memory_bytes,
        "processor": processor(),
        "rays_together": packet_width(),
        "notes": list(summary.notes),
    }
    if summary.clipped is not None and summary.black is not None:
        table |= {"clipped": round(summary.clipped, 4), "black": round(summary.black, 4)}
    if summary.standard_error:
        table["standard_error"] = summary.standard_error
    table |= {
        key: manifest.summary[key] for key in ("indirect", "automatic", "target", "warnings") if key in manifest.summary
    }
    return replace(manifest, summary=table)
