"""Threads that share tasks, and memory that is freed after them."""

import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType

LONGEST_TASK = 10.0  # seconds after which Ctrl-C leaves a thread alone: its disk may not answer
MOMENT = 0.002  # seconds


class TaskPool(ThreadPoolExecutor):
    """A pool none of whose threads runs after its `with` block; an error drops the tasks that have not begun.

    Ctrl-C comes at any moment: while a thread starts, which `ThreadPoolExecutor` then forgets, or while one is waited
    for, which Python 3.11 then takes for ended. They would go on with arrays, and in a scene, that are freed by then.
    """

    def __init__(self, threads: int, thread_name_prefix: str = "") -> None:
        self._numbers: list[int] = []
        super().__init__(threads, thread_name_prefix, initializer=self._begin)

    def _begin(self) -> None:
        """Make the thread that calls this known, before it takes its first task."""
        self._numbers.append(threading.get_ident())

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
                while not sys._current_frames().keys().isdisjoint(self._numbers):
                    time.sleep(MOMENT)
                break
            except BaseException as error:
                if time.monotonic() > until:
                    raise
                interruption = error
        if interruption is not None:
            raise interruption

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(drop=error is not None)
