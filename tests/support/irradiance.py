"""Direct light at many hits of one place, each with a random point of every source."""

from typing import Any

import numpy as np

from framearray_cli.engine.embree import EmbreeScene
from framearray_cli.engine.hits.hits import Hits
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.lights import LightArrays, light_arrays
from framearray_cli.engine.terms.direct import direct
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights_without_groups
from framearray_cli.scene.scene import Scene

from . import tiny
from .hits import points

P, UP = np.array([0.3, 0.1, -0.2]), (0.0, 1.0, 0.0)
N = 40_000
FAR = np.concatenate([tiny.box((90, -21, -1), (91, -20, 1)), tiny.box((-91, 20, -1), (-90, 21, 1))])  # hides nothing


def arrays(*sources: LightPath) -> LightArrays:
    return light_arrays(lights_without_groups(sources), np.zeros(3))


def hits_at(place: Any = P, n: int = N, first: int = 0) -> Hits:
    hits = points(n, place, UP)
    hits.key[:] = np.arange(first, first + n)
    return hits


def lit(hits: Hits, lights: LightArrays, scene: Scene | None = None, neighbours: bool = True) -> Any:
    """Irradiance (n, n_lights) in float64."""
    n = len(hits.kind)
    out = np.full((n, 1, lights.n_lights), np.nan, np.float32)
    with EmbreeScene(scene or tiny.scene_of(FAR)) as embree:
        direct(hits, n, lights, embree.tracer, room_for_tests(4096, lights.n_lights), out, neighbours)
    return out[:, 0].astype(np.float64)
