"""Render one chunk on a Dask worker, report its progress, and stop when the chunk is cancelled."""

import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from distributed import Reschedule, Worker, WorkerPlugin, get_worker

from framearray_cli import __version__
from framearray_cli.array.integrity import OnDisk
from framearray_cli.base.errors import BusyError, FrameArrayError, JobError
from framearray_cli.base.forms.table import changed
from framearray_cli.base.hashing import digest
from framearray_cli.base.units import MOST_THREADS
from framearray_cli.engine.kernels.clock import CompileClock, compile_clock
from framearray_cli.engine.terms.ambient.estimate import Ambient
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_of_table

from ..prepare import Prepared
from ..progress import RenderEvents, ambient_figures
from ..render import render
from ..summary import Summary
from ..target.pilot import Target

# Seconds between two checks whether the chunk is still wanted, and between two progress messages.
LOOK_EVERY, SEND_EVERY = 0.2, 0.5
# Seconds that a chunk waits for one still running in this process before Dask reschedules it, and between two attempts
# to lock its cameras.
RETRY_AFTER = 1.0
# Seconds that a chunk waits for cameras that an ending run still locks.
PATIENCE = 60.0

_one_at_a_time = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class Common:
    """Parameters that all chunks of a render share.

    Attributes:
        version: of the program that submits the chunks.
        table: the job, see `job_table`; `file`: its path, for messages.
        folder: of the images; `probe`: a file in it, visible only to workers that see the same folder.
        scene: size and checksum of the scene file.
        threads: per chunk; None: those of the worker.
        memory: bytes that a chunk may take; None: as the job says.
        topic: of messages.
    """

    version: str
    table: dict[str, Any]
    file: str
    folder: str
    probe: str
    scene: tuple[int, str]
    threads: int | None
    memory: int | None
    topic: str

    def job(self, threads: int) -> Job:
        """Return the job of a chunk, on a worker with `threads` threads."""
        found = job_of_table(self.table, Path(self.file), Path(self.folder))
        machine = {"threads": self.threads or found.render.threads or min(threads, MOST_THREADS)}
        machine |= {"memory": self.memory} if self.memory else {}
        return changed(found, render=changed(found.render, **machine))


def worker_problem(common: dict[str, Any]) -> str:
    """Return why this worker cannot render chunks of a job; "" if it can."""
    here = f"worker {socket.gethostname()}"
    if common["version"] != __version__:
        return f"{here}: has framearray {__version__}, expected {common['version']}; install the same version"
    if not Path(common["probe"]).exists():
        return (
            f"{here}: does not see the output folder {common['folder']}; expected one folder for all machines, "
            "under the same name"
        )
    scene = Path(common["table"]["scene"]["file"])
    try:
        same = digest(scene) == tuple(common["scene"])
    except OSError:
        return f"{here}: does not see the scene {scene}; expected it on all machines, under the same name"
    return "" if same else f"{here}: has another file {scene} than the machine that hands out the chunks"


def render_chunk(common: dict[str, Any], cameras: tuple[int, ...]) -> dict[str, Any]:
    """Render some cameras of a job; runs on a worker.

    Errors are returned, so that Dask neither logs them nor retries.

    Args:
        common: the fields of `Common`.

    Returns:
        "notes" and "peak_memory" of the render, or "error" (name of its class), "problems" and "notes".
    """
    worker = get_worker()
    if not _one_at_a_time.acquire(timeout=RETRY_AFTER):
        raise Reschedule
    try:
        if problem := worker_problem(common):
            return {"error": "WorkerError", "problems": [problem], "notes": []}
        reporter = _Reporter(worker, Common(**common), cameras)
        with reporter.watch_task(), compile_clock(lambda: reporter.send(compiling=True)) as reporter.clock:
            job = reporter.common.job(worker.state.nthreads)
            summary = _retry_while_busy(lambda: render(job, reporter, cameras=cameras, pilots=False))
        return {"notes": list(reporter.notes), "peak_memory": summary.peak_memory}
    except FrameArrayError as error:
        problems = list(error.problems) if isinstance(error, JobError) else [str(error)]
        notes = list(getattr(error, "__notes__", ()))
        return {"error": type(error).__name__, "problems": problems, "notes": notes}
    except MemoryError:
        return {"error": "MemoryError", "problems": [], "notes": []}
    except _Unwanted:
        return {}  # the result of a cancelled task is not read
    finally:
        _one_at_a_time.release()


def _retry_while_busy(run: Callable[[], Summary]) -> Summary:
    """Retry while a run that was stopped, or a worker that lost its scheduler, still locks the cameras."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return run()
        except BusyError:
            if time.monotonic() > end:
                raise
            time.sleep(RETRY_AFTER)


class _Unwanted(BaseException):
    """The chunk was cancelled."""


class _Reporter(RenderEvents):
    """Reports the number of images left, and ends the render when the chunk is cancelled."""

    def __init__(self, worker: Worker, common: Common, cameras: tuple[int, ...]) -> None:
        self._worker, self.common, self._first = worker, common, cameras[0]
        self._key = worker.get_current_task()
        self._lock, self._left, self._last = threading.Lock(), 0, 0.0
        self._seconds: float | None = None
        self.clock = CompileClock()
        self._unwanted = False
        self.notes: tuple[str, ...] = ()

    def send(self, **message: Any) -> None:
        """Send a message to the program that submits the chunks."""
        self._worker.log_event(self.common.topic, {"chunk": self._first, **message})

    @contextmanager
    def watch_task(self) -> Iterator[None]:
        """Check regularly whether the chunk is still wanted."""
        done = threading.Event()

        def watch() -> None:
            while not done.wait(LOOK_EVERY):
                task = self._worker.state.tasks.get(self._key)
                if task is None or task.state != "executing":
                    self._unwanted = True
                    return

        thread = threading.Thread(target=watch, name="wanted", daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def _raise_if_unwanted(self) -> None:
        if self._unwanted:
            raise _Unwanted

    def prepared(self, prepared: Prepared) -> None:
        self._raise_if_unwanted()

    def scanned(self, on_disk: OnDisk, wanted: int) -> None:
        self._left = wanted
        self.send(left=wanted)

    def planned(self, ambient: Ambient) -> None:
        self._raise_if_unwanted()
        self.notes = ambient.notes
        self.send(ambient=asdict(ambient_figures(ambient)))

    def loaded(self) -> None:
        if self.clock.kernels:
            self.send(compiled=[self.clock.kernels, self.clock.seconds])

    def expected(self, seconds: float | None) -> None:
        first, self._seconds = self._seconds is None, seconds
        if first and seconds is not None:
            self.send(left=self._left, seconds=seconds)

    def allotted(self, target: Target) -> None:
        self._raise_if_unwanted()
        self.send(target=asdict(target))

    def written(self, images: int) -> None:
        self._raise_if_unwanted()
        with self._lock:
            self._left -= images
            now = time.monotonic()
            if self._left and now - self._last < SEND_EVERY:
                return
            self._last = now
            left = self._left
        self.send(left=left, seconds=self._seconds)


class IgnoreSignals(WorkerPlugin):
    """Makes workers of this machine ignore signals: the terminal sends them Ctrl-C too, but their parent ends them."""

    name = "framearray-signals"

    def setup(self, worker: Worker) -> None:
        if threading.current_thread() is threading.main_thread():
            for name in ("SIGINT", "SIGTERM", "SIGHUP"):
                if hasattr(signal, name):  # Windows lacks the last
                    signal.signal(getattr(signal, name), signal.SIG_IGN)
