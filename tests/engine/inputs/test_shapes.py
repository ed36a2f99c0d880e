"""Shapes of lights: the factors of irradiance of points, suns, rectangles and discs, by their definitions."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.irradiance import FAR, N, P, arrays, check_grouping, check_mean, hits_at, lambert, lamps, lit, suns

from framearray_cli.engine.inputs.shapes import is_plain, source_point, vector_and_factor
from framearray_cli.scene.paths.lightpath import LightPath, Panel

RNG = np.random.default_rng(6)
# Middles from P, and normals: in front of P, beside it, near, far, partly below its horizon, tilted.
MIDDLES = np.array([(0, 1.5, 0), (1.2, 0.8, 0.3), (-0.3, 0.7, 0.4), (2, 6, -3), (1.5, 0.2, 0), (-1, 2, 1)])
NORMALS = np.array([(0, -1, 0), (-1, -0.4, 0), (0.1, -1, -0.3), (-0.2, -1, 0.5), (-1, 0.1, 0.2), (0.1, -1, -0.7)])


def panel(
    width: float, height: float, *, middles: Any = MIDDLES, normals: Any = NORMALS, two_sided: bool = False
) -> LightPath:
    """A rectangle of radiance 1; width 0: a disc of that radius."""
    n, axis = len(middles), normals / np.linalg.norm(normals, axis=1, keepdims=True)
    across = np.cross(axis, np.add(axis[:, [2, 0, 1]], (0.3, 0.1, 0.7)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    sides = (2 * height, 2 * height) if width == 0 else (width, height)
    shape = Panel(
        shape="rect" if width else "disc", axis=axis, across=across, sides=np.tile(sides, (n, 1)), two_sided=two_sided
    )
    return LightPath(
        kind="point", vector=np.add(P, middles), intensity=np.tile(shape.area[:, None], (1, 3)), panel=shape
    )


def shape_of(source: LightPath) -> Panel:
    assert source.panel is not None
    return source.panel


def outline(source: LightPath, l: int, parts: int = 4000) -> Any:
    """Corners of a panel, seen from P; a disc is a polygon of as much area."""
    a, b = (axes[l] for axes in shape_of(source).half_axes)
    middle = source.vector[l] - P
    if shape_of(source).shape != "disc":
        return middle + np.array([-a - b, a - b, a + b, b - a])
    turn = 2 * np.pi * np.arange(parts) / parts
    wider = np.sqrt(2 * np.pi / parts / np.sin(2 * np.pi / parts))
    return middle + wider * (np.cos(turn)[:, None] * a + np.sin(turn)[:, None] * b)


def test_lamberts_formula_has_known_values() -> None:
    """A disc of radius r parallel to the floor at height h: pi r^2 / (h^2 + r^2); a wide ceiling: pi."""
    turn = 2 * np.pi * np.arange(10_000) / 10_000
    disc = np.stack([0.7 * np.cos(turn), np.full(10_000, 1.5), 0.7 * np.sin(turn)], axis=1)
    assert lambert(disc) == pytest.approx(np.pi * 0.49 / (2.25 + 0.49), rel=1e-6)
    assert lambert(np.array([(-1e4, 1, -1e4), (1e4, 1, -1e4), (1e4, 1, 1e4), (-1e4, 1, 1e4)])) == pytest.approx(np.pi)


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize(("width", "height"), [(1.2, 0.3), (0, 0.4)])
def test_the_mean_is_lamberts_light_of_the_whole_panel(width: float, height: float, two_sided: bool) -> None:
    """Within 3.5 standard errors, which are below 0.5 %."""
    source = panel(width, height, two_sided=two_sided)
    expected = np.array([lambert(outline(source, l)) for l in range(len(MIDDLES))])
    check_mean(lit(hits_at(n=4 * N), arrays(source)), expected)


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize(("width", "height"), [(1.2, 0.3), (0, 0.4)])
def test_each_hit_has_the_light_of_the_point_that_it_draws(width: float, height: float, neighbours: bool) -> None:
    """The point by the maps' own definitions; the light L cos cos / d^2 over the density of the point."""
    source, square = panel(width, height), arrays(panel(1, 1))
    found = lit(hits_at(n=200), arrays(source), neighbours=neighbours)
    for i in range(200):
        at = np.array(source_point(square, np.uint64(i), 0, False)[:2], np.float64)
        if width == 0:  # Shirley and Chiu: squares become circles, and their diagonals stay
            steep = abs(at[1]) > abs(at[0])
            radius, other = at[::-1] if steep else at
            angle = np.pi / 4 * other / radius
            at = radius * np.array([np.cos(angle), np.sin(angle)])[:: -1 if steep else 1]
        for l in range(len(MIDDLES)):
            way, density = chosen(shape_of(source), l, *at)
            d = np.linalg.norm(way)
            cosines = max(way[1] / d, 0) * max(-way @ shape_of(source).axis[l] / d, 0)
            assert found[i, l] == pytest.approx(cosines / d**2 / density, rel=3e-4, abs=2e-5)


