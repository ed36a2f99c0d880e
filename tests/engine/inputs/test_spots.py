"""Spots: the share of their light by the formula of KHR_lights_punctual."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.irradiance import arrays, check_among_others, lamps, lit_places

from framearray_cli.scene.paths.lightpath import Cone, LightPath

CONES = [(0.0, 45.0), (20.0, 40.0), (30.0, 30.0), (0.0, 2.0), (60.0, 90.0)]
RNG = np.random.default_rng(4)


def spot(inner: float, outer: float, n: int = 16, radius: float | None = None) -> LightPath:
    axis = np.add(RNG.normal(size=(n, 3)) * 0.3, (0, -1, 0))
    return lamps(
        np.add(RNG.uniform(-0.5, 0.5, (n, 3)), (0, 2, 0)),
        size=None if radius is None else np.full(n, radius),
        cone=Cone(axis=axis / np.linalg.norm(axis, axis=1, keepdims=True), angles_deg=np.tile((inner, outer), (n, 1))),
    )


def share(cosine: Any, inner: float, outer: float) -> Any:
    """The formula of KHR_lights_punctual, in float64, with our least width of an edge."""
    inner, outer = np.cos(np.radians((inner, outer)))
    return np.clip((cosine - outer) / max(inner - outer, 0.001 * (1 - outer)), 0, 1) ** 2


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize(("inner", "outer"), CONES)
def test_a_spot_lights_a_floor_by_the_formula(inner: float, outer: float, neighbours: bool) -> None:
    source, reach = spot(inner, outer), max(np.tan(np.radians(min(outer, 50))) * 2.4, 0.1)
    places = RNG.uniform(-reach, reach, (400, 3))
    axis = source.cone.axis  # type: ignore[union-attr]  # it has a cone
    places += np.tile(
        source.vector - axis * (source.vector[:, 1:2] / axis[:, 1:2]), (25, 1)
    )  # where it meets the floor
    places[:, 1] = 0
    found = lit_places(places, arrays(source), neighbours)
    way = source.vector[None] - places[:, None]
    d = np.linalg.norm(way, axis=-1)
    cosine = -np.einsum("ijk,jk->ij", way, axis) / d
    full = way[..., 1] / d**3
    slope = 2 / (np.cos(np.radians(inner)) - np.cos(np.radians(outer)) + 0.001)
    rounding = full * (1e-6 * slope + 1e-5)  # of the cosine, in single precision
    assert (np.abs(found - full * share(cosine, inner, outer)) <= rounding).all()
    assert (found > 0).any() and (outer == 90 or (found == 0).any())


def test_spots_beside_other_sources_leave_them_alone() -> None:
    check_among_others(RNG.uniform(-1, 1, (100, 3)) * (1, 0, 1), spot(20, 40))


def test_a_spot_may_have_a_size() -> None:
    """Far from the cones' edges it is the sphere's light times the share of the spot."""
    wide = spot(60, 90, radius=0.1)
    places = wide.vector * (1, 0, 1)
    found, sphere = (np.diag(lit_places(places, arrays(each))) for each in (wide, replace(wide, cone=None)))
    straight = -wide.cone.axis[:, 1] > 0.8  # type: ignore[union-attr]  # it has a cone
    np.testing.assert_allclose(found[straight], sphere[straight], rtol=1e-6)
    assert straight.any()
