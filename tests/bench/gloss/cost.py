"""The cost of an image of the kitchen by what its surfaces are, frame by frame in turns with diffuse ones."""

from pathlib import Path
from statistics import median

import numpy as np

from bench.core.cases import job_named, with_resolution
from bench.core.frames import frames
from bench.core.machine import describe, quiet
from bench.core.results import Table
from bench.lights.cost import in_turns
from bench.speed.speed import log
from framearray_cli.base.arrays import Float32
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job
from framearray_cli.report.case import open_case

from .glazing import CLEAR, GREEN, glazed

JOB = "kitchen-gloss"
DIFFUSE, FILE, CLEAR_PANES, GREEN_PANES = "diffuse", "as the job has them", "and clear panes", "and green panes"
FRAMES, QUICK_FRAMES, PLACE = 9, 1, 0.4
RESOLUTION, QUICK_RESOLUTION = (320, 240), (48, 36)
SHOWN = (5, 3)  # camera and light position of the picture
PARTS = {f"cost-{method}": method for method in ("obscurance", "cells")}


def jobs_of(method: str, quick: bool, folder: Path) -> dict[str, Job]:
    """The job with each kind of surfaces."""
    job = with_resolution(job_named(JOB, False), QUICK_RESOLUTION if quick else RESOLUTION)
    job = changed(job, indirect=changed(job.indirect, method=method))
    panes = {name: glazed(folder / f"{name.split()[-2]}.glb", colour)
             for name, colour in ((CLEAR_PANES, CLEAR), (GREEN_PANES, GREEN))}  # fmt: skip
    return {
        DIFFUSE: changed(job, scene=changed(job.scene, surfaces="diffuse", materials={})),
        FILE: job,
        **{name: changed(job, scene=changed(job.scene, file=file)) for name, file in panes.items()},
    }


def measure(part: str, quick: bool, folder: Path, patience: float = 0.0) -> Table:
    """Measure a part: surfaces -> medians over frames; `ratio` is over diffuse ones, frame by frame."""
    jobs, share = jobs_of(PARTS[part], quick, folder), quiet(patience)
    found = in_turns(jobs, QUICK_FRAMES if quick else FRAMES, PLACE)
    for table in found.values():
        table["ratio"] = median(a / b for a, b in zip(table["frames"], found[DIFFUSE]["frames"], strict=True))
    log(f"{part}: " + ", ".join(f"{name} {table['ms']:.3g} ms, {table['ratio']:.3f}x"
                                for name, table in found.items()))  # fmt: skip
    np.savez(folder / f"gloss-{part}.npz", **{name: _image(job) for name, job in jobs.items()})  # type: ignore[arg-type]
    return {"machine": describe(), "resolution": list(RESOLUTION), "busy": share, "surfaces": found}


def _image(job: Job) -> Float32:
    with open_case(job) as case:
        (composed,) = frames(case, SHOWN[0], [job.seed])
    image: Float32 = composed.images[SHOWN[1]]
    return image
