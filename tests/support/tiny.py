"""Tiny scenes and jobs for the tests of the engine: a room that has one of everything, in a few hundred triangles."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames, window_of
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import Prepared, open_embree, prepared_from
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.files.geometry import compute_tangents
from framearray_cli.scene.paths.paths import eyes, lights
from framearray_cli.scene.scene import Scene, build_scene
from support.scenes import Glb, png

PLAIN, FLOOR, PAINTED, SMOOTH, MIRROR, GLOSSY = range(6)
MATERIALS = (
    Material(name="Plain", reflectivity=(0.7, 0.6, 0.5)),
    Material(name="Floor", reflectivity=(0.9, 0.8, 0.7), texture=0),
    Material(name="Painted", reflectivity=(0.9, 0.9, 0.9)),
    Material(name="Smooth", reflectivity=(0.2, 0.5, 0.8)),
    Material(name="Mirror", reflectivity=(0.0, 0.0, 0.0), specular=(0.9, 0.8, 0.7)),
    Material(name="Glossy", reflectivity=(0.3, 0.1, 0.1), specular=(0.4, 0.5, 0.6)),
)

WALLS_AND_BOX = np.repeat([0, 1], [10, 12]).astype(np.int32)  # of the triangles of the plain part of the room


def quad(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Two triangles, (2, 3, 3), of the corners in turn."""
    return np.array([[a, b, c], [a, c, d]], np.float64)


def box(low: Any, high: Any, turn: float = 0.0) -> Any:
    """Twelve triangles; turned about the vertical axis through its middle, radians."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    low, high = np.array(low), np.array(high)
    middle, half = (low + high) / 2, (high - low) / 2
    c, s = np.cos(turn), np.sin(turn)
    corner = middle + (signs * half) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return np.concatenate([quad(*(corner[i] for i in face)) for face in faces])


def patches(points: Any) -> Any:
    """Two triangles, (n, 3, 3), for each square of a grid of points, (rows, columns, 3)."""
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3, 3)


def ball(middle: Any, radius: float, n: int = 6) -> tuple[Any, Any]:
    """A sphere of 2 n x n patches with smooth normals: corners and normals, (triangles, 3, 3); no frame of it is
    nearly flat along z, where the hemisphere's frame jumps."""
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n + 1), np.linspace(0.1, np.pi - 0.1, n + 1))
    normals = patches(np.stack([np.sin(up) * np.cos(around), np.cos(up), np.sin(up) * np.sin(around)], axis=-1))
    return np.array(middle) + radius * normals, normals


def checks(size: int = 8, seed: int = 1) -> Any:
    """(size, size, 4) texels, every one its own colour."""
    texels = np.random.default_rng(seed).integers(30, 255, (size, size, 4), dtype=np.uint8)
    texels[..., 3] = 255
    return texels


