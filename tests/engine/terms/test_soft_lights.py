"""Spheres and suns of a size: the light of one random direction per hit, on average that of the whole source."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.irradiance import FAR, N, P, arrays, check_grouping, check_mean, hits_at, lamps, lit, suns

from framearray_cli.engine.inputs.shapes import source_point
from framearray_cli.scene.paths.lightpath import LightPath

LAMPS = np.array([(0.2, 1.5, 0.3), (2.0, 0.9, 0.1), (-1.0, 3.0, 1.0), (0.3, 1.1, -0.2)] * 4)
WAYS = np.array([(0.0, -1.0, 0.0), (1.0, -1.0, 0.2), (1.0, -0.3, 0.5), (-0.2, -1.0, 0.9)] * 4)


def spheres(radius: float, positions: Any = LAMPS) -> LightPath:
    return lamps(positions, size=np.full(len(positions), radius))


def wide_suns(angle: float, ways: Any = WAYS) -> LightPath:
    return suns(ways, size=np.full(len(ways), angle))


NO_PANELS = arrays(spheres(1.0))


def twin(kind: str, vector: Any, size: float, q: Any) -> tuple[Any, float]:
    """The direction that q chooses, and the factor of its cosine: by the definition, with axes across the cone."""
    to_light = vector - P if kind == "point" else -vector
    d = np.linalg.norm(to_light)
    w = to_light / d
    sine = size / d if kind == "point" else np.sin(np.radians(size) / 2)
    least = np.sqrt(1 - sine**2)
    cosine = least + (1 - least) * (1 - q @ w) / 2  # uniform from `least` to 1
    side = q - (q @ w) * w
    direction = cosine * w + np.sqrt(1 - cosine**2) * side / np.linalg.norm(side)
    solid_angle = 2 * np.pi * (1 - least)
    radiance = 1 / (np.pi * size**2) if kind == "point" else 1 / (np.pi * sine**2)
    return direction, radiance * solid_angle


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize(
    ("kind", "size"), [("point", 0.3), ("point", 0.05), ("directional", 0.53), ("directional", 25)]
)
def test_each_hit_has_the_light_of_the_direction_that_it_draws(kind: str, size: float, neighbours: bool) -> None:
    source = spheres(size) if kind == "point" else wide_suns(size)
    found = lit(hits_at(n=100), arrays(source), neighbours=neighbours)
    for i in range(100):
        q = np.array(source_point(NO_PANELS, np.uint64(i), 0, False), np.float64)
        for l in range(4):
            direction, factor = twin(kind, source.vector[l], size, q)
            assert found[i, l] == pytest.approx(max(factor * direction[1], 0), rel=2e-4, abs=2e-4 * factor)


@pytest.mark.parametrize(("radius", "angle"), [(0.02, 0.53), (0.3, 20.0)])
def test_the_mean_is_the_light_of_a_whole_sphere_or_sun(radius: float, angle: float) -> None:
    """Above the horizon a sphere lights a point as if all came from its centre, a sun as the disc's middle does."""
    to_lamp = LAMPS - P
    of_lamp = to_lamp[:, 1] / np.linalg.norm(to_lamp, axis=1) ** 3
    of_sun = -WAYS[:, 1] / np.linalg.norm(WAYS, axis=1)
    for source, expected in ((spheres(radius), of_lamp), (wide_suns(angle), of_sun)):
        check_mean(lit(hits_at(), arrays(source)), expected)


def test_directions_fill_the_cone_evenly() -> None:
    """Random points are uniform on the sphere: as many in each of 64 parts of equal area, by a chi-square test."""
    q = np.array([source_point(NO_PANELS, np.uint64(i), 3, False) for i in range(20_000)])
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=2e-6)
    part = np.floor((q[:, 2] + 1) * 3.99999).astype(int) * 8 + np.floor(
        (np.arctan2(q[:, 1], q[:, 0]) / (2 * np.pi) % 1) * 8
    ).astype(int)
    counts = np.bincount(part, minlength=64)
    statistic = ((counts - len(q) / 64) ** 2 / (len(q) / 64)).sum()
    assert 30 < statistic < 110  # 63 degrees of freedom: one in 10,000 beyond either end


def test_half_a_sun_behind_an_edge_gives_half_the_light() -> None:
    """The edge of a wall in the plane that halves the disc of a sun."""
    wall = tiny.scene_of(np.concatenate([tiny.box((-5, 1, -5), (P[0], 1.1, 5)), FAR]))
    source = wide_suns(10, [(0.0, -1.0, 0.0)] * 16)
    found = lit(hits_at(), arrays(source), wall)
    share = found / 1.0
    error = share.std(axis=0) / np.sqrt(N)
    assert (np.abs(share.mean(axis=0) - 0.5) < 3.5 * error + 0.002).all()
    assert (lit(hits_at(), arrays(replace(source, size=None)), wall)[:, 0] % 1 == 0).all()


def test_a_sphere_half_below_the_horizon_lights_a_floor() -> None:
    """A sphere whose centre lies in the plane of the floor: half of its disc, sin(alpha)^3 2/3 of its radiance.

    The projected solid angle of the upper half of a cone of half angle alpha whose axis lies in the plane is
    integral over the half disc of radius sin(alpha) of the height: 2/3 sin^3(alpha), if directions are projected along
    the axis; here exactly integral cos(theta) dw = alpha - sin(alpha) cos(alpha).
    """
    d, radius = 2.0, 0.5
    alpha = np.arcsin(radius / d)
    expected = (alpha - np.sin(alpha) * np.cos(alpha)) / (np.pi * radius**2)
    found = lit(hits_at(), arrays(spheres(radius, [np.add(P, (d, 0, 0))] * 16)))[:, 0]
    assert abs(found.mean() - expected) < 3.5 * found.std() / np.sqrt(N)


def test_a_small_source_tends_to_a_point() -> None:
    """With the radius the noise goes to 0, and values to those of the point."""
    point, errors = lit(hits_at(n=2000), arrays(replace(spheres(1.0), size=None))), []
    for radius in (0.1, 0.01, 0.001):
        found = lit(hits_at(n=2000), arrays(spheres(radius)))
        errors.append(np.abs(found / point - 1).max())
    assert errors[1] < 0.15 * errors[0] and errors[2] < 0.15 * errors[1]


def test_sources_without_size_beside_soft_ones_are_points() -> None:
    soft, hard = spheres(0.2), replace(spheres(0.2), vector=LAMPS + 1, size=None)
    both = lit(hits_at(n=500), arrays(soft, hard))
    np.testing.assert_allclose(both, lit(hits_at(n=500), arrays(soft)) + lit(hits_at(n=500), arrays(hard)), rtol=1e-5)


def test_no_light_inside_a_sphere() -> None:
    found = lit(hits_at(n=100), arrays(spheres(0.5, [np.add(P, (0, y, 0)) for y in (0.4, 0.6, 0.0)] * 6)))
    assert (found[:, 0::3] == 0).all() and (found[:, 2::3] == 0).all() and (found[:, 1::3] > 0).all()


@pytest.mark.parametrize("n_lights", [5, 16, 48])
def test_soft_light_is_the_same_to_the_last_bit_for_any_grouping(n_lights: int) -> None:
    rng = np.random.default_rng(3)
    above = np.add(rng.uniform(-2, 2, (n_lights, 3)), (0, 3, 0))
    check_grouping(arrays(spheres(0.3, above), wide_suns(5, np.add(rng.normal(size=(n_lights, 3)), (0, -3, 0)))), rng)
