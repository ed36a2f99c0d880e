"""The threads that find and compose frames."""

from collections import Counter, deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any, Self

from framearray_cli.base.threads import TaskPool

from .records import ArrayPool, bytes_per_hit
from .setup import FrameSetup, Scratch

# Number of hits per batch: large enough that calls and changes of threads cost nothing, small enough that a frame has
# several batches per thread and that the arrays of a batch stay in a core's cache.
BATCH, LARGEST_BATCH, BATCHES_PER_THREAD = 2048, 8192, 20
# Bytes of the light of a batch, unless the smallest one needs more.
LIGHT_ROOM = 1 << 22


class TracePool:
    """The threads that trace rays and compose, each with scratch arrays of its own; they end with the `with` block.

    Attributes:
        threads: number of threads.
        batch: number of hits per task.
        arrays: memory that eyes hand on.
    """

    def __init__(self, setup: FrameSetup, threads: int) -> None:
        self.threads = threads
        hits = setup.n_zone * float(setup.per_pixel.max()) / (BATCHES_PER_THREAD * threads)
        bytes_of_light = bytes_per_hit(setup.columns()) - bytes_per_hit(setup.kept_columns())
        most = min(hits, LARGEST_BATCH, LIGHT_ROOM / max(bytes_of_light, 1))
        self.batch = max(int(most) // BATCH, 1) * BATCH
        self.arrays = ArrayPool()
        self._pool = TaskPool(threads, thread_name_prefix="trace")
        self._scratch: SimpleQueue[Scratch] = SimpleQueue()
        self._all = [Scratch(setup, self.batch) for _ in range(threads)]
        for scratch in self._all:
            self._scratch.put(scratch)

    def run(self, task: Callable[[Any, Scratch], Any], items: Iterable[Any]) -> list[Any]:
        """Call `task(item, scratch)` for all items, in any order on all threads; return results in the items' order.

        Each thread takes items until none is left: waking a thread per item would cost more than a small task.
        An error in a task stops the others after their current items, and is raised here.
        """
        waiting = deque(enumerate(items))
        results: list[Any] = [None] * len(waiting)

        def take_turns() -> None:
            scratch = self._scratch.get()
            try:
                while waiting:
                    try:
                        i, item = waiting.popleft()
                    except IndexError:  # another thread took the last one
                        return
                    results[i] = task(item, scratch)
            except BaseException:
                waiting.clear()  # the other threads finish their current items and take no more
                raise
            finally:
                self._scratch.put(scratch)

        futures: list[Future[None]] = [self._pool.submit(take_turns) for _ in range(min(self.threads, len(results)))]
        try:
            for future in futures:
                future.result()
        finally:
            waiting.clear()  # after Ctrl-C, too
        return results

    def batches(self, n: int) -> list[tuple[int, int]]:
        """Cut n hits into tasks (first, number); the last quarter into small ones, so that threads end together."""
        large = n - n // 4
        found = [(first, self.batch) for first in range(0, large, self.batch)]
        end = found[-1][0] + self.batch if found else 0
        found += [(first, BATCH) for first in range(end, n, BATCH)]
        return [(first, min(m, n - first)) for first, m in found]

    def rays(self) -> Counter[str]:
        """Number of rays traced so far, by kind."""
        return sum((scratch.rays for scratch in self._all), Counter())

    def seconds(self) -> dict[str, float]:
        """Thread seconds spent so far, by stage."""
        stages = dict.fromkeys(stage for scratch in self._all for stage in scratch.seconds)
        return {stage: sum(scratch.seconds[stage] for scratch in self._all) for stage in stages}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        """Wait for running tasks and end the threads; rays and seconds can still be read."""
        self._pool.close(drop=True)
