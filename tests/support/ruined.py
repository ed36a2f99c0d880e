"""Jobs whose frame arrays would be useless, and what the warnings of them say: a closed room with a solid in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from framearray_cli.job.job import Job
from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene
from support.models.shapes import block as outwards
from support.stages import sun
from support.tiny import scene_of, table

WHITE = Material(name="White", reflectivity=(0.7, 0.7, 0.7))
BLACK = Material(name="Black", reflectivity=(0.0, 0.0, 0.0))
MIRROR = Material(name="Mirror", reflectivity=(0.0, 0.0, 0.0), specular=(0.9, 0.9, 0.9))

ROOM = (-2.0, 0.0, -2.0), (2.0, 2.5, 2.0)
SOLID = (-0.5, 0.0, -1.2), (0.5, 1.0, -0.2)


def room(
    *, material: Material = WHITE, size: float = 1.0, walls: bool = True, wall: bool = False, crack: bool = False
) -> Scene:
    """A closed room that shows its fronts inside, and a solid in it that shows them outside.

    Args:
        size: what all lengths are multiplied with.
        walls: False: only the floor, and the solid.
        wall: a thin wall across the room, at z = 0.5.
        crack: a slot in the ceiling, 2 cm wide.
    """
    inside = outwards(*ROOM)[:, ::-1]
    if not walls:
        inside = inside[(inside[..., 1] < 1e-6).all(axis=1)]
    parts = [inside, outwards(*SOLID)]
    if wall:
        parts.append(outwards((-2, 0, 0.45), (2, 2.5, 0.5)))
    if crack:
        parts[0] = inside[(inside[..., 1] < 2.4).any(axis=1)]
        parts += [outwards((-2, 2.5, -2), (-1.2, 2.52, 2)), outwards((-1.18, 2.5, -2), (2, 2.52, 2))]
    return scene_of(size * np.concatenate(parts), material)


def camera(*eyes: tuple[Any, Any], frames: int = 6, **more: Any) -> dict[str, Any]:
    """A camera with some eyes and targets at equal intervals."""
    at = np.linspace(0, frames - 1, len(eyes)).round().astype(int).tolist()
    keys = [{"frame": f, "eye": list(e), "target": list(t)} for f, (e, t) in zip(at, eyes, strict=True)]
    return {"frames": frames, "keys": keys, **more}


def lamp(*positions: Any, intensity: float = 8.0, **more: Any) -> dict[str, Any]:
    """A lamp that moves through some positions, one light frame each."""
    return {
        "type": "point",
        "keys": [{"frame": l, "position": list(p), "intensity": intensity, **more} for l, p in enumerate(positions)],
    }


def lit(*sources: dict[str, Any], frames: int | None = None) -> dict[str, Any]:
    """The table of the light."""
    return {"frames": frames or max(source["keys"][-1]["frame"] for source in sources) + 1, "sources": list(sources)}


PANEL = {"frame": 0, "power": 50.0, "radius": 0.5}
DAZZLING = {"frame": 2, "position": [0.9, 2.0, -0.5], "intensity": 8e3}
EYE, TARGET = (1.5, 1.5, 1.7), (0.0, 0.8, -1.0)
GOOD_LAMP = (-0.8, 2.2, 0.4), (0.8, 2.2, 0.4), (0.9, 2.0, -0.5)
GOOD: dict[str, Any] = {
    "camera": camera((EYE, TARGET), ((0.5, 1.5, 1.7), TARGET)),
    "light": lit(lamp(*GOOD_LAMP)),
    "output": {"format": "png"},
}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A job that is ruined.

    Attributes:
        words: that one warning of it holds.
        job: tables that differ from those of GOOD.
        scene: options of `room`.
    """

    words: tuple[str, ...]
    job: Mapping[str, Any] = field(default_factory=dict)
    scene: Mapping[str, Any] = field(default_factory=dict)

    def prepared_from(self) -> tuple[Job, Scene]:
        """Return the job and its scene."""
        return Job.model_validate(table(**{**GOOD, **self.job})), room(**self.scene)


def case(*words: str, scene: Mapping[str, Any] | None = None, **job: Any) -> Case:
    """Return a case; keys of `job` are its tables, `sky` is its background."""
    sky = {"scene": {"background": job.pop("sky")}} if "sky" in job else {}
    return Case(words=words, job=job | sky, scene=scene or {})


