"""Sixteen numbers that move: to the end of a queue, from rows to columns, across lanes."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.engine.kernels import instructions
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.simd import (
    LANES,
    append,
    largest_of_lanes,
    load,
    popcount,
    product,
    store,
    store_columns,
)


@kernel
def queue_flagged(mask: Any, reals: Any, numbers: Any, out_reals: Any, out_numbers: Any) -> int:
    found = 0
    for first in range(0, mask.size, LANES):
        flags = load(mask, first) > 0
        append(flags, load(reals, first), out_reals, found)
        append(flags, load(numbers, first), out_numbers, found)
        found += popcount(flags)
    return found


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_a_queue_holds_the_flagged_lanes_in_order(share: float) -> None:
    rng = np.random.default_rng(7)
    n = 256 * LANES
    mask, reals = (rng.random(n) < share).astype(np.int32), rng.normal(size=n).astype(np.float32)
    numbers = rng.integers(-(1 << 31), 1 << 31, n).astype(np.int32)
    out_reals, out_numbers = np.full(n + LANES, 77, np.float32), np.full(n + LANES, 77, np.int32)
    found = queue_flagged(mask, reals, numbers, out_reals, out_numbers)
    assert found == mask.sum()
    np.testing.assert_array_equal(out_reals[:found], reals[mask > 0])
    np.testing.assert_array_equal(out_numbers[:found], numbers[mask > 0])
    assert (out_reals[found + LANES :] == 77).all() and (out_numbers[found + LANES :] == 77).all()


@kernel
def exchange(rows: Any, n: int, out: Any) -> None:
    store_columns(rows, 2, rows.shape[1], n, out, 3, out.shape[1])


@pytest.mark.parametrize("n", [1, 7, 8, 11, 16, 40])
@pytest.mark.parametrize("dtype", [np.float32, np.uint16])
def test_columns_of_a_tile_become_rows(n: int, dtype: Any) -> None:
    rows = np.random.default_rng(3).normal(size=(LANES, 21)).astype(np.float32)
    out = np.full((LANES, 24), 77, dtype)
    exchange(rows, n, out)
    expected, m = np.full_like(out, 77), min(n, LANES)
    columns = rows[:, 2 : 2 + m].T
    expected[:m, 3 : 3 + LANES] = columns if dtype == np.float32 else columns.astype(np.float16).view(np.uint16)
    np.testing.assert_array_equal(out, expected)


@kernel
def add_product(a: Any, b: Any, factor: Any, out: Any) -> None:
    store(out, 0, load(a, 0) + product(load(b, 0), factor))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_products_are_rounded_before_they_are_added(dtype: Any) -> None:
    b, factor = np.random.default_rng(4).normal(size=LANES).astype(dtype), dtype(1 / 3)
    rounded = b * factor
    out = np.empty(LANES, dtype)
    add_product(-rounded, b, factor, out)  # fused, this is the error of the product
    np.testing.assert_array_equal(out, np.zeros(LANES))


@kernel
def largest(values: Any) -> Any:
    return largest_of_lanes(load(values, 0))


@pytest.mark.parametrize("lane", range(LANES))
def test_the_largest_of_lanes(lane: int) -> None:
    values = np.random.default_rng(5).normal(size=LANES).astype(np.float32)
    values[lane] = 9
    assert largest(values) == 9


@pytest.mark.parametrize(
    ("named", "known"),
    [("x86-64-v4", ["f16c", "avx2", "avx512f"]), ("x86-64-v3", ["f16c", "avx2"]), ("generic", [])],
)
def test_a_named_processor_has_the_instructions_of_its_level(
    named: str, known: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CPU_NAME", named)
    assert [name for name in ("f16c", "avx2", "avx512f") if instructions.has_instructions(name)] == known
