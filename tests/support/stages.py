"""Small scenes and jobs for the comparisons, and images of them through the whole program."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job
from framearray_cli.render import render as rendering
from framearray_cli.render.plan import plan_work
from framearray_cli.render.render import render
from support import ROOT

Array = NDArray[np.float64]
Vector = Sequence[float]

FURNACE = ROOT / "jobs" / "scenes" / "furnace.glb"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """Triangles of one material: points (n, 3), faces (m, 3), and texture coordinates (n, 2) or none."""

    material: str
    points: Array
    faces: NDArray[np.int64]
    uvs: Array | None = None


def quad(material: str, corner: Vector, u: Vector, v: Vector, n: int = 1, *, uv: float = 0.0) -> Part:
    """A parallelogram of 2 n^2 triangles from a corner along two edges; `uv` > 0: texture repeats along an edge."""
    steps = np.linspace(0, 1, n + 1)
    a, b = (grid.ravel()[:, None] for grid in np.meshgrid(steps, steps, indexing="ij"))
    points = np.array(corner) + a * np.array(u) + b * np.array(v)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([i, i + n + 1, i + 1], 1), np.stack([i + 1, i + n + 1, i + n + 2], 1)])
    return Part(material=material, points=points, faces=faces, uvs=np.hstack([a, b]) * uv if uv else None)


def box(material: str, low: Vector, high: Vector, n: int = 1) -> list[Part]:
    """The six sides of a box, each of 2 n^2 triangles."""
    low_, size = np.array(low, float), np.array(high, float) - np.array(low, float)
    sides = []
    for axis in range(3):
        edges = [np.eye(3)[i] * size[i] for i in range(3) if i != axis]
        for end in (0.0, 1.0):
            sides.append(quad(material, low_ + end * np.eye(3)[axis] * size[axis], edges[0], edges[1], n))
    return sides


def disc(material: str, centre: Vector, radius: float, n: int = 720) -> Part:
    """A horizontal disc: a fan of n triangles with the disc's area."""
    angle = 2 * np.pi * np.arange(n) / n
    rim = radius * np.sqrt(2 * np.pi / n / np.sin(2 * np.pi / n))
    points = np.vstack([[0, 0, 0], np.stack([rim * np.cos(angle), 0 * angle, rim * np.sin(angle)], 1)])
    i = np.arange(n)
    faces = np.stack([0 * i, i + 1, (i + 1) % n + 1], 1)
    return Part(material=material, points=points + np.array(centre), faces=faces)


def mirrored(part: Part) -> Part:
    """Mirror a part in the plane z = 0."""
    return Part(material=part.material, points=part.points * [1, 1, -1], faces=part.faces[:, ::-1], uvs=part.uvs)


def write_scene(folder: Path, parts: Sequence[Part], textures: Mapping[str, NDArray[np.uint8]] | None = None) -> Path:
    """Write an OBJ file with materials by name; textures (h, w, 3) replace the colour of theirs."""
    import PIL.Image

    lines, first, first_uv = ["mtllib scene.mtl"], 1, 1
    for part in parts:
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in part.points]
        lines += [] if part.uvs is None else [f"vt {u:.9g} {v:.9g}" for u, v in part.uvs]
        lines.append(f"usemtl {part.material}")
        for face in part.faces:
            corners = [f"{i + first}" if part.uvs is None else f"{i + first}/{i + first_uv}" for i in face]
            lines.append("f " + " ".join(corners))
        first, first_uv = first + len(part.points), first_uv + (0 if part.uvs is None else len(part.uvs))
    materials = []
    for name in dict.fromkeys(part.material for part in parts):
        materials += [f"newmtl {name}", "Kd 1 1 1"]
        if textures and name in textures:
            PIL.Image.fromarray(textures[name]).save(folder / f"{name}.png")
            materials.append(f"map_Kd {name}.png")
    (folder / "scene.mtl").write_text("\n".join(materials) + "\n")
    file = folder / "scene.obj"
    file.write_text("\n".join(lines) + "\n")
    return file


def dark() -> list[dict[str, Any]]:
    """A light of no intensity, for tests of only the ambient light."""
    return [{"type": "point", "keys": [{"frame": 0, "position": [0.0, 0.0, 0.0], "intensity": 0.0}]}]


def point(position: Vector, intensity: float | Vector = 1.0) -> dict[str, Any]:
    """A constant point source."""
    return {"type": "point", "keys": [{"frame": 0, "position": list(position), "intensity": intensity}]}


def sun(direction: Vector, irradiance: float | Vector = 1.0) -> dict[str, Any]:
    """A constant directional source."""
    return {"type": "directional", "keys": [{"frame": 0, "direction": list(direction), "irradiance": irradiance}]}


