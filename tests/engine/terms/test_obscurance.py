"""Obscurance: the falloff curves, and cases whose every ray is known."""

import math
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.hits import points

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.hits import ESCAPED, Hits
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.inputs.surfaces import surfaces
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.terms.obscurance import CONSTANT, FALLOFFS, SQRT, ObscuranceSettings, obscurance, rho
from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene

AVERAGE = np.float32([0.5, 0.25, 0.125])


@kernel
def fill(falloff: int, tau: float, x: Any, out: Any) -> None:
    for i in range(x.shape[0]):
        out[i] = rho(falloff, tau, x[i])


def curve(name: str, x: Any, tau: float = 3.0) -> Any:
    x = np.asarray(x, np.float32)
    out = np.empty_like(x)
    fill(FALLOFFS[name], tau, x, out)
    return out


def gathered(
    scene: Scene, hits: Hits, room: int = 4096, neighbours: bool = True, **changes: Any
) -> tuple[Any, Any, int]:
    """W (n, 3), S (n, 3) and the number of rays."""
    values = {"d_max": 1.0, "falloff": SQRT, "tau": 3.0, "n_rays": 5, "coherent": True, "sky": False} | changes
    background = np.float32(values.pop("background", (0, 0, 0)))
    step_x, step_y = lattice_steps(values["n_rays"])
    settings = ObscuranceSettings(**values, step_x=step_x, step_y=step_y, average=AVERAGE, background=background)
    n = len(hits.kind)
    result, sky = np.full((n, 3), np.nan, np.float32), np.full((n if settings.sky else 0, 3), np.nan, np.float32)
    with EmbreeScene(scene) as embree:
        packets = room_for_hits(room)
        rays = obscurance(hits, n, settings, surfaces(scene), embree.tracer, packets, result, sky, neighbours)
    return result, sky, rays


def ceiling(height: float, **material: Any) -> Scene:
    """A huge plate above the origin, and a small one far below that keeps the scene's centre at the origin."""
    size = 1e4
    plate = tiny.quad((-size, height, -size), (size, height, -size), (size, height, size), (-size, height, size))
    return tiny.scene_of(np.concatenate([plate, plate * [1, -1, 1]]), Material(name="Plate", **material))


UP = (0.0, 1.0, 0.0)


@pytest.mark.parametrize("name", FALLOFFS)
def test_falloffs_rise_from_0_to_1(name: str) -> None:
    x = np.linspace(0, 1, 1001, dtype=np.float32)
    out, exact = curve(name, x), x.astype(np.float64)
    expected = {
        "sqrt": np.sqrt(exact),
        "linear": exact,
        "cbrt": np.cbrt(exact),
        "exponential": (1 - np.exp(-3 * exact)) / (1 - np.exp(-3)),
        "constant": 0 * exact,
    }[name]
    np.testing.assert_allclose(out, expected, rtol=1e-6, atol=1e-7)
    assert (np.diff(out) >= 0).all() and out[0] == 0
    assert out[-1] == pytest.approx(0 if name == "constant" else 1, abs=1e-6)


@pytest.mark.parametrize("tau", [1e-3, 100.0])
def test_the_exponential_holds_at_the_ends_of_tau(tau: float) -> None:
    x = np.linspace(0, 1, 101, dtype=np.float32)
    expected = np.expm1(-tau * x.astype(np.float64)) / math.expm1(-tau)
    np.testing.assert_allclose(curve("exponential", x, tau), expected, rtol=1e-6, atol=1e-7)


def test_distance_close_to_the_range() -> None:
    """A plate a hair beyond the range does nothing; a hair within, it takes but the few rays that go straight up."""
    beyond = gathered(ceiling(1.0 + 1e-4), points(2000, (0, 0, 0), UP), falloff=CONSTANT)[0]
    within = gathered(ceiling(1.0 - 1e-2), points(2000, (0, 0, 0), UP), falloff=CONSTANT)[0]
    np.testing.assert_allclose(beyond, np.tile(AVERAGE, (2000, 1)), rtol=1e-6)
    # rays within cos > 0.99 meet it: a share of 1 - 0.99^2
    share = 1 - within[:, 0].mean(dtype=np.float64) / AVERAGE[0]
    assert share == pytest.approx(1 - 0.99**2, abs=4 * math.sqrt(0.02 * 0.98 / 10_000))


@pytest.mark.parametrize("name", FALLOFFS)
def test_below_a_plate_w_is_the_mean_of_the_curve(name: str) -> None:
    """The distance is h / cos, and cos^2 is uniform: W = R integral of rho(h / sqrt(x)) dx, 1 where out of range."""
    h, n, colour = 0.3, 20_000, (0.8, 0.6, 0.2)
    result = gathered(ceiling(h, reflectivity=colour), points(n, (0, 0, 0), UP), falloff=FALLOFFS[name])[0]
    x = (np.arange(200_000) + 0.5) / 200_000
    distance = h / np.sqrt(x)
    near = distance < 1
    values = curve(name, distance[near])
    for channel in range(3):
        brought = np.full(len(x), float(AVERAGE[channel]))
        brought[near] = values * colour[channel]
        error = brought.std() / math.sqrt(5 * n)  # the rays of a hit are spread, so the true one is smaller
        assert result[:, channel].mean(dtype=np.float64) == pytest.approx(brought.mean(), abs=4 * error + 1e-6)


