"""`samples.error`: the pilot, the weights of hits whose number varies by block, and renders with allotted hits."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support import tiny
from support.tiny import WALK

from framearray_cli.base.errors import JobError
from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.passes import Allotment, blocks_of
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.hits.hits import empty_hits
from framearray_cli.engine.hits.native import Samples, native_hits
from framearray_cli.engine.hits.outer import balance_weights, divide_by_own_hits, scale_by_expected_hits
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.cameras import OUTSIDE
from framearray_cli.job.job import Job
from framearray_cli.render.errortarget import allot_hits, hit_pairs
from framearray_cli.render.memory import require_memory
from framearray_cli.render.messages import target_lines


def job(**changes: Any) -> Job:
    """Return a tiny job with an error instead of hits; its camera walks, so frames are reused."""
    table = tiny.table(**{"camera": WALK, "reuse": {"n_r": 2}} | changes)
    del table["samples"]["hits"]
    return Job.model_validate(table)


def allotted_setup(inputs: Any) -> Any:
    with tiny.open_embree(inputs) as embree:
        setup, ambient = tiny.plan_work(inputs, embree)
        return allot_hits(inputs, setup, ambient)


def test_weights_of_blocks_with_different_hits_follow_the_formula() -> None:
    rng, n, n_r, n_c, blocks = np.random.default_rng(2), 50, 1, 5, blocks_of(24, 16)
    pixel = rng.integers(OUTSIDE, 24 * 16, (n_c, n)).astype(np.int32)
    density = rng.random((n_c, n)) * (pixel != OUTSIDE)
    hits = rng.uniform(0.25, 6, (n_c, blocks.n)).astype(np.float32)
    weight, known = np.empty((n_c, n), np.float32), density.copy()
    scale_by_expected_hits(hits, blocks.of_pixel, 0, n, pixel, known)
    balance_weights(np.ones(n_c), n_r, 0, 0, n, pixel, known, weight)
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
    with tiny.open_embree(inputs) as embree:
        planned, ambient = tiny.plan_work(inputs, embree)
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
    with tiny.open_embree(inputs) as embree:
        setup, _ = tiny.plan_work(inputs, embree)
        pixels, hits = setup.order[:n], empty_hits(2 * n)
        samples = Samples(3, pixels, per_pixel=2, first=0, halves=True)
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
        with tiny.open_embree(inputs) as embree:
            planned, ambient = tiny.plan_work(inputs, embree)
            setup, _ = allot_hits(
                replace(inputs, job=inputs.job.model_copy(update={"render": render})), planned, ambient
            )
            with TracePool(setup, threads) as pool:
                images.append(composed(setup, ambient, pool))
            block = range(1, 3)
            with TracePool(setup.for_block(block), threads) as pool:
                some = composed(setup.for_block(block), ambient.for_lights(block), pool)
                np.testing.assert_array_equal(some, images[-1][:, 1:3])
    np.testing.assert_array_equal(*images)


def composed(setup: Any, ambient: Any, pool: Any) -> Any:
    """All images, (n_frames, n_lights, height, width, 3)."""
    return np.stack([frame.images for frame in tiny.frames_of(setup, ambient, pool)])


def test_every_pixel_gets_a_hit() -> None:
    inputs = tiny.prepared(job(camera=WALK | {"resolution": [5, 3]}, samples={"error": 5.0}))
    with tiny.open_embree(inputs) as embree:
        planned, ambient = tiny.plan_work(inputs, embree)
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
    table = tiny.table()
    table["samples"] = samples
    with pytest.raises(ValidationError, match=message):
        Job.model_validate(table)


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
    with tiny.open_embree(inputs) as embree:
        setup, ambient = tiny.plan_work(inputs, embree)
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
