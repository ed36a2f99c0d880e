"""The threads that work on a frame, the arrays each of them keeps, and memory that goes from frame to frame."""

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any, Self

import numpy as np

from framearray_cli.base.arrays import reshaped, with_room

from ..hits.hits import empty_hits
from ..hits.rays import room_for_hits, room_for_tests
from ..terms.direct_steps import room_for_steps
from .setup import FrameSetup

# Hits of a batch: large enough that calls and changes of threads cost nothing, small enough that a frame has several
# for each thread and that their arrays stay in a core's cache.
BATCH, LARGEST_BATCH, BATCHES_A_THREAD = 2048, 8192, 20
# Rays traced together within a batch.
RAYS = 4096


class ArrayPool:
    """Arrays of frames that were dropped, for the next frame to use: fresh memory costs the system a page at a time.

    Frames have about as many mirror hits as their neighbours; native ones are up to twice as many at the path's ends.
    """

    def __init__(self) -> None:
        self._kept: dict[str, list[Any]] = {}

    def take(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        """An array of a shape, contents arbitrary; kept ones of that name that do not fit are let go."""
        kept = self._kept.get(name, [])
        while kept:
            array = reshaped(kept.pop(), shape)
            if array is not None:
                return array
        return with_room(shape, dtype)

    def give(self, name: str, array: Any) -> None:
        """Put an array back that nobody reads any more."""
        self._kept.setdefault(name, []).append(array)


class Scratch:
    """One thread's arrays, kept from batch to batch."""

    def __init__(self, setup: FrameSetup, batch: int) -> None:
        n_eyes = 4 * setup.n_r + 1
        rays = max(RAYS, batch, setup.obscurance.n_rays)
        self.hit_rays = room_for_hits(rays)
        self.test_rays = room_for_tests(RAYS, setup.lights.n_lights)
        self.hits = empty_hits(batch)
        self.reflected = [empty_hits(batch) for _ in range(2 if setup.depth else 0)]
        self.throughput = [np.empty((batch, 3), np.float32) for _ in self.reflected]
        self.steps = room_for_steps(setup.lights.n_lights) if setup.shadow_step > 1 else None
        full = (0 if setup.keeps_all else batch, setup.lights.channels, setup.lights.n_lights)
        self.irradiance = np.empty(full, np.float32)  # of all lights, where only some are kept
        self.pixel = np.empty((n_eyes, batch), np.int32)
        self.density = np.empty((n_eyes, batch if setup.balance else 0), np.float64)
        self.obscurance = np.empty((batch, 3), np.float32)
        self.skylight = np.empty((batch if setup.obscurance.sky else 0, 3), np.float32)
        self.rays: Counter[str] = Counter()
        self.seconds: defaultdict[str, float] = defaultdict(float)


class TracePool:
    """The threads that work on a frame, and their scratch arrays; they end with the `with` block.

    Attributes:
        batch: how many hits a task finds.
    """

    def __init__(self, setup: FrameSetup, threads: int) -> None:
        self.threads = threads
        hits = setup.n_pixels * float(setup.per_pixel.max())
        self.batch = min(max(int(hits / (BATCHES_A_THREAD * threads)) // BATCH, 1) * BATCH, LARGEST_BATCH)
        self.arrays = ArrayPool()
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="trace")
        self._scratch: SimpleQueue[Scratch] = SimpleQueue()
        self._all = [Scratch(setup, self.batch) for _ in range(threads)]
        for scratch in self._all:
            self._scratch.put(scratch)

    def run(self, task: Callable[[Any, Scratch], Any], items: Iterable[Any]) -> list[Any]:
        """`task(item, scratch)` for every item, in any order on all threads; results in the order of the items.

        Each thread takes one item after another by itself: a thread that is woken for each costs more than small tasks.
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
                waiting.clear()  # what others have begun ends, nothing else begins
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
        """Cut n hits into tasks, (first, number) each; the last quarter in small ones, so that threads end together."""
        large = n - n // 4
        found = [(first, self.batch) for first in range(0, large, self.batch)]
        end = found[-1][0] + self.batch if found else 0
        found += [(first, BATCH) for first in range(end, n, BATCH)]
        return [(first, min(m, n - first)) for first, m in found]

    def rays(self) -> Counter[str]:
        """Rays traced so far, by kind."""
        return sum((scratch.rays for scratch in self._all), Counter())

    def seconds(self) -> dict[str, float]:
        """Thread seconds spent so far, by stage."""
        stages = dict.fromkeys(stage for scratch in self._all for stage in scratch.seconds)
        return {stage: sum(scratch.seconds[stage] for scratch in self._all) for stage in stages}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        """Wait for running tasks and end the threads; rays and seconds can still be read."""
        self._pool.shutdown(wait=True, cancel_futures=True)
