"""Scene -> first job (`init`).

The job can be rendered as it is, with the cameras, lights and animations of the file, or with a walk or orbit that the
starter chooses by tracing rays in the scene.
"""

import re
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError
from framearray_cli.base.files import require_new, write_bytes
from framearray_cli.base.forms.toml import require_scene
from framearray_cli.job.job import NAME
from framearray_cli.render.precompile import FLOATS
from framearray_cli.render.precompile import offer_beside as offer
from framearray_cli.scene.files import Stage, read_stage
from framearray_cli.scene.files.model import SCREENED
from framearray_cli.scene.paths.curves import unit
from framearray_cli.scene.scene import Scene, load_scene

from .draft import (
    FPS,
    INDIRECT,
    MaterialNote,
    NotedTable,
    Start,
    StartOptions,
    SunOption,
    Up,
    Vector,
    round_points,
    round_vector,
    table_of,
    to_text,
    validate_job,
    without_accents,
)
from .lighting import AllNames, add_lights, noon_direction
from .probe import directions_around
from .site import Site, explored, surroundings
from .staged import choose_camera, convert_camera
from .walks import KEYS, ORBIT_FOV_DEG, ROOM_FOV_DEG, choose_orbit, choose_walk, key_frames

__all__ = ["Start", "StartOptions", "SunOption", "init", "offer_beside", "to_text"]

LINEAR = ("exr", "tif")  # formats whose images can be added up
SKY: Vector = (0.7, 0.85, 1.05)  # radiance, as in the jobs that come with the project: a bright day

EYES = 24  # of a first array: enough for a smooth walk
RESOLUTION = (320, 240)
# Backs are hidden if these shares of what is met are backs of one-sided materials; rays from an eye, within this angle.
SOME_BACKS, BACK_RAYS, BACK_SPREAD = (0.005, 0.3), 512, 0.6
DEPTH_SHARE = 0.25  # distance from a camera of the file to its target over the size of the scene


def init(scene: Path, job_file: Path, options: StartOptions, *, force: bool = False) -> Start:
    """Write a first job for a scene; the job, and the folder of its images, have the name of the file.

    Args:
        force: replace an existing file.

    Raises:
        SceneError: the scene cannot be read, or has no inside where one is asked for.
        JobError: no camera has the name in the options, the sun never rises, or the format cannot hold groups.
        OutputError: the job file exists already or cannot be written.
    """
    require_scene(scene)
    require_new(job_file, force=force)
    start = _plan(scene, job_file.stem, options)
    validate_job(table_of(start), scene)
    write_bytes(job_file, to_text(start, job_file).encode("utf-8"))
    return start


def offer_beside() -> None:
    """Have a second process compile kernels that a first job needs, should any be missing."""
    offer({"scene": {"surfaces": "file"}, "indirect": {"method": INDIRECT}} | FLOATS)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _ChosenCamera:
    """A camera, and what it shows.

    Attributes:
        ends: (2, 2, 3) first and last eye and target, in centred coordinates.
        inside: True if it is inside a room.
        about: why it was chosen.
    """

    camera: NotedTable
    ends: Float64
    inside: bool
    about: tuple[str, ...] = ()


def _plan(file: Path, name: str, options: StartOptions) -> Start:
    """Choose a first job for a scene; the name of the job is as a person wrote it."""
    if options.groups and options.image_format not in LINEAR:
        problem = f'--groups: expected --format exr or tif, as groups are added up afterwards, got "{options.format}"'
        raise JobError(str(file), [problem])
    scene = load_scene(file, folders=options.folders, shining=AllNames(), as_file=True)
    stage = read_stage(file, options.folders)
    options, place = _at_home(options, stage)
    with explored(scene, file, options, stage) as site:
        up: Up = "z" if site.up == 2 else "y"
        options = replace(options, sun=options.sun and options.sun.with_axis(up))
        shot = _choose_shot(site, stage, options, file)
        start = Start(
            name=_job_name(name),
            file=file,
            up=up,
            background=SKY,
            camera=shot.camera,
            light_frames=1,
            sources=(),
            inside=shot.inside,
            about=(*(shot.about or site.about), *place),
            materials=_materials(scene),
            notes=scene.report.notes,
            fps=stage.fps or FPS,
            format=options.image_format,
            as_file=_says_more(scene),
            hide_backs=_shows_backs(site, shot.ends),
            folders=options.folders,
        )
        return add_lights(site, start, stage, options, shot.ends)


def _at_home(options: StartOptions, stage: Stage) -> tuple[StartOptions, tuple[str, ...]]:
    """Take the sun over the place where the file says that the scene stands; also return a reason."""
    if options.room is not None:
        options = replace(options, inside=True)
    if stage.earth is None:
        return options, ()
    sun, north = options.sun, round_vector(np.round(stage.earth.north, 6))
    if sun is not None:
        return replace(options, sun=sun._replace(north=north if sun.north is None else sun.north)), ()
    latitude, longitude = round(stage.earth.latitude, 5), round(stage.earth.longitude, 5)
    sun = SunOption(latitude, longitude, (date(date.today().year, 6, 21),), north)
    why = "The file says where it stands, so the sun of its place lights it; --sun chooses another place or day."
    return replace(options, sun=sun), (why,)


