"""Kernels compute what Python computes, however functions are inlined, and are compiled once per kind of arguments."""

from typing import Any

import numpy as np
import pytest
from numba.core import untyped_passes

from framearray_cli.engine.kernels import pipeline, start
from framearray_cli.engine.kernels.kernel import inlined, kernel

pytestmark = pytest.mark.usefixtures("own_cache")  # what an earlier run compiled counts for nothing

SCALE = 3


def collatz(n: int, most: int = 50) -> tuple[int, int]:
    steps, largest = 0, n
    while n > 1 and steps < most:
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        largest = max(largest, n)
        steps += 1
    return steps, largest


collatz_inlined: Any = inlined(collatz)


@inlined
def twice(n: int, more: int) -> int:
    """Inlines another function two times, by position and by name, and changes its own argument."""
    steps, _ = collatz_inlined(n)
    n += more
    _, largest = collatz_inlined(n, most=5)
    return steps * SCALE + largest


def summed(numbers: Any, out: Any) -> None:
    for i in range(len(numbers)):
        first = twice(numbers[i], 1)
        steps, largest = collatz_inlined(numbers[i])
        second = twice(steps, SCALE) if largest > 20 else 0
        out[i] = first - second


def expected(numbers: Any) -> list[int]:
    def twice_(n: int, more: int) -> int:
        return collatz(n)[0] * SCALE + collatz(n + more, 5)[1]

    found = []
    for n in numbers.tolist():
        steps, largest = collatz(n)
        found.append(twice_(n, 1) - (twice_(steps, SCALE) if largest > 20 else 0))
    return found


def test_calls_of_one_inlined_function_have_their_own_variables() -> None:
    numbers, out = np.arange(1, 60), np.zeros(59, np.int64)
    kernel(summed)(numbers, out)
    assert out.tolist() == expected(numbers)
    again = np.zeros_like(out)
    kernel(summed)(numbers.astype(np.int32), again)  # compiled once more, from the same analysis
    assert again.tolist() == expected(numbers)


@pytest.mark.skipif(not start.is_tried(), reason="another numba compiles with its own passes")
def test_an_inlined_function_is_analysed_once(monkeypatch: Any) -> None:
    """By five calls in two kernels; numba would analyse it at each."""
    analysed: list[str] = []
    translate = untyped_passes.TranslateByteCode.run_pass

    def run_pass(self: Any, state: Any) -> Any:
        analysed.append(state.func_id.func_name)
        return translate(self, state)

    monkeypatch.setattr(untyped_passes.TranslateByteCode, "run_pass", run_pass)
    monkeypatch.setattr(pipeline, "_analysed", {})
    kernel(summed).compile("(int64[::1], int64[::1])")  # type: ignore[attr-defined]
    kernel(summed).compile("(int64[::1], float64[::1])")  # type: ignore[attr-defined]
    assert analysed.count("collatz") == 1 and analysed.count("summed") == 2


def test_other_versions_of_numba_compile_with_their_own_passes(monkeypatch: Any) -> None:
    monkeypatch.setattr(start, "TRIED", "0.1")
    monkeypatch.setattr(pipeline, "_analysed", {})
    numbers, out = np.arange(1, 60), np.zeros(59, np.int64)
    kernel(summed)(numbers, out)
    assert out.tolist() == expected(numbers)
    assert not pipeline._analysed


@kernel
def _signed(positive: bool, x: float) -> float:
    return x if positive else -x


def test_a_kernel_is_compiled_once_for_true_and_false() -> None:
    """Written in another kernel or computed there."""

    def both(flag: bool) -> float:
        return 4.0 * _signed(True, 1.0) + 2.0 * _signed(False, 1.0) + _signed(flag, 1.0)  # type: ignore[no-any-return]

    called = kernel(both)
    assert (called(True), called(False)) == (3.0, 1.0)
    found: Any = _signed
    assert len(found.signatures) == 1
