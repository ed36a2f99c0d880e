"""What runs on a Dask worker: a chunk, which stops when its task is cancelled."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from distributed import Reschedule, Worker, get_worker

from .chunk import RETRY_AFTER, render_chunk

LOOK_EVERY = 0.2  # seconds between two checks whether the chunk is still wanted

_one_at_a_time = threading.Lock()


def run_chunk(common: dict[str, Any], cameras: tuple[int, ...]) -> dict[str, Any]:
    """Render some cameras of a job, see `chunk.render_chunk`."""
    worker = get_worker()
    if not _one_at_a_time.acquire(timeout=RETRY_AFTER):  # one that was cancelled is still running in this process
        raise Reschedule
    try:
        with _watch_task(worker) as unwanted:
            threads = worker.state.nthreads
            return render_chunk(
                common, cameras, threads, lambda message: worker.log_event(common["topic"], message), unwanted
            )
    finally:
        _one_at_a_time.release()


@contextmanager
def _watch_task(worker: Worker) -> Iterator[threading.Event]:
    """Check regularly whether the task of this thread is still wanted; yield an event that says it is not."""
    key, done, unwanted = worker.get_current_task(), threading.Event(), threading.Event()

    def watch() -> None:
        while not done.wait(LOOK_EVERY):
            task = worker.state.tasks.get(key)
            if task is None or task.state != "executing":
                unwanted.set()
                return

    thread = threading.Thread(target=watch, name="wanted", daemon=True)
    thread.start()
    try:
        yield unwanted
    finally:
        done.set()
        thread.join()
