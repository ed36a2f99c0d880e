"""Bundles: named tuples that kernels take by reference."""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from framearray_cli.base.arrays import Float32, Int32
from framearray_cli.engine.kernels.bundle import bundle
from framearray_cli.engine.kernels.kernel import inlined, kernel


@bundle
class Inner(NamedTuple):
    """Arrays."""

    numbers: Int32
    table: Float32


@bundle
class Outer(NamedTuple):
    """A bundle, numbers of all kinds and an array."""

    inner: Inner
    whole: int
    real: float
    single: np.float32
    small: np.int32
    flag: bool
    last: Any

    @cached_property
    def doubled(self) -> "Outer":
        """With twice the whole number."""
        return self._replace(whole=2 * self.whole)


@inlined
def table_of(inner: Inner, i: int, j: int) -> float:
    """A number of a bundle within a bundle."""
    return float(inner.table[i, j])


@kernel
def read(b: Outer, i: int, j: int, out: Any) -> int:
    """Write what a bundle holds."""
    out[0], out[1], out[2], out[3] = b.whole, b.real, b.single, b.small
    out[4], out[5], out[6] = b.flag, b.last[i], table_of(b.inner, i, j)
    found: int = b.inner.table.shape[0] * 100 + b.inner.table.shape[1] * 10 + len(b.inner.numbers)
    return found


def outer(table: Any) -> Outer:
    inner = Inner(np.arange(5, dtype=np.int32), table)
    return Outer(inner, -7, 0.1, np.float32(2.5), np.int32(-3), True, np.array([2**63 + 1, 9], np.uint64))


def test_kernels_read_what_a_bundle_holds() -> None:
    given, out = outer(np.arange(12, dtype=np.float32).reshape(3, 4)), np.zeros(7)
    assert read(given, 1, 2, out) == 345
    assert out.tolist() == [-7, 0.1, 2.5, -3, 1, 9, 6]
    assert read(given.doubled, 0, 0, out) == 345 and out[0] == -14 and given.doubled is given.doubled
    assert read(outer(np.zeros((0, 4), np.float32)), 1, 2, np.zeros(7)) == 45
    found: Any = read
    assert len(found.signatures) == 1, "arrays without rows share the machine code"


def test_kernels_see_what_arrays_hold_later() -> None:
    given, out = outer(np.zeros((3, 4), np.float32)), np.zeros(7)
    read(given, 0, 0, out)
    given.inner.table[2, 3] = 5
    read(given, 1, 0, out)
    assert out[6] == 0
    read(given, 0, 0, out)
    given.last[1] = 11
    read(given, 1, 0, out)
    assert out[5] == 11


def test_strided_arrays_are_refused() -> None:
    with pytest.raises(TypingError, match="must be contiguous"):
        read(outer(np.zeros((4, 3), np.float32).T), 0, 0, np.zeros(7))
