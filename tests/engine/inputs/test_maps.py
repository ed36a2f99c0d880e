"""Environments: the light of one random direction per hit, on average that of the whole map."""

from typing import Any

import numpy as np
import pytest
from support import oracle_random, tiny
from support.hits import points
from support.irradiance import UP, N, P, arrays, check_mean, hits_at, irradiances, lamps
from support.panoramas import TURNS, environment, irradiance

from framearray_cli.engine.inputs.maps import alias_table, map_point
from framearray_cli.scene.paths.panorama import lit_texels, texel_powers
from framearray_cli.scene.paths.placing import cut_suns

RNG = np.random.default_rng(8)
TILTED = np.array([0.48, 0.6, -0.64])


def agree(found: Any, wanted: Any, facing: float = 0.0) -> None:
    """Means over hits (n, ...) within 3.5 standard errors, and half a per cent of them or of a facing surface's."""
    mean, error = found.mean(axis=0), found.std(axis=0) / np.sqrt(len(found))
    wanted = np.broadcast_to(wanted, mean.shape)
    assert (np.abs(mean - wanted) <= 3.5 * error + 1e-5 * np.abs(wanted)).all()
    np.testing.assert_allclose(mean, wanted, rtol=5e-3, atol=5e-3 * facing)


@pytest.mark.parametrize("normal", [UP, TILTED])
def test_one_colour_lights_like_an_open_sky(normal: Any) -> None:
    """E = pi L, in each channel."""
    lights = arrays(environment(np.full((4, 8, 3), (0.5, 1.0, 2.0))))
    hits = points(4 * N, P, normal)
    agree(irradiances(hits, lights), np.pi * np.array([0.5, 1.0, 2.0])[:, None] * np.ones(5))


def test_hits_sorted_by_direction_get_the_light_that_each_gets_by_itself() -> None:
    """In several runs of a sort, the last of them not full; hits that reflect nothing get none."""
    rng = np.random.default_rng(9)
    lights, hits = arrays(environment(rng.random((6, 12, 3)))), points(5001, P, TILTED)
    hits.position[:] += rng.normal(0, 0.2, (5001, 3)).astype(np.float32)
    hits.reflectivity[::7] = 0.0
    scene = tiny.scene_of(tiny.box((-1.0, 1.0, -1.0), (0.0, 1.5, 0.0)))
    together, apart = (irradiances(hits, lights, scene, neighbours) for neighbours in (True, False))
    assert (together == apart).mean() > 0.9999, "but for rays that touch an edge"
    assert (together[::7] == 0).all()
    assert 0.1 < (together[1::7] > 0).mean() < 0.9


def test_one_bright_texel_is_a_sun() -> None:
    """E cos of a directional source from its middle within 0.5 %, and exactly the integral over the texel."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[12, 70] = 1000.0
    lights = arrays(environment(pixels))
    assert lights.channels == 1
    top, bottom = (np.pi / 2 - k / 64 * np.pi for k in (12, 13))
    middle, turned = (top + bottom) / 2, np.radians(TURNS) + (70.5 / 128 - 0.5) * 2 * np.pi
    power = 1000.0 * (np.sin(top) - np.sin(bottom)) * 2 * np.pi / 128
    to_sun = power * np.stack(
        [np.cos(middle) * np.sin(turned), np.full(5, np.sin(middle)), -np.cos(middle) * np.cos(turned)]
    )
    level = 1000.0 * ((top - bottom) / 2 + (np.sin(2 * top) - np.sin(2 * bottom)) / 4) * 2 * np.sin(np.pi / 128)
    height = 1000.0 * (np.sin(top) ** 2 - np.sin(bottom) ** 2) / 2 * 2 * np.pi / 128
    whole = np.stack([level * np.sin(turned), np.full(5, height), -level * np.cos(turned)])
    for normal in (UP, TILTED):
        for neighbours in (True, False):
            found = irradiances(points(N, P, normal), lights, neighbours=neighbours)
            agree(found, np.maximum(normal @ whole, 0), power)
            by_sun = np.maximum(normal @ to_sun, 0)
            np.testing.assert_allclose(found.mean(axis=0)[0], by_sun, rtol=5e-3, atol=5e-3 * power)


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize("normal", [UP, TILTED])
def test_any_map_lights_as_quadrature_says(neighbours: bool, normal: Any) -> None:
    """Random colours from 0 to bright, beside a panel of light without a map."""
    pixels = RNG.random((6, 12, 3)) ** 6 * (1.0, 2.0, 4.0)
    lights = arrays(environment(pixels, factor=(2.0, 1.0, 0.5)))
    found = irradiances(points(8 * N, P, normal), lights, neighbours=neighbours)
    wanted = np.stack([irradiance(pixels, normal, turn) for turn in TURNS], axis=1) * [[2.0], [1.0], [0.5]]
    check_mean(found, wanted, 0.02, rounding=0)


def test_a_hit_draws_the_same_direction_under_every_turn() -> None:
    """That of one position, turned; the readable twin of the draw."""
    pixels = RNG.random((8, 16, 3)) ** 4
    maps = arrays(environment(pixels)).maps
    share, other = alias_table(texel_powers(lit_texels(np.asarray(pixels, np.float32))).ravel())
    for key in range(200):
        q = np.array(map_point(maps, 0, np.uint64(key)), np.float64)
        texel, u, v = drawn(key, share, other)
        row, column = divmod(texel, 16)
        top, bottom = np.sin(np.pi / 2 - np.pi * row / 8), np.sin(np.pi / 2 - np.pi * (row + 1) / 8)
        z, azimuth = top + v * (bottom - top), ((column + u) / 16 - 0.5) * 2 * np.pi
        level = np.sqrt(1 - z * z)
        np.testing.assert_allclose(q, [level * np.cos(azimuth), level * np.sin(azimuth), z], atol=2e-6)


def drawn(key: int, share: Any, other: Any) -> tuple[int, float, float]:
    """The texel of source 0 that a hit draws, and the place in it, with Python's integers."""
    word, place = (oracle_random.bits([key], (1 << 20) + more)[0] for more in (0, 1 << 19))
    slot, chance = word % len(share), (word >> 40) / 2**24
    texel = slot if chance < np.float32(share[slot]) else int(other[slot])
    return texel, (place % 2**32 >> 8) / 2**24, (place >> 40) / 2**24


