"""The surface of glTF: against its text in float64, energy in even light, reciprocity, and the directions drawn."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2
from support import gloss_twin as twin

from framearray_cli.engine.inputs.gloss import evaluate_lobe, lobe_density, sample_lobe
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.simd import LANES, load, put_triples, store, triples_at

# Chance that a right sampler fails one test; seeds are fixed.
RARE = 1e-6
N = 1 << 16
ROUGHNESS = (0.05**0.5, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)


@kernel
def fill(alpha: Any, m: Any, v: Any, u: Any, d: Any, values: Any) -> None:
    """Draw directions, and evaluate them, one by one: d, lobe, x, density, weight and x of the draw."""
    for i in range(u.shape[1]):
        to, weight, drawn_x = sample_lobe(
            alpha[i], (m[i, 0], m[i, 1], m[i, 2]), (v[i, 0], v[i, 1], v[i, 2]), u[0, i], u[1, i]
        )
        d[i, 0], d[i, 1], d[i, 2] = to
        lobe, x = evaluate_lobe(alpha[i], (m[i, 0], m[i, 1], m[i, 2]), (v[i, 0], v[i, 1], v[i, 2]), to)
        density = lobe_density(alpha[i], (m[i, 0], m[i, 1], m[i, 2]), (v[i, 0], v[i, 1], v[i, 2]), to)
        values[0, i], values[1, i], values[2, i], values[3, i], values[4, i] = lobe, x, density, weight, drawn_x


@kernel
def fill_in_lanes(alpha: Any, m: Any, v: Any, u: Any, d: Any, values: Any) -> None:
    """`fill`, sixteen at a time."""
    n = u.shape[1]
    for i in range(0, n, LANES):
        a, normal, to_eye = load(alpha, i), triples_at(m, i), triples_at(v, i)
        to, weight, drawn_x = sample_lobe(a, normal, to_eye, load(u, i), load(u, n + i))
        put_triples(d, i, to[0], to[1], to[2])
        lobe, x = evaluate_lobe(a, normal, to_eye, to)
        store(values, i, lobe)
        store(values, n + i, x)
        store(values, 2 * n + i, lobe_density(a, normal, to_eye, to))
        store(values, 3 * n + i, weight)
        store(values, 4 * n + i, drawn_x)


def unit(vectors: Any) -> Any:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def drawn(alpha: Any, m: Any, v: Any, seed: int = 1, n: int = N, lanes: bool = True) -> tuple[Any, Any]:
    """Directions d, (n, 3), and values, (5, n), of `fill`."""
    u = np.random.default_rng(seed).random((2, n), np.float32)
    d, values = np.empty((n, 3), np.float32), np.empty((5, n), np.float32)
    of_all = [np.ascontiguousarray(np.broadcast_to(np.asarray(a, np.float32), (n, 3))) for a in (m, v)]
    alphas = np.ascontiguousarray(np.broadcast_to(np.float32(alpha), n))
    (fill_in_lanes if lanes else fill)(alphas, *of_all, u, d, values)
    return d, values


def anywhere(n: int) -> tuple[Any, Any, Any]:
    """Roughnesses squared, normals, and directions to viewers above them."""
    rng = np.random.default_rng(5)
    m, v = unit(rng.normal(size=(n, 3))), unit(rng.normal(size=(n, 3)))
    v *= np.sign((m * v).sum(1))[:, None]
    # no closer to the surface than float32 knows its own cosines
    v = unit(v + 0.02 * m)
    return rng.uniform(0.1, 1.0, n) ** 2, m, v


def test_one_and_sixteen_agree():
    alpha, m, v = anywhere(4096)
    one, sixteen = (drawn(alpha, m, v, n=4096, lanes=lanes) for lanes in (False, True))
    for a, b in zip(one, sixteen, strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-3, atol=1e-5)


def test_lobe_and_density_are_those_of_the_text():
    alpha, m, v = anywhere(N)
    d, (lobe, x, density, weight, drawn_x) = drawn(alpha, m, v)
    d = unit(d.astype(np.float64))
    above = (m * d).sum(1) > 0.01
    h = unit(v + d)
    # grazing microfacets and the flanks of narrow lobes amplify what float32 rounds off directions, some 1e-7 / alpha
    expected = twin.distribution(alpha, (m * h).sum(1)) * twin.smith(alpha, (m * v).sum(1), (m * d).sum(1))
    expected /= 4 * (m * v).sum(1) * (m * d).sum(1)
    np.testing.assert_allclose(lobe[above], expected[above], rtol=1e-3)
    np.testing.assert_allclose(density[above], twin.visible_density(alpha, m, v, d)[above], rtol=1e-3)
    schlick = (1 - (v * h).sum(1)) ** 5
    np.testing.assert_allclose(x, schlick, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(drawn_x, schlick, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(weight[above], (expected * (m * d).sum(1) / density)[above], rtol=2e-3)
    assert (weight <= 1.0 + 1e-5).all()
    assert (lobe[(m * d).sum(1) < -1e-5] == 0).all() and (weight[(m * d).sum(1) < -1e-5] == 0).all()


def test_light_goes_both_ways():
    alpha, m, v = anywhere(N)
    d, (lobe, x, *_) = drawn(alpha, m, v)
    above = (m * d).sum(1) > 0.02
    back = np.empty((5, N), np.float32)
    _evaluate(*(np.ascontiguousarray(a, np.float32) for a in (alpha, m, d, v)), back)
    np.testing.assert_allclose(back[0][above], lobe[above], rtol=1e-3)
    np.testing.assert_allclose(back[1], x, rtol=1e-3, atol=1e-6)


@kernel
def _evaluate(alpha: Any, m: Any, v: Any, d: Any, values: Any) -> None:
    n = alpha.shape[0]
    for i in range(0, n, LANES):
        lobe, x = evaluate_lobe(load(alpha, i), triples_at(m, i), triples_at(v, i), triples_at(d, i))
        store(values, i, lobe)
        store(values, n + i, x)


@pytest.mark.parametrize("mu", [0.9, 0.4, 0.1])
@pytest.mark.parametrize("alpha", [0.05, 0.25, 0.6, 1.0])
def test_directions_have_their_density(alpha: float, mu: float):
    """Chi-squared test of the normals at which v is mirrored, those with d below the surface too."""
    n = 1 << 17
    v = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    m = np.array([0.0, 0.0, 1.0])
    d, _ = drawn(alpha, m, v, seed=7, n=n)
    h = unit(v + d)
    # cells of h: by azimuth, and by s = 1 - root(1 - p) of p = tan^2 / (tan^2 + alpha^2) of its angle
    tan2 = (h[:, 0] ** 2 + h[:, 1] ** 2) / np.maximum(h[:, 2] ** 2, 1e-12)
    s, azimuth = 1 - alpha / np.sqrt(tan2 + alpha**2), np.arctan2(h[:, 1], h[:, 0]) / (2 * np.pi) % 1.0
    table, _, _ = np.histogram2d(s, azimuth, bins=(12, 12), range=((0, 1), (0, 1)))
    assert table.sum() == n
    fine = 60
    q = (np.arange(12 * fine) + 0.5) / (12 * fine)
    tan = alpha * np.sqrt(1 / (1 - q) ** 2 - 1)[:, None]
    cosine = 1 / np.sqrt(1 + tan * tan)
    vh = tan * cosine * np.cos(2 * np.pi * q)[None, :] * v[0] + cosine * mu
    # D_v = G1 max(v.h, 0) D / mu, and D cos(h) dh = dp dq, with dp = 2 (1 - s) ds
    g1 = 2 * mu / (mu + np.sqrt(alpha**2 + (1 - alpha**2) * mu**2))
    chance = g1 * np.maximum(vh, 0) / (mu * cosine) * 2 * (1 - q)[:, None]
    expected = n * chance.reshape(12, fine, 12, fine).mean(axis=(1, 3)) / 144
    assert expected.sum() == pytest.approx(n, rel=2e-3)
    expected *= n / expected.sum()
    some = expected > 8
    rest = (table[~some].sum() - expected[~some].sum()) ** 2 / max(expected[~some].sum(), 1.0)
    statistic = ((table - expected) ** 2 / np.maximum(expected, 1e-9))[some].sum() + rest
    assert statistic < chi2.isf(RARE, some.sum())


@pytest.mark.parametrize("metal", [0.0, 1.0])
@pytest.mark.parametrize("roughness", ROUGHNESS)
def test_white_furnace(roughness: float, metal: float):
    """In even light of 1 a white surface sends out its albedo: drawn directions agree with the integral."""
    alpha, m = roughness**2, np.array([0.0, 0.0, 1.0])
    f0 = 0.04 * (1 - metal) + metal
    for seed, mu in enumerate((1.0, 0.7, 0.3, 0.1)):
        v = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
        _, (_, _, _, weight, x) = drawn(alpha, m, v, seed=seed)
        light = (f0 + (1 - f0) * x.astype(np.float64)) * weight
        expected = twin.albedo(1.0, metal, alpha, mu) - twin.diffuse_albedo(1.0, metal, mu)
        error = light.std() / np.sqrt(N)
        assert abs(light.mean() - float(expected[0] if np.ndim(expected) else expected)) < 3 * error + 1e-4 * expected
