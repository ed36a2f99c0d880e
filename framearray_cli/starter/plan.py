"""From a scene file to a first job: what the file brings along, and the rest by looking around in it."""

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

from .expose import factors_for
from .model import Camera, EyeKey, LightKeys, MaterialNote, Start, Vector, rounded, tidy
from .orbit import FOV_DEG as ORBIT_FOV
from .orbit import KEYS, SUN_KEYS, key_frames, orbit, sun_over
from .rays import Probe
from .room import Room, find_room, lamp_way, surroundings, walk_through
from .staged import chosen_camera, staged_camera, staged_lights
from .views import FOV_DEG as ROOM_FOV

EYES, LIGHTS = 24, 12  # of a first array: enough to walk through it, and rendered in a minute
RESOLUTION = (320, 240)
SKY: Vector = (0.7, 0.85, 1.05)  # radiance, as in the jobs that come with the project: a bright day
LAMP: Vector = (1.0, 0.92, 0.8)  # colour of a lamp, and of the sun
SUN: Vector = (1.0, 0.94, 0.84)
ROOM_RANGE, THING_RANGE = 0.5, 0.2  # d_max over the height of a room, and over the largest extent of a thing
DEPTH_SHARE = 0.25  # of the scene's size: how far before a file's camera its target is set


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What the user says; None: it is chosen.

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
class _Place:
    """The scene, looked at."""

    probe: Probe
    up: int
    room: Room | None
    size: float  # largest extent

    @property
    def centre(self) -> Float64:
        return self.probe.scene.centre


def plan_start(file: Path, wishes: Wishes) -> Start:
    """Choose a first job for a scene.

    Raises:
        SceneError: a scene that cannot be read, or has nothing to stand in front of or inside of.
        JobError: no camera of that name.
    """
    scene, stage = load_scene(file), read_stage(file)
    up: Literal["y", "z"] = "z" if file.suffix.lower() in Z_UP_FORMATS else "y"
    corners = scene.corners.reshape(-1, 3)
    size = float(max(corners[:, axis].max() - corners[:, axis].min() for axis in range(3)))
    with EmbreeScene(scene) as embree:
        probe = Probe(scene=scene, embree=embree)
        axis = 2 if up == "z" else 1
        room, share = (None, 0.0) if wishes.inside is False else find_room(probe, axis)
        if wishes.inside:  # perhaps its faces are turned outwards, and only cupboards are closed from their fronts
            turned = replace(probe, turned=True)
            other, more = find_room(turned, axis)
            if more > share:
                probe, room, share = turned, other, more
        if wishes.inside and room is None:
            raise SceneError(f"{file}: --inside: nothing in it looks like the inside of a room")
        place = _Place(probe=probe, up=axis, room=room, size=size)
        camera, targets, inside, about = _camera(place, stage, wishes, file, share)
        start = Start(
            name=_job_name(file),
            file=file,
            up=up,
            background=SKY,
            camera=camera,
            light_frames=1,
            sources=(),
            range=_range(place, inside),
            inside=inside,
            about=tuple(about),
            materials=_materials(scene),
        )
        return _with_lights(place, start, stage, wishes, targets)


def _camera(
    place: _Place, stage: Stage, wishes: Wishes, file: Path, share: float
) -> tuple[Camera, Float64, bool, list[str]]:
    """The camera; its first and last eye and target, (2, 2, 3), centred; whether it is inside; and why."""
    found = chosen_camera(stage, wishes.camera, file)
    if found is not None:
        camera = staged_camera(stage, found, wishes.frames, DEPTH_SHARE * place.size)
        ends = np.array([[key.eye, key.target] for key in (camera.keys[0], camera.keys[-1])]) - place.centre
        inside = bool(surroundings(place.probe, ends[:, 0])[0].all()) if wishes.inside is None else wishes.inside
        return camera, ends, inside and place.room is not None, ["The file brings its own camera."]
    if place.room is not None:
        walk = walk_through(place.probe, place.room)
        if walk is not None:
            ends = np.stack([walk.eyes, np.array([walk.target] * 2)], axis=1)
            why = f"{share:.0%} of its bounds are inside, so it is taken for a room; --outside says otherwise."
            return _walk_camera(place, ends, wishes), ends, True, [why]
    frames, shares = key_frames(wishes.frames or EYES, KEYS)
    eyes, target = orbit(place.probe, place.up, shares)
    ends = np.stack([eyes, np.array([target] * len(eyes))], axis=1)
    why = "There is no room in it to be inside of, so it is looked at from outside; --inside says otherwise."
    return _orbit_camera(place, eyes, target, frames, wishes), ends[[0, -1]], False, [why]


def _walk_camera(place: _Place, ends: Float64, wishes: Wishes) -> Camera:
    n = wishes.frames or EYES
    points = [tidy(end + place.centre, place.size) for end in ends]
    last = {n - 1: points[1]} if n > 1 and points[1][0] != points[0][0] else {}
    keys = tuple(EyeKey(frame=f, eye=eye, target=target) for f, (eye, target) in ({0: points[0]} | last).items())
    about = ("a short walk; `target` is what the eye looks at",)
    return Camera(keys=keys, frames=n, fov_deg=ROOM_FOV, resolution=RESOLUTION, about=about)


