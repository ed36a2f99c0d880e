"""The chunks of a render, handed out to Dask workers one at a time, and taken back."""

import threading
import time
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import Any

from framearray_cli.array.ranges import frames_text
from framearray_cli.base import errors
from framearray_cli.base.errors import JobError, OutputError, WorkerError

from ..progress import AmbientFigures
from ..session import RenderSession
from ..target.pilot import Target
from .chunks import Chunks
from .progress import PartEvents

# Seconds between two looks at what goes on, and for which workers get to stop by themselves.
LOOK_EVERY, STOPPING = 0.5, 5.0
# How often Dask may give a chunk up, because some workers in turn died on it, without an image more.
MOST_DEATHS = 2
LOST = "the Dask scheduler has gone away"


def count_workers(client: Any) -> int:
    """How many workers there are.

    Raises:
        WorkerError: the scheduler is not there any more.
    """
    try:
        if client.status == "running":
            return len(client.nthreads())
    except (OSError, CancelledError) as error:
        raise WorkerError(LOST) from error
    raise WorkerError(LOST)


def lacks_program(error: BaseException | None) -> bool:
    """Whether a worker could not load what it was to run; Dask may hand on no more than the words of the error."""
    while error is not None:
        if isinstance(error, ImportError) or "ModuleNotFoundError" in str(error) or "ImportError" in str(error):
            return True
        error = error.__cause__
    return False


class ChunkQueue:
    """The chunks of a render: those that wait, and those that workers are at."""

    def __init__(
        self, client: Any, common: dict[str, Any], chunks: Chunks, session: RenderSession, events: PartEvents
    ) -> None:
        self._client, self._common, self._events = client, common, events
        self._folder, self._n_lights = session.folder, session.prepared.n_lights
        self._waiting = list(reversed(chunks.each))
        self._at_work: dict[Any, tuple[int, ...]] = {}
        self._left = {chunk[0]: len(chunk) * self._n_lights for chunk in chunks.each}
        self._came_back, self._lock = threading.Event(), threading.Lock()  # a chunk came back; of what is counted
        self._deaths: dict[int, tuple[int, int]] = {}  # by chunk: how many, and images left at the last
        self._received: set[str] = set()
        self.notes: tuple[str, ...] = ()
        self.peak_memory = self.images = 0
        client.subscribe_topic(common["topic"], self._receive)

    def render_all(self) -> None:
        """Hand out chunks until all are rendered.

        Raises:
            FrameArrayError: what a worker met, the first time that one met something.
        """
        while self._waiting or self._at_work:
            for _ in range(max(count_workers(self._client), 1) - len(self._at_work)):
                if self._waiting:
                    self._hand_out(self._waiting.pop())
            self._came_back.wait(LOOK_EVERY)
            self._came_back.clear()
            for future in [future for future in self._at_work if future.done()]:
                self._take_back(future, self._at_work.pop(future))

    def _hand_out(self, chunk: tuple[int, ...]) -> None:
        from .worker import render_chunk

        future = self._client.submit(render_chunk, self._common, chunk, pure=False)
        self._at_work[future] = chunk
        future.add_done_callback(lambda _: self._came_back.set())

    def _take_back(self, future: Any, chunk: tuple[int, ...]) -> None:
        """Look at what became of a chunk."""
        from distributed import KilledWorker

        try:
            result = future.result()
        except CancelledError as error:
            raise WorkerError(LOST) from error
        except KilledWorker:
            self._retry(chunk)
            return
        except Exception as error:
            if not lacks_program(error):
                raise
            version = self._common["version"]
            raise WorkerError(f"a worker that came later: lacks framearray {version}; install it there") from error
        if "error" in result:
            raise self._error(result)
        self._count_written(chunk[0], 0, last=True)
        self.notes = tuple(dict.fromkeys((*self.notes, *result["notes"])))
        self.peak_memory = max(self.peak_memory, result["peak_memory"])

    def _retry(self, chunk: tuple[int, ...]) -> None:
        """Hand out a chunk that several workers died on, if it got further meanwhile; else something is wrong with it.

        Raises:
            WorkerError: it did not.
        """
        first = chunk[0]
        deaths, left = self._deaths.get(first, (0, -1))
        deaths = deaths + 1 if self._left[first] == left else 1
        if deaths > MOST_DEATHS:
            raise WorkerError(
                f"cameras {frames_text(chunk)}: workers died on them again and again, most likely of too little "
                "memory; have fewer workers on a machine, or see what they say"
            )
        self._deaths[first] = deaths, self._left[first]
        self._waiting.append(chunk)

    def _error(self, result: dict[str, Any]) -> BaseException:
        """What a worker met, as if it were met here."""
        problems, kind = result["problems"], result["error"]
        found: BaseException
        if kind == "MemoryError":
            return MemoryError()
        if kind == "JobError":
            prefix = f"{self._common['file']}: "
            found = JobError(self._common["file"], [problem.removeprefix(prefix) for problem in problems])
        else:
            found = getattr(errors, kind)(*problems)
        for note in result["notes"]:
            found.add_note(note)
        return found

    def _receive(self, event: tuple[float, dict[str, Any]]) -> None:
        """Take a message of a worker; in a thread of Dask."""
        message = event[1]
        if "left" in message:
            self._count_written(message["chunk"], message["left"])
        if self._first("ambient", message):
            figures = message["ambient"]
            self._events.ambient_known(AmbientFigures(**figures | {"notes": tuple(figures["notes"])}))
        if self._first("target", message):
            least, most = message["target"]["frames"]
            self._events.target_known(Target(**message["target"] | {"frames": (least, most)}))
        if self._first("compiling", message):
            self._events.compiling()

    def _first(self, kind: str, message: dict[str, Any]) -> bool:
        """Whether this is the first message of a kind, which all workers send and one is reported of."""
        if kind not in message or kind in self._received:
            return False
        self._received.add(kind)
        return True

    def _count_written(self, chunk: int, left: int, *, last: bool = False) -> None:
        """Count what a chunk has written; messages that come after its end do not count."""
        with self._lock:
            if chunk not in self._left:
                return
            written, self._left[chunk] = self._left[chunk] - left, left
            if last:
                del self._left[chunk]
            self.images += written
        if written:
            self._events.written(written)

    def stop(self) -> None:
        """Take all chunks back, and wait a moment until workers have let go of the folder."""
        with suppress(Exception):  # the scheduler may be gone; what stopped the render is reported
            self._client.cancel(list(self._at_work), force=True)
        end = time.monotonic() + STOPPING
        with suppress(OutputError):
            while time.monotonic() < end:
                with self._folder.exclusive():
                    if not self._folder.other_locks():
                        return
                time.sleep(0.1)
