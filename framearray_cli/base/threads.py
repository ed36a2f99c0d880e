"""Threads that share tasks, and memory that is freed after them; waits that Ctrl-C ends.

The system may hand a signal to any thread, and Python acts on it when its main thread next runs. A main thread that is
blocked does not run; so it never waits for long at a time.
"""

import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import NoReturn, TypeVar

T = TypeVar("T")

LONGEST_TASK = 10.0  # seconds that Ctrl-C waits for a thread, which may be writing to a disk that hangs
MOMENT = 0.002  # seconds
WAIT = 0.2  # seconds that the main thread waits at a time


def take(queue: SimpleQueue[T]) -> T:
    """Wait until a queue has an item, and take it."""
    while True:
        try:
            return queue.get(timeout=WAIT)
        except Empty:
            continue


def sleep_until_stopped() -> NoReturn:
    """Sleep until Ctrl-C."""
    while True:
        time.sleep(WAIT)


class _Alive:
    """Exists as long as a thread, which holds it."""


class TaskPool(ThreadPoolExecutor):
    """A pool none of whose threads runs after its `with` block; an error drops the tasks that have not begun.

    Ctrl-C comes at any moment: while a thread starts, which `ThreadPoolExecutor` then forgets, or while one is waited
    for, which Python 3.11 then takes for ended. They would go on with arrays, and in a scene, that are freed by then.
    """

    def __init__(self, threads: int, thread_name_prefix: str = "") -> None:
        self._alive = weakref.WeakSet[_Alive]()
        self._own = threading.local()
        super().__init__(threads, thread_name_prefix, initializer=self._begin)

    def _begin(self) -> None:
        """Make the thread that calls this known, before it takes its first task."""
        self._own.alive = _Alive()
        self._alive.add(self._own.alive)

    def close(self, *, drop: bool) -> None:
        """Wait until all threads have ended, for some seconds also if Ctrl-C interrupts that.

        Args:
            drop: whether to drop the tasks that have not begun.
        """
        until = time.monotonic() + LONGEST_TASK
        interruption: BaseException | None = None
        while True:
            try:
                self.shutdown(wait=True, cancel_futures=drop or interruption is not None)
                while self._alive:
                    time.sleep(MOMENT)
                break
            except BaseException as error:
                if time.monotonic() > until:
                    raise
                interruption = error
        if interruption is not None:
            raise interruption

    def __exit__(self, *error: object) -> None:
        self.close(drop=error[0] is not None)
