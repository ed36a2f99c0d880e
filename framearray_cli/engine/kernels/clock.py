"""Measure compiling: the first run on a machine compiles kernels for up to a minute, later runs load them."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

# Start times of the functions being compiled, innermost last: within a function numba compiles those that it calls.
_compiling: list[float] = []


@dataclass(slots=True, kw_only=True)
class CompileClock:
    """The time spent compiling so far, in seconds."""

    seconds: float = 0.0


@contextmanager
def compile_clock(begins: Callable[[], None] = lambda: None) -> Iterator[CompileClock]:
    """Measure the time spent compiling; kernels loaded from disk do not count.

    Args:
        begins: called once, when the first kernel starts to compile, on any thread.
    """
    from numba.core import event

    clock = CompileClock()
    own: list[float] = []  # start times of this clock; several clocks may run

    class CompileEvents(event.Listener):
        def on_start(self, event: object) -> None:
            if not own and clock.seconds == 0.0:
                begins()
            own.append(time.perf_counter())
            _compiling.append(own[-1])

        def on_end(self, event: object) -> None:
            _compiling.pop()
            started = own.pop()
            if not own:
                clock.seconds += time.perf_counter() - started

    with event.install_listener("numba:compile", CompileEvents()):
        yield clock


def is_compiling() -> bool:
    """Whether a kernel is being compiled; known within `compile_clock` only."""
    return bool(_compiling)
