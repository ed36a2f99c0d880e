"""Weights by area against their slow twin, and what they promise."""

from typing import Any

import numpy as np
import pytest
from support.area_twin import PARTS, area_weights

from framearray_cli.engine.frames.records import HitsByPixel, StoredLight, empty_records, light_columns
from framearray_cli.engine.hits.outer import sort_by_pixel
from framearray_cli.engine.hits.row import BY_SAMPLE, HALF
from framearray_cli.engine.images.area import WHOLE, AreaWeights, WeighedHits
from framearray_cli.engine.images.sourcelists import OF, ORDER, SHARES, START, HitSource, SourceList
from framearray_cli.engine.kernels.kernel import integer_at, kernel, real_at

SIZE = WIDTH, HEIGHT = 7, 5
N_PIXELS = WIDTH * HEIGHT


@kernel
def read_hits(listed: Any, pixel: int, of: Any, order: Any, share: Any) -> int:
    """Copy the hits of a pixel, their sources and their weights; return their number."""
    first, end = integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)
    for entry in range(first, end):
        of[entry - first], order[entry - first] = integer_at(listed[OF], entry), integer_at(listed[ORDER], entry)
        share[entry - first] = real_at(listed[SHARES], entry)
    return int(end - first)


class Hits:
    """Random hits of some eyes, that all fall into a frame."""

    def __init__(self, counts: Any = (90, 60, 1, 0, 150), ratio: float = 1.4, seed: int = 1, top: int = HEIGHT) -> None:
        rng = np.random.default_rng(seed)
        self.column = [rng.integers(0, WIDTH * PARTS, n) for n in counts]
        self.row = [rng.integers(0, top * PARTS, n) for n in counts]
        self.balance = [rng.uniform(1, ratio, n).astype(np.float32) / 14 for n in counts]
        self.half = [rng.integers(0, 2, n) for n in counts]

    def listed(self) -> SourceList:
        sources = []
        for column, row, balance, half in zip(self.column, self.row, self.balance, self.half, strict=True):
            n = len(column)
            pixel = (row // PARTS * WIDTH + column // PARTS).astype(np.int32)
            start, order = np.empty(N_PIXELS + 1, np.int32), np.empty(n, np.int32)
            sort_by_pixel(pixel, 0, N_PIXELS, start, order)
            records = empty_records(light_columns(StoredLight(1, 1, 1)), n)
            records.row[:, HALF] = half
            subpixel = (row % PARTS * PARTS + column % PARTS).astype(np.uint8)
            sources.append(
                HitSource(
                    HitsByPixel(start=start, order=order), {**records.arrays, "weight": balance, "subpixel": subpixel}
                )
            )
        return SourceList(sources)

    def twin(self, chosen: Any = None) -> dict[int, dict[tuple[int, int], float]]:
        """The weights of hits (source, number) by pixel; `chosen`: of these hits only, by source."""
        kept = [
            np.flatnonzero(np.ones(len(c), bool) if chosen is None else chosen[s]) for s, c in enumerate(self.column)
        ]
        names = [(s, int(hit)) for s, hits in enumerate(kept) for hit in hits]
        column, row, balance = (
            np.concatenate([values[s][hits] for s, hits in enumerate(kept)])
            for values in (self.column, self.row, self.balance)
        )
        weighed = area_weights(column, row, balance.astype(np.float64), SIZE)
        return {
            pixel: {names[i]: float(w) for i, w in zip(near, weight, strict=True)} for pixel, near, weight in weighed
        }


def found_in(weighed: WeighedHits, pixels: range) -> dict[int, dict[tuple[int, int], float]]:
    """The weights of hits (source, number) by pixel."""
    of, order, share = np.empty(999, np.int32), np.empty(999, np.int32), np.empty(999, np.float32)
    found: dict[int, dict[tuple[int, int], float]] = {}
    for pixel in pixels:
        n = read_hits(weighed.addresses[0], pixel, of, order, share)
        if n:
            hits = zip(of[:n], order[:n], share[:n], strict=True)
            found[pixel] = {(int(s) - 1, int(hit)): float(w) for s, hit, w in hits}
            assert len(found[pixel]) == n
    return found


def assert_same(found: Any, expected: Any) -> None:
    """Up to rounding; a hit at the limit may be dropped, which changes the others by its share."""
    assert found.keys() == expected.keys()
    for pixel, weights in expected.items():
        either = found[pixel].keys() ^ weights.keys()
        assert all(found[pixel].get(hit, 0) + weights.get(hit, 0) < 1 / 16 / len(weights) for hit in either)
        assert len(either) <= 1
        for hit in found[pixel].keys() & weights.keys():
            assert found[pixel][hit] == pytest.approx(weights[hit], rel=1e-5 if not either else 0.05)


@pytest.mark.parametrize("ratio", [1.0, 2.4, 2.7, 6.0])
@pytest.mark.parametrize("task", [N_PIXELS, 9, 1])
def test_weights_are_those_of_the_twin(ratio: float, task: int) -> None:
    """Whatever the pixels of a task are."""
    hits, area, found = Hits(ratio=ratio), AreaWeights(SIZE), {}
    listed = hits.listed()
    for first in range(0, N_PIXELS, task):
        n = min(task, N_PIXELS - first)
        with area.weighed(listed, first, n) as weighed:
            found |= found_in(weighed, range(first, first + n))
    assert_same(found, hits.twin())
    assert len(found) == N_PIXELS


@pytest.mark.parametrize("half", [0, 1])
def test_of_a_half_only_its_hits_count(half: int) -> None:
    """The other hits neither weigh anything nor stand in the way."""
    hits, halves = Hits(), np.array([1, BY_SAMPLE, 0, 0, BY_SAMPLE], np.int32)
    of_half = [hits.half[s] == half if its == BY_SAMPLE else np.full(len(hits.half[s]), its == half)
               for s, its in enumerate(halves)]  # fmt: skip
    with AreaWeights(SIZE).weighed(hits.listed(), 0, N_PIXELS, halves, half) as weighed:
        found = found_in(weighed, range(N_PIXELS))
    assert_same(found, hits.twin(of_half))


def test_numbers_of_hits_and_squares_of_weights() -> None:
    hits = Hits(top=HEIGHT - 1)
    with AreaWeights(SIZE).weighed(hits.listed(), 0, N_PIXELS) as weighed:
        found, own, squares = found_in(weighed, range(N_PIXELS)), weighed.own.copy(), weighed.squares.copy()
    pixels = np.concatenate([r // PARTS * WIDTH + c // PARTS for r, c in zip(hits.row, hits.column, strict=True)])
    np.testing.assert_array_equal(own, np.bincount(pixels, minlength=N_PIXELS))
    assert (own[-WIDTH:] == 0).all() and set(found) == set(np.flatnonzero(own))
    expected = [sum(w * w for w in found.get(pixel, {}).values()) for pixel in range(N_PIXELS)]
    np.testing.assert_allclose(squares, expected, rtol=1e-5)


def test_a_hit_weighs_as_much_as_the_part_of_the_pixel_that_it_stands_for() -> None:
    """Nine hits at one place left of the middle, one as far to the right of it; a cell is 0.12 pixels wide."""
    hits = Hits(counts=(10,))
    hits.column[0], hits.row[0] = 2 * PARTS + np.array([4] * 9 + [11]), np.full(10, 2 * PARTS + 8)
    hits.balance[0][:] = 1
    pixel = 2 * WIDTH + 2
    with AreaWeights(SIZE).weighed(hits.listed(), pixel, 1) as weighed:
        assert found_in(weighed, range(pixel, pixel + 1))[pixel][0, 9] == pytest.approx(0.5, abs=0.06)


def test_where_balance_weights_differ_they_stay() -> None:
    hits = Hits(counts=(10,))
    hits.column[0], hits.row[0] = np.arange(32, 42), np.arange(32, 42)
    hits.balance[0][:] = [1] * 9 + [3]
    pixel = 2 * WIDTH + 2
    with AreaWeights(SIZE).weighed(hits.listed(), pixel, 1) as weighed:
        found = found_in(weighed, range(pixel, pixel + 1))[pixel]
    assert list(found.values()) == pytest.approx([1 / 12] * 9 + [3 / 12])


def test_a_hit_that_fills_a_hole_is_alone_in_its_pixel() -> None:
    """It has no place, and counts in no other pixel."""
    hits = Hits(counts=(150, 1))
    hole = 2 * WIDTH + 3
    column, row = hits.column[0], hits.row[0]
    inside = row // PARTS * WIDTH + column // PARTS == hole
    hits.column[0], hits.row[0], hits.balance[0] = column[~inside], row[~inside], hits.balance[0][~inside]
    hits.half[0] = hits.half[0][~inside]
    hits.column[1][:], hits.row[1][:] = 3 * PARTS, 2 * PARTS
    others, filling = hits.listed().sources
    listed = SourceList([others, HitSource(filling.by_pixel, {"row": filling.columns["row"]})])
    with AreaWeights(SIZE).weighed(listed, 0, N_PIXELS) as weighed:
        found = found_in(weighed, range(N_PIXELS))
    assert found[hole] == {(1, 0): 1.0}
    assert not any((1, 0) in weights for pixel, weights in found.items() if pixel != hole)


def test_room_is_used_again_and_by_several_tasks() -> None:
    hits, area = Hits(), AreaWeights(SIZE)
    listed = hits.listed()
    with area.weighed(listed, 0, 9) as one, area.weighed(listed, 9, 9) as other:
        found = found_in(one, range(9)) | found_in(other, range(9, 18))
    with area.weighed(listed, 0, 18) as whole:
        assert found_in(whole, range(18)) == found
    with pytest.raises(MemoryError), area.weighed(listed, 0, 18):
        raise MemoryError
    with area.weighed(listed, 0, 18, half=WHOLE) as again:
        assert found_in(again, range(18)) == found