def chosen(shape: Panel, l: int, s: float, t: float) -> tuple[Any, float]:
    """The point of a panel for s and t, which are even over its square or disc, and its density over the area."""
    axes = np.array([shape.across[l], np.cross(shape.axis[l], shape.across[l])])
    half, middle, h = shape.sides[l] / 2, axes @ MIDDLES[l], abs(MIDDLES[l] @ shape.axis[l])
    e = np.hypot(h, max(abs(middle[1]) - half[1], 0))
    first, last = np.arctan((middle[0] + np.array([-1, 1]) * half[0]) / e)
    chord = np.sqrt(1 - s * s) if shape.shape == "disc" else 1.0  # s is as likely as the chord there is long
    x = e * np.tan(first + (last - first) * (s + 1) / 2)
    per_x = e / (x * x + e * e) / (last - first) * (4 / np.pi * chord if shape.shape == "disc" else 1)
    reach = half[1] * (np.sqrt(1 - ((x - middle[0]) / half[0]) ** 2) if shape.shape == "disc" else 1)
    d = np.hypot(x, h)
    low, high = (y / np.hypot(y, d) for y in (middle[1] - reach, middle[1] + reach))
    at = low + (high - low) * (t / chord + 1) / 2
    y = d * at / np.sqrt(1 - at * at)
    per_y = d * d / np.hypot(y, d) ** 3 / (high - low)
    return x * axes[0] + y * axes[1] + (MIDDLES[l] @ shape.axis[l]) * shape.axis[l], per_x * per_y


def test_near_a_panel_its_light_varies_little() -> None:
    """Below the middle of a square of 2 x 2, and below its edge: the light of one point over its mean.

    The bounds are those of an integral of the squared estimate over all points, which has no random numbers: 1.3 times
    the standard deviation; points that are even over the area have 6.6 and 6.4 at a tenth of its half width.
    """
    for away, most in ((0.1, 0.8), (0.5, 0.6), (2.0, 0.25)):
        middles = np.array([(0, away, 0), (0.7, away, 0.1)])
        found = lit(hits_at(), arrays(panel(2, 2, middles=middles, normals=np.array([(0, -1.0, 0)] * 2))))
        assert (found.std(axis=0) < most * found.mean(axis=0)).all()


def test_far_away_a_panel_is_a_point_of_its_intensity() -> None:
    middles, normals = MIDDLES[[0, 1, 3]], -MIDDLES[[0, 1, 3]]
    for width, height in ((0.05, 0.02), (0, 0.03)):
        source = panel(width, height, middles=middles, normals=normals)
        bare = LightPath(kind="point", vector=source.vector, intensity=source.intensity)
        found, point = (lit(hits_at(n=500), arrays(one)).mean(axis=0) for one in (source, bare))
        np.testing.assert_allclose(found, point, rtol=0.01)


