"""One picture of an array, small and with few hits: a first look at a job, within seconds."""

from collections.abc import Mapping

import numpy as np

from framearray_cli.base.arrays import Image
from framearray_cli.base.forms.table import changed
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.job.job import Job
from framearray_cli.job.keys import MAIN_AXIS
from framearray_cli.job.method import SamplesTable
from framearray_cli.scene.paths.paths import Lights, eyes, lights, lights_without_groups

from .automatic import require_least_memory
from .frames import compose_frames
from .plan import plan_work
from .prepare import Prepared, open_embree, prepare, prepared_from

SHRINK = 4  # of both sides
LEAST_SIDE = 320  # pixels of the longer side, unless the job has fewer; a smaller picture shows too little
HITS = 8  # per pixel; without neighbours in a window, noise is then hardly seen at this size
WALKS = 4096  # for the ambient light, which is then known to some hundredths
# Walks for cells: in one small picture under one light position, more change less than another seed does.
CELL_SAMPLES = 2**16


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
        image = np.empty((1, setup.cams.height, setup.cams.width, 3), np.float32)
        with TracePool(setup, prepared.threads) as pool:
            next(compose_frames(prepared, setup, ambient, pool, [0], lambda: image))
    return image[0], prepared


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
    return changed(
        job,
        camera=changed(job.camera, resolution=resolution),
        samples=SamplesTable(hits=hits, obscurance=job.samples.obscurance),
        reuse=changed(job.reuse, n_r=0),
        specular=changed(job.specular, hits=min(job.specular.hits, hits)),
        indirect=changed(job.indirect, samples=min(job.indirect.samples, CELL_SAMPLES)),
        ambient=changed(job.ambient, paths=paths),
    )


def lights_of_preview(lights: Lights, places: Mapping[str, int]) -> Lights:
    """Return all sources at one light position along each axis, without groups."""

    def row(i: int) -> int:
        group = next((group for group in lights.groups if i in group.sources), None)
        return places[MAIN_AXIS] if group is None else group.positions.start + places[group.axis]

    return lights_without_groups([source.at([row(i)]) for i, source in enumerate(lights.sources)])
