"""Generated scenes of any number of triangles: a room full of spheres, and a job in it."""

import math
import time

import numpy as np
from support import tiny

from framearray_cli.base.arrays import Float64
from framearray_cli.job.job import Job
from framearray_cli.render.prepare import Prepared
from framearray_cli.scene.files import Material, Meshes
from framearray_cli.scene.files.model import Part
from framearray_cli.scene.scene import build_scene

SIZE = (8.0, 3.0, 8.0)  # of the room
COUNT = (5, 2, 5)  # spheres along each axis
RADIUS = 0.4


def room(n_triangles: int, resolution: tuple[int, int]) -> tuple[Prepared, float]:
    """A room of about n triangles, ready to render, and the seconds it took to make a scene of its triangles."""
    parts, materials = spheres(n_triangles)
    started = time.perf_counter()
    meshes = Meshes(parts=tuple(parts), materials=tuple(materials), textures=(), dropped={}, notes=())
    scene = build_scene(meshes, {})
    seconds = time.perf_counter() - started
    return tiny.prepared(_job(resolution), scene), seconds


def spheres(n_triangles: int) -> tuple[list[Part], list[Material]]:
    """A closed room full of spheres, of about n triangles."""
    n = n_triangles / math.prod(COUNT)
    rings = max(3, round(math.sqrt(n / 4)))  # 2 * rings * (rings - 1) * 2 triangles a sphere
    parts = [Part(material=0, corners=tiny.box((0, 0, 0), SIZE))]
    sphere = _sphere(rings, 2 * rings)
    for index in np.ndindex(*COUNT):
        place = [(i + 0.5) / k * side for i, k, side in zip(index, COUNT, SIZE, strict=True)]
        parts.append(Part(material=1 + sum(index) % 2, corners=sphere + place))
    names = ("Wall", 0.7), ("Ball", 0.6), ("Other ball", 0.4)
    return parts, [Material(name=name, reflectivity=(r, r, r)) for name, r in names]


def _sphere(rings: int, segments: int) -> Float64:
    """A sphere about the origin, (2 * segments * (rings - 1), 3, 3)."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments + 1), indexing="ij")
    p = RADIUS * np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    upper = np.stack([a, b, c], 2)[1:]  # at the poles one of the two triangles has no area
    lower = np.stack([a, c, d], 2)[:-1]
    # the other triangle of the first row is (a, b, c), of the last row (a, c, d)
    first, last = np.stack([a, b, c], 2)[:1], np.stack([a, c, d], 2)[-1:]
    return np.concatenate([t.reshape(-1, 3, 3) for t in (first, upper[:-1], lower[1:], last)])


def _job(resolution: tuple[int, int]) -> Job:
    eyes = [
        {"frame": frame, "eye": [x, 1.5, 7.2], "target": [target, 1.2, 3.0]}
        for frame, x, target in ((0, 1.0, 4.0), (95, 3.2, 4.5))
    ]
    lamps = [{"frame": frame, "position": [x, 2.7, 4.0], "intensity": [20.0] * 3} for frame, x in ((0, 0.8), (47, 7.2))]
    return Job.model_validate(
        {
            "name": "room",
            "scene": {"file": "room.glb"},
            "camera": {"resolution": list(resolution), "fov": 60.0, "frames": 96, "keys": eyes},
            "light": {"frames": 48, "sources": [{"type": "point", "keys": lamps}]},
            "reuse": {"weights": "balance"},
            "obscurance": {"range": 1.0},
            "indirect": {"method": "obscurance"},
        }
    )
