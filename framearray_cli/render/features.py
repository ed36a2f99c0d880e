"""The features of a job: what of the engine it needs, by its keys and its scene."""

from dataclasses import replace
from datetime import datetime

import numpy as np

from framearray_cli.base.sundays import sun_days
from framearray_cli.engine.features.aov import Aov
from framearray_cli.engine.features.emission import AreaLights, UnlistedEmission
from framearray_cli.engine.features.glass import Glass
from framearray_cli.engine.features.gloss import Gloss
from framearray_cli.engine.features.sun_hours import SunHours
from framearray_cli.engine.features.surface import Alpha, SurfaceLayers
from framearray_cli.engine.frames.setup import Feature
from framearray_cli.engine.inputs.aov import aov_tables
from framearray_cli.engine.inputs.emitters import Emitters, Glow, glows
from framearray_cli.engine.inputs.gloss import Glossy
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.job.job import Job
from framearray_cli.job.sources import SunSource
from framearray_cli.scene.paths.paths import Lights, lights_without_groups
from framearray_cli.scene.scene import Scene

# All layers, and a material with each property: kernels are compiled for a job that has them.
EVERY_LAYER = dict.fromkeys(("layers", "alpha", "position", "uv", "cryptomatte"), True)
EVERY_PROPERTY = {"mirror": {"reflectivity": 0.1, "specular": 0.8}}


def features_of(
    job: Job, scene: Scene, lights: Lights, emitters: Emitters, glossy: Glossy, glow: Glow
) -> tuple[Feature, ...]:
    """Return the features of a job, in the order in which they act.

    Args:
        emitters: the triangles of area lights; `glow`: surfaces that shine without being a source.
    """
    output, found = job.output, list[Feature]()
    if emitters.span.size:
        found.append(AreaLights())
    if glows(glow):
        found.append(UnlistedEmission(glow))
    if scene.has_glass:
        found.append(Glass())
    if scene.is_glossy:
        found.append(Gloss(glossy, glass=scene.has_glass, lobes=job.specular.depth > 0))
    if output.alpha:
        found.append(Alpha())
    if output.layers:
        found.append(SurfaceLayers())
    if (tables := aov_tables(scene, **output.aov)) is not None:
        found.append(Aov(tables, glass=scene.has_glass))
    if job.sun_days:
        found.append(sun_hours(job, lights))
    return tuple(found)


def sun_hours(job: Job, lights: Lights) -> SunHours:
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
    return SunHours(light_arrays(lights_without_groups([sun]), np.zeros(3)), days)
