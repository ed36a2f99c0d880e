"""Scenes for the ambient estimate: a furnace, a closed room, a room with a window, open land, and the jobs.

One camera at rest sees each of the generated ones, so path tracing its one picture gives the right mean.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bench.core.cases import JOBS, QUICK_RESOLUTION, with_resolution
from bench.core.results import ROOT
from bench.core.rooms import prepared_of, scene_of, spheres
from framearray_cli.base.arrays import Float64
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.render.prepare import Prepared, prepare
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import Part

# Places of the camera path and of the light path of a job's picture.
PLACE = 0.4, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe:
    """A scene, and one picture of it.

    Attributes:
        name: in results and tables.
        words: the scene in words.
        prepared: makes it.
        c, l: camera and light position of the picture.
        same: another probe whose path-traced picture is this one's, or "".
    """

    name: str
    words: str
    prepared: Callable[[], Prepared]
    c: int = 0
    l: int = 0
    same: str = ""

    @property
    def traced(self) -> str:
        """The probe whose path-traced picture is this one's."""
        return self.same or self.name


def with_ambient(prepared: Prepared, method: str, paths: int | None = None, seed: int | None = None) -> Prepared:
    """The same with another estimate of its ambient light."""
    job = prepared.job
    wanted: dict[str, Any] = {"method": method} | ({"paths": paths} if paths else {})
    ambient = type(job.ambient).model_validate(wanted)
    return replace(
        prepared, job=job.model_copy(update={"ambient": ambient, "seed": job.seed if seed is None else seed})
    )


def under_one(prepared: Prepared, l: int) -> Prepared:
    """The same with the ambient light of only position l, as position 0."""
    sources = tuple(
        replace(path, vector=path.vector[l : l + 1], intensity=path.intensity[l : l + 1])
        for path in prepared.lights.sources
    )
    lights = replace(prepared.lights, sources=sources, planes=prepared.lights.planes[l : l + 1])
    return replace(prepared, lights=lights, light_arrays=prepared.light_arrays.at([l]))


def resized(prepared: Prepared, resolution: tuple[int, int]) -> Prepared:
    """The same at another resolution."""
    return replace(prepared, job=with_resolution(prepared.job, resolution))


def _of_job(name: str) -> Probe:
    job = with_resolution(read_job(ROOT / "jobs" / f"{name}.toml"), QUICK_RESOLUTION)
    c, l = (int(share * n) for share, n in zip(PLACE, (job.camera.frames, job.light.frames), strict=True))
    return Probe(name=name, words=f"`jobs/{name}.toml`", prepared=lambda: prepare(job), c=c, l=l)


def _job(name: str, camera: Mapping[str, Any], light: Mapping[str, Any], **tables: Any) -> Job:
    """A job of one camera and one light position."""
    table = {
        "name": name,
        "scene": {"file": f"{name}.glb", "background": tables.pop("background", [0.0, 0.0, 0.0])},
        "camera": {"resolution": list(QUICK_RESOLUTION), "fov": 60.0, "frames": 1, "keys": [{"frame": 0, **camera}]},
        "light": {"frames": 1, "sources": [light]},
        "reuse": {"weights": "balance"},
        "obscurance": {"range": 1.0},
        "indirect": {"method": "obscurance"},
    }
    return Job.model_validate(table | tables)


def _materials(**reflectivity: tuple[float, float, float]) -> list[Material]:
    return [Material(name=name, reflectivity=value) for name, value in reflectivity.items()]


def _closed() -> Prepared:
    """The room of `rooms.py` with a lamp off its middle."""
    scene = scene_of(*spheres(20_000))
    lamp = {"type": "point", "keys": [{"frame": 0, "position": [3.2, 2.6, 4.0], "intensity": [20.0, 18.0, 15.0]}]}
    return prepared_of(_job("closed", {"eye": [1.0, 1.5, 7.2], "target": [4.0, 1.2, 3.0]}, lamp), scene)


WALLS, BOX, GROUND = 0, 1, 2


