"""Squared bias without noise, with a standard error: known biases, no bias, and what its parts say."""

import numpy as np
import pytest
from support.squares import products, squares

K, M, N = 6, 9, 400
SPREAD, PART_SPREAD = 2.0, 0.7


def found(rng: np.random.Generator, bias: np.ndarray) -> tuple[float, float, float]:
    right = rng.normal(5, 1, N)
    runs = right + bias + rng.normal(0, SPREAD, (K, N))
    parts = right + rng.normal(0, PART_SPREAD, (M, N))
    one = squares(*products(runs.astype(np.float32), parts.astype(np.float32)), K)
    return one.bias, one.error, one.variance


@pytest.mark.parametrize("size", [0.0, 0.2, 3.0])
def test_the_mean_is_right_and_the_standard_error_not_too_small(size: float):
    rng = np.random.default_rng(3)
    bias = size * rng.normal(0, 1, N)
    right, trials = float((bias**2).mean()), 1000
    values, errors, variances = np.array([found(rng, bias) for _ in range(trials)]).T
    spread = values.std(ddof=1)
    assert abs(values.mean() - right) < 4 * spread / trials**0.5
    # the jackknife is right where the bias stands out, and without bias too large by at most sqrt 2
    typical = np.sqrt((errors**2).mean())
    assert 0.9 < typical / spread < 1.6
    assert abs(variances.mean() - SPREAD**2) < 4 * variances.std() / trials**0.5


def test_it_is_the_square_of_means_less_both_variances():
    rng = np.random.default_rng(4)
    runs, parts = rng.normal(1, 1, (K, N)), rng.normal(0, 1, (M, N))
    one = squares(*products(runs, parts), K)
    naive = ((runs.mean(axis=0) - parts.mean(axis=0)) ** 2).mean()
    noise = (runs.var(axis=0, ddof=1) / K + parts.var(axis=0, ddof=1) / M).mean()
    assert one.bias == pytest.approx(naive - noise)
    assert one.variance == pytest.approx(runs.var(axis=0, ddof=1).mean())
    assert one.mean_square == pytest.approx(one.bias + one.variance)


def test_pictures_add_up():
    rng = np.random.default_rng(5)
    runs, parts = rng.normal(1, 1, (K, N)), rng.normal(0, 1, (M, N))
    halves = [products(runs[:, some], parts[:, some]) for some in (slice(0, 100), slice(100, N))]
    together = squares(halves[0][0] + halves[1][0], halves[0][1] + halves[1][1], K)
    whole = squares(*products(runs, parts), K)
    assert together.bias == pytest.approx(whole.bias)
    assert together.error == pytest.approx(whole.error)
