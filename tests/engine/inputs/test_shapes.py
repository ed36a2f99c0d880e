"""Shapes of lights: the factors of irradiance, by their definitions."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.engine.inputs.shapes import source_at, vector_and_factor
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights_without_groups

LAMP, SUN = (0.3, 2.0, -0.4), (0.6, -0.8, 0.0)
UP, TILTED = (0.0, 1.0, 0.0), (0.0, 0.8, 0.6)


def lights() -> Any:
    """A lamp and a sun of strength 1."""
    paths = [
        LightPath(kind=kind, vector=np.array([vector]), intensity=np.ones((1, 3)))
        for kind, vector in (("point", LAMP), ("directional", SUN))
    ]
    return light_arrays(lights_without_groups(paths), np.zeros(3))


def factor(s: int, normal: Any = UP, shading: Any = None, lit: float = 1.0) -> float:
    """The factor of source s at the origin."""
    triples = [tuple(np.float32(x) for x in v) for v in ((0, 0, 0), normal, normal if shading is None else shading, UP)]
    source = source_at(lights(), s, 0)._replace(lit=np.float32(lit))
    return float(vector_and_factor(lights(), s, source, *triples)[3])


@pytest.mark.parametrize("normal", [UP, TILTED])
def test_factors_are_cosines_over_squares(normal: Any) -> None:
    way = np.array(LAMP)
    distance = np.linalg.norm(way)
    assert factor(0, normal) == pytest.approx(way @ normal / distance**3, rel=1e-6)
    assert factor(1, normal) == pytest.approx(-np.array(SUN) @ normal, rel=1e-6)


@pytest.mark.parametrize("s", [0, 1])
def test_no_light_from_behind_either_normal_nor_of_a_dark_source(s: int) -> None:
    down = (0.0, -1.0, 0.0)
    assert factor(s, down) == factor(s, UP, down) == factor(s, down, UP) == factor(s, lit=0.0) == 0.0
    assert factor(s, UP) > 0
