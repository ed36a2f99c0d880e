"""Measured lamps: the light of a table by its definition, in float64."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.hits import points
from support.irradiance import arrays, check_among_others, irradiances, lamps, lit_places

from framearray_cli.engine.inputs.profiles import angle_of
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.profiles import Profile, Web

RNG = np.random.default_rng(5)
CIRCLE = np.linspace(-180, 180, 25)


def web(polar: Any, around: Any, sideways: bool = False) -> Web:
    share = RNG.uniform(0.1, 1, (len(around), len(polar)))
    if len(around) > 1 and around[-1] - around[0] == 360:
        share[-1] = share[0]
    return Web(
        polar_deg=np.array(polar, float),
        around_deg=np.array(around, float),
        share=share / share.max(),
        candela=1,
        sideways=sideways,
    )


WEBS = {
    "round": web([0, 10, 25, 40, 90], [0]),
    "whole": web(np.linspace(0, 180, 19), CIRCLE),
    "up": web(np.linspace(90, 180, 7), CIRCLE),
    "uneven": web([0, 7.5, 33.3, 90, 180], [-180, -90, 15.25, 90, 180]),
    "floodlight": web(np.linspace(60, 120, 13), np.linspace(-45, 45, 10), True),
}


def lamp(table: Web, n: int = 16, radius: float | None = None) -> LightPath:
    axis = np.add(RNG.normal(size=(n, 3)) * 0.4, (0, -1, 0))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    zero = np.cross(axis, RNG.normal(size=(n, 3)))
    return lamps(
        np.add(RNG.uniform(-0.5, 0.5, (n, 3)), (0, 1, 0)),
        size=None if radius is None else np.full(n, radius),
        profile=Profile(file="a.ies", web=table, axis=axis, zero=zero / np.linalg.norm(zero, axis=1, keepdims=True)),
    )


def share(source: LightPath, way: Any) -> Any:
    """The share into directions (..., n, 3), by the definition of types C and B in LM-63-2002."""
    profile = source.profile
    assert profile is not None
    table, axis, zero = profile.web, profile.axis, profile.zero
    way = way / np.linalg.norm(way, axis=-1, keepdims=True)
    # seen from above, a lamp that points down has its C plane of 90 degrees a quarter turn against the clock from C 0
    side = np.cross(-axis, zero)
    down, ahead, left = ((way * part).sum(axis=-1) for part in (axis, zero, side))
    if table.sideways:
        clockwise = np.degrees(np.arcsin(np.clip(-left, -1, 1)))  # horizontal angles of type B
        polar, around = 90 + clockwise, np.degrees(np.arctan2(ahead, down))
    else:
        polar, around = np.degrees(np.arccos(np.clip(down, -1, 1))), np.degrees(np.arctan2(left, ahead))
    t, a = table.polar_deg, table.around_deg
    i = np.clip(np.searchsorted(t, polar, side="right") - 1, 0, len(t) - 2)
    f = (polar - t[i]) / (t[i + 1] - t[i])
    inside = (f >= 0) & (f <= 1)
    if len(a) == 1:
        return np.where(inside, table.share[0, i] * (1 - f) + table.share[0, i + 1] * f, 0)
    j = np.clip(np.searchsorted(a, around, side="right") - 1, 0, len(a) - 2)
    g = (around - a[j]) / (a[j + 1] - a[j])
    rows = [table.share[k, i] * (1 - f) + table.share[k, i + 1] * f for k in (j, j + 1)]
    return np.where(inside & (g >= 0) & (g <= 1), rows[0] * (1 - g) + rows[1] * g, 0)


def floor_points(n: int) -> Any:
    return RNG.uniform(-3, 3, (n, 3)) * (1, 0.2, 1) - (0, 0.2, 0)


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize("name", WEBS)
def test_a_measured_lamp_lights_points_by_its_table(name: str, neighbours: bool) -> None:
    source, places = lamp(WEBS[name]), floor_points(600)
    found = lit_places(places, arrays(source), neighbours)
    way = source.vector[None] - places[:, None]
    full = np.maximum(way[..., 1], 0) / np.linalg.norm(way, axis=-1) ** 3
    wanted = full * share(source, -way)
    # beside the outermost angles a table ends with a step, which rounding may move
    steps = np.abs(found - wanted) > 2e-4 * full
    assert steps.mean() < 1e-3
    assert (wanted > 0).any()
    np.testing.assert_array_equal(found, lit_places(places, arrays(source), not neighbours))


def test_profiles_beside_other_sources_leave_them_alone() -> None:
    check_among_others(floor_points(100), lamp(WEBS["whole"]), lamp(WEBS["floodlight"]))


def test_a_measured_lamp_may_have_a_size() -> None:
    """On average over its points a small sphere lights as the point, as its table has no steps here."""
    table = Web(
        polar_deg=np.linspace(0, 180, 91),
        around_deg=np.zeros(1),
        share=(1 + np.cos(np.radians(np.linspace(0, 180, 91))))[None] / 2,
        candela=1,
        sideways=False,
    )
    source = lamp(table, n=16, radius=0.02)
    place = np.zeros((20_000, 3))
    found = lit_places(place, arrays(source))
    wanted = lit_places(place[:1], arrays(replace(source, size=None)))[0]
    error = found.std(axis=0) / len(place) ** 0.5
    assert (np.abs(found.mean(axis=0) - wanted) < 3.5 * error + 1e-3 * wanted).all()


def test_angles_are_exact_to_single_precision() -> None:
    at = np.linspace(-np.pi, np.pi, 4001)
    for length in (1e-6, 1.0, 1e6):
        x, y = (length * np.cos(at)).astype(np.float32), (length * np.sin(at)).astype(np.float32)
        found = np.array([angle_of(b, a) for a, b in zip(x, y, strict=True)])
        np.testing.assert_allclose(found, np.arctan2(y.astype(float), x.astype(float)), atol=4e-7)
    assert angle_of(np.float32(0), np.float32(0)) == 0


@pytest.mark.parametrize("name", ["whole", "floodlight"])
def test_all_light_of_a_lamp_arrives_at_the_walls_around_it(name: str) -> None:
    """The integral of the irradiance over a closed box is the lamp's flux."""
    source, n = lamp(WEBS[name], n=1), 20_000
    lights = arrays(source)
    total, variance = 0.0, 0.0
    for axis in range(3):
        for side in (-2.0, 2.0):  # around a lamp at a height of 1
            places, normal = RNG.uniform(-2, 2, (n, 3)), np.zeros(3)
            places[:, axis], normal[axis] = side, -np.sign(side)
            hits = points(n, (0, 0, 0), normal)
            hits.position[:] = np.add(places, (0, 1, 0))
            light = irradiances(hits, lights)
            total += 16 * float(light.mean())
            variance += 16**2 * float(light.var()) / n
    wanted = WEBS[name].flux
    assert abs(total - wanted) < 3 * variance**0.5 + 1e-4 * wanted
    assert variance**0.5 < 0.01 * wanted
