"""Threads that share tasks."""

from concurrent.futures import ThreadPoolExecutor
from types import TracebackType


class TaskPool(ThreadPoolExecutor):
    """A pool whose `with` block ends when no thread runs any more; an error drops the tasks that have not begun."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.shutdown(wait=True, cancel_futures=error is not None)
