"""Small pictures with few hits: one of a job, within seconds, or a coarse array for a page, before the fine one.

A coarse array has pictures of some camera and light positions. Camera positions come from coarse to fine: both ends of
the path, its middle, the middles of the halves, and so on until the time is over. Each is rendered independently, at
all chosen light positions; the ends of each axis are among them.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from framearray_cli.array.coarsearray import coarse_folder, write_coarse
from framearray_cli.base.arrays import Image
from framearray_cli.base.forms.table import changed
from framearray_cli.base.units import counted, duration
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job
from framearray_cli.job.keys import MAIN_AXIS
from framearray_cli.job.method import SamplesTable
from framearray_cli.scene.paths.paths import Lights, eyes, lights, lights_without_groups

from .automatic import require_least_memory
from .events import CoarseBegun, Report, Working, note
from .frames import compose_all, compose_frames
from .manifest import initial_manifest
from .plan import ambient_at, plan_work
from .prepare import Prepared, open_embree, prepare, prepared_from
from .session import RenderSession
from .trial import few_prepared, nearest_known
from .writer import ArrayWriter, array_target

SHRINK = 4  # of both sides
LEAST_SIDE = 320  # pixels of the longer side, unless the job has fewer; a smaller picture shows too little
HITS = 8  # per pixel; without neighbours in a window, noise is then hardly seen at this size
WALKS = 4096  # for the ambient light, which is then known to some hundredths
# Walks for cells: in one small picture under one light position, more change less than another seed does.
CELL_SAMPLES = 2**16
MANY_SOURCES = 32  # with more, fewer hits and samples share as many shadow rays
FEWEST_SAMPLES = 2**13


def light_axes(job: Job) -> dict[str, int]:
    """Return the number of light positions along each axis of a job, the main one first if any source uses it."""
    groups = job.light.groups
    used = not groups or any(group.axis == MAIN_AXIS for group in groups)
    return ({MAIN_AXIS: job.light.frames} if used else {}) | dict(job.light.axes)


def render_preview(job: Job, c: int, places: Mapping[str, int]) -> tuple[Image, Prepared]:
    """Render one picture, a quarter as wide and high as the job's, without touching the output folder.

    Args:
        c: camera position.
        places: light position along each axis of `light_axes`.

    Returns:
        (h, w, 3) radiance, linear; job and scene of the picture.

    Raises:
        JobError, SceneError: the job cannot be rendered.
    """
    all_eyes, all_lights = eyes(job), lights(job)
    prepared = prepare(small_job(job, LEAST_SIDE, HITS))
    prepared = prepared_from(prepared.job, prepared.scene, all_eyes.at([c]), lights_of_preview(all_lights, places))
    require_least_memory(prepared)
    with open_embree(prepared) as embree:
        setup, ambient = plan_work(prepared, embree, compare=False)
        (composed,) = compose_all(prepared, setup, ambient, [0], floats=True)
    return np.asarray(composed.images[0], np.float32), prepared


def small_job(job: Job, least: int, hits: int) -> Job:
    """Return the job with small pictures and few hits; its settings of noise and reuse are for whole arrays.

    Args:
        least: pixels of the longer side at least, unless the job has fewer.
        hits: per pixel.
    """
    width, height = job.camera.resolution
    shrink = min(max(1 / SHRINK, least / max(width, height)), 1.0)
    resolution = (max(1, round(shrink * width)), max(1, round(shrink * height)))
    paths = WALKS if job.ambient.paths is None else min(job.ambient.paths, WALKS)
    n_sources = len(job.light.sources)
    samples, hits = share_of(CELL_SAMPLES, n_sources, FEWEST_SAMPLES), share_of(hits, n_sources, 1)
    return changed(
        job,
        camera=changed(job.camera, resolution=resolution),
        samples=SamplesTable(hits=hits, obscurance=job.samples.obscurance),
        reuse=changed(job.reuse, n_r=0),
        specular=changed(job.specular, hits=min(job.specular.hits, hits)),
        indirect=changed(job.indirect, samples=min(job.indirect.samples, samples)),
        ambient=changed(job.ambient, paths=paths),
    )


def share_of(count: int, n_sources: int, least: int) -> int:
    """Return how many hits or samples of a small picture many sources leave: each casts a shadow ray per source."""
    return max(count * MANY_SOURCES // max(n_sources, MANY_SOURCES), least)


def lights_of_preview(lights: Lights, places: Mapping[str, int]) -> Lights:
    """Return all sources at one light position along each axis, without groups."""

    def row(i: int) -> int:
        group = next((group for group in lights.groups if i in group.sources), None)
        return places[MAIN_AXIS] if group is None else group.positions.start + places[group.axis]

    return lights_without_groups([source.at([row(i)]) for i, source in enumerate(lights.sources)])


SECONDS = 3.0  # of rendering; camera positions that it leaves out have neighbours that are there
MOST_LIGHTS = 13  # positions of all axes together, about: every fourth of 48
COARSE_HITS = 4  # per pixel; no window adds hits of neighbours


@contextmanager
def coarse_beside(session: RenderSession, report: Report) -> Iterator[None]:
    """Render a coarse array into a folder next to the array, and keep it there for the block.

    Raises:
        OutputError: a file cannot be written.
    """
    with coarse_folder(session.prepared.job.output.directory) as folder:
        if folder is not None:
            _render_coarse(session, folder, report)
        yield


def _render_coarse(session: RenderSession, folder: Path, report: Report) -> None:
    started = time.perf_counter()
    whole = session.prepared
    output = changed(whole.job.output, directory=folder, layers=False, sun_hours=None, compression="none")
    job = small_job(changed(whole.job, output=output), 1, COARSE_HITS)
    prepared = few_prepared(replace(whole, job=job), MOST_LIGHTS)
    setup, ambient = plan_work(prepared, session.embree, compare=False)
    manifest = initial_manifest(prepared, ambient, session.identity, None, None)
    write_coarse(folder, manifest, places_of(whole.lights, whole.lights.few(MOST_LIGHTS)))

    def begin() -> None:
        rough = ambient_at(ambient, nearest_known(whole, MOST_LIGHTS))  # the array to come will have its own
        report(CoarseBegun(array=initial_manifest(whole, rough, session.identity, session.settings, None)))
        report(Working(text="rendering coarse pictures"))

    n = _write_pictures(prepared, setup, ambient, session.wanted, begin)
    few, all_lights = (sum(plane.lit for plane in lights.planes) for lights in (prepared.lights, whole.lights))
    sizes = (
        f"{n:,} of {counted(len(session.wanted), 'camera position')} x {few} of {counted(all_lights, 'light position')}"
    )
    (width, height), seconds = prepared.job.camera.resolution, time.perf_counter() - started
    note(report, [f"coarse array: {sizes}, {width} x {height} pixels, in {duration(seconds)}"])
    report(Working(text="estimating the ambient light"))


def _write_pictures(
    prepared: Prepared, setup: FrameSetup, ambient: Ambient, wanted: Sequence[int], begin: Callable[[], None]
) -> int:
    """Render and write camera positions from coarse to fine while there is time; return their number.

    Args:
        begin: called once both ends are on disk.
    """
    planes, target, done = range(prepared.n_lights), array_target(prepared), 0
    chosen = wanted[:1] if prepared.still else list(coarse_to_fine(wanted))
    with TracePool(setup, prepared.threads) as pool, ArrayWriter(target, planes, prepared.threads) as writer:
        end = np.inf
        for c in chosen:
            frame = [0 if prepared.still else c]
            for composed, images in compose_frames(prepared, setup, ambient, pool, frame, writer.block):
                writer.write(composed, [c], images)
            done += 1
            if done == min(2, len(chosen)):
                writer.finish()
                begin()
                end = time.perf_counter() + SECONDS  # from now on: kernels may have been compiled so far
            if time.perf_counter() > end:
                break
        writer.finish()
    return done


def coarse_to_fine(places: Sequence[int]) -> Iterator[int]:
    """Yield both ends of some places, then the middle one, then the middles of both halves, and so on to all."""
    yield from dict.fromkeys((places[0], places[-1]))
    gaps = deque([(0, len(places) - 1)])
    while gaps:
        low, high = gaps.popleft()
        if high - low > 1:
            middle = (low + high) // 2
            yield places[middle]
            gaps += ((low, middle), (middle, high))


def places_of(lights: Lights, planes: Sequence[int]) -> dict[str, list[int]]:
    """Return the positions along each light axis that some image planes are."""
    if not lights.groups:
        return {MAIN_AXIS: list(planes)}
    return {
        group.axis: [p - group.positions.start for p in planes if p in group.positions]
        for group in reversed(lights.groups)
    }
