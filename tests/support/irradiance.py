"""Direct light at many hits of one place, each with a random point of every source, and of polygons that shine."""

from typing import Any

import numpy as np

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.hits import SURFACE, Hits
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.lights import LightArrays, light_arrays
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.terms.direct import direct
from framearray_cli.job.job import Job
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import open_embree, prepare
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights_without_groups
from framearray_cli.scene.scene import Scene
from support import tiny
from support.hits import native, points

P, UP = np.array([0.3, 0.1, -0.2]), (0.0, 1.0, 0.0)
N = 40_000
FAR = np.concatenate([tiny.box((90, -21, -1), (91, -20, 1)), tiny.box((-91, 20, -1), (-90, 21, 1))])  # hides nothing


def arrays(*sources: LightPath) -> LightArrays:
    return light_arrays(lights_without_groups(sources), np.zeros(3))


def flat_arrays(bundle: Any) -> list[Any]:
    """All arrays of a bundle, and of those in it."""
    return [each for field in bundle for each in (flat_arrays(field) if isinstance(field, tuple) else [field])]


def lamps(positions: Any, intensity: Any = (1.0, 1.0, 1.0), **more: Any) -> LightPath:
    """A lamp that moves, or what `more` makes of it."""
    positions = np.asarray(positions, np.float64)
    intensity = np.tile(np.float64(intensity), (len(positions), 1))
    return LightPath(**{"kind": "point", "vector": positions, "intensity": intensity, **more})


def suns(directions: Any, irradiance: Any = (1.0, 1.0, 1.0), **more: Any) -> LightPath:
    """A sun that moves."""
    directions = np.asarray(directions, np.float64)
    ways = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return lamps(ways, irradiance, kind="directional", **more)


def hits_at(place: Any = P, n: int = N, first: int = 0) -> Hits:
    hits = points(n, place, UP)
    hits.key[:] = np.arange(first, first + n)
    return hits


def irradiances(hits: Hits, lights: LightArrays, scene: Scene | None = None, neighbours: bool = True) -> Any:
    """(n, channels, n_lights) in float64."""
    n = len(hits.kind)
    out = np.full((n, lights.channels, lights.n_lights), np.nan, np.float32)
    with EmbreeScene(scene or tiny.scene_of(FAR)) as embree:
        direct(hits, n, lights, Sight(embree.tracer), room_for_tests(4096, lights.n_lights), out, neighbours)
    return out.astype(np.float64)


def lit(hits: Hits, lights: LightArrays, scene: Scene | None = None, neighbours: bool = True) -> Any:
    """Irradiance (n, n_lights) of lights of one channel."""
    return irradiances(hits, lights, scene, neighbours)[:, 0]


def lit_places(places: Any, lights: LightArrays, neighbours: bool = True) -> Any:
    """Irradiance (n, n_lights) of points that look up."""
    hits = hits_at((0, 0, 0), len(places))
    hits.position[:] = places
    return lit(hits, lights, neighbours=neighbours)


def check_mean(found: Any, expected: Any, share: float = 0.005, rounding: float = 1e-5) -> None:
    """Means over hits are within 3.5 standard errors and rounding; errors are at most a share of what is expected."""
    error = found.std(axis=0) / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - expected) <= 3.5 * error + rounding * expected).all()
    assert (error <= share * expected).all()


def check_among_others(places: Any, first: LightPath, *rest: LightPath) -> None:
    """Sources of 16 positions, a lamp and a sun light places as each by itself does; some positions do as all."""
    lamp, sun = lamps(np.tile((0.1, 1.0, 0.0), (16, 1))), suns(np.tile((0.6, -0.8, 0.0), (16, 1)))
    lights = arrays(lamp, first, sun, *rest)
    together = lit_places(places, lights)
    apart = sum(lit_places(places, arrays(each)) for each in (first, *rest))
    np.testing.assert_allclose(together, lit_places(places, arrays(lamp, sun)) + apart, rtol=1e-6)
    np.testing.assert_array_equal(lit_places(places, lights, neighbours=False), together)
    np.testing.assert_array_equal(lit_places(places, lights.at([5, 3])), together[:, [5, 3]])


def check_grouping(lights: LightArrays, rng: np.random.Generator) -> None:
    """Some of it behind a box, light is the same to the last bit for any grouping; some positions are lit as all."""
    box = tiny.scene_of(np.concatenate([tiny.box((-2, 0.6, -2), (0.3, 0.7, 2)), FAR]))
    hits = hits_at(n=203)
    hits.position[:] += rng.uniform(-1, 1, (203, 3)) * [1, 0, 1]
    together, apart = (lit(hits, lights, box, neighbours) for neighbours in (True, False))
    np.testing.assert_array_equal(together, apart)
    chosen = [lights.n_lights - 1, 0, 2]
    np.testing.assert_allclose(lit(hits, lights.at(chosen), box), together[:, chosen], rtol=1e-6)


def seen(job: Job) -> tuple[Any, Hits, Any]:
    """What the first eye of a job sees of surfaces, by the program's kernels, one hit per pixel.

    Returns:
        positions (n, 3) in the coordinates of the file; the hits; irradiance (n, channels, n_lights) in float64.
    """
    prepared = prepare(job)
    with open_embree(prepared) as embree:
        setup, _ = plan_work(prepared, embree)
        hits, tests = native(setup, 0, 1), room_for_tests(1024, setup.lights.n_lights)
        light = np.empty((len(hits.kind), setup.lights.channels, setup.lights.n_lights), np.float32)
        direct(hits, len(hits.kind), setup.lights, setup.world.sight, tests, light, True)
    met = hits.kind == SURFACE
    hits = Hits(*(array[met] for array in hits))
    return hits.position.astype(float) + prepared.scene.centre, hits, light[met].astype(float)


def lambert(corners: Any) -> float:
    """Irradiance of a floor at the origin by a polygon of radiance 1 above it, by Lambert's formula (1760).

    Half the sum over edges of the angle under which the edge is seen, times the height of the unit normal of the plane
    through it and the origin.
    """
    below = corners[:, 1] < 0  # cut the polygon at the horizon
    kept: list[Any] = []
    for v, w, v_below, w_below in zip(corners, np.roll(corners, -1, 0), below, np.roll(below, -1), strict=True):
        kept += [] if v_below else [v]
        kept += [v + (w - v) * v[1] / (v[1] - w[1])] if v_below != w_below else []
    if not kept:
        return 0.0
    v = np.array(kept)
    w = np.roll(v, -1, 0)
    across = np.cross(v, w)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (v * w).sum(axis=1))
    heights = np.divide(across[:, 1], sine, out=np.zeros_like(sine), where=sine > 0)
    return abs(float((angle * heights).sum())) / 2
