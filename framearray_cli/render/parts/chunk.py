"""Render one chunk on a worker, report its progress, and stop when it is cancelled.

A worker process of `render --workers` renders the chunks that come in at stdin, and answers on stdout. Both carry
pickles, for both ends are this program: requests are (what all chunks share, cameras), or None to cancel the chunk in
progress; answers are messages, and at last the result, a dictionary. The process ends with its stdin, which closes
however its parent ends.
"""

import copyreg
import os
import pickle
import queue
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

from framearray_cli import __version__
from framearray_cli.base.errors import BusyError, FrameArrayError, JobError, WorkerError
from framearray_cli.base.files import digest
from framearray_cli.base.forms.table import changed
from framearray_cli.base.platform import ending_signals
from framearray_cli.base.units import MOST_THREADS
from framearray_cli.engine.kernels.clock import CompileClock, compile_clock
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_of_table

from .. import events
from ..events import Event, Progress
from ..manifest import Summary
from ..render import render
from .queue import Message

# An exception is copied with the arguments of its base class, which are others than its own.
copyreg.pickle(JobError, lambda error: (JobError, (error.file, error.problems), error.__dict__))

SEND_EVERY = 0.5  # seconds between two progress messages
RETRY_AFTER = 1.0  # seconds between two attempts to lock the cameras
# Seconds that a chunk waits for cameras that an ending run still locks.
PATIENCE = 60.0
STOPPING = 5.0  # seconds that a cancelled chunk has to stop; a thread that compiles cannot be stopped


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


def render_chunk(
    common: dict[str, Any],
    cameras: tuple[int, ...],
    threads: int,
    send: Callable[[Message], None],
    unwanted: threading.Event,
) -> dict[str, Any]:
    """Render some cameras of a job; runs on a worker.

    Errors are returned, as Dask would take what is raised for a failure of the worker.

    Args:
        common: see `run.py`.
        threads: of this worker, where neither the render nor the job says how many.
        send: passes a message on to the program that hands out the chunks; may be called from any thread.
        unwanted: set when the chunk was cancelled; it then ends at its next image.

    Returns:
        "notes" and "peak_memory" of the render, or an "error"; nothing if it was cancelled.
    """
    try:
        if problem := worker_problem(common):
            return {"error": WorkerError(problem)}
        reporter = _Reporter(cameras[0], send, unwanted)
        with compile_clock(lambda: reporter.send(events.Compiling())) as reporter.clock:
            job = _job(common, threads)
            summary = _retry_while_busy(lambda: render(job, reporter.report, cameras=cameras, pilots=False))
        return {"notes": reporter.notes, "peak_memory": summary.peak_memory_bytes}
    except FrameArrayError as error:
        return {"error": error}
    except MemoryError:
        return {"error": MemoryError()}
    except _Unwanted:
        return {}


def _job(common: dict[str, Any], threads: int) -> Job:
    """Return the job of a chunk, on a worker with `threads` threads."""
    found = job_of_table(common["table"], Path(common["file"]), Path(common["folder"]))
    machine = {"threads": common["threads"] or found.render.threads or min(threads, MOST_THREADS)}
    machine |= {"memory": common["memory"]} if common["memory"] else {}
    return changed(found, render=changed(found.render, **machine))


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


# Events at which a chunk that was cancelled ends.
_STOPS = events.Started, events.AmbientEstimated, events.HitsAllotted, events.ImagesWritten


class _Unwanted(BaseException):
    """The chunk was cancelled."""


class _Reporter:
    """Sends progress and other events, and ends the render when the chunk is cancelled."""

    def __init__(self, first: int, send: Callable[[Message], None], unwanted: threading.Event) -> None:
        self._first, self._send, self._unwanted = first, send, unwanted
        self._lock, self._written, self._wanted, self._last = threading.Lock(), 0, 0, 0.0
        self._seconds: float | None = None
        self.clock = CompileClock()
        self.notes: tuple[str, ...] = ()

    def send(self, event: Event) -> None:
        """Send an event to the program that hands out the chunks."""
        self._send((self._first, event))

    def report(self, event: Event) -> None:
        """Send what the other program counts or prints."""
        if self._unwanted.is_set() and isinstance(event, _STOPS):
            raise _Unwanted
        match event:
            case events.Scanned():
                self._wanted = event.wanted
                self.send(self._progress)
            case events.AmbientEstimated():
                self.notes = event.notes
                self.send(event)
            case events.KernelsLoaded() if self.clock.kernels:
                self.send(events.Compiled(kernels=self.clock.kernels, seconds=self.clock.seconds))
            case events.TimeLeft():
                first, self._seconds = self._seconds is None, event.seconds
                if first and event.seconds is not None:
                    self.send(self._progress)
            case events.HitsAllotted():
                self.send(event)
            case events.ImagesWritten():
                self._count(event.images)

    def _count(self, images: int) -> None:
        """Count written images, and send the rest from time to time."""
        with self._lock:
            self._written += images
            now = time.monotonic()
            if self._written < self._wanted and now - self._last < SEND_EVERY:
                return
            self._last, progress = now, self._progress
        self.send(progress)

    @property
    def _progress(self) -> Progress:
        return Progress(written=self._written, wanted=self._wanted, seconds_left=self._seconds)


# A chunk to render: what all chunks share, its cameras, and an event that says it was cancelled.
_Request: TypeAlias = tuple[dict[str, Any], tuple[int, ...], threading.Event]


def serve() -> None:
    """Render chunks until the sender is gone."""
    for number in ending_signals():  # a terminal sends Ctrl-C to this process too, but its parent ends it
        signal.signal(number, signal.SIG_IGN)
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what libraries print goes to stderr
    sending = threading.Lock()

    def answer(content: Message | dict[str, Any]) -> None:
        with suppress(OSError), sending:  # the parent is gone, which the other thread notices
            pickle.dump(content, answers)
            answers.flush()

    requests: queue.SimpleQueue[_Request | None] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, requests), name="requests", daemon=True).start()
    while (request := requests.get()) is not None:
        common, cameras, unwanted = request
        answer(render_chunk(common, cameras, 1, answer, unwanted))
    os._exit(0)  # nothing is open any more, and modules take long to unload


def _receive(stream: BinaryIO, requests: "queue.SimpleQueue[_Request | None]") -> None:
    """Queue requests as they come; cancel the last one when asked, or when the stream ends."""
    last = threading.Event()
    with suppress(EOFError, OSError, pickle.UnpicklingError):  # the parent ended, perhaps within a request
        while True:
            content = pickle.load(stream)
            if content is not None:
                last = threading.Event()
                requests.put((*content, last))
            else:
                last.set()
    last.set()
    requests.put(None)
    timer = threading.Timer(STOPPING, os._exit, [1])
    timer.daemon = True
    timer.start()
