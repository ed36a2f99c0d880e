"""A second process that compiles kernels next to this one: compiling is mostly Python, which runs on one thread.

The command line offers the code that the process would run (`offer`), in the order that suits it. It starts at once if
no kernel is on disk, else when the first is missing (`start`). Its kernels are on disk when this process needs them
(`machine_code.py`). It ends with this one.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from framearray_cli.base.memory import available_cores, free_memory
from framearray_cli.base.platform import python_command, python_environment

from .cache import kept_kernels, kernel_folder

# Processes that compile; 1: no other.
PROCESSES = "FRAMEARRAY_COMPILERS"
# Free memory without which there is no second process, bytes; it takes a third.
NEEDS = 2**30


class KernelTakenError(Exception):
    """Another process compiles a kernel."""


_without_waiting: list[None] = []  # an entry for each block that does not wait
_offered: list[str] = []
_started: list[tuple[float, subprocess.Popen[bytes]]] = []


def offer(code: str, arguments: Sequence[str] = ()) -> None:
    """Set the code of the second process, if kernels must be compiled at all and a core is free for it.

    Args:
        code: Python code, which calls `end_with_parent` first.
    """
    if os.environ.get(PROCESSES) != "1" and available_cores() > 1 and sys.executable and kernel_folder():
        _offered[:] = python_command(code, arguments)
        if not kept_kernels():
            start()


def start() -> None:
    """Start the second process, once."""
    if not _offered or free_memory() < NEEDS:
        return
    command, _offered[:] = list(_offered), []
    with suppress(OSError):  # no memory, or no more processes: this one compiles all
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=python_environment(**{PROCESSES: "1"}),
        )  # fmt: skip
        _started.append((time.time(), process))


def stop() -> None:
    """End the second process, and start none from now on: all kernels are there, and frames take every core."""
    _offered.clear()
    for _, process in _started:
        if process.stdin is not None:
            process.stdin.close()


@contextmanager
def without_waiting() -> Iterator[None]:
    """Raise `KernelTakenError` within the block instead of waiting for another process's kernel."""
    _without_waiting.append(None)
    try:
        yield
    finally:
        _without_waiting.pop()


def expect_to_wait() -> None:
    """Raise `KernelTakenError` if the caller must not wait for another process's kernel."""
    if _without_waiting:
        raise KernelTakenError


def has_made(file: Path) -> bool:
    """Return True if a kernel was put on disk since the second process started."""
    with suppress(OSError):
        return bool(_started) and file.stat().st_mtime >= _started[0][0]
    return False


def end_with_parent() -> None:
    """End this process, at once, as soon as the one that started it is gone; a Ctrl-C is meant for that one."""
    import signal
    import threading

    def wait() -> None:
        with suppress(OSError):
            os.read(0, 1)  # returns when the other end is closed, however the parent ended
        os._exit(0)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=wait, daemon=True).start()
