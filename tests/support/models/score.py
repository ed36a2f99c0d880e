"""Score what `init` chose for a model against its labels: by rays through its cameras, and by corners in pictures."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import Eyes, eyes, lights
from framearray_cli.scene.scene import Scene, load_scene
from framearray_cli.starter import StartOptions, init
from framearray_cli.starter.probe import Probe
from support.models.cases import Case
from support.models.shapes import METRES

GRID = (64, 48)  # rays through a picture
MARGIN = 0.98  # of half the width and height, within which a whole thing lies
FILLED = 0.6  # least share of half the width or height that it reaches
LEAST_LIT = 0.35  # of the points that a room's pictures show, by the light at one of its places
BACKS, CLOSE, NEAR = 0.03, 0.08, 0.25  # largest shares of back sides and of what is nearer than NEAR metres
LEAST_WALK = 0.25  # metres, in a room


@dataclass(frozen=True)
class Verdict:
    """How well each label is met, 0 to 1."""

    marks: dict[str, float]

    @property
    def score(self) -> float:
        return 100 * float(np.mean(list(self.marks.values())))

    @property
    def missed(self) -> str:
        return ", ".join(f"{name} {mark:.2f}" for name, mark in self.marks.items() if mark < 1)


def judge(case: Case, folder: Path, **options: Any) -> Verdict:
    """Run `init` for a case and score the job that it writes."""
    job_file = folder / f"{case.name}.toml"
    start = init(case.scene(folder), job_file, StartOptions(**options), force=True)
    job = read_job(job_file)
    scene = load_scene(job.scene.file)
    path, aspect = eyes(job), job.camera.resolution[0] / job.camera.resolution[1]
    marks = {"kind": float(start.inside == case.inside), "up": float(job.scene.up == case.up)}
    if case.whole is not None:
        marks |= _whole(scene, path, aspect, case.whole)
    with EmbreeScene(scene) as embree:
        probe = Probe(scene=scene, embree=embree)
        marks |= _pictures(case, probe, path, aspect)
        if case.inside:
            marks["light"] = _lit(probe, path, aspect, lights(job))
            marks["walk"] = (
                float(np.ptp(path.position, axis=0).max() * METRES[case.unit] >= LEAST_WALK) if case.eye else 1.0
            )
    return Verdict(marks)


def _rays(path: Eyes, c: int, aspect: float) -> Any:
    """(n, 3) directions through the picture of eye c."""
    matrix = path.world_from_camera[c]
    tall = math.tan(math.radians(path.lenses[0].fov) / 2)
    x = (2 * (np.arange(GRID[0]) + 0.5) / GRID[0] - 1) * tall * aspect
    y = (1 - 2 * (np.arange(GRID[1]) + 0.5) / GRID[1]) * tall
    a, b = (part.reshape(-1) for part in np.meshgrid(x, y))
    return np.stack([a, b, -np.ones(len(a))], axis=1) @ matrix[:3, :3].T


def _pictures(case: Case, probe: Probe, path: Eyes, aspect: float) -> dict[str, float]:
    scene, metre = probe.scene, METRES[case.unit]
    found: list[dict[str, float]] = []
    for c in sorted({0, path.n // 2, path.n - 1}):
        eye, ways = path.position[c] - scene.centre, _rays(path, c, aspect)
        seen = probe.trace(eye, ways)
        names = np.array(["?", *scene.material_names])[np.where(seen.hit, 1 + scene.material[seen.triangle], 0)]
        one_material = len(scene.material_names) == 1  # an STL
        marks = {
            f"shows {name}": min(_share(names, name) / least, 1.0)
            for name, least in case.shows.items()
            if name == "" or not one_material
        }
        for name, most in {} if one_material else case.little.items():
            marks[f"little {name}"] = float(_share(names, name) <= most)
        if case.build is not None:  # in the files of others some surfaces show their backs
            marks["fronts"] = float((seen.hit & ~seen.front).mean() <= BACKS)
        if case.inside:
            near = seen.distance * np.linalg.norm(ways, axis=1) * metre < NEAR
            marks["nothing close"] = float(near.mean() <= CLOSE)
        if case.eye is not None:
            down = -np.eye(3)[2 if case.up == "z" else 1]
            high = float(probe.trace(eye, down).distance[0]) * metre
            marks["eye height"] = float(case.eye[0] <= high <= case.eye[1])
        found.append(marks)
    return {key: float(np.mean([marks[key] for marks in found])) for key in found[0]}


def _share(names: Any, wanted: str) -> float:
    if wanted == "":
        return float((names != "?").mean())
    return float(np.mean([str(name).startswith(tuple(wanted.split("|"))) for name in names]))


def _whole(scene: Scene, path: Eyes, aspect: float, wanted: str) -> dict[str, float]:
    kept = [k for k, name in enumerate(scene.material_names) if name.startswith(tuple(wanted.split("|")))]
    points = scene.corners[np.isin(scene.material, kept)].reshape(-1, 3) + scene.centre
    tall = math.tan(math.radians(path.lenses[0].fov) / 2)
    inside, reach = [], []
    for matrix in path.world_from_camera:
        local = (points - matrix[:3, 3]) @ matrix[:3, :3]
        spots = np.abs(local[:, :2] / -local[:, 2:] / [tall * aspect, tall])
        inside.append(bool((local[:, 2] < 0).all() and spots.max() <= MARGIN))
        reach.append(float(spots.max()))
    return {"whole": float(np.mean(inside)), "fills": float(min(reach) >= FILLED and max(reach) < 2)}


def _lit(probe: Probe, path: Eyes, aspect: float, light: Any) -> float:
    """How well the light at its first and last place lights what the first picture shows: 1 for LEAST_LIT or more."""
    eye, ways = path.position[0] - probe.scene.centre, _rays(path, 0, aspect)[::7]
    seen = probe.trace(eye, ways)
    points = (eye + ways * (seen.distance * (1 - 1e-3))[:, None])[seen.hit]
    shares = []
    for place in (0, -1):
        lit = np.zeros(len(points), bool)
        for source in light.sources:
            for end in _ends(source, place, points, probe.scene):
                lit |= ~probe.blocked(points, end)
        shares.append(min(float(lit.mean()) / LEAST_LIT, 1.0) if len(points) else 0.0)
    return float(np.mean(shares))


def _ends(source: LightPath, place: int, points: Float64, scene: Scene) -> list[Float64]:
    """Where segments from points to a source end, each (3,) or (n_points, 3): a lit point sees one of them."""
    if source.emitter is not None:  # just before the middle of each triangle that shines
        shines = scene.material == scene.material_names.index(source.emitter.material)
        return [points + (1 - 1e-3) * (middle - points) for middle in scene.corners[shines].mean(1)]
    vector = source.vector[place]
    if source.kind == "point":
        return [vector - scene.centre]
    return [points - 10 * float(np.abs(scene.corners).max()) * vector]
