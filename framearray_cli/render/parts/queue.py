"""Queue of the chunks of a render: submit them to workers, one per worker, and collect the results."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, Protocol, TypeAlias

from framearray_cli.array.places import frames_text
from framearray_cli.base.errors import OutputError, WorkerError

from ..events import Event, ImagesWritten, Progress, Report, TimeLeft
from ..session import RenderSession
from .chunks import Chunks

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


# Seconds between two checks for results, and seconds that workers get to stop.
LOOK_EVERY, STOPPING = 0.5, 5.0
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
