"""Render a job from Python: in a thread of its own, with events."""

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from queue import SimpleQueue

from framearray_cli.array.places import read_indices
from framearray_cli.base.errors import FrameArrayError, JobError
from framearray_cli.job.job import Job
from framearray_cli.render import events
from framearray_cli.render.events import Event

from .arguments import arguments_named, rename_options
from .array import FrameArray, open_array
from .jobs import JobSource, load_job

EVERY = 0.1  # seconds between two events of progress


class RenderCancelled(FrameArrayError):  # what happened is no error
    """A render was cancelled; finished images stay, and the next run renders the rest."""


def render(
    job: JobSource,
    *,
    on_event: Callable[[Event], object] | None = None,
    output: str | os.PathLike[str] | None = None,
    cameras: str | Sequence[int] | None = None,
    restart: bool = False,
    threads: int | None = None,
    sets: str | Sequence[str] = (),
) -> FrameArray:
    """Render a frame array, or what is missing of it, and return it.

    Ctrl-C, and an error in `on_event`, end the render after the frame in progress; finished images stay, and the next
    call renders the rest.

    Args:
        job: a job file; the tables of one, with file names relative to the current folder; or a `Job`.
        on_event: called with each event, in the thread that called `render`.
        output: folder for the images, instead of the job's.
        cameras: camera positions to render, as places ("0-47", "0-47x3") or indices; None: all.
        restart: first remove the array in the folder; otherwise another array there is an error.
        threads: instead of the job's.
        sets: "KEY=VALUE" texts that replace keys of the job, as `framearray render --set` takes them; one, or several.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: a file could not be written, or another array is in the folder.
        BusyError: another run renders these camera positions.
    """
    run = rendering(job, output=output, cameras=cameras, restart=restart, threads=threads, sets=sets)
    for event in run:
        if on_event is not None:
            on_event(event)
    return run.result()


@arguments_named()
def rendering(
    job: JobSource,
    *,
    output: str | os.PathLike[str] | None = None,
    cameras: str | Sequence[int] | None = None,
    restart: bool = False,
    threads: int | None = None,
    sets: str | Sequence[str] = (),
) -> "Rendering":
    """Prepare a render whose events are iterated over; arguments as for `render`.

    Raises:
        JobError: the job has problems.
    """
    checked = load_job(job, output=output, threads=threads, sets=sets)
    n = checked.camera.frames
    chosen = cameras if cameras is None or isinstance(cameras, str) else ",".join(str(int(c)) for c in cameras)
    if cameras is not None and not isinstance(cameras, str) and not chosen:
        raise JobError("cameras", ["expected at least one camera position, got an empty list"])
    return Rendering(checked, None if chosen is None else sorted(read_indices("cameras", chosen, n)), restart=restart)


class Rendering:
    """A render in a thread of its own, which begins when its events are asked for.

    The loop over events owns the render: leaving it early (`break`, an error) cancels it, and waits until the frame in
    progress is done. An error of the render is raised in the loop.

        run = framearray.rendering("room.toml")
        for event in run:
            ...
        array = run.result()
    """

    def __init__(self, job: Job, cameras: Sequence[int] | None, *, restart: bool) -> None:
        """Begin nothing yet; `job` is checked."""
        self._job, self._cameras, self._restart = job, cameras, restart
        self._events = SimpleQueue[Event | None]()  # None: the end
        self._thread = threading.Thread(target=self._run, name="framearray-render")
        self._cancelled, self._error = threading.Event(), list[BaseException]()
        self._lock = threading.Lock()  # of those below
        self._left: float | None = None
        self._written, self._wanted, self._reported, self._done = 0, 0, 0.0, False

    def __iter__(self) -> Iterator[Event]:
        if self._thread.ident is not None:
            raise RuntimeError("events of a render can be read once")
        self._thread.start()
        try:
            while (event := self._events.get()) is not None:
                yield event
        finally:
            self.cancel()
            self._thread.join()
        if self._error and not isinstance(self._error[0], RenderCancelled):
            raise self._error[0]

    def cancel(self) -> None:
        """End the render after the frame in progress; from any thread. Without effect when it is done."""
        self._cancelled.set()

    def result(self) -> FrameArray:
        """Wait for the end, and return the array.

        Raises:
            RenderCancelled: the render was cancelled.
            FrameArrayError: what ended it, as of `render`.
        """
        if self._thread.ident is None:
            for _ in self:
                pass
        self._thread.join()
        if self._error:
            raise self._error[0]
        return open_array(self._job.output.directory)

    def _run(self) -> None:
        """Render, in the thread."""
        try:
            self._render()
        except BaseException as error:  # whatever it is, it is raised where the events are read
            rename_options(error)
            self._error.append(error)
        finally:
            self._events.put(None)

    def _render(self) -> None:
        self._stop_if_cancelled()
        from framearray_cli.engine.kernels.clock import compile_clock
        from framearray_cli.render.precompile import offer_for
        from framearray_cli.render.render import render as render_job

        offer_for(self._job)
        with compile_clock(lambda: self._report(events.Compiling())) as clock:
            summary = render_job(self._job, self._report, restart=self._restart, cameras=self._cameras)
        self._events.put(events.Finished(summary=summary.result(clock.seconds), notes=summary.notes))

    def _stop_if_cancelled(self) -> None:
        """Raise `RenderCancelled` between two steps of a cancelled render, in its own thread."""
        if self._cancelled.is_set() and threading.current_thread() is self._thread:
            raise RenderCancelled(f"{self._job.name}: the render was cancelled; the next run renders the rest")

    def _report(self, event: Event) -> None:
        """Pass an event on; images and time become progress."""
        match event:
            case events.TimeLeft():
                self._progress(0, event.seconds)
            case events.ImagesWritten():
                self._progress(event.images, self._left)
            case _:
                if isinstance(event, events.Scanned):
                    self._wanted = event.wanted
                self._events.put(event)
        if not isinstance(event, events.ImagesWritten | events.FrameWritten):
            self._stop_if_cancelled()

    def _progress(self, images: int, left: float | None) -> None:
        """Report progress, unless that was done just now; the last image always."""
        with self._lock:
            self._written, self._left = self._written + images, left
            now, done = time.monotonic(), self._written == self._wanted
            if now - self._reported < EVERY and not (done and not self._done):
                return
            self._reported, self._done = now, done
            self._events.put(events.Progress(written=self._written, wanted=self._wanted, seconds_left=self._left))