def room_meshes(*, mirrors: bool = True, textured: bool = True, at: Any = (0.0, 0.0, 0.0), size: float = 1.0) -> Meshes:
    """A room of 4 x 2.5 x 4 with an open window and a hole in the roof, a floor with a texture, a wall with corner
    colours, a smooth ball, a turned box, a mirror, and glossy panels across and beside it.

    Args:
        at: where the middle of the floor is.
        size: what all lengths are multiplied with.
    """
    x, z, h = 2.0, 2.0, 2.5
    floor = quad((-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z))
    uv = np.array([[[0, 0], [1.5, 0], [1.5, 2.25]], [[0, 0], [1.5, 2.25], [0, 2.25]]]) - 0.4
    back = quad((-x, 0, -z), (x, 0, -z), (x, h, -z), (-x, h, -z))
    paint = np.array([[[1, 0.2, 0.2], [0.2, 1, 0.2], [0.2, 0.2, 1]], [[1, 0.2, 0.2], [0.2, 0.2, 1], [1, 1, 0.2]]])
    walls = [
        quad((-x, 0, z), (-x, 0, -z), (-x, h, -z), (-x, h, z)),
        quad((x, 0, -z), (x, 0, z), (x, 0.8, z), (x, 0.8, -z)),  # above it the window
        quad((x, 2.1, -z), (x, 2.1, z), (x, h, z), (x, h, -z)),
        quad((-x, 0, z), (-x, h, z), (x, h, z), (x, 0, z)),
        quad((-x, h, z), (-x, h, -z), (0.4, h, -z), (0.4, h, z)),  # beside it the hole in the roof
        box((0.5, 0, -1.0), (1.1, 0.9, -0.4), 0.5),
    ]
    corners, normals = ball((-0.6, 0.5, -0.7), 0.45)
    parts = [
        Part(material=PLAIN, corners=np.concatenate(walls), objects=("walls", "box"), object=WALLS_AND_BOX),
        Part(material=FLOOR if textured else PLAIN, corners=floor, uvs=uv if textured else None, objects=("floor",)),
        Part(material=PAINTED, corners=back, colours=paint.astype(np.float32), objects=("walls",)),
        Part(material=SMOOTH, corners=corners, normals=normals, objects=("ball",)),
    ]
    if mirrors:
        left = quad((-1.9, 0.3, 1.0), (-1.9, 0.3, -1.5), (-1.9, 2, -1.5), (-1.9, 2, 1))
        right = quad((1.9, 0.1, -1.8), (1.9, 0.1, 1.8), (1.9, 1.4, 1.8), (1.9, 1.4, -1.8))
        behind = quad((-1.8, 0.8, -1.95), (-0.6, 0.8, -1.95), (-0.6, 2.2, -1.95), (-1.8, 2.2, -1.95))
        parts.append(Part(material=MIRROR, corners=left, objects=("mirror",)))
        parts.append(Part(material=GLOSSY, corners=np.concatenate([right, behind]), objects=("panels",)))
    moved = tuple(replace(part, corners=size * part.corners + np.array(at)) for part in parts)
    textures = (checks(),) if textured else ()
    materials = MATERIALS if mirrors else MATERIALS[:MIRROR]
    return Meshes(parts=moved, materials=materials, textures=textures, dropped={}, notes=())


def bumps(size: int = 8, seed: int = 2) -> Any:
    """(size, size, 4) texels of a normal map that leans up to 60 degrees to all sides."""
    random = np.random.default_rng(seed)
    way, lean = random.uniform(0, 2 * np.pi, (size, size)), random.uniform(0, np.pi / 3, (size, size))
    normal = np.stack([np.sin(lean) * np.cos(way), np.sin(lean) * np.sin(way), np.cos(lean)], axis=-1)
    return np.dstack([np.rint((normal + 1) * 127.5), np.full((size, size), 255)]).astype(np.uint8)


def bumpy_room() -> Scene:
    """`room_meshes` with normal maps: on the floor mirrored, on the ball doubled, and in the mirror."""
    meshes = room_meshes()
    ball = next(part.normals for part in meshes.parts if part.normals is not None)
    uvs = {
        FLOOR: next(part.uvs * [-1.3, 2.0] for part in meshes.parts if part.uvs is not None),
        SMOOTH: ball @ np.array([[2.0, 0.3], [-0.4, 1.5], [0.5, 0.9]]),
        MIRROR: np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64),
    }
    parts = list(meshes.parts)
    for k, part in enumerate(parts):
        if (uv := uvs.get(part.material)) is not None:
            parts[k] = replace(part, normal_uvs=uv, tangents=compute_tangents(part.corners, part.normals, uv))
    scales = {FLOOR: 1.0, SMOOTH: 2.0, MIRROR: 0.1}
    materials = [
        replace(m, normal_texture=1, normal_scale=scales[k]) if k in scales else m
        for k, m in enumerate(meshes.materials)
    ]
    textures = (*meshes.textures, bumps())
    return build_scene(replace(meshes, parts=tuple(parts), materials=tuple(materials), textures=textures), {})


def room(**options: Any) -> Scene:
    """`room_meshes` as a scene."""
    return build_scene(room_meshes(**options), {})


