"""Direct light at hits whose irradiance is known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.hits import points
from support.irradiance import FAR, UP, arrays, lamps, suns

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.hits import ESCAPED, Hits
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.terms.direct import direct
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.scene import Scene

RNG = np.random.default_rng(7)
ABOVE = np.array([0.0, 4.0, 0.0])


def lit(scene: Scene, hits: Hits, lights: LightArrays, room: int = 4096, neighbours: bool = True) -> tuple[Any, int]:
    """Irradiance (n, 3, n_lights), the lights' colour included, and the number of rays."""
    n = len(hits.kind)
    out = np.full((n, lights.channels, lights.n_lights), np.nan, np.float32)
    with EmbreeScene(scene) as embree:
        rays = direct(hits, n, lights, Sight(embree.tracer), room_for_tests(room, lights.n_lights), out, neighbours)
    return out * lights.colour.T, rays


def far_box() -> Scene:
    """Something to trace that no ray to a light meets; its centre is the origin."""
    return tiny.scene_of(FAR)


def boxed() -> Scene:
    """The same, and a box over the floor."""
    return tiny.scene_of(np.concatenate([tiny.box((-2, 1, -2), (2, 1.5, 2)), FAR]))


def floor_points(n: int = 200) -> Hits:
    hits = points(n, (0, 0, 0), UP)
    hits.position[:] = RNG.uniform(-3, 3, (n, 3)) * [1, 0, 1]
    return hits


def test_a_point_source_falls_off_with_the_square_of_the_distance() -> None:
    hits = floor_points()
    positions = RNG.uniform(-3, 3, (17, 3)) + ABOVE
    found, rays = lit(far_box(), hits, arrays(lamps(positions, (3.0, 2.0, 1.0))))
    way = positions[None] - hits.position[:, None].astype(np.float64)
    square = (way**2).sum(axis=-1)
    expected = way[..., 1] / np.sqrt(square) / square
    np.testing.assert_allclose(found[:, 0], 3 * expected, rtol=1e-6)
    np.testing.assert_allclose(found[:, 2], 1 * expected, rtol=1e-6)
    assert rays == 200 * 17


@pytest.mark.parametrize("room", [32, 4096])
def test_few_lights_are_those_of_many(room: int) -> None:
    """Sixteen hits at a time, for up to eight positions, or sixteen positions at a time: the same light."""
    scene, hits = boxed(), floor_points()
    hits.kind[7], hits.reflectivity[11] = ESCAPED, 0.0
    positions, ways = RNG.uniform(-3, 3, (18, 3)) + ABOVE, RNG.normal(size=(18, 3)) - ABOVE
    sources = lamps(positions), suns(ways, (1.0, 2.0, 3.0))
    sources[0].intensity[3] = 0.0
    (expected, _), (free, _) = (lit(each, hits, arrays(*sources), room) for each in (scene, far_box()))
    assert 0.05 < (expected < 0.999 * free).mean() < 0.95

    def some(chosen: slice) -> LightArrays:
        return arrays(*(replace(s, vector=s.vector[chosen], intensity=s.intensity[chosen]) for s in sources))

    for n_lights in (1, 8):
        found, rays = lit(scene, hits, some(np.s_[:n_lights]), room)
        np.testing.assert_allclose(found, expected[:, :, :n_lights], rtol=1e-6, atol=0)
        assert rays == sum(lit(scene, hits, some(np.s_[l : l + 1]), room)[1] for l in range(n_lights))
        assert (found[[7, 11]] == 0).all()


@pytest.mark.parametrize("n_lights", [9, 16, 18, 48])
def test_hits_that_lie_together_get_the_same_light_to_the_last_bit(n_lights: int) -> None:
    scene, hits = boxed(), floor_points(203)
    hits.kind[7], hits.reflectivity[11] = ESCAPED, 0.0
    hits.shading[:] += RNG.normal(scale=0.1, size=(203, 3))
    positions, ways = RNG.uniform(-3, 3, (n_lights, 3)) + ABOVE, RNG.normal(size=(n_lights, 3)) - ABOVE
    lights = arrays(lamps(positions, (3.0, 2.0, 1.0)), suns(ways, (1.0, 2.0, 3.0)))
    together, rays = lit(scene, hits, lights, 64, neighbours=True)
    apart, rays_apart = lit(scene, hits, lights, 64, neighbours=False)
    np.testing.assert_array_equal(together, apart)
    assert rays == rays_apart and 0.1 < (together > 0).mean() < 0.9


