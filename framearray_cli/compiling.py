"""Notices when kernels are compiled: the first run on a machine does that for up to a minute, later ones not at all."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

# When each function that is being compiled was begun. Numba compiles one at a time, and within it those that it calls.
_begun: list[float] = []


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
    own: list[float] = []  # of this clock: there may be several

    class CompileEvents(event.Listener):
        def on_start(self, event: object) -> None:
            if not own and clock.seconds == 0.0:
                begins()
            own.append(time.perf_counter())
            _begun.append(own[-1])

        def on_end(self, event: object) -> None:
            _begun.pop()
            started = own.pop()
            if not own:
                clock.seconds += time.perf_counter() - started

    with event.install_listener("numba:compile", CompileEvents()):
        yield clock


def is_compiling() -> bool:
    """Whether a kernel is being compiled, within `compile_clock`."""
    return bool(_begun)
