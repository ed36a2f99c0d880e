"""Worker processes of this machine, by the standard library; one that dies is replaced."""

import os
import pickle
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from typing import Any

from framearray_cli.base.errors import WorkerError
from framearray_cli.base.files import reason
from framearray_cli.base.platform import python_command, python_environment

from .queue import ChunkDiedError, Crew, Handed, Message

CODE = "from framearray_cli.render.parts.chunk import serve; serve()"
# Rendering does not use the threads of linear algebra, which take memory; a user's own setting holds.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
STOPPING = 5.0  # seconds that processes have to end by themselves


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

    def close(self) -> None:
        """End all processes: those that do not end soon by themselves at once."""
        for process in self._processes:
            process.hang_up()
        end = time.monotonic() + STOPPING
        for process in self._processes:
            process.close(max(end - time.monotonic(), 0.0))


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
        process = self._process
        with suppress(OSError, ValueError):  # it died; its stdin is closed
            if process is not None and process.stdin is not None:
                pickle.dump(content, process.stdin)
                process.stdin.flush()

    def _read(self, process: "subprocess.Popen[bytes]", errors: Any) -> None:
        """Pass on the answers of a process until it ends."""
        with errors:
            with suppress(Exception):  # the end of the stream, or of a process within an answer: garbage of any kind
                while process.stdout is not None:
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
        process = self._process
        with suppress(OSError, ValueError):
            if process is not None and process.stdin is not None:
                process.stdin.close()

    def close(self, patience: float) -> None:
        """Wait for the end of the process, that many seconds at most."""
        process = self._process
        if process is not None:
            try:
                process.wait(patience)
            except subprocess.TimeoutExpired:
                process.kill()
        if self._reader is not None:
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
    crew = LocalCrew(processes)
    try:
        for process in processes:
            process.start()
        yield crew
    finally:
        crew.close()