def test_a_mirror_counts_with_both_its_parts() -> None:
    scene = ceiling(0.3, reflectivity=(0.1, 0.2, 0.3), specular=(0.5, 0.4, 0.3))
    plain = ceiling(0.3, reflectivity=(0.6, 0.6, 0.6))
    hits = points(200, (0, 0, 0), UP)
    np.testing.assert_allclose(gathered(scene, hits)[0], gathered(plain, hits)[0], rtol=1e-6)


def test_the_sky_is_seen_by_rays_that_escape() -> None:
    scene = tiny.scene_of(np.concatenate([tiny.box((-1, -3, -1), (1, -2, 1)), tiny.box((-1, 2, -1), (1, 3, 1))]))
    hits = points(500, (0, 0, 0), (1, 0, 0))
    background = (1.0, 2.0, 3.0)
    dark, none, rays = gathered(scene, hits)
    assert none.shape == (0, 3) and rays == 2500
    result, sky, _ = gathered(scene, hits, sky=True, background=background)
    escaped = sky[:, 0]  # share of rays
    np.testing.assert_allclose(sky, escaped[:, None] * background, rtol=1e-6)
    assert 0.5 < escaped.mean() < 0.95
    # the boxes are out of range, so that what does not escape brings the average
    np.testing.assert_allclose(result, (1 - escaped)[:, None] * AVERAGE, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(dark, np.tile(AVERAGE, (500, 1)), rtol=1e-6)


def test_hits_that_reflect_nothing_cost_no_ray() -> None:
    hits = points(100, (0, 0, 0), UP)
    hits.reflectivity[:50] = 0.0
    hits.kind[50:60] = ESCAPED
    result, _, rays = gathered(ceiling(0.3), hits)
    assert rays == 5 * 40
    assert not result[:60].any() and (result[60:] > 0).all()


@pytest.mark.parametrize("room", [16, 32, 48, 4096])
def test_any_room_for_rays_gives_the_same(room: int) -> None:
    hits = points(333, (0, 0, 0), UP)
    expected, _, rays = gathered(ceiling(0.5), hits)
    result, _, again = gathered(ceiling(0.5), hits, room=room)
    np.testing.assert_array_equal(result, expected)
    assert rays == again == 333 * 5


def test_w_is_between_0_and_1() -> None:
    for falloff in FALLOFFS.values():
        result = gathered(ceiling(0.1, reflectivity=(1, 1, 1)), points(500, (0, 0, 0), UP), falloff=falloff)[0]
        assert (result >= 0).all() and (result <= 1 + 1e-6).all()


def test_tilted_shading_normals_do_not_look_into_the_surface() -> None:
    """On a floor nothing is met, even if the shading normal leans: what dips below is mirrored up."""
    floor = ceiling(0.0)
    hits = points(2000, (0, 0, 0), UP)
    hits.shading[:] = np.float32([0.8, 0.6, 0.0])
    result = gathered(floor, hits)[0]
    np.testing.assert_allclose(result, np.tile(AVERAGE, (2000, 1)), rtol=1e-6)


def shelves() -> Scene:
    """Boards and posts of one material above and around the points of `scattered`."""
    boards = [tiny.box((x, y, -3), (x + 0.9, y + 0.05, 3)) for x in range(-3, 3) for y in (0.4, 0.8)]
    posts = [tiny.box((x, 0.02, z), (x + 0.1, 1.5, z + 0.1)) for x in range(-3, 3) for z in range(-3, 3)]
    return tiny.scene_of(np.concatenate(boards + posts), Material(name="Wood", reflectivity=(0.7, 0.4, 0.2)))


def scattered(n: int) -> Hits:
    """Points of a floor in rows, of which some reflect nothing."""
    hits = points(n, (0, 0, 0), UP)
    rng = np.random.default_rng(5)
    hits.position[:] = rng.uniform(-3, 3, (n, 3)) * [1, 0, 1]
    hits.position[:] = hits.position[np.argsort(hits.position[:, 0] // 0.5, kind="stable")]
    hits.key[:] = rng.integers(0, 2**63, n)
    hits.reflectivity[rng.random(n) < 0.1] = 0.0
    return hits


@pytest.mark.parametrize("changes", [{}, {"sky": True, "background": (1, 2, 3)}, {"n_rays": 300}, {"n_rays": 1}])
def test_rays_in_the_order_of_directions_have_the_same_values(changes: dict[str, Any]) -> None:
    """To the last bit, where no two surfaces of unlike colour meet a ray at the same distance."""
    n = 100 if changes.get("n_rays") == 300 else 5000
    hits, scene = scattered(n), shelves()
    w, s, rays = gathered(scene, hits, neighbours=True, **changes)
    w_apart, s_apart, rays_apart = gathered(scene, hits, neighbours=False, **changes)
    np.testing.assert_array_equal(w, w_apart)
    np.testing.assert_array_equal(s, s_apart)
    assert rays == rays_apart and 0.1 < w[hits.reflectivity[:, 0] > 0].std() / w.mean() < 2


def test_batches_of_any_size_give_the_same_obscurances() -> None:
    hits, scene = scattered(5000), shelves()
    whole, _, _ = gathered(scene, hits, 8192)
    parts = [gathered(scene, Hits(*(a[i : i + 2048] for a in hits)), 4096)[0] for i in range(0, 5000, 2048)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
