"""Shapes of lights: the factors of irradiance and the power of particles, by their definitions."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.engine.inputs.shapes import emitted_power, emitted_ray, source_at, vector_and_factor
from framearray_cli.scene.paths.paths import lights_without_groups
from framearray_cli.scene.paths.placing import LightPath

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


def test_particles_carry_the_power_of_their_source() -> None:
    """A lamp of 1 W/sr emits 4 pi W; a sun of 1 W/m2 sends pi r^2 W through a disc as wide as the scene."""
    radius = 3.0
    assert emitted_power(lights(), 0, radius) == pytest.approx([4 * np.pi])
    assert emitted_power(lights(), 1, radius) == pytest.approx([np.pi * radius**2])


def test_particles_start_at_the_lamp_or_on_a_disc_in_front_of_the_scene() -> None:
    both, radius = lights(), 3.0
    for a, b in np.random.default_rng(1).random((50, 2)):
        lamp, sun = (np.array(emitted_ray(both, s, 0, radius, a, b, 0.0, 0.0)).reshape(2, 3) for s in (0, 1))
        np.testing.assert_allclose(lamp[0], LAMP, rtol=1e-6)
        assert np.linalg.norm(lamp[1]) == pytest.approx(1, rel=1e-6)
        np.testing.assert_allclose(sun[1], SUN, rtol=1e-6)
        np.testing.assert_allclose((sun[0] + 2 * radius * np.array(SUN)) @ SUN, 0, atol=1e-5)
        assert np.linalg.norm(sun[0] + 2 * radius * np.array(SUN)) <= radius * (1 + 1e-6)
