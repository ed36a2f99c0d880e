"""Notices when kernels are compiled: the first run on a machine does that for about a minute, later ones not at all."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True, kw_only=True)
class CompileClock:
    """How long kernels were compiled so far, seconds."""

    seconds: float = 0.0


@contextmanager
def compile_clock(begins: Callable[[], None] = lambda: None) -> Iterator[CompileClock]:
    """Measure the time that goes into compiling; kernels that are loaded from the disk do not count.

    Args:
        begins: called when the first kernel starts to compile, from any thread.
    """
    from numba.core import event

    clock = CompileClock()
    # Numba compiles one function at a time, and those that it calls within it: only the outermost is timed.
    starts: list[float] = []

    class Listener(event.Listener):
        def on_start(self, event: object) -> None:
            if not starts and clock.seconds == 0.0:
                begins()
            starts.append(time.perf_counter())

        def on_end(self, event: object) -> None:
            started = starts.pop()
            if not starts:
                clock.seconds += time.perf_counter() - started

    with event.install_listener("numba:compile", Listener()):
        yield clock
