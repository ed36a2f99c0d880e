"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from . import __version__
from .auto import Choice, require_least_memory, settled
from .crew import Crew
from .embree import Engine
from .errors import OutputError
from .filepatterns import file_patterns
from .frame import find_frame
from .job import Job
from .jobfile import job_table
from .manifest import Manifest, ManifestCamera, ManifestLight, matrix_rows
from .manifestfile import write_manifest
from .memory import light_blocks, mirror_share, peak_memory, require_memory
from .outfolder import claim_folder
from .prepare import Prepared, job_fingerprint, open_embree, plan_work, prepare
from .standarderror import summed_up
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
    standard_error: dict[str, float | int]

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
        manifest = _manifest(prepared, ambient, identity, choice, target)
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
    if work.lights.n_lights < prepared.n_lights:
        ambient = ambient.for_lights(lights)
    window = Window(work, ambient, crew)
    writer = ArrayWriter(
        job.output.directory,
        _patterns(prepared),
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
        standard_error=summed_up(errors) if errors else {},
    )


def _bad_values(count: int, c: int, first: tuple[int, int] | None, width: int) -> str:
    l, pixel = first or (0, 0)
    where = f"camera {c}, light {l}, pixel ({pixel % width}, {pixel // width})"
    return f"{count} values of camera {c} were not finite and were set to 0; the first: {where}"


def _patterns(prepared: Prepared) -> tuple[str, str]:
    return file_patterns(prepared.job.name, prepared.n_cameras, prepared.n_lights, prepared.job.output.format)


def _manifest(
    prepared: Prepared, ambient: Ambient, identity: str, choice: Choice | None, target: Target | None
) -> Manifest:
    """What a program needs that has never seen this one; everything but how the run went."""
    job, report = prepared.job, prepared.scene.report
    images, layers = _patterns(prepared)
    place = {"point": ("position", "intensity"), "directional": ("direction", "irradiance")}
    lights = []
    for l in range(prepared.n_lights):
        sources = [
            {"type": s.kind, place[s.kind][0]: s.vector[l].tolist(), place[s.kind][1]: s.intensity[l].tolist()}
            for s in prepared.lights.sources
        ]
        i_a = ambient.intensity[l].astype(float)
        error = i_a * float(ambient.standard_error[l])
        lights.append(
            ManifestLight(ambient=tuple(i_a.tolist()), ambient_error=tuple(error.tolist()), sources=tuple(sources))
        )
    return Manifest(
        version=__version__,
        name=job.name,
        fingerprint=identity,
        images=images,
        layers=layers if job.output.layers else "",
        resolution=job.camera.resolution,
        fps=job.output.fps,
        cameras=tuple(
            ManifestCamera(world_from_camera=matrix_rows(matrix), fov=prepared.eyes.fov_deg)
            for matrix in prepared.eyes.world_from_camera
        ),
        lights=tuple(lights),
        job=job_table(job),
        scene={
            "triangles": report.triangles,
            "materials": report.materials,
            "textures": report.textures,
            "dropped": report.dropped,
            "notes": list(report.notes),
        },
        summary={"finished": False, "images": 0, "ambient_paths": ambient.paths}
        | ({"automatic": choice.table()} if choice else {})
        | ({"target": target.table()} if target else {}),
        directory=job.output.directory,
    )


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
