"""Frames: passes, the pool of threads, and reflected hits."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from threading import Barrier
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.kept import irradiance_of

from framearray_cli.base.arrays import LINE
from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.passes import Allotment, blocks_of, passes, repeated, repetitions
from framearray_cli.engine.frames.pool import BATCH, LARGEST_BATCH, TracePool
from framearray_cli.engine.frames.records import ArrayPool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.native import pixel_order

PATHS = [(n_c, n_r) for n_c in (1, 2, 3, 4, 5, 7, 12, 24) for n_r in (0, 1, 2, 3, 5, 8, 30, 64)]


@pytest.mark.parametrize(("n_c", "n_r"), PATHS)
def test_the_path_goes_on_in_reverse_order_beyond_its_ends(n_c: int, n_r: int) -> None:
    frames = [repeated(eye, n_c) for eye in range(-n_r, n_c + n_r)]
    assert frames[n_r : n_r + n_c] == list(range(n_c)) and set(frames) == set(range(n_c))
    assert all(abs(b - a) <= 1 for a, b in pairwise(frames)) and frames == [n_c - 1 - c for c in reversed(frames)]
    eyes = [repetitions(c, n_c, n_r) for c in range(n_c)]
    assert sorted(eye for some in eyes for eye in some) == list(range(-n_r, n_c + n_r))
    assert [some[0] for some in eyes] == list(range(n_c))


def test_every_frame_has_the_hits_of_a_whole_window() -> None:
    inputs = tiny.prepared(tiny.job(camera=tiny.WALK, reuse={"n_r": 3}))
    with tiny.planned(inputs) as (setup, _):
        every = range(setup.n_frames)
        np.testing.assert_array_equal(setup.hits_in(every, every).sum(axis=1), 7 * setup.per_pixel[0])
        assert setup.hits_in(every, every)[0].tolist() == [4, 4, 4, 2, 0, 0]
        samples = [part.first_sample for eye in (0, -1) for part in setup.passes(eye)]
        assert samples == [0, 2] and setup.unused_sample(0) == 4 and setup.unused_sample(3) == 4


def test_a_still_camera_has_the_hits_of_its_whole_window_and_no_reuse() -> None:
    inputs = tiny.prepared(tiny.job(camera={"frames": 9}, reuse={"n_r": 3}))
    assert inputs.still
    with tiny.planned(inputs) as (setup, _):
        assert setup.per_pixel.tolist() == [14]
        assert (setup.n_r, setup.n_frames, setup.balance) == (0, 1, False)


def test_features_that_a_scene_lacks_are_off() -> None:
    with tiny.planned(tiny.prepared(tiny.job(reuse={"n_r": 2}), tiny.room(mirrors=False))) as (setup, _):
        assert setup.depth == 0 and setup.mirror_hits == 0 and not setup.background.any()
    with tiny.planned(tiny.prepared(tiny.job(reuse={"n_r": 2}, specular={"depth": 0}))) as (setup, _):
        assert setup.depth == 0 and setup.mirror_hits == 0
    with tiny.planned(tiny.prepared(tiny.job(reuse={"n_r": 2}))) as (setup, _):
        assert setup.depth == 4 and setup.mirror_hits == 10


@pytest.mark.parametrize(("hits", "m"), [(1 / 2, 2), (1 / 3, 3), (1 / 4, 4), (1 / 7, 7), (1 / 8, 8)])
def test_a_fraction_1_over_m_visits_every_pixel_once_in_m_frames(hits: float, m: int) -> None:
    order = pixel_order(21, 13)
    found = [passes(order, 21, c, hits) for c in range(m)]
    assert all(len(parts) == 1 and parts[0].per_pixel == 1 and parts[0].first_sample == 0 for parts in found)
    np.testing.assert_array_equal(np.sort(np.concatenate([parts[0].pixels for parts in found])), np.arange(21 * 13))


def test_whole_hits_come_first_and_then_the_fraction() -> None:
    whole, part = passes(pixel_order(8, 8), 8, 0, 2.5)
    assert (whole.per_pixel, whole.first_hit, whole.n, part.first_sample, part.first_hit) == (2, 0, 128, 2, 128)
    assert part.n == 32
    assert [p.n for p in passes(pixel_order(8, 8), 8, 0, 3.0)] == [192]


def test_a_pixel_without_hits_gets_one() -> None:
    """Sparse hits leave holes, which would be black."""
    sky = {"background": [0.5, 0.5, 0.5]}
    job = tiny.job(samples={"hits": 0.125}, camera=tiny.WALK, reuse={"n_r": 1}, scene=sky)
    for frame in tiny.render_frames(tiny.prepared(job)).composed:
        assert (frame.hits >= 1).all() and frame.hits.mean() < 1.5
        # a pixel whose only hit is an outer one on a mirror stays black: one or two of 432
        assert (frame.images.max(axis=(0, 3)) == 0).sum() <= 2


@pytest.fixture
def pool() -> Iterator[TracePool]:
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _), TracePool(setup, 3) as found:
        yield found


def test_every_item_is_done_once_and_results_keep_their_order(pool: TracePool) -> None:
    done: list[int] = []

    def task(item: int, _scratch: object) -> int:
        done.append(item)
        return item * item

    assert pool.run(task, range(1000)) == [item * item for item in range(1000)]
    assert sorted(done) == list(range(1000))
    assert pool.run(task, []) == []


def test_all_threads_run_each_with_arrays_of_its_own(pool: TracePool) -> None:
    together = Barrier(3, timeout=60)  # breaks if three tasks do not run at the same time

    def task(_item: int, scratch: object) -> int:
        together.wait()
        return id(scratch)

    assert len(set(pool.run(task, range(3)))) == 3


def test_an_error_reaches_the_caller_and_ends_the_work(pool: TracePool) -> None:
    done: list[int] = []

    def task(item: int, _scratch: object) -> None:
        if item == 5:
            raise ValueError("item 5")
        done.append(item)

    with pytest.raises(ValueError, match="item 5"), pool:
        pool.run(task, range(100_000))
    assert len(done) < 99_999


def test_the_pool_is_usable_after_an_error(pool: TracePool) -> None:
    def task(item: int, _scratch: object) -> int:
        return 1 // item

    with pytest.raises(ZeroDivisionError):
        pool.run(task, [0])
    assert pool.run(task, [1, 1, 1, 1]) == [1, 1, 1, 1]


def test_returned_memory_serves_arrays_of_about_its_size() -> None:
    arrays = ArrayPool()
    array = arrays.take("row", (50, 16), np.float32)
    block = array.base
    arrays.give("row", array)
    smaller = arrays.take("row", (7, 100), np.float32)
    assert smaller.base is block and smaller.shape == (7, 100) and smaller.ctypes.data % LINE == 0
    arrays.give("row", smaller)
    again = arrays.take("row", (50, 16), np.float32)
    assert again.base is block and again.ctypes.data == array.ctypes.data
    arrays.give("row", again)
    assert arrays.take("row", (51, 16), np.float32).base is not block
    arrays.give("row", again)
    assert arrays.take("row", (25, 16), np.float32).base is not block, "frames at a path's ends are twice as large"


def test_blocks_are_pieces_of_memory_with_huge_pages_and_serve_again() -> None:
    arrays = ArrayPool()
    blocks = [arrays.take_block(1 << 18) for _ in range(65)]
    pieces = {id(block.base) for block in blocks}
    assert len(pieces) == 2 and min(block.base.nbytes for block in blocks) >= 1 << 22
    assert not any(np.shares_memory(*pair) for pair in pairwise(blocks))
    assert all(block.ctypes.data % LINE == 0 and len(block) == 1 << 18 for block in blocks)
    assert arrays.lent == arrays.peak == 65 << 18
    arrays.give_block(blocks[7])
    assert arrays.take_block(1 << 18) is blocks[7] and arrays.lent == 65 << 18
    assert len(arrays.take_block(1 << 25)) == 1 << 25, "more than a piece"


def test_arrays_of_another_type_are_not_handed_on() -> None:
    arrays = ArrayPool()
    arrays.give("one name", arrays.take("one name", (64,), np.int64))
    assert arrays.take("one name", (64,), np.uint8).dtype == np.uint8
    assert arrays.take("one name", (64,), np.int64).dtype == np.int64


SIZE = (64, 48)
# 3 hits per pixel and 5 more where mirrors are seen: batches end within the hits of a pixel
JOB: dict[str, Any] = {
    "camera": {"resolution": list(SIZE)},
    "samples": {"hits": 3, "obscurance": 1},
    "specular": {"depth": 3, "hits": 8},
}


def allotted(setup: FrameSetup) -> FrameSetup:
    """Another number of hits in every block, as with a wanted error."""
    blocks = blocks_of(*SIZE)
    hits = 5 + 2 * np.random.default_rng(3).random((setup.n_frames, blocks.n))
    return replace(setup, allotment=Allotment(blocks=blocks, hits=hits.astype(np.float32)))


def reflected_hits(setup: FrameSetup, n_threads: int) -> tuple[int, Any]:
    """The size of batches, and the rows of the reflected hits, pixel by pixel."""
    with TracePool(setup, n_threads) as pool:
        found = find_frame(setup, 0, pool)
        assert found.mirrored and found.mirror_places
        rows = found.mirrored.row[found.mirror_places.order]
        return pool.batch, (
            found.mirror_places.start.copy(),
            rows,
            irradiance_of(found.mirrored, setup.stored)[found.mirror_places.order],
        )


@pytest.mark.parametrize("change", [lambda setup: setup, allotted], ids=["hits", "error"])
def test_reflected_hits_do_not_depend_on_the_size_of_batches(change: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mirrors on two walls face each other: paths have several bounces."""
    with tiny.planned(tiny.prepared(tiny.job(**JOB))) as (setup, _):
        setup = change(setup)
        batch, small = reflected_hits(setup, 2)
        monkeypatch.setattr("framearray_cli.engine.frames.pool.BATCHES_PER_THREAD", 1)
        for n_threads, expected in ((2, 2 * BATCH), (1, LARGEST_BATCH)):
            larger, large = reflected_hits(setup, n_threads)
            assert (batch, larger) == (BATCH, expected)
            for one, other in zip(small, large, strict=True):
                np.testing.assert_array_equal(one, other)
    deepest = np.diff(small[0]).max()
    assert len(small[1]) > 2 * BATCH and deepest > 8, "more reflected hits in a pixel than native ones: several bounces"