def _says_more(scene: Scene) -> bool:
    """True if a scene, read as its file says, has more than diffuse surfaces and mirrors."""
    shines = bool((scene.emission > 0).any())
    screens = bool((scene.alpha_cutoff == SCREENED).any())
    return scene.is_glossy or scene.has_glass or shines or screens or len(scene.tangents) > 0 or len(scene.levels) > 0


def _shows_backs(site: Site, ends: Float64) -> bool:
    """True if a camera sees some backs of one-sided materials; where it sees little else, faces are turned around."""
    if site.probe.turned or not site.probe.scene.one_sided.any():
        return False
    origins = np.repeat(ends[:, 0], BACK_RAYS, axis=0)
    way = np.repeat(unit(ends[:, 1] - ends[:, 0]), BACK_RAYS, axis=0)
    seen = site.probe.trace(origins, way + BACK_SPREAD * np.tile(directions_around(BACK_RAYS), (len(ends), 1)))
    backs = seen.hit & ~seen.front & (site.probe.scene.one_sided[site.probe.scene.material[seen.triangle]] > 0)
    return SOME_BACKS[0] <= float(backs.sum() / max(int(seen.hit.sum()), 1)) <= SOME_BACKS[1]


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
        glossy = len(scene.roughness) > 0 and scene.roughness[k] > 0
        gloss = (round(float(scene.roughness[k]), 3), round(float(scene.metallic[k]), 3)) if glossy else None
        note = MaterialNote(
            name=name,
            reflectivity=round_vector(np.round(scene.reflectivity[k], 3)),
            specular=round_vector(np.round(scene.specular[k], 3)),
            more=more,
            gloss=gloss,
        )
        found.setdefault(name, note)
    return tuple(found.values())


def _choose_shot(site: Site, stage: Stage, options: StartOptions, file: Path) -> _ChosenCamera:
    """Choose a camera: one of the file, a walk in a room, or an orbit around a thing."""
    found = choose_camera(stage, options.camera, file)
    if found is not None:
        camera = convert_camera(stage, found, options.frames, DEPTH_SHARE * site.size, options.resolution)
        ends = np.array([[key["eye"], key["target"]] for key in (camera.keys[0], camera.keys[-1])]) - site.centre
        inside = bool(surroundings(site.probe, ends[:, 0])[0].all()) if options.inside is None else options.inside
        room = site.room is not None and not site.room.roofless
        return _ChosenCamera(
            camera=camera, ends=ends, inside=inside and room, about=("The file brings its own camera.",)
        )
    if site.room is not None:
        walk = choose_walk(site.probe, site.room, site.metre)
        if walk is not None:
            return _ChosenCamera(camera=_walk_camera(site, walk, options), ends=walk, inside=not site.room.roofless)
    frames, shares = key_frames(options.frames or EYES, KEYS)
    width, height = options.resolution or RESOLUTION
    to_sun = noon_direction(options.sun, file, site.up) if options.sun else None
    eyes, target = choose_orbit(site.probe, site.up, shares, width / height, from_above=site.from_above, to_sun=to_sun)
    ends = np.stack([eyes, np.array([target] * len(eyes))], axis=1)
    return _ChosenCamera(camera=_orbit_camera(site, eyes, target, frames, options), ends=ends[[0, -1]], inside=False)


def _walk_camera(site: Site, ends: Float64, options: StartOptions) -> NotedTable:
    first, last = (round_points(end + site.centre, site.size) for end in ends)
    moves = last[0] != first[0]
    n = (options.frames or EYES) if moves else 1
    points = {0: first} | ({n - 1: last} if n > 1 else {})
    what = "a short walk" if moves else "an eye that stands still, as no way leads on; a second key makes it move"
    return _camera(points, n, ROOM_FOV_DEG, options, f"{what}; `target` is what the eye looks at")


def _orbit_camera(site: Site, eyes: Float64, target: Float64, frames: list[int], options: StartOptions) -> NotedTable:
    (at,) = round_points(target[None] + site.centre, site.size)
    points = {frame: [eye, at] for frame, eye in zip(frames, round_points(eyes + site.centre, site.size), strict=True)}
    about = "a quarter of a circle around the thing; `target` is its middle"
    return _camera(points, options.frames or EYES, ORBIT_FOV_DEG, options, about)


def _camera(points: dict[int, list[Vector]], n: int, fov: float, options: StartOptions, about: str) -> NotedTable:
    """Make `[camera]` of an eye and a target at some of n frames."""
    keys = [{"frame": f, "eye": list(eye), "target": list(target)} for f, (eye, target) in points.items()]
    resolution = list(options.resolution or RESOLUTION)
    return NotedTable(table={"resolution": resolution, "fov": fov, "frames": n, "keys": keys}, about=(about,))
