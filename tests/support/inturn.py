"""Processes that run tests side by side compile each kernel once: one compiles it, the others wait and load it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

_held: set[str] = set()  # source files of kernels that this process compiles


def compile_in_turn() -> None:
    """Have numba load, compile and cache each kernel under a lock, in one process at a time."""
    if sys.platform == "win32":
        return
    compile_at_once: Any = Dispatcher.compile

    def compile_(self: Any, sig: Any) -> Any:
        with global_compiler_lock, _locked(self.py_func.__code__.co_filename):
            return compile_at_once(self, sig)

    Dispatcher.compile = compile_


@contextmanager
def _locked(source: str) -> Iterator[None]:
    """Lock a source file against other processes. Sources import in one direction, so none waits for ever."""
    import fcntl

    if source in _held or not Path(source).is_file():
        yield
        return
    with open(source, "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        _held.add(source)
        try:
            yield
        finally:
            _held.discard(source)
