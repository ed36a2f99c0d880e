"""`samples.error`: allotment of hits to blocks of pixels, its pilot, weights of such hits, and renders with them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import minimize
from support import tiny
from support.tiny import WALK

from framearray_cli.base.errors import JobError
from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.passes import Allotment, blocks_of, passes_of_counts
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.hits.hits import empty_hits
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.engine.hits.outer import balance_weights, divide_by_own_hits, scale_by_expected_hits
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.cameras import OUTSIDE
from framearray_cli.job.job import Job
from framearray_cli.render.automatic import EVENNESS, independent_hits
from framearray_cli.render.errortarget import FEWEST, Witnesses, allot, allot_hits, fewest_hits, hit_pairs, variances
from framearray_cli.render.memory import require_memory
from framearray_cli.render.messages import target_lines

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


def job(**changes: Any) -> Job:
    """Return a tiny job with an error instead of hits; its camera walks, so frames are reused."""
    samples = {"hits": None} | changes["samples"]
    return tiny.job(**{"camera": WALK, "reuse": {"n_r": 2}} | changes | {"samples": samples})


def allotted_setup(inputs: Any) -> Any:
    with tiny.planned(inputs) as (setup, ambient):
        return allot_hits(inputs, setup, ambient)


def test_weights_of_blocks_with_different_hits_follow_the_formula() -> None:
    rng, n, n_r, n_c, blocks = np.random.default_rng(2), 50, 1, 5, blocks_of(24, 16)
    pixel = rng.integers(OUTSIDE, 24 * 16, (n_c, n)).astype(np.int32)
    density = rng.random((n_c, n)) * (pixel != OUTSIDE)
    hits = rng.uniform(0.25, 6, (n_c, blocks.n)).astype(np.float32)
    weight, known = np.empty((n_c, n), np.float32), density.copy()
    scale_by_expected_hits(hits, blocks.of_pixel, 0, n, pixel, known)
    balance_weights(np.ones((n_c, n_c)), n_r, 0, 0, n, pixel, known, weight)
    divide_by_own_hits(hits, blocks.of_pixel, 0, n, pixel, weight)
    for j in range(n_c):
        for i in range(n):
            if pixel[j, i] == OUTSIDE:
                assert weight[j, i] == 0
                continue
            window = [k for k in range(max(j - n_r, 0), min(j + n_r, n_c - 1) + 1) if pixel[k, i] != OUTSIDE]
            total = sum(float(hits[k, blocks.of_pixel[pixel[k, i]]]) * density[k, i] for k in window)
            assert weight[j, i] == pytest.approx(density[j, i] / total, rel=1e-6)


@pytest.mark.parametrize("weights", ["average", "balance"])
def test_frames_have_the_hits_allotted(weights: str) -> None:
    inputs = tiny.prepared(job(samples={"error": 0.05}, reuse={"n_r": 2, "weights": weights}))
    with tiny.planned(inputs) as (planned, ambient):
        setup, target = allot_hits(inputs, planned, ambient)
        assert target is not None and setup.allotment is not None
        assert target.frames[0] <= target.hits <= target.frames[1]
        with TracePool(setup, 1) as pool:
            for c in range(setup.n_frames):
                frame = find_frame(setup, c, pool)
                own, counts = np.diff(frame.places[c].start), setup.allotment.counts(c)
                np.testing.assert_array_equal(own, counts)


@pytest.mark.parametrize("n", [1, 15, 16, 17, 100])
def test_pairs_are_two_hits_of_one_pixel(n: int) -> None:
    inputs = tiny.prepared(job(samples={"error": 0.1}))
    with tiny.planned(inputs) as (setup, _):
        pixels, hits = setup.order[:n], empty_hits(2 * n)
        samples = PixelSamples(3, pixels, per_pixel=2, first=0, halves=True)
        native_hits(setup.cams, 0, samples, 0, 2 * n, setup.world, True, room_for_hits(2 * n).packets, hits)
    pair = hit_pairs(n)
    assert sorted(pair.ravel()) == list(range(2 * n))
    np.testing.assert_array_equal(hits.pixel[pair], [pixels, pixels])
    np.testing.assert_array_equal(hits.half[pair], [[0] * n, [1] * n])  # even and odd: independent of each other


def test_noisier_places_get_more_hits() -> None:
    setup, target = allotted_setup(tiny.prepared(job(samples={"error": 0.2})))
    assert setup.allotment.hits.std() > 0.1 * target.hits
    tighter, other = allotted_setup(tiny.prepared(job(samples={"error": 0.1})))
    assert 2 < other.hits / target.hits < 5  # half the error takes 2^(2 / 1.3) = 2.9 times the hits
    assert (tighter.per_pixel > setup.per_pixel).all()


def test_the_cap_binds_and_is_reported() -> None:
    _, target = allotted_setup(tiny.prepared(job(samples={"error": 1e-4, "most_hits": 3})))
    assert target.capped > 0.9 and target.expected > target.error
    assert "samples.most_hits" in target_lines(target)[1]
    assert target.frames[1] <= 3


def test_a_dark_array_takes_the_fewest_hits_and_renders() -> None:
    dark = {"sources": [{"type": "point", "keys": [{"frame": 0, "position": [0, 2, 0], "intensity": 0}]}]}
    setup, target = allotted_setup(tiny.prepared(job(light=dark, scene={"background": 0}, samples={"error": 0.05})))
    assert target.expected == 0 and target.radiance == 0 and setup.allotment.hits.max() < 1


def test_threads_and_blocks_of_lights_change_nothing() -> None:
    inputs = tiny.prepared(job(samples={"error": 0.1}))
    images = []
    for threads in (1, 2):
        render = inputs.job.render.model_copy(update={"threads": threads})
        with tiny.planned(inputs) as (planned, ambient):
            setup, _ = allot_hits(
                replace(inputs, job=inputs.job.model_copy(update={"render": render})), planned, ambient
            )
            with TracePool(setup, threads) as pool:
                images.append(composed(setup, ambient, pool))
            block = range(1, 3)
            with TracePool(setup.for_block(block), threads) as pool:
                some = composed(setup.for_block(block), ambient.at(block), pool)
                np.testing.assert_array_equal(some, images[-1][:, 1:3])
    np.testing.assert_array_equal(*images)


def composed(setup: Any, ambient: Any, pool: Any) -> Any:
    """All images, (n_frames, n_lights, height, width, 3)."""
    return np.stack([frame.images for frame in tiny.frames_of(setup, ambient, pool)])


def test_every_pixel_gets_a_hit() -> None:
    inputs = tiny.prepared(job(camera=WALK | {"resolution": [5, 3]}, samples={"error": 5.0}))
    with tiny.planned(inputs) as (planned, ambient):
        setup, target = allot_hits(inputs, planned, ambient)
        assert target is not None and target.hits < 1
        with TracePool(setup, 1) as pool:
            composed = tiny.frames_of(setup, ambient, pool)
        assert len(composed) == setup.n_frames
        assert all(frame.hits.min() >= 1 for frame in composed)


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        ({"error": 0.02, "hits": 2}, "either hits or error"),
        ({"most_hits": 8}, "expected error next to it"),
        ({"error": 0}, "error"),
        ({"error": 0.1, "most_hits": 0}, "most_hits"),
    ],
)
def test_wrong_targets_are_refused(samples: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        tiny.job(samples={"hits": None} | samples)


def test_hits_that_do_not_fit_into_memory_are_refused() -> None:
    inputs = tiny.prepared(job(samples={"error": 0.05}))
    with pytest.raises(JobError, match=r"a larger samples\.error"):
        require_memory(inputs, np.full(inputs.n_cameras, 1e9))
    require_memory(inputs, np.full(inputs.n_cameras, 4.0))


def test_a_camera_at_rest_gets_the_hits_of_its_whole_window(tmp_path: Path) -> None:
    walking = {"frames": 5, "keys": [{"frame": 0, "eye": [0, 1.2, 1.6], "target": [0, 1, 0]}]}
    setup, target = allotted_setup(tiny.prepared(job(camera=walking, samples={"error": 1e-3, "most_hits": 2})))
    assert setup.n_frames == 1 and setup.n_r == 0
    assert isinstance(setup.allotment, Allotment) and setup.allotment.hits.max() == 10
    assert target.capped > 0


def told_over_true(passes: int) -> tuple[float, float]:
    """The expected error over that of renders with other seeds and the same cells; and hits per pixel."""
    cells = {"method": "cells", "samples": 2**14, "filter": passes}
    inputs = tiny.prepared(
        job(indirect=cells, samples={"error": 0.1, "obscurance": 2}, camera={"resolution": [16, 12]}),
        tiny.room(mirrors=False),
    )
    with tiny.planned(inputs) as (setup, ambient):
        setup, target = allot_hits(inputs, setup, ambient)
        assert target is not None
        images = []
        for seed in range(100, 108):
            other = replace(setup, seed=seed)
            with TracePool(other, 2) as pool:
                images.append([frame.images for frame in tiny.frames_of(other, ambient, pool)])
    true = float(np.var(images, axis=0, ddof=1).mean()) ** 0.5 / float(np.mean(images))
    return target.expected / true, target.hits


def test_the_filter_counts_in_the_error_that_is_expected() -> None:
    (plain, more), (filtered, fewer) = (told_over_true(passes) for passes in (0, 2))
    assert fewer < 0.8 * more
    assert filtered == pytest.approx(plain, rel=0.2)
