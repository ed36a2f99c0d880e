"""Illuminance at 30 points of two rooms under sun, skies and lamps, against Mitsuba 3: `python -m bench.truth.sensors`.

Mitsuba lights each point as a surface there would be lit: sources directly by sampling them, and all other light by its
own `path` integrator along rays with density cos(theta) / pi. Both programs state the standard error of each point.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from support import tiny
from support.panoramas import write_overcast

from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.units import LUMENS_PER_WATT
from framearray_cli.render.prepare import Prepared, open_embree
from framearray_cli.render.sensors import measure, sensors_of
from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene

from .mitsuba import COMPILED, ROULETTE, find_mitsuba, scene_of
from .places import Place

PASSES, SAMPLES = 16, 2**14  # of Mitsuba at each point
GREY = {"walls": (0.6, 0.55, 0.5), "floor": (0.3, 0.25, 0.2), "things": (0.4, 0.4, 0.5)}
HIGH, LOW, TOP = 3.0, 0.9, 2.4  # of the rooms, and of a window
SUN = {"type": "directional", "keys": [{"frame": 0, "direction": [0.25, -0.6, 1.0], "irradiance": 100.0}]}
DAY = {"type": "sky", "latitude": 48.1, "longitude": 11.6, "date": "2026-06-21", "timezone": 1, "start": "07:00",
       "stop": "08:00"}  # fmt: skip
SKIES: dict[str, dict[str, Any]] = {
    "preetham": {}, "clear": {"sky": "clear"},
    "perez": {"sky": "perez", "units": "lux", "irradiance": 20e3, "direct": 50e3},
}  # fmt: skip
LAMPS = [
    {"type": "point", "keys": [{"frame": 0, "position": [x, 2.7, z], "intensity": 20.0}]}
    for x, z in ((-1.2, 0.4), (1.1, -0.8))
]


def room(depth: float, windows: int, divided: bool) -> Scene:
    """A room 6 m wide with windows in its front at -depth / 2 and a table; or with a wall across, and a door in it."""
    x, z = 3.0, depth / 2
    edges = np.linspace(-x, x, 2 * windows + 2)
    front = [tiny.quad((-x, 0, -z), (x, 0, -z), (x, LOW, -z), (-x, LOW, -z))]
    front += [tiny.quad((-x, TOP, -z), (x, TOP, -z), (x, HIGH, -z), (-x, HIGH, -z))]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        front.append(tiny.quad((a, LOW, -z), (b, LOW, -z), (b, TOP, -z), (a, TOP, -z)))
    box = tiny.box((-x, 0, -z), (x, HIGH, z))
    level = (box[:, :, 1] == 0).all(axis=1)
    walls = [box[~level & ~(box[:, :, 2] == -z).all(axis=1)], *front]
    if divided:
        walls.append(tiny.box((-x, 0, 0.9), (0.5, HIGH, 1.0)))
        walls.append(tiny.box((0.5, 2.1, 0.9), (1.4, HIGH, 1.0)))
        walls.append(tiny.box((1.4, 0, 0.9), (x, HIGH, 1.0)))
    parts = {
        "walls": np.concatenate(walls),
        "floor": box[level],
        "things": tiny.box((-1.5, 0.0, -1.2), (0.3, 0.7, -0.4), 0.3),
    }
    return tiny.scene_with(
        *((Material(name=name, reflectivity=GREY[name]), corners) for name, corners in parts.items())
    )


ROOMS = {
    "room with windows": (room(5.0, 2, divided=False), [-2.5, -2.0, 2.5, 2.0]),
    "room with a wall and a door": (room(6.0, 1, divided=True), [-2.5, -2.5, 2.5, 2.6]),
}


def reference(mi: Any, prepared: Prepared) -> Any:
    """Illuminance at all sensors by Mitsuba, (PASSES, n)."""
    import drjit as dr

    mi.set_variant(COMPILED)
    sensors, centre = sensors_of(prepared), prepared.scene.centre
    scene = scene_of(mi, prepared, Place(job="", c=0, l=0), sky=True, origin=centre)
    path = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": ROULETTE, "hide_emitters": True})
    n, m = len(sensors), len(sensors) * SAMPLES
    rows = np.repeat([[s.position - centre, s.normal] for s in sensors], SAMPLES, axis=0)
    place, normal = rows[:, 0].T, rows[:, 1].T
    found = []
    for seed in range(PASSES):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, m)
        point = dr.zeros(mi.SurfaceInteraction3f, m)
        point.p, point.n = mi.Point3f(*place.astype(np.float32)), mi.Normal3f(*normal.astype(np.float32))
        point.t = dr.zeros(mi.Float, m)
        to, light = scene.sample_emitter_direction(point, sampler.next_2d(), True)
        total = light * dr.maximum(dr.dot(to.d, point.n), 0)
        way = mi.Frame3f(point.n).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        ray = mi.RayDifferential3f(mi.Ray3f(point.p, way))
        total += dr.pi * path.sample(scene, sampler, ray)[0]
        dr.eval(total)
        rgb = np.stack([np.array(channel).reshape(n, SAMPLES).mean(axis=1) for channel in (total.x, total.y, total.z)])
        found.append(LUMENS_PER_WATT * LUMINANCE @ rgb)
    return np.stack(found)


def main() -> None:
    """Print the difference of each room and light, and the noise."""
    mi, why = find_mitsuba()
    if why:
        raise SystemExit(why)
    with tempfile.TemporaryDirectory() as folder:
        file = str(write_overcast(Path(folder) / "sky.exr"))
        sky = {"type": "environment", "file": file, "keys": [{"frame": 0, "intensity": 30.0}]}
        lights: dict[str, Any] = {"sun": [SUN], "overcast sky": [sky], "lamps": LAMPS}
        lights |= {f"sky {name}": [DAY | keys] for name, keys in SKIES.items()}
        for name, (scene, grid) in ROOMS.items():
            for light, sources in lights.items():
                job = tiny.job(
                    light={"frames": 1, "sources": sources},
                    camera={"keys": [{"frame": 0, "eye": [0.2, 1.6, -0.2], "target": [0.4, 1.0, 2.0]}]},
                    sensors=[{"name": "desks", "grid": grid, "height": 0.85, "spacing": 1.0, "error": 0.005}],
                )
                prepared = tiny.prepared(job, scene)
                with open_embree(prepared) as embree:
                    ours = measure(prepared, embree, sensors_of(prepared))
                passes = reference(mi, prepared)
                theirs, noise = passes.mean(axis=0), passes.std(axis=0, ddof=1) / np.sqrt(PASSES)
                total, error = ours[:, :2].sum(axis=1)[:, 0], ours[:, 2, 0]
                off = total / theirs - 1
                noises = [np.sqrt((each**2).mean()) for each in (error / total, noise / theirs)]
                print(
                    f"{name}, {light}: {len(sensors_of(prepared))} points, "
                    f"{theirs.min():.0f} to {theirs.max():.0f} lux; "
                    f"mean {total.sum() / theirs.sum() - 1:+.2%}, mean of points "
                    f"{off.mean():+.2%} (rms {np.sqrt((off**2).mean()):.2%}, most {abs(off).max():.2%}); "
                    f"noise of a point {noises[0]:.2%} and Mitsuba {noises[1]:.2%}"
                )


if __name__ == "__main__":
    main()
