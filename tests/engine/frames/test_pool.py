"""The threads of a pool: every task once, results in order, errors at once; and memory that is used again."""

from collections.abc import Iterator
from threading import Barrier

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.arrays import LINE
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import ArrayPool


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
