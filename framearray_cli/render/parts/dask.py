"""Workers of a running Dask scheduler, on this machine and others."""

import logging
import pickle
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import Any

from framearray_cli import __version__
from framearray_cli.base.errors import JobError, WorkerError
from framearray_cli.base.extras import extra

from .chunk import RETRY_AFTER, render_chunk, worker_problem
from .queue import ChunkDiedError, Crew, Handed, Message

PATIENCE = 10.0  # seconds in which a scheduler must answer, even on a busy machine
SILENT = logging.CRITICAL + 1
LOST = "the Dask scheduler has gone away"
LOOK_EVERY = 0.2  # seconds between two checks whether the chunk is still wanted

_one_at_a_time = threading.Lock()


def require_dask() -> Any:
    """Import Dask distributed and silence its log.

    Raises:
        MissingExtraError: Dask distributed is not installed.
    """
    with extra("--dask needs Dask distributed", "[dask]"):
        import distributed
    for name in list(logging.root.manager.loggerDict):  # this program reports what matters, in its own words
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(SILENT)
    return distributed


@contextmanager
def connect(address: str) -> Iterator["DaskCrew"]:
    """Connect to a scheduler.

    Raises:
        MissingExtraError: Dask distributed is not installed.
        JobError: no scheduler answers at that address.
    """
    distributed = require_dask()
    found: SimpleQueue[Any] = SimpleQueue()

    def open_client() -> None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found.put(distributed.Client(address, timeout=PATIENCE, set_as_default=False))
        except Exception as error:  # of any kind, if something other than a scheduler answers
            found.put(error)

    # Dask's own timeout does not hold if something other than a scheduler answers
    threading.Thread(target=open_client, name="connect", daemon=True).start()
    try:
        client = found.get(timeout=PATIENCE + 1.0)
    except Empty:
        client = TimeoutError()
    if isinstance(client, Exception):
        late = isinstance(client, OSError | MemoryError)  # Dask reads the answer of another program as a huge message
        why = f"none answered within {PATIENCE:.0f} s" if late else str(client)
        wanted = 'expected the address of a Dask scheduler, such as "tcp://host:8786"'
        raise JobError(f"--dask {address}", [f"{wanted}; {why}"]) from client
    try:
        yield DaskCrew(client)
    finally:
        with suppress(OSError, TimeoutError):
            client.close(timeout=PATIENCE)


class DaskCrew(Crew):
    """The workers of a scheduler; they may join and leave at any time."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def count(self) -> int:
        try:
            if self._client.status == "running":
                return len(self._client.nthreads())
        except (OSError, CancelledError) as error:
            raise WorkerError(LOST) from error
        raise WorkerError(LOST)

    def require_fit(self, common: dict[str, Any]) -> None:
        for address, found in self._client.run(worker_problem, common, on_error="return").items():
            if isinstance(found, BaseException) and lacks_program(found):
                found = f"worker {address}: lacks framearray {common['version']}; install it there"
            elif isinstance(found, BaseException):
                found = f"worker {address}: {found}"
            if found:
                raise WorkerError(found)

    def listen(self, topic: str, receive: Callable[[Message], None]) -> None:
        self._client.subscribe_topic(topic, lambda event: receive(pickle.loads(event[1])))

    def submit(self, common: dict[str, Any], cameras: tuple[int, ...]) -> Handed:
        handed: Handed = self._client.submit(run_chunk, common, cameras, pure=False)
        return handed

    def result(self, handed: Handed) -> dict[str, Any]:
        from distributed import KilledWorker

        try:
            return handed.result()
        except CancelledError as error:
            raise WorkerError(LOST) from error
        except KilledWorker as error:
            raise ChunkDiedError("run fewer workers per machine, or read their logs") from error
        except Exception as error:
            if not lacks_program(error):
                raise
            raise WorkerError(f"a worker that came later: lacks framearray {__version__}; install it there") from error

    def cancel(self, handed: Sequence[Handed]) -> None:
        with suppress(Exception):  # the scheduler may be gone; report the error that stopped the render
            self._client.cancel(list(handed), force=True)


def lacks_program(error: BaseException | None) -> bool:
    """True if a worker could not import this program; Dask may pass on only the text of the error."""
    while error is not None:
        if isinstance(error, ImportError) or "ModuleNotFoundError" in str(error) or "ImportError" in str(error):
            return True
        error = error.__cause__
    return False


def run_chunk(common: dict[str, Any], cameras: tuple[int, ...]) -> dict[str, Any]:
    """Render some cameras of a job, see `chunk.render_chunk`; runs on a Dask worker."""
    from distributed import Reschedule, get_worker

    worker = get_worker()
    if not _one_at_a_time.acquire(timeout=RETRY_AFTER):  # one that was cancelled is still running in this process
        raise Reschedule
    try:
        with _watch_task(worker) as unwanted:

            def send(message: Message) -> None:
                worker.log_event(common["topic"], pickle.dumps(message))  # Dask passes on plain data only

            return render_chunk(common, cameras, worker.state.nthreads, send, unwanted)
    finally:
        _one_at_a_time.release()


@contextmanager
def _watch_task(worker: Any) -> Iterator[threading.Event]:
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
