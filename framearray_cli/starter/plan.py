"""A scene file -> a first job: cameras and lights of the file, or some chosen by tracing rays in the scene."""

import re
from pathlib import Path

import numpy as np

from framearray_cli.base.errors import JobError
from framearray_cli.job.job import NAME
from framearray_cli.scene.files import read_stage
from framearray_cli.scene.files.model import SCREENED
from framearray_cli.scene.scene import Scene, load_scene

from .cameras import choose_shot
from .environment import Maps
from .lighting import add_lights
from .model import FPS, MaterialNote, Start, Vector, round_vector, without_accents
from .options import StartOptions
from .shining import AllNames
from .site import Site, explored

LINEAR = ("exr", "tif")  # formats whose images can be added up
SKY: Vector = (0.7, 0.85, 1.05)  # radiance, as in the jobs that come with the project: a bright day
ROOM_RANGE, THING_RANGE = 0.5, 0.2  # d_max over the height of a room, and over the largest extent of a thing


def plan_start(file: Path, name: str, options: StartOptions, maps: Maps | None = None) -> Start:
    """Choose a first job for a scene.

    Args:
        name: of the job, as a person wrote it.
        maps: where an environment of the file is saved; None: it is left out.

    Raises:
        SceneError: a scene that cannot be read, that has no inside where one is asked for, or whose visible surfaces no
            light reaches.
        JobError: no camera of that name, a sun that never rises, or groups in a format that cannot hold them.
        OutputError: the file of an environment is in the way, or cannot be written.
    """
    if options.groups and options.image_format not in LINEAR:
        problem = f'--groups: expected --format exr or tif, as groups are added up afterwards, got "{options.format}"'
        raise JobError(str(file), [problem])
    scene, stage = load_scene(file, shining=AllNames(), as_file=True), read_stage(file)
    with explored(scene, file, options, stage) as site:
        shot = choose_shot(site, stage, options, file)
        start = Start(
            name=_job_name(name),
            file=file,
            up=site.up_name,
            background=SKY,
            camera=shot.camera,
            light_frames=1,
            sources=(),
            range=_range(site, shot.inside),
            inside=shot.inside,
            about=shot.about or site.about,
            materials=_materials(scene),
            unit="" if site.unit is None else site.unit.name,
            notes=scene.report.notes,
            fps=stage.fps or FPS,
            format=options.image_format,
            as_file=_says_more(scene),
        )
        return add_lights(site, start, stage, options, shot.ends, maps)


def _says_more(scene: Scene) -> bool:
    """Whether a scene, read as its file says, has more than diffuse surfaces and mirrors."""
    shines = bool((scene.emission > 0).any())
    screens = bool((scene.alpha_cutoff == SCREENED).any())
    return scene.is_glossy or scene.has_glass or shines or screens or len(scene.tangents) > 0 or len(scene.levels) > 0


def _range(site: Site, inside: bool) -> float:
    """d_max, from the height of the room or the size of the thing."""
    if site.room is not None and (inside or site.room.roofless):
        return float(f"{ROOM_RANGE * site.room.height:.2g}")
    return float(f"{THING_RANGE * site.size:.2g}")


def _job_name(name: str) -> str:
    """A name without characters that some file system refuses."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", without_accents(name)).strip("-.")[:60]
    return name if re.fullmatch(NAME, name) else "scene"


def _materials(scene: Scene) -> tuple[MaterialNote, ...]:
    """Every material that some triangle has, in the order of the file."""
    found: dict[str, MaterialNote] = {}
    for k in np.unique(scene.material):
        name = scene.material_names[k]
        more = "times a texture" if scene.reflectivity_texture[k] >= 0 or scene.specular_texture[k] >= 0 else ""
        note = MaterialNote(
            name=name,
            reflectivity=round_vector(np.round(scene.reflectivity[k], 3)),
            specular=round_vector(np.round(scene.specular[k], 3)),
            more=more,
            gloss=_gloss(scene, k),
        )
        found.setdefault(name, note)
    return tuple(found.values())


def _gloss(scene: Scene, material: int) -> tuple[float, float] | None:
    """Roughness and metal of a material, rounded; None of what is not glossy."""
    if not len(scene.roughness) or not scene.roughness[material] > 0:
        return None
    return round(float(scene.roughness[material]), 3), round(float(scene.metallic[material]), 3)