PNG, OPEN = {"format": "png"}, {"walls": False}
CASES = {
    "an eye in a solid": case(
        "every camera position: the eye is inside a solid",
        "back faces",
        camera=camera(((0, 0.5, -0.7), (0, 0.5, -2)), ((0.1, 0.5, -0.7), (0, 0.5, -2))),
    ),
    "a path that ends in a solid": case(
        "cameras 4-5: the eye is inside a solid",
        camera=camera((EYE, TARGET), ((0, 0.5, -0.9), (0, 0.5, -2))),
    ),
    "a path through a solid": case(
        "the eye passes through a surface",
        camera=camera((EYE, TARGET), ((-1.5, 0.5, -1.7), (0, 0.9, -1.2)), frames=12),
    ),
    "a path through a thin wall": case(
        "cameras 2-3: the eye passes through a surface",
        '"White"',
        "add keys",
        scene={"wall": True},
        camera=camera(((1.5, 1.5, 1.5), TARGET), ((1.5, 1.5, -0.5), (-1, 1, -1))),
    ),
    "an eye below the floor": case(
        "the eye is behind the surfaces",
        scene=OPEN,
        camera=camera(((0, -2, 0.5), (0, 0, 0))),
        light=lit(sun((0, -1, 0.2), 5.0)),
    ),
    "an eye 460 units away": case(
        "the camera: nothing is seen",
        "457.5 scene units outside",
        "unit",
        camera=camera(((0, 460.0, 0), (460, 460, 0)), frames=1),
    ),
    "a scene that is a speck": case(
        "a speck", scene=OPEN, camera=camera(((0, 120, 460.0), TARGET)), light=lit(sun((0, -1, 0), 5.0))
    ),
    "an eye that looks away": case(
        "the camera: nothing is seen",
        "inside",
        scene=OPEN,
        camera=camera(((0, 0.9, 1), (0, 5, 4)), frames=1),
    ),
    "a path that leaves the scene": case(
        "cameras 3-5: nothing is seen",
        scene=OPEN,
        camera=camera(((0, 1.5, 1.7), TARGET), ((0, 1.5, 1.7), (0, 1.5, 5)), frames=6),
    ),
    "a field of view in radians": case(
        "camera.fov: 1.047 degrees", "60 degrees", camera=camera((EYE, TARGET), fov=1.047)
    ),
    "a colour of 255": case(
        "light.sources[0].keys[0].color, and 2 more: [255, 240, 220] multiplies the intensity by up to 255",
        "divide 8-bit codes by 255",
        light=lit(lamp(*GOOD_LAMP, color=[255, 240, 220])),
    ),
    "a colour in per cent": case("keys[0].color", "by up to 100", light=lit(lamp(*GOOD_LAMP, color=[100, 80, 60]))),
    "an intensity of 800": case(
        "all pictures: 100%",
        "of the pixels that see surfaces are clipped",
        light=lit(lamp(*GOOD_LAMP, intensity=800.0)),
    ),
    "an intensity of 800 in EXR": case(
        "all pictures: 100%",
        "divide the strength of the light by",
        light=lit(lamp(*GOOD_LAMP, intensity=800.0)),
        output={"format": "exr"},
    ),
    "an intensity of 1e-4": case("all pictures: 100% ", "black; multiply", light=lit(lamp(*GOOD_LAMP, intensity=1e-4))),
    "a sun of 100,000 lux": case("all pictures", "clipped", scene=OPEN, light=lit(sun((0.2, -1, -0.3), 1e5))),
    "an exposure of 8": case("all pictures", "set output.exposure = ", output={**PNG, "exposure": 8.0}),
    "an exposure of -12": case("all pictures", "black", "set output.exposure = ", output={**PNG, "exposure": -12.0}),
    "an ambient light of 255": case("all pictures", "clipped", ambient={"intensity": 255, "paths": None}),
    "one key too bright": case(
        "light 2: ",
        "clipped",
        light=lit({"type": "point", "keys": [*lamp(*GOOD_LAMP[:2])["keys"], DAZZLING]}),
    ),
    "a lamp outside the room": case(
        "light.sources[0] reaches nothing that is seen",
        "outside the scene, which reaches from [-2, 0, -2] to [2, 2.5, 2]",
        light=lit(lamp((0, 2, 5), (0, 2, 6))),
    ),
    "a lamp in a solid": case(
        "light.sources[0] reaches nothing", "inside a solid", light=lit(lamp((0, 0.5, -0.7), (0.1, 0.5, -0.7)))
    ),
    "a lamp that passes through a solid": case(
        "light 1: light.sources[0] is inside a solid",
        light=lit(lamp(GOOD_LAMP[0], (0, 0.5, -0.7), GOOD_LAMP[1])),
    ),
    "a lamp behind a wall": case(
        "surfaces hide the lamp at", scene={"wall": True}, light=lit(lamp((0, 2, -0.5), (0, 2, -1)))
    ),
    "a panel that faces a wall": case(
        "light.sources[0] reaches nothing",
        "shines past all that is seen, or surfaces hide it; turn it or move it",
        light=lit({"type": "disc", "keys": [PANEL | {"position": [0, 1.5, 1.9], "direction": [0, 0, 1]}]}),
    ),
    "one lamp of two": case(
        "light.sources[1] reaches nothing", light=lit(lamp(*GOOD_LAMP), lamp((0, 0.5, -0.7), (0, 0.5, -0.8)))
    ),
    "forty lamps outside": case(
        "every source reaches nothing that is seen: the lamp at [0, 2, 5]",
        light=lit(*[lamp((0, 2, 5), (0, 2, 6 + k)) for k in range(40)]),
    ),
    "one group of two": case(
        'light.sources[1] of group "b" reaches nothing',
        output={"format": "exr"},
        light=lit(lamp(*GOOD_LAMP) | {"group": "a"}, lamp((9, 9, 9)) | {"group": "b"}),
    ),
    "a lamp above a crack": case(
        "black; light reaches only",
        "light.sources[0]: the lamp at [0, 6, 0] is outside the scene",
        scene={"crack": True},
        light=lit(lamp((0, 6, 0), (0.1, 6, 0), intensity=4.0)),
    ),
    "an eye in millimetres": case(
        "the camera: the scene is a speck", "unit", camera=camera(((1500, 1500, 1700), (0, 800, -1000)), frames=1)
    ),
    "a sky in 8-bit codes": case("all pictures", "clipped", scene=OPEN, sky=[135.0, 206.0, 235.0]),
    "a sun outside a closed room": case("reaches nothing", "surfaces block it", light=lit(sun((0.2, -1, 0.1)))),
    "a sun from below": case("leads upwards", "turn it round, to [0, -1, 0]", scene=OPEN, light=lit(sun((0, 1, 0)))),
    "all sources off": case(
        "all sources are off, and the background is black", light=lit(lamp(*GOOD_LAMP, intensity=0.0))
    ),
    "black materials": case("reflects no light", scene={"material": BLACK}),
    "mirrors that are switched off": case("specular.depth = 0", scene={"material": MIRROR}, specular={"depth": 0}),
    "a range of 1000": case(
        "obscurance.range: 1000 scene units, in a scene of 6.18", "about 2", obscurance={"range": 1000.0}
    ),
    "a range of 0.001": case(
        "obscurance.range: 0.001 scene units", "narrower than a pixel", obscurance={"range": 0.001}
    ),
    "millimetres": case(
        "black; multiply the strength of the light by",
        "6,185 units across",
        scene={"size": 1000.0},
        camera=camera(((1500, 1500, 1700), (0, 800, -1000))),
        light=lit(lamp((-800, 2200, 400), (800, 2200, 400))),
        obscurance={"range": 1500.0},
    ),
    "a range in metres in a scene in millimetres": case(
        "narrower than a pixel",
        scene={"size": 1000.0},
        camera=camera(((1500, 1500, 1700), (0, 800, -1000))),
        light=lit(lamp((-800, 2200, 400), intensity=8e6)),
    ),
    "a background of 500": case(
        "scene.background: 500, where",
        "only outlines",
        camera=camera(((0, 1.5, 5.0), (0, 1.5, 0))),
        light=lit(sun((0, -1, 0), 5.0)),
        sky=500.0,
        scene=OPEN,
        ambient={"intensity": 0.1, "paths": None},
    ),
}
