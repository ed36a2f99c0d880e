"""The camera of a first job: that of the file, or a walk or an orbit."""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.scene.files import Stage

from .model import Camera, EyeKey, round_points
from .options import StartOptions
from .orbit import FOV_DEG as ORBIT_FOV
from .orbit import KEYS, choose_orbit, key_frames
from .room import surroundings
from .site import Site
from .staged import choose_camera, convert_camera, convert_lights
from .views import FOV_DEG as ROOM_FOV
from .walks import choose_walk

EYES = 24  # of a first array: enough for a smooth walk
RESOLUTION = (320, 240)
DEPTH_SHARE = 0.25  # distance from a camera of the file to its target over the size of the scene


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shot:
    """A camera, and what it shows.

    Attributes:
        ends: (2, 2, 3) first and last eye and target, in centred coordinates.
        inside: whether it is inside a room.
        about: why it was chosen.
    """

    camera: Camera
    ends: Float64
    inside: bool
    about: tuple[str, ...] = ()


def choose_shot(site: Site, stage: Stage, options: StartOptions, file: object) -> Shot:
    """Choose a camera.

    Raises:
        JobError: no camera of the file has the name in the options.
        SceneError: a camera of the file that looks nowhere.
    """
    found = choose_camera(stage, options.camera, file)
    if found is not None:
        camera = convert_camera(stage, found, options.frames, DEPTH_SHARE * site.size, options.resolution)
        ends = np.array([[key.eye, key.target] for key in (camera.keys[0], camera.keys[-1])]) - site.centre
        inside = bool(surroundings(site.probe, ends[:, 0])[0].all()) if options.inside is None else options.inside
        room = site.room is not None and not site.room.roofless
        return Shot(camera=camera, ends=ends, inside=inside and room, about=("The file brings its own camera.",))
    if site.room is not None:
        lights = () if options.sun else convert_lights(stage, options.lights)[0]
        walk = choose_walk(site.probe, site.room, site.metre, lights)
        if walk is not None:
            ends = np.stack([walk.eyes, np.array([walk.target] * 2)], axis=1)
            return Shot(camera=_walk_camera(site, ends, options), ends=ends, inside=not site.room.roofless)
    frames, shares = key_frames(options.frames or EYES, KEYS)
    width, height = options.resolution or RESOLUTION
    eyes, target = choose_orbit(site.probe, site.up, shares, width / height, from_above=site.from_above)
    ends = np.stack([eyes, np.array([target] * len(eyes))], axis=1)
    return Shot(camera=_orbit_camera(site, eyes, target, frames, options), ends=ends[[0, -1]], inside=False)


def _walk_camera(site: Site, ends: Float64, options: StartOptions) -> Camera:
    points = [round_points(end + site.centre, site.size) for end in ends]
    moves = points[1][0] != points[0][0]
    n = (options.frames or EYES) if moves else 1
    last = {n - 1: points[1]} if n > 1 else {}
    keys = tuple(EyeKey(frame=f, eye=eye, target=target) for f, (eye, target) in ({0: points[0]} | last).items())
    what = "a short walk" if moves else "an eye that stands still, as no way leads on; a second key makes it move"
    about = (f"{what}; `target` is what the eye looks at",)
    return Camera(keys=keys, frames=n, lens={"fov": ROOM_FOV}, resolution=options.resolution or RESOLUTION, about=about)


def _orbit_camera(site: Site, eyes: Float64, target: Float64, frames: list[int], options: StartOptions) -> Camera:
    n = options.frames or EYES
    (at,) = round_points(target[None] + site.centre, site.size)
    points = round_points(eyes + site.centre, site.size)
    keys = tuple(EyeKey(frame=frame, eye=eye, target=at) for frame, eye in zip(frames, points, strict=True))
    about = ("a quarter of a circle around the thing; `target` is its middle",)
    return Camera(
        keys=keys, frames=n, lens={"fov": ORBIT_FOV}, resolution=options.resolution or RESOLUTION, about=about
    )