@pytest.mark.parametrize("n", [1, 2, 3, 7, 64, 1000])
def test_an_alias_table_draws_in_proportion_to_weights(n: int) -> None:
    for weights in (np.ones(n), RNG.random(n) ** 8, np.eye(n)[n // 2], RNG.random(n) * (RNG.random(n) < 0.5) + 1e-9):
        share, other = alias_table(weights)
        assert len(share) >= max(n, 2) and len(share) & (len(share) - 1) == 0
        assert (share >= 0).all() and (share <= 1).all()
        found = np.bincount(np.arange(len(share)), share, len(share))
        found += np.bincount(other, 1 - share, len(share))
        np.testing.assert_allclose(found[:n] / len(share), weights / weights.sum(), atol=1e-12)
        assert found[n:].max(initial=0) < 1e-9


def test_a_fine_map_is_averaged_by_solid_angle() -> None:
    """Its light stays, in every part of the sphere."""
    pixels = RNG.random((1536, 3072, 3)).astype(np.float32)
    texels = lit_texels(pixels)
    assert texels.shape == (1024, 2048, 3)
    np.testing.assert_allclose(texel_powers(texels).sum(), texel_powers(pixels).sum(), rtol=1e-6)
    coarse = texel_powers(texels).reshape(8, 128, 16, 128).sum(axis=(1, 3))
    np.testing.assert_allclose(coarse, texel_powers(pixels).reshape(8, 192, 16, 192).sum(axis=(1, 3)), rtol=1e-6)


def test_a_lamp_beside_a_map_shines_as_by_itself() -> None:
    """Its texel is white."""
    lamp = lamps(np.tile(np.add(P, (0.2, 1.5, 0.1)), (5, 1)))
    sky = environment(np.full((2, 4, 3), (0.2, 0.4, 0.9)))
    hits = hits_at(n=64)
    both, alone = irradiances(hits, arrays(sky, lamp)), irradiances(hits, arrays(sky))
    np.testing.assert_allclose(both - alone, np.broadcast_to(irradiances(hits, arrays(lamp)), both.shape), rtol=1e-4)


def test_suns_apart_give_the_same_light_with_less_noise() -> None:
    """Where the sun is hidden, and where it is not: otherwise hits draw the sky rarely, with much weight."""
    pixels = np.full((64, 128, 3), (0.5, 1.0, 2.0), np.float32)
    pixels[8, 60:64] = 3000.0
    whole = environment(pixels, (0.0, 180.0))
    parts = cut_suns(whole, 0)
    assert len(parts) == 2
    roof = tiny.scene_of(tiny.quad((-3, 1, 0.3), (3, 1, 0.3), (3, 1, -3), (-3, 1, -3)))  # hides it at rotation 0
    hits = points(N, (0, 0, 0), UP)
    together, apart = (irradiances(hits, arrays(*sources), scene=roof) for sources in ((whole,), parts))
    error = np.hypot(together.std(axis=0), apart.std(axis=0)) / np.sqrt(N)
    assert (np.abs(together.mean(axis=0) - apart.mean(axis=0)) < 3.5 * error).all()
    assert (apart.std(axis=0) < together.std(axis=0)).all()
