"""The time left of a render in parts."""

import pytest

from framearray_cli.render.parts.queue import ChunkPace


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_waiting_chunks_take_as_long_as_those_at_work() -> None:
    clock = Clock()
    pace = ChunkPace(clock)
    left = {0: 40, 10: 40, 20: 40, 30: 20}
    assert pace.left(left) is None
    pace.begin(0, 40)
    pace.begin(10, 40)
    clock.now += 10
    assert pace.left(left) is None
    pace.expect(0, 30.0)  # 40 s for 40 images
    assert pace.left(left) == pytest.approx((30 + 40 + 40 + 20) / 2)
    pace.expect(10, 30.0)
    assert pace.left(left) == pytest.approx((30 + 30 + 40 + 20) / 2)
    clock.now += 10
    assert pace.left(left) == pytest.approx((20 + 20 + 40 + 20) / 2)


def test_the_last_chunk_is_as_long_as_its_worker_says() -> None:
    clock = Clock()
    pace = ChunkPace(clock)
    pace.begin(0, 40)
    pace.begin(10, 40)
    pace.expect(0, 5.0)
    pace.expect(10, 60.0)
    clock.now += 5
    assert pace.left({10: 30}) == pytest.approx(55.0)


def test_a_chunk_that_is_submitted_again_begins_again() -> None:
    clock = Clock()
    pace = ChunkPace(clock)
    pace.begin(0, 40)
    pace.expect(0, 5.0)
    pace.begin(0, 20)
    assert pace.left({0: 20}) is None