def _window() -> Prepared:
    """A room of 5 x 3 x 4 m with one window that the sun shines through, and a box; outside is the sky."""
    x, y, z = 5.0, 3.0, 4.0
    walls = [
        _quad((0, 0, 0), (x, 0, 0), (0, 0, z)),
        _quad((0, y, 0), (x, 0, 0), (0, 0, z)),
        _quad((0, 0, 0), (x, 0, 0), (0, y, 0)),
        _quad((0, 0, z), (x, 0, 0), (0, y, 0)),
        _quad((0, 0, 0), (0, y, 0), (0, 0, z)),
        _quad((x, 0, 0), (0, y, 0), (0, 0, 1.0)),  # around the window, from 0.8 to 2.2 m high
        _quad((x, 0, 3.0), (0, y, 0), (0, 0, 1.0)),
        _quad((x, 0, 1.0), (0, 0.8, 0), (0, 0, 2.0)),
        _quad((x, 2.2, 1.0), (0, 0.8, 0), (0, 0, 2.0)),
    ]
    parts = [
        Part(material=WALLS, corners=np.concatenate(walls)),
        Part(material=BOX, corners=_block((3.0, 0.0, 0.4), (3.8, 1.0, 1.4))),
    ]
    materials = _materials(Walls=(0.7, 0.65, 0.6), Box=(0.3, 0.4, 0.5))
    sun = {
        "type": "directional",
        "keys": [{"frame": 0, "direction": [-1.0, -0.6, -0.25], "irradiance": [20.0, 18.0, 15.0]}],
    }
    eye = {"eye": [0.5, 1.6, 0.5], "target": [4.0, 1.0, 2.6]}
    return prepared_of(_job("window", eye, sun, background=[0.7, 0.85, 1.05]), scene_of(parts, materials))


def _open(outside: str = "average") -> Prepared:
    """Hills with houses under a low sun and the sky."""
    steps = np.linspace(-20.0, 20.0, 81)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    ground = np.stack([x, _height(x, z), z], axis=-1)
    a, b, c, d = ground[:-1, :-1], ground[:-1, 1:], ground[1:, 1:], ground[1:, :-1]
    land = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])
    rng = np.random.default_rng(4)
    houses = []
    for place in rng.uniform(-9.0, 9.0, (24, 2)):
        low = np.array([place[0], _height(*place) - 1.0, place[1]])
        houses.append(_block(low, low + np.array([*rng.uniform(1.0, 2.0, 1), *rng.uniform(2.0, 3.5, 1), 1.5])))
    parts = [Part(material=0, corners=land), Part(material=1, corners=np.concatenate(houses))]
    materials = _materials(Ground=(0.35, 0.4, 0.2), Houses=(0.7, 0.6, 0.5))
    sun = {
        "type": "directional",
        "keys": [{"frame": 0, "direction": [0.8, -0.5, 0.4], "irradiance": [3.0, 2.7, 2.2]}],
    }
    eye = {"eye": [0.0, 6.0, 14.0], "target": [0.0, 0.5, 0.0]}
    job = _job(
        "open", eye, sun, background=[0.3, 0.4, 0.6], obscurance={"range": 2.0, "outside": outside}
    )  # fmt: skip
    return prepared_of(job, scene_of(parts, materials))


def _under_the_sky() -> Prepared:
    """The same, with obscurance rays that see the sky."""
    return _open("background")


def _height(x: Any, z: Any) -> Any:
    return np.sin(0.45 * x) * np.cos(0.35 * z) + 0.3 * np.sin(1.3 * x + 0.7 * z)


def _quad(corner: Any, u: Any, v: Any) -> Float64:
    """A parallelogram, (2, 3, 3)."""
    a, u, v = (np.array(vector, np.float64) for vector in (corner, u, v))
    return np.array([[a, a + u, a + u + v], [a, a + u + v, a + v]])


def _block(low: Any, high: Any) -> Float64:
    """The sides of a box, (12, 3, 3)."""
    low, edges = np.array(low, np.float64), np.diag(np.subtract(high, low))
    pairs = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    return np.concatenate([_quad(low + end * edges[i], edges[j], edges[k]) for i, j, k in pairs for end in (0, 1)])


# Jobs in the scenes of others, on a few steps of their paths.
SMALLER = tuple(f"{name}-small" for name in JOBS)
FURNACE = "furnace-50"
FURNACE_LEVEL = 1 / (1 - 0.5) / np.pi  # I_A: see jobs/furnace-50.toml


def probes() -> list[Probe]:
    """All of them."""
    furnace = read_job(ROOT / "jobs" / f"{FURNACE}.toml")
    return [
        Probe(name=FURNACE, words=f"`jobs/{FURNACE}.toml`", prepared=lambda: prepare(furnace), l=2),
        Probe(name="closed", words="closed room", prepared=_closed),
        Probe(name="window", words="room with a window", prepared=_window),
        Probe(name="open", words="open land", prepared=_open),
        Probe(name="open-sky", words='open land, `outside = "background"`', prepared=_under_the_sky, same="open"),
        *(_of_job(name) for name in (*JOBS, *SMALLER)),
    ]


def probe_named(name: str) -> Probe:
    """The probe of a name."""
    return next(probe for probe in probes() if probe.name == name)
