"""Processes that need the same kernel: one compiles it, the others wait until it is on disk, and load it."""

from contextlib import suppress
from pathlib import Path
from typing import Any

from .clock import counted_as_compiled

# Seconds that a process waits for another one's kernel before it compiles its own: the slowest takes a tenth.
PATIENCE = 60.0


class Claim:
    """The right to compile a kernel, which one process has at a time; the system ends it with the process.

    Processes wait only for kernels that theirs call, which do not call each other in a circle; so none waits for ever.
    """

    def __init__(self, function: Any) -> None:
        self._function = function
        self._lock: Any = None

    def take(self, folder: Path) -> bool:
        """Take the claim, or wait for whoever has it; a folder that cannot be locked gives it at once.

        Args:
            folder: of the kernel.

        Returns:
            whether another process had it; it has probably put the kernel on disk.
        """
        from filelock import FileLock

        if self._lock is None:
            self._lock = FileLock(folder / f"{self._function.__name__}-{self._function.__code__.co_firstlineno}.lock")
        with suppress(OSError, NotImplementedError):  # a folder, or a file system, without locks
            folder.mkdir(parents=True, exist_ok=True)
            try:
                self._lock.acquire(timeout=0)
            except TimeoutError:
                with counted_as_compiled(self._function), suppress(TimeoutError):
                    self._lock.acquire(timeout=PATIENCE, poll_interval=0.02)
                return True
        return False

    def give_back(self) -> None:
        """Let other processes go on."""
        if self._lock is not None:
            self._lock.release()
