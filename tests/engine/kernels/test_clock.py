"""Clocks that measure compiling, one within another."""

import numba

from framearray_cli.engine.kernels.clock import compile_clock, is_compiling


def test_each_clock_reports_once_and_measures_its_own_time() -> None:
    begun: list[str] = []
    with compile_clock(lambda: begun.append("outer")) as outer, compile_clock(lambda: begun.append("inner")) as inner:
        for k in range(3):
            numba.njit(lambda x, k=k: x + k)(1)
            assert not is_compiling()
    assert sorted(begun) == ["inner", "outer"]
    assert 0 < inner.seconds <= outer.seconds + 1e-3
    before = outer.seconds
    numba.njit(lambda x: x - 1)(1)
    assert outer.seconds == before, "a clock that has ended measures nothing"


def test_kernels_count_once_and_functions_of_others_never() -> None:
    """A kernel that is compiled for two kinds of arguments is one; numba compiles functions of its own, too."""
    counts: list[int] = []

    def own(x):
        return x + 1

    own.__module__ = "framearray_cli.made_up"
    with compile_clock(compiled=counts.append) as clock:
        numba.njit(lambda x: x + 2)(1)
        assert clock.kernels == 0
        kernel = numba.njit(own)
        kernel(1)
        kernel(1.5)
    assert clock.kernels == 1
    assert counts == [1]


def test_what_began_to_compile_before_a_clock_does_not_count() -> None:
    """Another thread may compile when a clock starts; its end raised an error there."""
    from numba.core import event

    with compile_clock() as clock:
        event.end_event("numba:compile", data={"dispatcher": None})
    assert (clock.seconds, clock.kernels) == (0.0, 0)
    assert not is_compiling()
