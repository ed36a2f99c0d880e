"""Rooms whose indirect light is hard to find by cells: what cells smear, miss, or let through.

Each is some metres in size, with eyes that see what is hard about it. Path tracing gives the right light.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene
from support import tiny
from support.rooms import coincident
from support.stages import sun

GREY = (0.6, 0.5, 0.4)
BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
RESOLUTION = (64, 48)
HIGH, CEILING = 2.5, 4  # height of rooms; the first parts of `roofless` are their ceiling
REACH = (40.0, 4.0)  # of plates, over the size of the triangle between them: as a ceiling, and below one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LitRoom:
    """A scene, its sources, and one or more eyes.

    Attributes:
        looks: eye and target of each frame.
        hard: what is hard about it.
        scale: size of the room, over that of its looks.
    """

    hard: str
    scene: Callable[[], Scene]
    sources: list[dict[str, Any]]
    looks: list[tuple[Any, Any]]
    scale: float = 1.0

    def job(self, **changes: Any) -> Any:
        """The job, with the camera in proportion to the room."""
        size = self.scale
        keys = [
            {"frame": k, "eye": [size * x for x in eye], "target": [size * x for x in target]}
            for k, (eye, target) in enumerate(self.looks)
        ]
        tables: dict[str, Any] = {
            "camera": {"resolution": list(RESOLUTION), "fov": 60.0, "frames": len(keys), "keys": keys},
            "light": {"frames": 1, "sources": self.sources},
            "obscurance": {"range": 1.5 * size},
            "samples": {"hits": 16, "obscurance": 8},
        }
        return tiny.job(**{**tables, **changes})


def lamp(at: Any, intensity: float = 5.0) -> dict[str, Any]:
    return {"type": "point", "keys": [{"frame": 0, "position": list(at), "intensity": intensity}]}


def scene_of(parts: dict[tuple[float, float, float], list[Any]]) -> Scene:
    """Triangles by reflectivity."""
    listed = enumerate(parts.items())
    return tiny.scene_with(
        *((Material(name=f"m{k}", reflectivity=c), np.concatenate(walls)) for k, (c, walls) in listed)
    )


def room(*things: Any) -> Scene:
    """A grey room of 4 x 2.5 x 4 with things in it."""
    return scene_of({GREY: [tiny.box((-2, 0, -2), (2, 2.5, 2)), *things]})


def plate(x0: float, x1: float, y: float, z0: float, z1: float) -> Any:
    """A level rectangle."""
    return tiny.quad((x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1))


def shade() -> Any:
    """A tube without thickness, open above and below, about the lamp."""
    turn, height = np.meshgrid(np.linspace(0, 2 * np.pi, 25), [1.2, 1.5], indexing="ij")
    return tiny.patches(np.stack([0.2 * np.cos(turn), height, 0.2 * np.sin(turn)], axis=-1))


def roofless(opening: Any) -> list[Any]:
    """A box from -2 to 2 whose ceiling has an opening: x0, x1, z0, z1."""
    x0, x1, z0, z1 = opening
    h = 2.5
    ceiling = [plate(-2, x0, h, -2, 2), plate(x1, 2, h, -2, 2), plate(x0, x1, h, -2, z0), plate(x0, x1, h, z1, 2)]
    walls = [
        tiny.quad((-2, 0, -2), (-2, 0, 2), (-2, h, 2), (-2, h, -2)),
        tiny.quad((2, 0, -2), (2, 0, 2), (2, h, 2), (2, h, -2)),
        tiny.quad((-2, 0, -2), (2, 0, -2), (2, h, -2), (-2, h, -2)),
        tiny.quad((-2, 0, 2), (2, 0, 2), (2, h, 2), (-2, h, 2)),
    ]
    return [*ceiling, *walls, plate(-2, 2, 0, -2, 2)]


def triangular_light(height: float) -> Scene:
    """Three plates that reach beyond all walls leave one triangle open to the sun: as the ceiling, or below one."""
    corners = np.array([[-0.3, height, -0.2], [0.3, height, -0.2], [0.0, height, 0.3]])
    middle = corners.mean(axis=0)
    far = [middle + REACH[height < HIGH] * (corner - middle) for corner in corners]
    plates = [tiny.quad(corners[k], corners[k - 1], far[k - 1], far[k]) for k in range(3)]
    walls = roofless((-0.5, 0.5, -0.5, 0.5))
    return scene_of({GREY: [*plates, *(walls if height < HIGH else walls[CEILING:])]})


def table() -> list[Any]:
    legs = [tiny.box((x, 0, z), (x + 0.06, 0.7, z + 0.06)) for x in (-0.6, 0.54) for z in (-0.4, 0.34)]
    return [tiny.box((-0.6, 0.7, -0.4), (0.6, 0.74, 0.4)), *legs]


def chequered() -> Scene:
    """Black and white tiles of 25 cm on all of the floor, and a white ball's worth of boxes."""
    tiles: dict[Any, list[Any]] = {BLACK: [], WHITE: []}
    for i in range(16):
        for k in range(16):
            x, z = -2 + 0.25 * i, -2 + 0.25 * k
            tiles[(BLACK, WHITE)[(i + k) % 2]].append(plate(x, x + 0.25, 0, z, z + 0.25))
    walls = tiny.box((-2, 0, -2), (2, 2.5, 2)).reshape(-1, 3, 3)
    walls = walls[(walls[:, :, 1] > 0).any(axis=1)]
    return scene_of({GREY: [walls], **tiles, (0.99, 0.99, 0.99): [tiny.box((0.4, 0, -1.0), (1.0, 0.9, -0.4), 0.5)]})


