"""A scene file -> a first job: cameras and lights of the file, or some chosen by tracing rays in the scene."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.engine.embree import EmbreeScene
from framearray_cli.job.job import NAME, Z_UP_FORMATS
from framearray_cli.scene.files import Stage, read_stage
from framearray_cli.scene.scene import Scene, load_scene

from .expose import find_factors
from .model import Camera, EyeKey, LightKeys, MaterialNote, Start, Vector, round_points, round_vector
from .orbit import FOV_DEG as ORBIT_FOV
from .orbit import KEYS, SUN_KEYS, choose_orbit, key_frames, sun_directions
from .rays import Probe
from .room import Room, choose_lamp_path, choose_walk, find_room, surroundings
from .staged import choose_camera, convert_camera, convert_lights
from .views import FOV_DEG as ROOM_FOV

EYES, LIGHTS = 24, 12  # of a first array: enough for a smooth walk, and rendered in a minute
RESOLUTION = (320, 240)
SKY: Vector = (0.7, 0.85, 1.05)  # radiance, as in the jobs that come with the project: a bright day
LAMP: Vector = (1.0, 0.92, 0.8)  # colour of a lamp, and of the sun
SUN: Vector = (1.0, 0.94, 0.84)
ROOM_RANGE, THING_RANGE = 0.5, 0.2  # d_max over the height of a room, and over the largest extent of a thing
DEPTH_SHARE = 0.25  # distance from a camera of the file to its target over the size of the scene


@dataclass(frozen=True, slots=True, kw_only=True)
class StartOptions:
    """Options of `init`; None: the starter chooses.

    Attributes:
        camera: name of a camera of the file.
        frames, lights: numbers of frames of the camera and of positions of the light.
        inside: whether the scene is a room.
    """

    camera: str | None = None
    frames: int | None = None
    lights: int | None = None
    inside: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Site:
    """A scene and what rays found in it."""

    probe: Probe
    up: int
    room: Room | None
    size: float  # largest extent

    @property
    def centre(self) -> Float64:
        return self.probe.scene.centre


def plan_start(file: Path, options: StartOptions) -> Start:
    """Choose a first job for a scene.

    Raises:
        SceneError: a scene that cannot be read, that has no inside where one is asked for, or whose visible surfaces no
            light reaches.
        JobError: no camera of that name.
    """
    scene, stage = load_scene(file), read_stage(file)
    up: Literal["y", "z"] = "z" if file.suffix.lower() in Z_UP_FORMATS else "y"
    corners = scene.corners.reshape(-1, 3)
    size = float(max(corners[:, axis].max() - corners[:, axis].min() for axis in range(3)))
    with EmbreeScene(scene) as embree:
        probe = Probe(scene=scene, embree=embree)
        axis = 2 if up == "z" else 1
        room, share = (None, 0.0) if options.inside is False else find_room(probe, axis)
        if options.inside:  # perhaps its faces are turned outwards, and only cupboards are closed from their fronts
            turned = replace(probe, turned=True)
            other, more = find_room(turned, axis)
            if more > share:
                probe, room, share = turned, other, more
        if options.inside and room is None:
            raise SceneError(f"{file}: --inside: nothing in it looks like the inside of a room")
        site = _Site(probe=probe, up=axis, room=room, size=size)
        camera, targets, inside, about = _choose_camera(site, stage, options, file, share)
        start = Start(
            name=_job_name(file),
            file=file,
            up=up,
            background=SKY,
            camera=camera,
            light_frames=1,
            sources=(),
            range=_range(site, inside),
            inside=inside,
            about=tuple(about),
            materials=_materials(scene),
        )
        return _add_lights(site, start, stage, options, targets)


def _choose_camera(
    site: _Site, stage: Stage, options: StartOptions, file: Path, share: float
) -> tuple[Camera, Float64, bool, list[str]]:
    """Choose the camera; return also its first and last eye and target, (2, 2, 3), whether it is inside, and why."""
    found = choose_camera(stage, options.camera, file)
    if found is not None:
        camera = convert_camera(stage, found, options.frames, DEPTH_SHARE * site.size)
        ends = np.array([[key.eye, key.target] for key in (camera.keys[0], camera.keys[-1])]) - site.centre
        inside = bool(surroundings(site.probe, ends[:, 0])[0].all()) if options.inside is None else options.inside
        return camera, ends, inside and site.room is not None, ["The file brings its own camera."]
    if site.room is not None:
        walk = choose_walk(site.probe, site.room)
        if walk is not None:
            ends = np.stack([walk.eyes, np.array([walk.target] * 2)], axis=1)
            why = f"{share:.0%} of its bounds are inside, so it is taken for a room; --outside says otherwise."
            return _walk_camera(site, ends, options), ends, True, [why]
    frames, shares = key_frames(options.frames or EYES, KEYS)
    eyes, target = choose_orbit(site.probe, site.up, shares)
    ends = np.stack([eyes, np.array([target] * len(eyes))], axis=1)
    why = "There is no room in it to be inside of, so it is looked at from outside; --inside says otherwise."
    return _orbit_camera(site, eyes, target, frames, options), ends[[0, -1]], False, [why]


def _walk_camera(site: _Site, ends: Float64, options: StartOptions) -> Camera:
    n = options.frames or EYES
    points = [round_points(end + site.centre, site.size) for end in ends]
    last = {n - 1: points[1]} if n > 1 and points[1][0] != points[0][0] else {}
    keys = tuple(EyeKey(frame=f, eye=eye, target=target) for f, (eye, target) in ({0: points[0]} | last).items())
    about = ("a short walk; `target` is what the eye looks at",)
    return Camera(keys=keys, frames=n, fov_deg=ROOM_FOV, resolution=RESOLUTION, about=about)


def _orbit_camera(site: _Site, eyes: Float64, target: Float64, frames: list[int], options: StartOptions) -> Camera:
    n = options.frames or EYES
    (at,) = round_points(target[None] + site.centre, site.size)
    points = round_points(eyes + site.centre, site.size)
    keys = tuple(EyeKey(frame=frame, eye=eye, target=at) for frame, eye in zip(frames, points, strict=True))
    about = ("a quarter of a circle around the thing; `target` is its middle",)
    return Camera(keys=keys, frames=n, fov_deg=ORBIT_FOV, resolution=RESOLUTION, about=about)


def _add_lights(site: _Site, start: Start, stage: Stage, options: StartOptions, ends: Float64) -> Start:
    """Add the lights of the file, or a lamp inside, or a sun outside, at the strength that exposes pictures well."""
    scene, embree = site.probe.scene, site.probe.embree
    about = [*start.about, *stage.notes]
    sources, n = convert_lights(stage, options.lights)
    if sources:
        own = replace(start, sources=sources, light_frames=n)
        if (factors := find_factors(own, scene, embree)) is not None:
            return _scale_lights(replace(own, about=(*about, "The file brings its own lights.")), *factors)
        about.append("The lights of the file light nothing that its pictures show, so others were chosen.")
    n = options.lights or LIGHTS
    for source in _lights_to_try(site, start, ends, n):
        chosen = replace(start, sources=(source,), light_frames=n, about=tuple(about))
        if (factors := find_factors(chosen, scene, embree)) is not None:
            return _scale_lights(chosen, *factors)
    raise SceneError(f"{start.file}: no light reaches what the camera sees; its surfaces may be black")


def _lights_to_try(site: _Site, start: Start, ends: Float64, n: int) -> list[LightKeys]:
    """Lights to try in turn: a lamp where there is a room, then a sun from behind the eye, then a lamp at the eye."""
    found = []
    eyes, targets = ends[:, 0], ends[:, 1]
    if start.inside and site.room is not None:
        way = choose_lamp_path(site.probe, site.room, eyes, targets)
        if way is not None:
            points = round_points(way + site.centre, site.size)
            frames = [0, n - 1] if n > 1 and points[0] != points[1] else [0]
            found.append(_make_light("point", frames, points, LAMP, "a lamp that is carried through the room"))
    frames, shares = key_frames(n, SUN_KEYS)
    suns = sun_directions(eyes.mean(axis=0) - targets.mean(axis=0), site.up, shares)
    about = "a sun that goes over from left to right behind the eye; `direction` is the way its light travels"
    found.append(_make_light("directional", frames, [_round_direction(way) for way in suns], SUN, about))
    (eye,) = round_points(eyes[:1] + site.centre, site.size)
    found.append(_make_light("point", [0], [eye], LAMP, "a lamp at the eye"))
    return found


def _make_light(
    kind: Literal["point", "directional"], frames: list[int], vectors: list[Vector], power: Vector, about: str
) -> LightKeys:
    n = len(frames)
    return LightKeys(kind=kind, frames=tuple(frames), vectors=tuple(vectors[:n]), powers=(power,) * n, about=(about,))


def _scale_lights(start: Start, factor: float, sky: float) -> Start:
    """Multiply all lights by `factor`, and the background by `sky`."""

    def strong(power: Vector, by: float) -> Vector:
        red, green, blue = (float(f"{channel * by:.3g}") for channel in power)
        return red, green, blue

    sources = tuple(replace(s, powers=tuple(strong(power, factor) for power in s.powers)) for s in start.sources)
    return replace(start, sources=sources, background=strong(start.background, sky))


def _range(site: _Site, inside: bool) -> float:
    """d_max, from the height of the room or the size of the thing."""
    if inside and site.room is not None:
        return float(f"{ROOM_RANGE * site.room.height:.2g}")
    return float(f"{THING_RANGE * site.size:.2g}")


def _job_name(file: Path) -> str:
    """The name of the file, without characters that some file system refuses."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem).strip("-.")[:60]
    return name if re.fullmatch(NAME, name) else "scene"


def _round_direction(way: Float64) -> Vector:
    return round_vector(np.round(way, 3))


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
        )
        found.setdefault(name, note)
    return tuple(found.values())
