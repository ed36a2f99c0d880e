"""Errors of images: their definitions on constants, noise of known size, and edges of shadows."""

import numpy as np
import pytest

from framearray_cli.report.metrics import block_mean, errors, relmse, rmse, shadow_edges, squared_bias


def flat(value: float, shape: tuple[int, int] = (40, 60)) -> np.ndarray:
    return np.full((*shape, 3), value, np.float32)


def test_rmse_and_relmse_of_constants():
    assert rmse(flat(1.5), flat(1.0)) == pytest.approx(0.5)
    assert relmse(flat(1.5), flat(1.0)) == pytest.approx(0.25 / 1.01)
    assert relmse(flat(0.0), flat(0.0)) == 0


def test_errors_are_relative_to_the_mean():
    image, reference = flat(2.0), flat(2.0)
    image[0, 0] = 5.0
    edges = np.zeros((40, 60), bool)
    edges[0, :2] = True
    found = errors(image, reference, edges)
    assert found.edge_max == pytest.approx(1.5)
    assert found.edge_rmse == pytest.approx(1.5 / np.sqrt(2))
    assert found.mean_off == pytest.approx(1.5 / 2400)
    assert found.rmse == pytest.approx(1.5 / np.sqrt(2400))
    assert errors(image, reference, ~edges & False).edge_max == 0


def test_squared_bias_is_free_of_noise():
    rng = np.random.default_rng(1)
    noise = [rng.normal(0, 1, (200, 200, 3)).astype(np.float32) for _ in range(4)]
    square, spread = squared_bias((1.3 + noise[0], 1.3 + noise[1]), (1 + noise[2], 1 + noise[3]))
    assert abs(square - 0.09) < 4 * spread
    # each pixel's product has a variance of 2 * 2 + 2 * 0.09 * 2, and there are 120,000 values
    assert spread == pytest.approx(np.sqrt(4.36 / 120_000), rel=0.3)
    square, spread = squared_bias((noise[0], noise[1]), (noise[2], noise[3]))
    assert abs(square) < 4 * spread


def test_errors_that_go_together_in_blocks_count_as_one():
    rng = np.random.default_rng(2)
    blocks = np.repeat(np.repeat(rng.normal(0, 1, (10, 10)), 20, 0), 20, 1)
    assert block_mean(blocks)[1] == pytest.approx(0.1, rel=0.25)
    assert block_mean(np.ones((5, 5)))[1] == np.inf


def test_shadow_edges_are_where_only_irradiance_jumps():
    irradiance, depth = np.ones((20, 30), np.float32), np.full((20, 30), 4.0, np.float32)
    normal = np.tile(np.array([0, 0, 1], np.float32), (20, 30, 1))
    irradiance[:, :10] = 0  # a shadow
    irradiance[:, 20:], normal[:, 20:] = 0, [1, 0, 0]  # a corner
    edges = shadow_edges(irradiance, normal, depth)
    assert set(np.flatnonzero(edges.any(0))) == {9, 10}
    assert edges[1:-1, 9:11].all()
    depth[:, 10:] = 5.0  # now it is the outline of something
    assert not shadow_edges(irradiance, normal, depth).any()