def make_job(
    scene: Path,
    out: Path,
    *,
    materials: Mapping[str, float | Vector | dict[str, Any]],
    camera: dict[str, Any],
    lights: list[dict[str, Any]] | None = None,
    light_frames: int = 1,
    seed: int = 0,
    background: float | Vector = 0.0,
    **tables: dict[str, Any],
) -> Job:
    """A job without reuse, whose EXR files hold float; `tables` and `camera` replace its values.

    Args:
        materials: name -> reflectivity, or the whole table of an override.
    """
    overrides = {
        name: value if isinstance(value, dict) else {"reflectivity": value} for name, value in materials.items()
    }
    table: dict[str, Any] = {
        "name": "t",
        "seed": seed,
        "scene": {"file": str(scene), "materials": overrides, "background": background},
        "camera": {"resolution": [32, 32]} | camera,
        "light": {"frames": light_frames, "sources": lights or dark()},
        "samples": {"hits": 1, "obscurance": 1},
        "reuse": {"n_r": 0, "weights": "balance"},
        "obscurance": {"range": 1.0},
        "indirect": {"method": "obscurance"},
        "output": {"directory": str(out), "half": "never", "compression": "none", "layers": False},
    }
    for name, changes in tables.items():
        table[name] = table.get(name, {}) | changes
    return Job.model_validate(table)


def write_stage(folder: Path, half: float = 2.0, *more: Part) -> Path:
    """A checkered floor of a half width, a box and a thin post, and a mirror that leans behind them."""
    checks = np.kron(np.indices((4, 4)).sum(axis=0) % 2, np.ones((8, 8)))
    texture = (np.stack([checks, 1 - checks, 0.5 + 0 * checks], axis=-1) * 200 + 30).astype(np.uint8)
    parts = [
        quad("Floor", [-half, 0, -3], [0, 0, half + 2], [2 * half, 0, 0], uv=2.0),
        *box("Box", [-0.5, 0, -1.2], [0.0, 0.7, -0.7]),
        *box("Post", [0.35, 0, -0.6], [0.42, 1.3, -0.53]),
        quad("Mirror", [0.5, 0.1, -1.6], [0.8, 0, 0.3], [0, 0.8, -0.2]),
    ]
    return write_scene(folder, [*parts, *more], {"Floor": texture})


def stage_job(scene: Path, out: Path, frames: int, size: tuple[int, int], *, way: float = 0.12, **more: Any) -> Job:
    """An eye that goes `way` to either side before the stage; its middle frame is the same for any."""
    keys = [
        {"frame": 0, "eye": [-way, 0.9, 1.2], "target": [0, 0.4, -1.0]},
        {"frame": frames - 1, "eye": [way, 0.95, 1.1], "target": [0, 0.4, -1.0]},
    ]
    return make_job(
        scene, out, materials={"Box": [0.7, 0.3, 0.2], "Post": 0.8, "Mirror": {"reflectivity": 0.1, "specular": 0.7}},
        camera={"resolution": list(size), "fov": 50.0, "keys": keys}, ambient={"intensity": [0.3, 0.25, 0.2]}, **more,
    )  # fmt: skip


def look(eye: Vector, target: Vector, fov: float = 0.02, up: Vector | None = None) -> dict[str, Any]:
    """A fixed camera; by default one that sees a spot so small that all its pixels see one point."""
    key = {"frame": 0, "eye": list(eye), "target": list(target)} | ({"up": list(up)} if up else {})
    return {"fov": fov, "keys": [key]}


def repeats(eye: Vector, target: Vector, n: int, fov: float, size: float = 1.0) -> dict[str, Any]:
    """n eyes that differ by so little (1e-6 of `size` in all) that their images are n independent ones of one view."""
    moved = [eye[0] + 1e-6 * size, eye[1], eye[2]]
    keys = [{"frame": 0, "eye": list(eye), "target": list(target)}]
    keys.append({"frame": n - 1, "eye": moved, "target": list(target)})
    return {"fov": fov, "frames": n, "keys": keys}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """The results of a render: images (n_c, n_l, h, w, 3) as read from the files, and the ambient estimate."""

    images: Array
    ambient: Ambient


def images(manifest: Manifest) -> Array:
    """Images (n_c, n_l, h, w, 3) of an array without groups."""
    lights, eyes = range(manifest.n_lights), range(manifest.n_cameras)
    return np.array([[read_image(image_path(manifest, c, l)) for l in lights] for c in eyes], np.float64)


def result_of(job: Job) -> Result:
    """Render a job and read its files back."""
    planned: list[Ambient] = []

    def plan(*args: Any, **options: Any) -> tuple[FrameSetup, Ambient]:
        setup, ambient = plan_work(*args, **options)
        planned.append(ambient)
        return setup, ambient

    with patch.object(rendering, "plan_work", plan):
        render(job)
    return Result(images=images(read_manifest(job.output.directory)), ambient=planned[0])