def test_a_directional_source_has_no_distance() -> None:
    hits = floor_points()
    found, _ = lit(far_box(), hits, arrays(suns([(0, -1, 0), (1, -1, 0), (0.3, -0.2, 0.9)], (2.0, 4.0, 8.0))))
    expected = np.array([1, 1 / np.sqrt(2), 0.2 / np.sqrt(0.94)])
    np.testing.assert_allclose(found[:, 1], np.tile(4 * expected, (200, 1)), rtol=1e-6)


def test_twice_the_light_is_twice_the_direct_light() -> None:
    """To the last bit: a factor of two changes no digit."""
    hits = floor_points()
    positions = RNG.uniform(-3, 3, (8, 3)) + ABOVE
    sun = [(0.3, -0.4, 0.5)] * 8
    for one, two in (
        ((lamps(positions, (3, 2, 1)),), (lamps(positions, (6, 4, 2)),)),
        ((lamps(positions, (3, 2, 1)), suns(sun, (1, 1, 5))), (lamps(positions, (6, 4, 2)), suns(sun, (2, 2, 10)))),
    ):
        once, twice = (lit(tiny.room(), hits, arrays(*sources))[0] for sources in (one, two))
        assert once.any()
        np.testing.assert_array_equal(twice, 2 * once)


def test_two_sources_add() -> None:
    hits = floor_points()
    positions = RNG.uniform(-3, 3, (8, 3)) + ABOVE
    a, b = lamps(positions, (3, 2, 1)), suns([(0.3, -0.4, 0.5)] * 8, (1, 1, 5))
    both, rays = lit(far_box(), hits, arrays(a, b))
    (one, n_one), (two, n_two) = lit(far_box(), hits, arrays(a)), lit(far_box(), hits, arrays(b))
    np.testing.assert_allclose(both, one + two, rtol=1e-6)
    assert rays == n_one + n_two


def test_three_channels_of_one_colour_are_the_same_as_one() -> None:
    hits = floor_points()
    lights = arrays(lamps(RNG.uniform(-3, 3, (8, 3)) + ABOVE, (3, 2, 1)))
    assert lights.channels == 1
    three = lights._replace(
        strength=np.ascontiguousarray(lights.strength * lights.colour.T), colour=np.ones_like(lights.colour)
    )
    np.testing.assert_allclose(lit(far_box(), hits, three)[0], lit(far_box(), hits, lights)[0], rtol=1e-6)


def test_what_is_behind_either_normal_gives_nothing_and_costs_nothing() -> None:
    hits = points(10, (0, 0, 0), UP)
    found, rays = lit(far_box(), hits, arrays(lamps([(1, -0.5, 0), (0, -1, 0), (1, 0, 0), (0, 1, 0)])))
    assert rays == 10 and not found[..., :3].any() and found[..., 3].all()
    hits.shading[:] = np.float32([0.6, 0.8, 0.0])
    found, rays = lit(far_box(), hits, arrays(lamps([(2, -0.5, 0), (-2, 0.5, 0), (2, 0.5, 0)])))
    assert rays == 10 and not found[..., :2].any() and found[..., 2].all()


def test_a_source_that_is_dark_costs_nothing() -> None:
    hits = points(10, (0, 0, 0), UP)
    source = LightPath(kind="point", vector=np.ones((3, 3)), intensity=np.array([[1.0, 1, 1], [0, 0, 0], [0, 0, 2.0]]))
    found, rays = lit(far_box(), hits, arrays(source))
    assert rays == 20 and not found[..., 1].any()


def test_hits_that_reflect_nothing_get_nothing() -> None:
    hits = points(10, (0, 0, 0), UP)
    hits.reflectivity[:5] = 0.0
    hits.kind[5:7] = ESCAPED
    found, rays = lit(far_box(), hits, arrays(lamps([(0, 1, 0)])))
    assert rays == 3 and not found[:7].any() and found[7:].all()


