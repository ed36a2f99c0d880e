"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .auto import Choice, require_least_memory, settled
from .crew import Crew
from .describe import describe
from .embree import Engine
from .errors import OutputError
from .frame import find_frame
from .job import Job
from .jobfile import job_table
from .manifest import Manifest
from .manifestfile import write_manifest
from .memory import light_blocks, mirror_share, peak_memory, require_memory
from .outfolder import claim_folder
from .prepare import Prepared, composed_with, job_fingerprint, open_embree, plan_work, prepare
from .standarderror import summed_up
from .stored import array_names
from .target import Target, aimed
from .terms.ambient import Ambient
from .window import Window
from .work import Work
from .writer import ArrayWriter, image_format


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """How a render went.

    Attributes:
        images: written.
        seconds: of the whole command so far, and `tracing`: without waiting for files.
        rays: number by kind.
        pixels: of one image.
        hits: mean accepted hits a pixel of a frame, native and outer.
        peak_memory: bytes.
        notes: what the user should know.
        standard_error: see `standarderror.summed_up`; empty unless the job asks for it.
    """

    images: int
    seconds: float
    rays: dict[str, int]
    stages: dict[str, float]
    pixels: int
    hits: float
    peak_memory: int
    notes: tuple[str, ...]
    standard_error: dict[str, Any]

    @property
    def rays_per_pixel_image(self) -> dict[str, float]:
        """Rays a pixel an image, by kind."""
        return {kind: n / (self.pixels * max(self.images, 1)) for kind, n in self.rays.items()}


class Listener:
    """What a render tells while it runs; override what you want to hear. Calls may come from any thread."""

    def prepared(self, prepared: Prepared) -> None:
        """Inputs were read."""

    def removed(self, files: int) -> None:
        """That many files of the array that lay in the folder were removed."""

    def settled(self, choice: Choice) -> None:
        """What the job leaves open was chosen."""

    def planned(self, ambient: Ambient) -> None:
        """The ambient light is known."""

    def aimed(self, target: Target) -> None:
        """Native hits were allotted for the error that the job wants."""

    def written(self, images: int) -> None:
        """That many more images are on disk."""


def render(job: Job, listener: Listener | None = None, *, engine: Engine = "auto", restart: bool = False) -> Summary:
    """Render a whole frame array.

    Args:
        restart: remove the array that lies in the job's folder first; without it, another array there is an error.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: something could not be written; images that were finished stay, and the manifest counts them.
    """
    listener = listener or Listener()
    started = time.perf_counter()
    prepared = prepare(job)
    listener.prepared(prepared)
    require_least_memory(prepared)
    folder = job.output.directory
    with open_embree(prepared, engine) as embree:
        prepared, choice = settled(prepared, embree)
        identity = job_fingerprint(prepared)
        listener.removed(claim_folder(folder, job.name, identity, job_table(job)["output"], restart=restart))
        if choice:
            listener.settled(choice)
        work, ambient = plan_work(prepared, embree)
        listener.planned(ambient)
        work, target = aimed(prepared, work, ambient)
        if target:
            require_memory(prepared, work.per_pixel)
            listener.aimed(target)
        manifest = describe(prepared, ambient, identity, choice, target)
        write_manifest(folder, manifest)
        written: list[int] = []
        try:
            parts = [
                _frames(prepared, work.for_lights(block), ambient, block, listener, written)
                for block in light_blocks(prepared, mirror_share(work), per_pixel=work.per_pixel)
            ]
        except BaseException:
            with suppress(OutputError):  # what stopped the render is told; the manifest may meet the same full disk
                write_manifest(folder, replace(manifest, summary=manifest.summary | {"images": sum(written)}))
            raise
    summary = _summary(prepared, ambient, target, parts, time.perf_counter() - started)
    write_manifest(folder, _with_summary(manifest, summary))
    return summary


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """What one pass over the camera path cost; see `Summary`."""

    rays: Counter[str]
    stages: dict[str, float]
    hits: float
    notes: tuple[str, ...]
    errors: dict[tuple[int, int], tuple[float, float]]


