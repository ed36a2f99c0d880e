"""The sun of a job whose hours are counted."""

from dataclasses import replace
from datetime import datetime

import numpy as np

from framearray_cli.base.sundays import sun_days
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.engine.terms.sun_hours import SunStudy
from framearray_cli.job.job import Job
from framearray_cli.job.sources import SunSource
from framearray_cli.scene.paths.paths import Lights, lights_without_groups


def sun_study(job: Job, lights: Lights) -> SunStudy:
    """Return the sun of a job without all other light, of strength 1 where it is up.

    Args:
        lights: of the job, at all positions or a few.
    """
    i = next(i for i, source in enumerate(job.light.sources) if isinstance(source, SunSource))
    positions = next((group.positions for group in lights.groups if i in group.sources), range(lights.n))
    path = lights.sources[i].at(positions)
    up = (path.intensity > 0).any(axis=1, keepdims=True)
    sun = replace(path, intensity=np.where(up, 1.0, np.zeros((1, 3))))
    days = sun_days([datetime.fromisoformat(note["time"]) for note in path.notes])
    return SunStudy(lights=light_arrays(lights_without_groups([sun]), np.zeros(3)), days=days)
