"""Measure compiling: the first run on a machine compiles its kernels for 15 to 30 seconds, others load them."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

# Start times of the functions being compiled, innermost last: within a function numba compiles those that it calls.
_compiling: list[float] = []
# numba also compiles functions of its own; they are part of the kernel that calls them.
_PACKAGE = __name__.partition(".")[0]


@dataclass(slots=True, kw_only=True)
class CompileClock:
    """The time spent compiling so far, in seconds, and the number of kernels compiled."""

    seconds: float = 0.0
    kernels: int = 0


@contextmanager
def compile_clock(
    begins: Callable[[], None] = lambda: None, compiled: Callable[[int], None] = lambda kernels: None
) -> Iterator[CompileClock]:
    """Measure the time spent compiling; kernels loaded from disk do not count.

    Args:
        begins: called once, when the first kernel starts to compile, on any thread.
        compiled: called with the number of kernels so far after each kernel, on any thread.
    """
    from numba.core import event

    clock = CompileClock()
    own: list[float] = []  # start times of this clock; several clocks may run
    done: set[str] = set()  # a kernel that is compiled for two kinds of arguments counts once
    begun = False

    class CompileEvents(event.Listener):
        def on_start(self, event: Any) -> None:
            nonlocal begun
            if not begun:
                begun = True
                begins()
            own.append(time.perf_counter())
            _compiling.append(own[-1])

        def on_end(self, event: Any) -> None:
            if not own:  # it began before this clock, on another thread
                return
            _compiling.pop()
            started = own.pop()
            if not own:
                clock.seconds += time.perf_counter() - started
            if (name := _kernel_name(event.data)) and name not in done:
                done.add(name)
                clock.kernels = len(done)
                compiled(clock.kernels)

    with event.install_listener("numba:compile", CompileEvents()):
        yield clock


def counted_as_compiled(function: Any) -> AbstractContextManager[None]:
    """Count a kernel that another process compiles as one compiled within the block."""
    from numba.core import event

    return event.trigger_event("numba:compile", data={"dispatcher": SimpleNamespace(py_func=function)})


def _kernel_name(data: Any) -> str:
    """Return the name of a compiled function of this package, else ""; `data` comes from numba's event."""
    function = getattr(data.get("dispatcher"), "py_func", None)
    module = getattr(function, "__module__", "")
    return f"{module}.{function.__qualname__}" if function and module.partition(".")[0] == _PACKAGE else ""


def is_compiling() -> bool:
    """Return True if a kernel is being compiled; known within `compile_clock` only."""
    return bool(_compiling)