def _orbit_camera(place: _Place, eyes: Float64, target: Float64, frames: list[int], wishes: Wishes) -> Camera:
    n = wishes.frames or EYES
    (at,) = tidy(target[None] + place.centre, place.size)
    points = tidy(eyes + place.centre, place.size)
    keys = tuple(EyeKey(frame=frame, eye=eye, target=at) for frame, eye in zip(frames, points, strict=True))
    about = ("a quarter of a circle around the thing; `target` is its middle",)
    return Camera(keys=keys, frames=n, fov_deg=ORBIT_FOV, resolution=RESOLUTION, about=about)


def _with_lights(place: _Place, start: Start, stage: Stage, wishes: Wishes, ends: Float64) -> Start:
    """Add the lights of the file, or a lamp inside, or a sun outside; as strong as pictures need them."""
    scene, embree = place.probe.scene, place.probe.embree
    about = [*start.about, *stage.notes]
    sources, n = staged_lights(stage, wishes.lights)
    if sources:
        own = replace(start, sources=sources, light_frames=n)
        if (factors := factors_for(own, scene, embree)) is not None:
            return _exposed(replace(own, about=(*about, "The file brings its own lights.")), *factors)
        about.append("The lights of the file light nothing that its pictures show, so others were chosen.")
    n = wishes.lights or LIGHTS
    for source in _own_lights(place, start, ends, n):
        chosen = replace(start, sources=(source,), light_frames=n, about=tuple(about))
        if (factors := factors_for(chosen, scene, embree)) is not None:
            return _exposed(chosen, *factors)
    raise SceneError(f"{start.file}: no light reaches what the camera sees; its surfaces may be black")


def _own_lights(place: _Place, start: Start, ends: Float64, n: int) -> list[LightKeys]:
    """Lights to try in turn: a lamp where there is a room, then a sun from behind the eye, then a lamp at the eye."""
    found = []
    eyes, targets = ends[:, 0], ends[:, 1]
    if start.inside and place.room is not None:
        way = lamp_way(place.probe, place.room, eyes, targets)
        if way is not None:
            points = tidy(way + place.centre, place.size)
            frames = [0, n - 1] if n > 1 and points[0] != points[1] else [0]
            found.append(_moving("point", frames, points, LAMP, "a lamp that is carried through the room"))
    frames, shares = key_frames(n, SUN_KEYS)
    suns = sun_over(eyes.mean(axis=0) - targets.mean(axis=0), place.up, shares)
    about = "a sun that goes over from left to right behind the eye; `direction` is the way its light travels"
    found.append(_moving("directional", frames, [_short(way) for way in suns], SUN, about))
    (eye,) = tidy(eyes[:1] + place.centre, place.size)
    found.append(_moving("point", [0], [eye], LAMP, "a lamp at the eye"))
    return found


def _moving(
    kind: Literal["point", "directional"], frames: list[int], vectors: list[Vector], power: Vector, about: str
) -> LightKeys:
    n = len(frames)
    return LightKeys(kind=kind, frames=tuple(frames), vectors=tuple(vectors[:n]), powers=(power,) * n, about=(about,))


def _exposed(start: Start, factor: float, sky: float) -> Start:
    """Multiply all lights, and the background."""

    def strong(power: Vector, by: float) -> Vector:
        red, green, blue = (float(f"{channel * by:.3g}") for channel in power)
        return red, green, blue

    sources = tuple(replace(s, powers=tuple(strong(power, factor) for power in s.powers)) for s in start.sources)
    return replace(start, sources=sources, background=strong(start.background, sky))


def _range(place: _Place, inside: bool) -> float:
    """d_max, from the height of the room or the size of the thing."""
    if inside and place.room is not None:
        return float(f"{ROOM_RANGE * place.room.height:.2g}")
    return float(f"{THING_RANGE * place.size:.2g}")


def _job_name(file: Path) -> str:
    """The name of the file, with what no file system takes replaced."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem).strip("-.")[:60]
    return name if re.fullmatch(NAME, name) else "scene"


def _short(way: Float64) -> Vector:
    return rounded(np.round(way, 3))


def _materials(scene: Scene) -> tuple[MaterialNote, ...]:
    """Every material that some triangle has, in the order of the file."""
    found: dict[str, MaterialNote] = {}
    for k in np.unique(scene.material):
        name = scene.material_names[k]
        more = "times a texture" if scene.reflectivity_texture[k] >= 0 or scene.specular_texture[k] >= 0 else ""
        note = MaterialNote(
            name=name,
            reflectivity=rounded(np.round(scene.reflectivity[k], 3)),
            specular=rounded(np.round(scene.specular[k], 3)),
            more=more,
        )
        found.setdefault(name, note)
    return tuple(found.values())