def scene_of(corners: Any, material: Material | None = None, *, textures: Sequence[Any] = (), **more: Any) -> Scene:
    """A scene of one material; `more` are arrays of `Part`."""
    return scene_with((material or Material(name="Only"), {"corners": corners, **more}), textures=textures)


def scene_with(
    *surfaces: tuple[Material, Any], textures: Sequence[Any] = (), notes: Sequence[str] = (), **options: Any
) -> Scene:
    """A scene of several materials, each with its corners, or with arrays of `Part` by name."""
    named = [arrays if isinstance(arrays, dict) else {"corners": arrays} for _, arrays in surfaces]
    parts = tuple(
        Part(**arrays | {"material": k, "corners": np.asarray(arrays["corners"], np.float64)})
        for k, arrays in enumerate(named)
    )
    materials = tuple(material for material, _ in surfaces)
    meshes = Meshes(parts=parts, materials=materials, textures=tuple(textures), dropped={}, notes=tuple(notes))
    return build_scene(meshes, {}, **options)


def save_glb(meshes: Meshes, file: Path) -> Path:
    """Write meshes as a GLB; a specular material becomes a smooth metal."""
    glb = Glb()
    textures = [glb.texture(png(texels)) for texels in meshes.textures]
    for part in meshes.parts:
        m = meshes.materials[part.material]
        metal = max(m.specular) > 0
        pbr: dict[str, Any] = {"baseColorFactor": [*(m.specular if metal else m.reflectivity), 1.0]}
        pbr |= {"metallicFactor": float(metal), "roughnessFactor": 0.0 if metal else 1.0}
        more: dict[str, Any] = {}
        if part.normals is not None:
            more["NORMAL"] = glb.accessor(part.normals.reshape(-1, 3).astype(np.float32))
        if part.uvs is not None:
            uvs = part.uvs.reshape(-1, 2) * [1, -1] + [0, 1]  # v of glTF points down
            more["TEXCOORD_0"] = glb.accessor(uvs.astype(np.float32))
            pbr["baseColorTexture"] = {"index": textures[m.texture]}
        if part.colours is not None:
            more["COLOR_0"] = glb.accessor(part.colours.reshape(-1, 3).astype(np.float32))
        positions = part.corners.reshape(-1, 3).astype(np.float32)
        faces = np.arange(len(positions), dtype=np.uint16)
        glb.node(glb.mesh(glb.material(m.name, pbr), positions=positions, faces=faces, **more))
    return glb.save(file)


TABLE: dict[str, Any] = {
    "name": "tiny",
    "seed": 5,
    "scene": {"file": "tiny.glb"},
    "camera": {
        "resolution": [24, 18],
        "fov": 75.0,
        "frames": 1,
        "keys": [{"frame": 0, "eye": [0.2, 1.3, 1.7], "target": [-0.1, 0.9, -1.0]}],
    },
    "light": {
        "frames": 3,
        "sources": [
            {
                "type": "point",
                "keys": [
                    {"frame": 0, "position": [-0.9, 2.2, 0.3], "intensity": [8.0, 8.0, 6.0]},
                    {"frame": 2, "position": [0.7, 1.9, 0.6], "intensity": [6.0, 7.0, 8.0]},
                ],
            }
        ],
    },
    "samples": {"hits": 2, "obscurance": 5},
    "reuse": {"n_r": 0, "weights": "balance"},
    "obscurance": {"range": 1.5},
    "indirect": {"method": "obscurance"},
    "ambient": {"paths": 512},
    "render": {"threads": 2},
}
WALK: dict[str, Any] = {
    "frames": 6,
    "keys": [
        {"frame": 0, "eye": [0.2, 1.3, 1.7], "target": [-0.1, 0.9, -1.0]},
        {"frame": 5, "eye": [0.5, 1.45, 1.2], "target": [0.1, 0.8, -1.0]},
    ],
}


def walk(frames: int, **camera: Any) -> dict[str, Any]:
    """The way of `WALK` in another number of frames."""
    return {**WALK, "frames": frames, "keys": [WALK["keys"][0], {**WALK["keys"][1], "frame": frames - 1}], **camera}