def _frames(
    prepared: Prepared, work: Work, ambient: Ambient, lights: range, listener: Listener, written: list[int]
) -> _Part:
    """Find every frame's hits, compose each frame as soon as its window is complete, write it, forget it.

    Args:
        work: for a block of light positions, `lights`.
        written: an entry a written image is added, whatever happens afterwards.
    """

    def count(images: int) -> None:
        written.append(images)
        listener.written(images)

    job = prepared.job
    threads = prepared.threads
    notes, hits, stored = [], 0.0, image_format(job)
    crew = Crew(work, threads)
    ambient = composed_with(ambient, prepared.lights)
    if work.lights.n_lights < prepared.n_lights:
        ambient = ambient.for_lights(lights)
    window = Window(work, ambient, crew)
    writer = ArrayWriter(
        job.output.directory,
        array_names(job, prepared.n_cameras, prepared.lights),
        prepared.eyes,
        job.camera.resolution,
        job.output.fps,
        stored,
        lights,
        threads,
        count,
    )
    try:
        with writer:
            for c in range(work.n_frames):
                window.add(find_frame(work, c, crew))
                for j in window.complete():
                    block = writer.block()
                    composed = window.compose(j, block)
                    if composed.beyond and stored.half == "auto":  # too bright for halves: some images will be floats
                        composed = window.compose(j, np.empty(block.shape, np.float32))
                    hits += float(composed.hits.mean())
                    if composed.bad:
                        notes.append(_bad_values(composed.bad, j, composed.first_bad, job.camera.resolution[0]))
                    writer.write(composed, range(prepared.n_cameras) if prepared.still else range(j, j + 1), block)
            writer.finish()
    finally:
        crew.close()
    return _Part(
        rays=crew.rays(),
        stages=crew.seconds(),
        hits=hits / work.n_frames,
        notes=tuple(notes),
        errors=writer.errors,
    )


def _summary(
    prepared: Prepared, ambient: Ambient, target: Target | None, parts: list[_Part], seconds: float
) -> Summary:
    """Put the passes over the camera path together."""
    rays = sum((part.rays for part in parts), Counter({"ambient": ambient.rays}))
    if target:
        rays["target"] = target.rays
    width, height = prepared.job.camera.resolution
    errors = {image: error for part in parts for image, error in part.errors.items()}
    return Summary(
        images=prepared.n_cameras * prepared.n_lights,
        seconds=seconds,
        rays=dict(rays),
        stages={stage: sum(part.stages[stage] for part in parts) for stage in parts[0].stages},
        pixels=width * height,
        hits=parts[0].hits,
        peak_memory=peak_memory(),
        notes=(*ambient.notes, *(note for part in parts for note in part.notes)),
        standard_error=_standard_error(prepared, errors) if errors else {},
    )


def _standard_error(prepared: Prepared, errors: dict[tuple[int, int], tuple[float, float]]) -> dict[str, Any]:
    """What the manifest says of the errors; with groups, of those of their own light."""
    lights = prepared.lights
    found: dict[str, Any] = summed_up({(c, l): error for (c, l), error in errors.items() if l < lights.n_lit})
    for group in lights.groups:
        if found["light"] in group.positions:
            return found | {"light": found["light"] - group.positions.start, "group": group.name}
    return found


def _bad_values(count: int, c: int, first: tuple[int, int] | None, width: int) -> str:
    l, pixel = first or (0, 0)
    where = f"camera {c}, light {l}, pixel ({pixel % width}, {pixel // width})"
    return f"{count} values of camera {c} were not finite and were set to 0; the first: {where}"


def _with_summary(manifest: Manifest, summary: Summary) -> Manifest:
    table = {
        "finished": True,
        "ambient_paths": manifest.summary["ambient_paths"],
        "images": summary.images,
        "seconds": round(summary.seconds, 3),
        "hits_per_pixel": round(summary.hits, 3),
        "rays": summary.rays,
        "rays_per_pixel_image": {kind: round(n, 5) for kind, n in summary.rays_per_pixel_image.items()},
        "peak_memory": summary.peak_memory,
        "notes": list(summary.notes),
    }
    if summary.standard_error:
        table["standard_error"] = summary.standard_error
    table |= {key: manifest.summary[key] for key in ("automatic", "target") if key in manifest.summary}
    return replace(manifest, summary=table)
