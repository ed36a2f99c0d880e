"""Materials of the scene that sources of a job let shine: their emission, and what is wrong with them."""

import difflib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.job.job import Job
from framearray_cli.scene.files.model import join_names
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import Lights
from framearray_cli.scene.scene import Scene

NAMES_IN_A_MESSAGE = 6


def with_emission(job: Job, lights: Lights, scene: Scene) -> Lights:
    """Return the lights with the radiance of all meshes, where the scene file says what their materials emit.

    Raises:
        JobError: a material is missing, has no triangles or emits nothing.
    """
    if all(source.emitter is None for source in lights.sources):
        return lights
    if problems := list(_problems(lights, scene)):
        raise JobError(job.file or job.name, problems)
    return replace(lights, sources=tuple(_absolute(source, scene) for source in lights.sources))


def _absolute(source: LightPath, scene: Scene) -> LightPath:
    """Multiply the intensity of a mesh by the emission of its material."""
    if source.emitter is None or source.emitter.absolute:
        return source
    emission = scene.emission[_rows(source.emitter.material, scene)].max(axis=0).astype(np.float64)
    return replace(source, intensity=source.intensity * emission, emitter=replace(source.emitter, absolute=True))


def _rows(name: str, scene: Scene) -> list[int]:
    """The materials of a name; a mesh without texture coordinates has one of its own."""
    return [m for m, known in enumerate(scene.material_names) if known == name]


def _problems(lights: Lights, scene: Scene) -> Iterator[str]:
    """Say what is wrong with the materials of all meshes."""
    first: dict[str, int] = {}
    used = set(np.unique(scene.material).tolist())
    for s, source in enumerate(lights.sources):
        if (emitter := source.emitter) is None:
            continue
        name, place = emitter.material, f"light.sources[{s}].material"
        rows = _rows(name, scene)
        if not rows:
            known = sorted(set(scene.material_names), key=lambda other: -_likeness(name, other))
            yield (
                f"{place}: expected a material of the scene, got {shown(name)}; it has "
                f"{join_names(known, NAMES_IN_A_MESSAGE)}"
            )
        elif not used.intersection(rows):
            yield f"{place}: expected a material that some triangle of the scene has, got {shown(name)}, which has none"
        elif not emitter.absolute and not (scene.emission[rows] > 0).any():
            yield (
                f"{place}: expected a material that emits light, got {shown(name)}, whose emission in the scene file "
                "is black; give `radiance` in the keys of the source"
            )
        if name in first:
            yield f"{place}: expected a material that no other source has, got that of light.sources[{first[name]}]"
        first.setdefault(name, s)


def _likeness(name: str, known: str) -> float:
    return difflib.SequenceMatcher(None, name.lower(), known.lower()).ratio()
