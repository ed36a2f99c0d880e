"""Chunks of the camera path: where it is split, and what halos cost."""

import importlib

import numpy as np
import pytest

from framearray_cli.render.messages import chunks_line
from framearray_cli.render.parts.queue import default_size, plan_chunks, split_cameras


@pytest.mark.parametrize(("n", "size"), [(1, 1), (5, 9), (24, 24), (25, 24), (96, 24), (100, 24), (101, 7), (8, 1)])
def test_chunks_are_few_and_of_almost_equal_length(n, size):
    cameras = tuple(range(3, 3 + n))
    chunks = split_cameras(cameras, size)
    assert sum(chunks, ()) == cameras
    lengths = [len(chunk) for chunk in chunks]
    assert len(chunks) == -(-n // size)
    assert max(lengths) <= size and max(lengths) - min(lengths) <= 1


def test_no_cameras_give_no_chunks():
    assert split_cameras((), 4) == []
    assert default_size(0, 3) == 1


def test_cameras_with_gaps_are_split_too():
    assert split_cameras((0, 3, 6, 9, 12), 2) == [(0, 3), (6, 9), (12,)]


@pytest.mark.parametrize("n_r", [0, 1, 3, 9])
@pytest.mark.parametrize("size", [1, 4, 24, 100])
def test_the_cost_is_that_of_the_frames_traced(n_r, size):
    n = 60
    chunks = plan_chunks(range(n), size, n_r)
    found = sum(len(chunk) + 2 * n_r for chunk in chunks.each)
    assert chunks.more == pytest.approx(found / (n + 2 * n_r) - 1)
    assert (chunks.more == 0) == (n_r == 0 or size >= n)


def test_halos_of_long_chunks_cost_about_2_n_r_over_their_length():
    chunks = plan_chunks(range(2400), 24, 3)
    assert chunks.more == pytest.approx(6 / 24, rel=0.02)
    assert chunks_line(chunks) == "100 chunks of 24 camera positions; halos add 25% to the hits"


def test_line_about_chunks():
    assert chunks_line(plan_chunks(range(5), 9, 2)) == "1 chunk of 5 camera positions"
    assert chunks_line(plan_chunks(range(1), 9, 0)) == "1 chunk of 1 camera position"
    assert chunks_line(plan_chunks(range(5), 2, 0)) == "3 chunks of 1 to 2 camera positions; halos add 0% to the hits"


def test_a_camera_at_rest_has_one_frame_to_trace():
    assert plan_chunks(range(8), 2, 3, still=True).more == 3.0


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
@pytest.mark.parametrize(("n", "n_r"), [(1, 0), (5, 3), (96, 3), (288, 3), (1000, 16), (20000, 0)])
def test_by_default_all_workers_are_busy_to_the_end(workers, n, n_r):
    size = default_size(n, n_r, workers)
    assert 1 <= size <= max(8 * n_r, 16)
    count = len(split_cameras(range(n), size))
    rounds = -(-count // workers)
    assert count > (rounds - 1) * workers
    assert size * rounds * workers >= n
    if n >= 16 * workers:
        assert np.isclose(count / workers, rounds, atol=0.5)


def test_dask_is_named_where_it_is_missing(monkeypatch):
    import sys

    from framearray_cli.base.errors import MissingExtraError

    cluster = importlib.import_module("framearray_cli.render.parts.dask")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r'pip install .*\[dask\]"'):
        cluster.require_dask()
