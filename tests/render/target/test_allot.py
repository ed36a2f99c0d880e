"""Allotment of hits to blocks of pixels: against a general solver, and with noisy pilots."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from framearray_cli.engine.frames.passes import Allotment, blocks_of, passes_of_counts
from framearray_cli.render.automatic import EVENNESS, independent_hits
from framearray_cli.render.errortarget import FEWEST, Witnesses, allot, fewest_hits, variances

MANY = 1e9


def lognormal(*shape: int, seed: int = 1) -> Any:
    return np.exp(np.random.default_rng(seed).normal(size=shape))


def test_equal_blocks_get_equal_hits_and_the_target_is_met() -> None:
    u = np.repeat([[5.0], [1.0]], 40, axis=1)
    hits = fewest_hits(u, 0.1, MANY)
    np.testing.assert_allclose(hits, np.broadcast_to(hits[:, :1], hits.shape), rtol=1e-12)
    np.testing.assert_allclose(variances(u, hits), 0.1, rtol=1e-6)  # of every frame
    assert hits[0, 0] == pytest.approx(50 ** (1 / EVENNESS), rel=1e-6)


@pytest.mark.filterwarnings("ignore:Values in x were outside bounds")  # of SciPy 1.13 on its way
@pytest.mark.parametrize("seed", range(4))
def test_no_allotment_has_fewer_hits(seed: int) -> None:
    """Compare with a general solver for the fewest hits with at most the wanted error."""
    u, wanted = lognormal(1, 8, seed=seed), 0.2
    found = fewest_hits(u, wanted, MANY)
    assert variances(u, found)[0] <= wanted * 1.001
    best = minimize(
        lambda logs: np.exp(logs).sum(),
        np.full(8, np.log(20.0)),
        jac=np.exp,
        constraints={"type": "ineq", "fun": lambda logs: np.log(wanted / variances(u, np.exp(logs)[None]))},
        bounds=[(np.log(FEWEST), 20)] * 8,
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-9},
    )
    assert best.success
    assert found.sum() == pytest.approx(best.fun, rel=2e-3)


def test_hits_stay_within_their_bounds() -> None:
    u = lognormal(2, 200) ** 4
    hits = fewest_hits(u, 0.05, 6.0)
    assert hits.min() >= FEWEST and hits.max() == 6.0
    assert (fewest_hits(np.zeros((2, 7)), 0.1, 6.0) == FEWEST).all()
    mixed = fewest_hits(np.array([[0.0, 1e-9, 4.0]]), 0.01, 1000.0)
    assert mixed[0, 0] == FEWEST and mixed[0, 2] > 10


@pytest.mark.parametrize("n_r", [0, 3])
def test_a_pilot_does_not_flatter_itself(n_r: int) -> None:
    """Compare the expected error of noisy pairs with the true one, from the variances that they were drawn from.

    Every eye sees every place in the same block, so that the hits of a window add up block by block.
    """
    blocks, rng, wanted, frames = blocks_of(240, 160), np.random.default_rng(5), 0.02, 12
    rows, columns = blocks.shape
    true_u = np.exp(np.sin(np.arange(rows)[:, None] / 5) + np.cos(np.arange(columns) / 4)).reshape(-1)
    reported, true, naive = [], [], []
    for _ in range(6):
        variance = true_u * rng.chisquare(1, (2, frames, blocks.n))
        eyes = [range(max(c - n_r, 0), min(c + n_r, frames - 1) + 1) for c in range(frames)]
        shared = np.array([len(window) for window in eyes])[:, None]
        witnesses = [
            Witnesses(
                c=c,
                first_eye=window.start,
                variance=variance[:, c],
                block=np.broadcast_to(np.arange(blocks.n)[:, None], (2, 2, blocks.n, len(window))),
                density=np.ones((2, 2, blocks.n, len(window))),
            )
            for c, window in enumerate(eyes)
        ]
        hits, expected = allot(variance / shared, blocks, wanted, MANY, witnesses)
        reported.append(expected.mean())
        arriving = np.stack([independent_hits(hits[window.start : window.stop]).sum(axis=0) for window in eyes])
        true.append((true_u / arriving).mean())
        unjudged = fewest_hits((variance / shared).mean(axis=0), wanted, MANY)
        naive.append(variances(true_u / shared, unjudged).mean())
    np.testing.assert_allclose(reported, wanted, rtol=0.01)
    error = np.std(true) / np.sqrt(len(true))
    # pairs count the hits of half a pilot for their own frame, which is a little too severe
    assert 0.85 * wanted < np.mean(true) < wanted + 4 * error
    assert np.mean(naive) > 1.3 * wanted  # a pilot that judges itself is off by far more


def test_smoothing_is_the_mean_of_the_blocks_around_and_never_negative() -> None:
    blocks, rng = blocks_of(90, 60), np.random.default_rng(6)
    values = rng.random((2, blocks.n)) * (rng.random((2, blocks.n)) < 0.05) * [[1.0], [1e9]]
    smoothed = blocks.smooth(values)
    grid = np.pad(values.reshape(2, *blocks.shape), ((0, 0), (1, 1), (1, 1)), mode="edge")
    rows, columns = blocks.shape
    expected = sum(grid[:, y : y + rows, x : x + columns] for y in range(3) for x in range(3)) / 9
    np.testing.assert_allclose(smoothed.reshape(expected.shape), expected, rtol=1e-9, atol=1e-6)
    assert smoothed.min() >= 0


@pytest.mark.parametrize(("width", "height"), [(1, 1), (8, 8), (9, 17), (400, 300), (1920, 1080)])
def test_blocks_cover_the_frame_and_are_few(width: int, height: int) -> None:
    blocks = blocks_of(width, height)
    y, x = np.divmod(np.arange(width * height), width)
    np.testing.assert_array_equal(blocks.of_pixel, y // blocks.edge * blocks.shape[1] + x // blocks.edge)
    assert set(np.unique(blocks.of_pixel)) == set(range(blocks.n)) and blocks.n < 4400
    for random in (
        np.zeros((blocks.n, 2)),
        np.full((blocks.n, 2), 1 - 1e-12),
        np.random.default_rng(1).random((blocks.n, 2)),
    ):
        np.testing.assert_array_equal(blocks.of_pixel[blocks.random_pixels(random)], np.arange(blocks.n))


def test_pixels_have_rounded_hits_whose_mean_over_frames_is_exact() -> None:
    blocks = blocks_of(64, 48)
    hits = np.random.default_rng(3).uniform(0.25, 5, (1, blocks.n)).astype(np.float32).repeat(64, axis=0)
    allotment = Allotment(blocks=blocks, hits=hits)
    counts = np.stack([allotment.counts(c) for c in range(64)])
    wanted = hits[0][blocks.of_pixel]
    assert (counts >= np.floor(wanted)).all() and (counts <= np.floor(wanted) + 1).all()
    np.testing.assert_allclose(counts.mean(axis=0), wanted, atol=3 / 64)  # each pixel: off by less than 3 of 64 frames
    by_block = np.stack([np.bincount(blocks.of_pixel, row) for row in counts]) / np.bincount(blocks.of_pixel)
    assert np.abs(by_block - hits).max() < 0.13  # each block, in every frame: of 64 pixels 8 at most are off
    np.testing.assert_allclose(allotment.mean(), counts.mean(axis=1), rtol=0.01)


def test_passes_give_every_pixel_its_hits() -> None:
    rng = np.random.default_rng(4)
    counts, order = rng.integers(0, 5, 300).astype(np.int32), rng.permutation(300).astype(np.int32)
    passes = passes_of_counts(order, counts)
    found = np.zeros(300, np.int32)
    for part in passes:
        found[part.pixels] += part.per_pixel
        assert part.first_sample == 0 and len(part.pixels)
    np.testing.assert_array_equal(found, counts)
    ends = [part.first_hit + part.n for part in passes]
    assert [part.first_hit for part in passes] == [0, *ends[:-1]] and ends[-1] == counts.sum()
    assert independent_hits(np.array([2.0])) > 2  # two hits of one eye count more than two of different eyes
