"""Chunks of consecutive frames of the camera path: split off it, queued, and rendered, one per worker.

Each chunk is rendered independently. The hits of the N_r frames on either side of it, its halo, reach into it too, so
the chunk traces them, and so does the neighbour chunk that holds these frames. The worker processes of this machine
need only the standard library; one that dies is replaced.
"""

import os
import pickle
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TypeAlias

import numpy as np

from framearray_cli.array.places import frames_text
from framearray_cli.base.errors import OutputError, WorkerError
from framearray_cli.base.files import reason
from framearray_cli.base.platform import python_command, python_environment

from ..events import Chunks, Event, ImagesWritten, Progress, Report, TimeLeft
from ..session import RenderSession

# Default frames of a chunk, per frame of N_r: the halo of 2 N_r frames is a quarter of it.
FRAMES_PER_N_R = 8
# Least default: without reuse there is no halo, but each chunk reads the scene and estimates the ambient light again.
FEWEST = 16


def split_cameras(cameras: Sequence[int], size: int) -> list[tuple[int, ...]]:
    """Split cameras, in rising order, into the fewest chunks of at most `size`, of almost equal length."""
    count = -(-len(cameras) // size)
    return [tuple(chunk.tolist()) for chunk in np.array_split(np.asarray(cameras, int), count)] if count else []


def default_size(n: int, n_r: int, workers: int = 1) -> int:
    """Return the default frames of a chunk: at most `FRAMES_PER_N_R` N_r, and a whole number of chunks per worker.

    Args:
        n: number of frames to render.
    """
    most = max(FRAMES_PER_N_R * n_r, FEWEST)
    return max(-(-n // (workers * -(-n // (workers * most)))), 1) if n else 1


def plan_chunks(cameras: Sequence[int], size: int, n_r: int, *, still: bool = False) -> Chunks:
    """Split cameras into chunks and compute the cost.

    Args:
        still: whether the camera never moves, so that every chunk traces the same single frame.
    """
    each = split_cameras(cameras, size)
    if still or not each:
        return Chunks(each=tuple(each), more=float(max(len(each) - 1, 0)))

    def found(chunk: Sequence[int]) -> float:
        """Count eyes whose hits a chunk shows; before and after the path they repeat its frames."""
        return float(len({eye for j in chunk for eye in range(j - n_r, j + n_r + 1)}))

    return Chunks(each=tuple(each), more=sum(map(found, each)) / found(cameras) - 1.0)


STOPPING = 5.0  # seconds that workers get to stop
Message: TypeAlias = tuple[int, Event]  # the first camera of a chunk, and what happened to it
Handed: TypeAlias = Future[dict[str, Any]]  # a chunk that was handed to a worker; a future of Dask has the same methods


class ChunkDiedError(Exception):
    """The workers that rendered a chunk died; the text says what to do, as the end of a message."""


class Crew(Protocol):
    """Workers."""

    def count(self) -> int:
        """Return the number of workers.

        Raises:
            WorkerError: none can be reached any more.
        """

    def require_fit(self, common: dict[str, Any]) -> None:
        """Check that all workers can render the job.

        Raises:
            WorkerError: one cannot.
        """

    def listen(self, topic: str, receive: Callable[[Message], None]) -> None:
        """Have the messages of all workers about a render handed to a function, in threads of the crew."""

    def submit(self, common: dict[str, Any], cameras: tuple[int, ...]) -> Handed:
        """Hand a chunk to a worker that has none.

        Raises:
            WorkerError: instead of one that died, no other can be started.
        """

    def result(self, handed: Handed) -> dict[str, Any]:
        """Return what `chunk.render_chunk` returned for a chunk that has ended.

        Raises:
            ChunkDiedError: workers died on it.
            WorkerError: the worker cannot render, or can no longer be reached.
        """

    def cancel(self, handed: Sequence[Handed]) -> None:
        """Stop chunks at their next images; do not wait."""


class ChunkPace:
    """Time that workers expect for their chunks, and from it for the chunks that wait."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begun: dict[int, tuple[float, int]] = {}  # by chunk: when, and its images
        self._ends: dict[int, float] = {}  # by chunk: when it is expected to end

    def begin(self, chunk: int, images: int) -> None:
        """A worker begins a chunk, named by its first camera."""
        self._begun[chunk] = self._clock(), images
        self._ends.pop(chunk, None)

    def expect(self, chunk: int, seconds: float) -> None:
        """A worker expects its chunk to take that much longer."""
        self._ends[chunk] = self._clock() + seconds

    def left(self, images: Mapping[int, int]) -> float | None:
        """Return the expected seconds until the end of all chunks; None: not known yet.

        Args:
            images: the number that is left, of every chunk that has not ended.
        """
        known = {chunk: end for chunk, end in self._ends.items() if chunk in self._begun}
        if not known:
            return None
        now = self._clock()
        at_work = [max(end - now, 0.0) for chunk, end in known.items() if chunk in images]
        each = sum((end - self._begun[chunk][0]) / max(self._begun[chunk][1], 1) for chunk, end in known.items())
        waiting = sum(left for chunk, left in images.items() if chunk not in known) * each / len(known)
        workers = max(len([chunk for chunk in self._begun if chunk in images]), 1)
        return max([*at_work, (sum(at_work) + waiting) / workers])


LOOK_EVERY = 0.5  # seconds between two checks for results
# Times that a process may die on a chunk, or that Dask may give it up because several did, without a further image.
MOST_DEATHS = 2


class ChunkQueue:
    """The chunks of a render: those waiting, and those in progress on workers."""

    def __init__(
        self, crew: Crew, common: dict[str, Any], chunks: Chunks, session: RenderSession, report: Report
    ) -> None:
        self._crew, self._common, self._report, self._folder = crew, common, report, session.folder
        self._waiting = list(reversed(chunks.each))
        self._at_work: dict[Handed, tuple[int, ...]] = {}
        self._left = {chunk[0]: len(chunk) * session.prepared.n_lights for chunk in chunks.each}
        self._chunk_ended, self._lock = threading.Event(), threading.Lock()  # set when a chunk ends; guards the counts
        self._pace = ChunkPace()
        self._deaths: dict[int, tuple[int, int]] = {}  # by chunk: number of deaths, and images left at the last
        self._received: set[type[Event]] = set()
        self.notes: tuple[str, ...] = ()
        self.peak_memory = self.images = 0
        crew.listen(common["topic"], self._receive)

    def render_all(self) -> None:
        """Submit chunks until all are rendered.

        Raises:
            FrameArrayError: the first error of a worker.
        """
        while self._waiting or self._at_work:
            for _ in range(max(self._crew.count(), 1) - len(self._at_work)):
                if self._waiting:
                    self._submit(self._waiting.pop())
            self._chunk_ended.wait(LOOK_EVERY)
            self._chunk_ended.clear()
            for handed in [handed for handed in self._at_work if handed.done()]:
                self._collect(handed, self._at_work.pop(handed))

    def _submit(self, chunk: tuple[int, ...]) -> None:
        handed = self._crew.submit(self._common, chunk)
        self._at_work[handed] = chunk
        self._pace.begin(chunk[0], self._left[chunk[0]])
        handed.add_done_callback(lambda _: self._chunk_ended.set())

    def _collect(self, handed: Handed, chunk: tuple[int, ...]) -> None:
        """Take the result of a chunk."""
        try:
            result = self._crew.result(handed)
        except ChunkDiedError as error:
            self._retry(chunk, error)
            return
        if "error" in result:
            raise result["error"]
        self._count_written(chunk[0], 0, last=True)
        self.notes = tuple(dict.fromkeys((*self.notes, *result["notes"])))
        self.peak_memory = max(self.peak_memory, result["peak_memory"])

    def _retry(self, chunk: tuple[int, ...], error: ChunkDiedError) -> None:
        """Queue a chunk again that workers died on, if it progressed meanwhile.

        Raises:
            WorkerError: it did not progress.
        """
        first = chunk[0]
        deaths, left = self._deaths.get(first, (0, -1))
        deaths = deaths + 1 if self._left[first] == left else 1
        if deaths > MOST_DEATHS:
            raise WorkerError(
                f"cameras {frames_text(chunk)}: workers died on them again and again, most likely of too little "
                f"memory; {error}"
            ) from error
        self._deaths[first] = deaths, self._left[first]
        self._waiting.append(chunk)

    def _receive(self, message: Message) -> None:
        """Count the progress of a worker; report the first of other events, which all workers send; in any thread."""
        chunk, event = message
        if isinstance(event, Progress):
            self._count_written(chunk, event.wanted - event.written)
            if event.seconds_left is not None:
                self._pace.expect(chunk, event.seconds_left)
                self._report(TimeLeft(seconds=self._pace.left(self._left)))
        elif type(event) not in self._received:
            self._received.add(type(event))
            self._report(event)

    def _count_written(self, chunk: int, left: int, *, last: bool = False) -> None:
        """Count the images that a chunk has written; ignore messages that arrive after its end."""
        with self._lock:
            if chunk not in self._left:
                return
            written, self._left[chunk] = self._left[chunk] - left, left
            if last:
                del self._left[chunk]
            self.images += written
        if written:
            self._report(ImagesWritten(images=written))

    def stop(self) -> None:
        """Cancel all chunks, and wait briefly until workers have released the folder."""
        self._crew.cancel(list(self._at_work))
        end = time.monotonic() + STOPPING
        with suppress(OutputError):
            while time.monotonic() < end:
                with self._folder.exclusive():
                    if not self._folder.other_locks():
                        return
                time.sleep(0.1)


CODE = "from framearray_cli.render.parts.chunk import serve; serve()"
# Rendering does not use the threads of linear algebra, which take memory; a user's own setting holds.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class LocalCrew(Crew):
    """Worker processes, each with at most one chunk; those that died are started again when they are needed."""

    def __init__(self, processes: "Sequence[_WorkerProcess]") -> None:
        self._processes = processes

    def count(self) -> int:
        return len(self._processes)

    def require_fit(self, common: dict[str, Any]) -> None:
        """Accept all: it is the same program on the same machine."""

    def listen(self, topic: str, receive: Callable[[Message], None]) -> None:
        for process in self._processes:
            process.receive = receive

    def submit(self, common: dict[str, Any], cameras: tuple[int, ...]) -> Handed:
        idle = next(process for process in self._processes if process.is_idle)
        return idle.submit(common, cameras)

    def result(self, handed: Handed) -> dict[str, Any]:
        return handed.result()

    def cancel(self, handed: Sequence[Handed]) -> None:
        for process in self._processes:  # these are all chunks that there are
            process.send(None)


class _WorkerProcess:
    """A worker process, and the chunk that it renders."""

    def __init__(self) -> None:
        self.receive: Callable[[Message], None] = lambda _: None
        self._lock = threading.Lock()  # guards what follows
        self._process: subprocess.Popen[bytes] | None = None
        self._reader: threading.Thread | None = None
        self._chunk: Future[dict[str, Any]] | None = None

    @property
    def is_idle(self) -> bool:
        return self._chunk is None

    def start(self) -> None:
        """Start the process, and a thread that reads its answers.

        Raises:
            WorkerError: the system does not start it.
        """
        own = {name: os.environ.get(name, "1") for name in ONE_THREAD}
        errors = tempfile.TemporaryFile()  # noqa: SIM115 - the thread closes it with the process
        try:
            process = subprocess.Popen(
                python_command(CODE), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors,
                env=python_environment(**own),
            )  # fmt: skip
        except OSError as error:
            errors.close()
            raise WorkerError(f"a worker process cannot be started: {reason(error)}") from error
        self._process = process
        self._reader = threading.Thread(target=self._read, args=(process, errors), name="worker", daemon=True)
        self._reader.start()

    def submit(self, common: dict[str, Any], cameras: tuple[int, ...]) -> "Future[dict[str, Any]]":
        """Have a chunk rendered; start the process again if it died meanwhile."""
        chunk: Future[dict[str, Any]] = Future()
        with self._lock:
            if self._process is None:
                self.start()
            self._chunk = chunk
        self.send((common, cameras))
        return chunk

    def send(self, content: object) -> None:
        """Send something; if the process is dying, the thread that reads finds that out."""
        with suppress(OSError, ValueError):  # it died; its stdin is closed
            if (process := self._process) and process.stdin:
                pickle.dump(content, process.stdin)
                process.stdin.flush()

    def _read(self, process: "subprocess.Popen[bytes]", errors: Any) -> None:
        """Pass on the answers of a process until it ends."""
        with errors:
            with suppress(Exception):  # the end of the stream, or of a process within an answer: garbage of any kind
                while process.stdout:
                    content = pickle.load(process.stdout)
                    if isinstance(content, dict):  # the result
                        self._end_chunk(content)
                        continue
                    try:
                        self.receive(content)
                    except Exception as error:  # of any kind: of the program that shows progress
                        self._end_chunk(error)
            process.kill()
            how = _how_it_ended(process.wait(), errors)
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # what it did not read any more
                if stream is not None:
                    stream.close()
        with self._lock:
            self._process = None
        self._end_chunk(ChunkDiedError(f"run fewer workers; the last {how}"))

    def _end_chunk(self, result: dict[str, Any] | Exception) -> None:
        with self._lock:
            chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        if isinstance(result, Exception):
            chunk.set_exception(result)
        else:
            chunk.set_result(result)

    def hang_up(self) -> None:
        """Close the stream of requests, which ends the process."""
        with suppress(OSError, ValueError):
            if (process := self._process) and process.stdin:
                process.stdin.close()

    def close(self, patience: float) -> None:
        """Wait for the end of the process, that many seconds at most."""
        if process := self._process:
            try:
                process.wait(patience)
            except subprocess.TimeoutExpired:
                process.kill()
        if self._reader:
            self._reader.join()


def _how_it_ended(code: int, errors: Any) -> str:
    """Return how a process ended: by which signal, or its last line."""
    if code < 0:
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-code).name}"
    errors.seek(0)
    lines = errors.read().decode("utf-8", "replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f"ended with exit code {code}" + (f": {last}" if last else "")


@contextmanager
def start_local(workers: int) -> Iterator[LocalCrew]:
    """Start worker processes on this machine, and end them afterwards.

    Raises:
        WorkerError: the system does not start them.
    """
    processes = [_WorkerProcess() for _ in range(workers)]
    try:
        for process in processes:
            process.start()
        yield LocalCrew(processes)
    finally:
        for process in processes:
            process.hang_up()
        end = time.monotonic() + STOPPING  # those that do not end soon by themselves end at once
        for process in processes:
            process.close(max(end - time.monotonic(), 0.0))