def test_walls_throw_shadows() -> None:
    """A box between lamp and floor; the shadow's edge is where the line to the lamp grazes the box's top."""
    scene = tiny.scene_of(np.concatenate([tiny.box((-0.5, 1, -0.5), (0.5, 1.2, 0.5)), tiny.box((8, 0, 8), (9, 1, 9))]))
    hits = points(400, (0, 0, 0), UP)
    hits.position[:] = np.column_stack([np.linspace(-3, 3, 400), np.zeros((400, 2))]) - scene.centre
    found, _ = lit(scene, hits, arrays(lamps([np.array([0, 2.2, 0]) - scene.centre])))
    x = np.linspace(-3, 3, 400)
    np.testing.assert_array_equal(found[:, 0, 0] == 0, abs(x) * 1.0 / 2.2 < 0.5)


def test_nothing_beyond_the_lamp_shades() -> None:
    roof = tiny.quad((-5, 1.01, -5), (5, 1.01, -5), (5, 1.01, 5), (-5, 1.01, 5))
    scene = tiny.scene_of(np.concatenate([roof, roof * [1, -1, 1]]))
    found, _ = lit(scene, points(4, (0, 0, 0), UP), arrays(lamps([(0, 1, 0), (0, 1.02, 0)])))
    assert found[..., 0].all() and not found[..., 1].any()


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_a_light_on_a_surface_shines_from_it(size: float) -> None:
    """A lamp in the very plane of the ceiling is not hidden by it, at any scale."""
    scene = tiny.scene_of(tiny.box((-2 * size, -size, -2 * size), (2 * size, size, 2 * size)))
    hits = points(300, (0, 0, 0), UP)
    hits.position[:] = RNG.uniform(-1.9, 1.9, (300, 3)) * [size, 0, size] - [0, size, 0]
    hits.offset[:] = 16 * 2.0**-23 * 2 * size
    spots = RNG.uniform(-1.9, 1.9, (20, 3)) * [size, 0, size] + [0, size, 0]
    found, _ = lit(scene, hits, arrays(lamps(spots, (size**2,) * 3)))
    assert (found > 0).all()


def test_a_hit_at_the_lamp_itself_stays_finite_or_is_zero() -> None:
    hits = points(3, (0, 0, 0), UP)
    found, _ = lit(far_box(), hits, arrays(lamps([(0, 0, 0), (0, 1e-30, 0), (0, 1, 0)])))
    assert not np.isnan(found).any()
    assert (found[..., 0] == 0).all()


@pytest.mark.parametrize("n_lights", [1, 3, 16, 48])
@pytest.mark.parametrize("room", [16, 64, 4096])
def test_any_number_of_packets_gives_the_same(room: int, n_lights: int) -> None:
    rng, scene = np.random.default_rng(n_lights), tiny.room()
    hits = points(400, -scene.centre, UP)
    hits.position[:] += rng.uniform(-2, 2, (400, 3)).astype(np.float32) * [1, 0, 1]
    lights = arrays(lamps(rng.uniform(-1.5, 1.5, (n_lights, 3)) * [1, 0.3, 1] + [0, 1.5, 0] - scene.centre))
    expected, rays = lit(scene, hits, lights)
    found, again = lit(scene, hits, lights, room)
    np.testing.assert_array_equal(found, expected)
    assert rays == again and (expected == 0).any() and (expected > 0).any()


@pytest.mark.parametrize("neighbours", [True, False])
def test_sources_one_by_one_add_up_to_all(neighbours: bool) -> None:
    """The rays of each source are those that all sources need together, and none of the others."""
    hits, scene = floor_points(), boxed()
    positions, ways = RNG.uniform(-3, 3, (12, 3)) + ABOVE, RNG.normal(size=(12, 3)) - ABOVE
    lights = arrays(lamps(positions), suns(ways, (1.0, 2.0, 3.0)), lamps(positions + 0.5, (2.0, 1.0, 1.0)))
    expected, n_rays = lit(scene, hits, lights, neighbours=neighbours)
    apart = [lit(scene, hits, lights.of_source(s), neighbours=neighbours) for s in range(3)]
    np.testing.assert_allclose(sum(found for found, _ in apart), expected, rtol=1e-5)
    assert sum(rays for _, rays in apart) == n_rays and all(found.any() for found, _ in apart)