def folds() -> Scene:
    """A curtain whose folds are 6 cm wide and 4 cm deep, before a wall."""
    z, height = np.meshgrid(np.arange(-1.0, 1.0, 0.03), [0.1, 2.3], indexing="ij")
    depth = np.where(np.arange(len(z)) % 2, 0.04, 0.0)[:, None]
    return room(tiny.patches(np.stack([-1.9 + depth + 0 * z, height, z], axis=-1)))


ACROSS = ((0.2, 1.3, 1.7), (-0.1, 0.9, -1.0))


def sized_room(name: str, scale: float) -> LitRoom:
    """The room of most tests, as large as that."""
    at = [scale * x for x in (-0.9, 2.2, 0.3)]
    scene = partial(tiny.room, mirrors=False, size=scale)
    return LitRoom(hard=name, scene=scene, sources=[lamp(at, 8.0 * scale**2)], looks=[ACROSS], scale=scale)


LIT_ROOMS = {
    "a lamp inside a shade": LitRoom(
        hard="the room around it, which only walls and ceiling light",
        scene=lambda: room(shade()),
        sources=[lamp((0.0, 1.35, 0.0))],
        looks=[((0.5, 1.3, 1.7), (0.0, 1.2, 0.0))],
    ),
    "a corner": LitRoom(
        hard="0.5 m of the corner of a room: rays shorter than cells",
        scene=room,
        sources=[lamp((1.2, 2.0, 0.5))],
        looks=[((-1.4, 0.6, -1.4), (-2.0, 0.0, -2.0))],
    ),
    "a lit slit": LitRoom(
        hard="a sun through a slit of 2 cm",
        scene=lambda: scene_of({GREY: roofless((-0.01, 0.01, -1.5, 1.5))}),
        sources=[sun((0.3, -1.0, 0.1), 10.0)],
        looks=[ACROSS],
    ),
    "coincident walls": LitRoom(
        hard="each wall of a box three times, cut along either diagonal",
        scene=lambda: tiny.scene_of(coincident(), Material(name="Grey", reflectivity=GREY)),
        sources=[lamp((0.3, -0.6, 0.2))],
        looks=[((0.2, 0.1, 0.8), (-0.1, -0.3, -1.0))],
    ),
    "a room of 1 mm": sized_room("all of it", 0.00025),
    "a room of 1 km": sized_room("all of it", 250.0),
    "a sunlit floor under a table": LitRoom(
        hard="a sun through a window, under and around a table",
        scene=lambda: scene_of({GREY: [*roofless((-1.5, 1.5, -1.0, 1.0)), *table()]}),
        sources=[sun((0.5, -1.0, 0.2), 10.0)],
        looks=[((0.3, 0.6, 1.7), (0.0, 0.3, 0.0))],
    ),
    "a very bright, very small patch": LitRoom(
        hard="a lamp 10 cm above the floor: half of its light on 0.03 m2",
        scene=room,
        sources=[lamp((0.3, 0.1, -0.5))],
        looks=[ACROSS],
    ),
    "black and white surfaces": LitRoom(
        hard="black and white tiles, and a box that reflects 99 %",
        scene=chequered,
        sources=[lamp((-0.9, 2.0, 0.3))],
        looks=[ACROSS],
    ),
    "one triangle lit": LitRoom(
        hard="a sun on one triangle of 0.15 m2, all else lit by it",
        scene=lambda: triangular_light(HIGH),
        sources=[sun((0.001, -1.0, 0.002), 10.0)],
        looks=[ACROSS],
    ),
    "folds finer than cells": LitRoom(
        hard="a curtain with folds of 6 cm, seen from near",
        scene=folds,
        sources=[lamp((-0.5, 1.6, 1.2))],
        looks=[((-1.2, 1.2, 0.4), (-1.9, 1.2, 0.0))],
    ),
}
# Where cells fail, and why.
TOO_HARD = {
    "a bright gap above a blind": LitRoom(
        hard="the triangle is cut out of a blind 10 cm below a skylight: cells of the ceiling, 0.8 m wide for rays "
        "from below, hold its bright part above the blind",
        scene=lambda: triangular_light(HIGH - 0.1),
        sources=[sun((0.001, -1.0, 0.002), 10.0)],
        looks=[ACROSS],
    ),
}