def test_a_panel_shines_forwards_and_where_it_says_so_backwards() -> None:
    """Points behind its plane, in its plane and in its middle."""
    turned = panel(1.2, 0.3, normals=-NORMALS)
    assert (lit(hits_at(n=300), arrays(turned)) == 0).all()
    both = panel(1.2, 0.3, normals=-NORMALS, two_sided=True)
    # the same points of the panel, if the width of the turned one runs backwards
    front = lit(hits_at(n=300), arrays(panel(1.2, 0.3)))
    back = lit(hits_at(n=20_000), arrays(both))
    assert (np.abs(back.mean(axis=0) / front.mean(axis=0) - 1) < 0.2).all()
    inside = panel(1.2, 0.3, middles=np.zeros((2, 3)), normals=np.array([(1.0, 0, 0), (0, -1.0, 0)]), two_sided=True)
    assert (lit(hits_at(n=300), arrays(inside))[:, 1] == 0).all()
    assert np.isfinite(lit(hits_at(n=300), arrays(inside))).all()


def test_half_a_disc_behind_an_edge_gives_half_the_light() -> None:
    wall = tiny.scene_of(np.concatenate([tiny.box((-5, 0.8, -5), (P[0], 0.81, 5)), FAR]))
    source = panel(0, 0.3, middles=MIDDLES[[0]], normals=NORMALS[[0]])
    found = lit(hits_at(), arrays(source), wall)[:, 0]
    whole = lambert(outline(source, 0))
    assert abs(found.mean() - whole / 2) < 3.5 * found.std() / np.sqrt(N) + 0.002 * whole


def test_a_wall_that_a_panel_lies_on_does_not_hide_it() -> None:
    ceiling = tiny.scene_of(np.concatenate([tiny.box((-5, P[1] + 1.5, -5), (5, 2.0, 5)), FAR]))
    source = panel(1.2, 0.3, middles=MIDDLES[[0]], normals=NORMALS[[0]])
    assert (lit(hits_at(n=2000), arrays(source), ceiling) > 0).all()


def test_panels_beside_other_sources_leave_them_alone() -> None:
    rect, disc = panel(1.2, 0.3), panel(0, 0.4, two_sided=True)
    lamp, sun = lamps(P + MIDDLES + 1, size=np.full(6, 0.1)), suns(np.tile((0.6, -0.8, 0.0), (6, 1)))
    together = lit(hits_at(n=500), arrays(sun, lamp))
    assert (lit(hits_at(n=500), arrays(sun, lamp, rect, disc)) >= together).all()
    dark = LightPath(kind="point", vector=rect.vector, intensity=rect.intensity * 0, panel=rect.panel)
    np.testing.assert_allclose(lit(hits_at(n=500), arrays(sun, lamp, dark)), together, rtol=1e-6)
    apart = lit(hits_at(n=500), arrays(dark, disc)) + lit(hits_at(n=500), arrays(rect))
    np.testing.assert_allclose(lit(hits_at(n=500), arrays(rect, disc)), apart, rtol=1e-5)


@pytest.mark.parametrize("n_lights", [5, 16, 48])
def test_light_of_panels_is_the_same_to_the_last_bit_for_any_grouping(n_lights: int) -> None:
    middles = np.add(RNG.uniform(-2, 2, (n_lights, 3)), (0, 3, 0))
    normals = np.add(RNG.normal(size=(n_lights, 3)) * 0.4, (0, -1, 0))
    panels = (
        panel(1.0, 0.5, middles=middles, normals=normals),
        panel(0, 0.5, middles=-middles, normals=normals, two_sided=True),
    )
    check_grouping(arrays(*panels), RNG)


LAMP, SUN = (0.3, 2.0, -0.4), (0.6, -0.8, 0.0)
UP, TILTED = (0.0, 1.0, 0.0), (0.0, 0.8, 0.6)


def lights() -> Any:
    """A lamp and a sun of strength 1."""
    return arrays(lamps([LAMP]), suns([SUN]))


def factor(s: int, normal: Any = UP, shading: Any = None, lit: float = 1.0) -> float:
    """The factor of source s at the origin."""
    triples = [tuple(np.float32(x) for x in v) for v in ((0, 0, 0), normal, normal if shading is None else shading, UP)]
    found = lights()._replace(lit=np.full((2, 1), lit, np.float32))
    return float(vector_and_factor(found, s, is_plain(found, s), 0, *triples)[3])


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
