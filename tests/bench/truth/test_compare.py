"""Distances from a noisy truth: known errors come out, whatever the noise."""

from pathlib import Path

import numpy as np
import pytest

from bench.core.results import save

from . import run
from .compare import BLOCK, distance, means, noise
from .places import Place
from .traced import Truth

H, W = 120, 160


def truth_of(image: np.ndarray, direct: np.ndarray, spread: float, rng: np.random.Generator) -> Truth:
    total = image + rng.normal(0, spread, (2, *image.shape))
    return Truth(total=total.astype(np.float32), indirect=(total - direct).astype(np.float32))


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_known_errors_come_out(spread: float):
    rng = np.random.default_rng(5)
    direct = rng.uniform(0.2, 1.0, (H, W, 3))
    indirect = np.full((H, W, 3), 0.5)
    image = direct + indirect
    truth = truth_of(image, direct, spread, rng)
    found = distance((image + 0.1).astype(np.float32), direct.astype(np.float32), truth)
    level = np.sqrt((means(image.astype(np.float32)) ** 2).mean())
    # what chance leaves: the products of errors and noise, over the number of values
    left = 3 * spread * (0.1 + spread / BLOCK) / np.sqrt(image.size / BLOCK**2)
    assert found["all"] == pytest.approx(0.1 / level, abs=left / level + 1e-4)
    assert found["mean"] == pytest.approx((image.mean() + 0.1) / image.mean(), rel=0.01)
    left = 3 * spread * (0.1 + spread) / np.sqrt(image.size) / (2 * 0.1 * 0.5)
    assert found["indirect"] == pytest.approx(0.1 / 0.5, abs=left + 1e-4)
    assert found["indirect_mean"] == pytest.approx(0.6 / 0.5, rel=0.02)


def test_noise_is_that_of_the_mean_of_both_halves():
    rng = np.random.default_rng(6)
    image = np.full((H, W, 3), 2.0)
    found = noise(truth_of(image, image - 0.5, 0.4, rng))
    assert found["all"] == pytest.approx(0.4 / np.sqrt(2) / BLOCK / 2.0, rel=0.1)
    assert found["indirect"] == pytest.approx(0.4 / np.sqrt(2) / 0.5, rel=0.05)


def test_the_time_at_equal_error_follows_from_the_noise(tmp_path: Path) -> None:
    """Half the samples have 1.41 times the noise; the last two columns are milliseconds and a ratio."""
    place = Place(job="kitchen", c=3, l=4)
    table = {
        "traced": {"samples": 128, "seconds": 2.0},
        "noise": {"all": 0.02},
        "methods": {"obscurance": {"all": 0.02}, "cells": {"all": 0.04}},
    }
    machine = {"processor": "one", "cores": "2"}
    save(tmp_path, "truth-pace-kitchen", {"cells": 5.0, "obscurance": 4.0, "machine": machine})
    rows = run.times_at_equal_error({place: table}, tmp_path).rows
    assert [row[1:] for row in rows] == [
        ["obscurance", "4", "2 %", "128", "2000", "500x"],
        ["cells", "5", "4 %", "32", "500", "100x"],
    ]