CELLS = {"method": "cells", "samples": 4096}  # of `indirect`
DARK = {"intensity": (0.0, 0.0, 0.0), "paths": None}  # of `ambient`: no light but that of sources
SUN = {"type": "directional", "keys": [{"frame": 0, "direction": [-0.6, -1.0, -0.3], "irradiance": [3.0, 2.5, 1.5]}]}
RED = {"type": "point", "keys": [{"frame": 0, "position": [1.2, 1.0, 0.2], "intensity": [4.0, 0.5, 0.0]}]}
STUDY: dict[str, Any] = {  # a sun of two days, with nine positions each
    "type": "sun", "latitude": 41.9, "longitude": 12.5, "date": ["2026-06-21", "2026-12-21"], "timezone": 1.0,
    "start": "06:00", "stop": "18:00", "step": 90.0, "irradiance": [3.0, 2.5, 2.0],
}  # fmt: skip


def table(**changes: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a tiny job with some keys of its tables changed; None leaves a key out."""
    result = {key: dict(value) if isinstance(value, dict) else value for key, value in TABLE.items()}
    for key, value in changes.items():
        if isinstance(value, Mapping):
            value = {name: one for name, one in {**result.get(key, {}), **value}.items() if one is not None}
        result[key] = value
    return result


def job(**changes: Any) -> Job:
    """A tiny job; `job(camera=WALK, reuse={"n_r": 2})` changes single keys of those tables."""
    return Job.model_validate(table(**changes))


def job_of_file(scene: Path, out: Path, /, **changes: Any) -> Job:
    """A tiny job of a scene file, which is rendered into a folder."""
    for key, own in (("scene", {"file": str(scene)}), ("output", {"directory": str(out)})):
        changes[key] = {**own, **changes.get(key, {})}
    return job(**changes)


def prepared(job: Job, scene: Scene | None = None) -> Prepared:
    """Return the result of `prepare` for a scene without a file."""
    return prepared_from(job, scene or room(), eyes(job), lights(job))


@contextmanager
def planned(inputs: Prepared, **options: Any) -> Iterator[tuple[FrameSetup, Ambient]]:
    """Embree open, ambient light known."""
    with open_embree(inputs) as embree:
        yield plan_work(inputs, embree, **options)


@dataclass(frozen=True)
class Rendered:
    """All traced and composed frames; one for a camera that stands still."""

    composed: list[Composed]
    ambient: Ambient
    rays: dict[str, int]

    @property
    def images(self) -> Any:
        """(n_frames, n_lights, height, width, 3)."""
        return np.stack([frame.images for frame in self.composed])


def frames_of(setup: FrameSetup, ambient: Ambient, pool: TracePool) -> list[Composed]:
    """All frames, composed, without files."""
    window = Window(setup, ambient, pool)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    wanted = range(setup.n_frames)
    return [window.compose(j, np.empty(shape, np.float32)) for j in ready_frames(window, setup, wanted, pool)]


def composed(setup: FrameSetup, ambient: Ambient, j: int, *, threads: int = 1, eyes: Any = None) -> Composed:
    """Frame j alone, of all hits of its window or of those of some eyes."""
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    with TracePool(setup, threads) as pool:
        return window_of(j, setup, ambient, pool).compose(j, np.empty(shape, np.float32), eyes)


def frames_of_seeds(inputs: Prepared, j: int, seeds: Iterable[int], **changes: Any) -> Iterator[Composed]:
    """Frame j for each seed, with the same ambient light."""
    with planned(inputs) as (setup, ambient):
        for seed in seeds:
            yield composed(replace(setup, seed=seed, **changes), ambient, j)


def render_frames(inputs: Prepared, threads: int = 1) -> Rendered:
    """All frames of a job."""
    with planned(inputs) as (setup, ambient), TracePool(setup, threads) as pool:
        composed = frames_of(setup, ambient, pool)
        return Rendered(composed, ambient, dict(pool.rays()))
