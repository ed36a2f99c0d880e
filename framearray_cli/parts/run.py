"""A render whose chunks are handed out to Dask workers, on this machine or on others that share its folders."""

import secrets
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

from .. import __version__, errors
from ..auto import require_least_memory
from ..errors import JobError, OutputError, SceneError, WorkerError
from ..files import reason
from ..folderlock import Folder
from ..interrupts import forget
from ..job import Job
from ..jobfile import job_table
from ..manifestfile import read_manifest, write_manifest
from ..prepare import Prepared
from ..record import FOLDER, digest, read_records
from ..render import Begun, Listener, begun, nothing_to_do
from ..summary import Summary, summed, with_summary
from ..usage import free_memory
from .chunks import Chunks, default_size, in_chunks
from .cluster import connected, cores, local, require_dask

# Share of the free memory that workers get; the rest is for files that the system keeps in memory.
SHARE = 0.9
# Seconds between two looks at what goes on, and for which workers get to stop by themselves.
LOOK_EVERY, STOPPING = 0.5, 5.0
# Deaths of workers that a chunk survives without an image more, after those that Dask itself allows.
MOST_DEATHS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Hands:
    """Who renders.

    Attributes:
        workers: processes of this machine, if no scheduler is named.
        address: of a Dask scheduler.
        chunk: frames of a chunk, at most; None: `chunks.default_size`.
    """

    workers: int = 1
    address: str | None = None
    chunk: int | None = None


def render_in_parts(
    job: Job,
    listener: Listener,
    hands: Hands,
    *,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
) -> Summary:
    """Render as `render.render` does, with the same bytes; each chunk of the camera path is rendered by one worker.

    A worker that dies costs the frames that its chunk had under way: the chunk is handed out again, and goes on.

    Raises:
        JobError, SceneError, OutputError: as `render`; also where no scheduler answers.
        MissingExtraError: Dask is not installed.
        WorkerError: workers do not see what they need, or die again and again.
    """
    started = time.perf_counter()
    require_dask()
    with ExitStack() as stack:
        client = stack.enter_context(connected(hands.address)) if hands.address else None
        with begun(job, listener, restart=restart, cameras=cameras) as start:
            if not start.wanted:
                with start.place.alone():
                    return nothing_to_do(start.prepared, start.found, time.perf_counter() - started)
            memory = None if hands.address else _memory(start.prepared, hands.workers)
        if client is None:
            listener.waits("starting workers")
            client = stack.enter_context(local(hands.workers))
        n_workers = _some_workers(client, hands, listener)
        common = stack.enter_context(_common(job, start, hands, memory))
        _require_fit(client, common)
        chunks = _cut(start, hands, n_workers)
        listener.handed_out(f"{_told(n_workers)}, {chunks.line()}")
        work = _HandedOut(client, common, chunks, start, listener)
        try:
            work.all_done()
        except BaseException:
            forget()  # a signal that was heard must not break off what follows
            work.stop()
            with suppress(OutputError):  # what stopped the render is told, not what that meets
                there = _summary(start, work, time.perf_counter() - started).there
                listener.written(there - start.found.images - work.images)  # of which no message came
            raise
    return _summary(start, work, time.perf_counter() - started)


def _told(n: int) -> str:
    return f"{n:,} worker{'s' if n > 1 else ''}"


def _cut(start: Begun, hands: Hands, n_workers: int) -> Chunks:
    prepared, n = start.prepared, len(start.wanted)
    n_r = 0 if prepared.still else prepared.job.n_r
    size = hands.chunk or (n if prepared.still else default_size(n, n_r, n_workers))
    return in_chunks(start.wanted, size, prepared.n_cameras, n_r, still=prepared.still)


def _memory(prepared: Prepared, workers: int) -> int:
    """Bytes that each worker of this machine may take.

    Raises:
        JobError: the job does not fit into that.
    """
    limit = prepared.job.render.memory
    each = (limit or int(SHARE * free_memory())) // workers
    table = prepared.job.render.model_copy(update={"memory": each})
    try:
        require_least_memory(replace(prepared, job=prepared.job.model_copy(update={"render": table})))
    except JobError as error:
        more = f"; {_told(workers)} share {(limit or each * workers) / 2**30:.1f} GiB, fewer have more each"
        raise JobError(error.file, [f"{problem}{more}" for problem in error.problems]) from error
    return each


def _some_workers(client: Any, hands: Hands, listener: Listener) -> int:
    """How many workers there are, once there is one."""
    if not client.nthreads():
        listener.waits(f"waiting for workers of {hands.address or 'this machine'}")
    while not (n := len(client.nthreads())):
        _require_scheduler(client)
        time.sleep(LOOK_EVERY)
    return max(n, 1 if hands.address else hands.workers)


def _require_scheduler(client: Any) -> None:
    if client.status != "running":
        raise WorkerError("the Dask scheduler has gone away")


@contextmanager
def _common(job: Job, start: Begun, hands: Hands, memory: int | None) -> Iterator[dict[str, Any]]:
    """What all chunks share; a file in the output folder, there meanwhile, shows workers that it is this one."""
    from .worker import Common

    folder, scene = job.output.directory, job.scene.file
    token = secrets.token_hex(4)
    probe = folder / FOLDER / f".parts-{token}"
    threads = None if hands.address else job.render.threads or max(cores() // hands.workers, 1)
    try:
        known = digest(scene)
    except OSError as error:
        raise SceneError(f"{scene}: cannot be read: {reason(error)}") from error
    common = Common(
        version=__version__,
        table=job_table(job),
        file=str(job.file or job.name),
        folder=str(folder),
        probe=str(probe),
        scene=known,
        threads=threads,
        memory=memory,
        topic=f"framearray-{token}",
    )
    try:
        probe.touch()
    except OSError as error:
        raise OutputError(f"{probe}: cannot be written: {reason(error)}") from error
    try:
        yield asdict(common)
    finally:
        with suppress(OSError):
            probe.unlink()


def _require_fit(client: Any, common: dict[str, Any]) -> None:
    """Look whether all workers can render the job.

    Raises:
        WorkerError: one cannot.
    """
    from .worker import unfit

    for address, found in client.run(unfit, common, on_error="return").items():
        if isinstance(found, ImportError):
            found = f"worker {address}: lacks framearray {common['version']} ({found}); install it there"
        elif isinstance(found, BaseException):
            found = f"worker {address}: {found}"
        if found:
            raise WorkerError(found)


class _HandedOut:
    """The chunks of a render: those that wait, and those that workers are at."""

    def __init__(self, client: Any, common: dict[str, Any], chunks: Chunks, start: Begun, listener: Listener) -> None:
        self._client, self._common, self._listener = client, common, listener
        self._place, self._n_lights = start.place, start.prepared.n_lights
        self._waiting = list(reversed(chunks.each))
        self._at_work: dict[Any, tuple[int, ...]] = {}
        self._left = {chunk[0]: len(chunk) * self._n_lights for chunk in chunks.each}
        self._something = threading.Event()  # a chunk came back
        self._deaths: dict[int, tuple[int, int]] = {}  # by chunk: how many, and images left at the last
        self._said: set[str] = set()
        self.notes: tuple[str, ...] = ()
        self.peak_memory = self.images = 0
        client.subscribe_topic(common["topic"], self._hear)

    def all_done(self) -> None:
        """Hand out chunks until all are rendered.

        Raises:
            FrameArrayError: what a worker met, the first time that one met something.
        """
        while self._waiting or self._at_work:
            _require_scheduler(self._client)
            for _ in range(max(len(self._client.nthreads()), 1) - len(self._at_work)):
                if self._waiting:
                    self._hand_out(self._waiting.pop())
            self._something.wait(LOOK_EVERY)
            self._something.clear()
            for future in [future for future in self._at_work if future.done()]:
                self._take_back(future, self._at_work.pop(future))

    def _hand_out(self, chunk: tuple[int, ...]) -> None:
        from .worker import render_chunk

        future = self._client.submit(render_chunk, self._common, chunk, pure=False)
        self._at_work[future] = chunk
        future.add_done_callback(lambda _: self._something.set())

    def _take_back(self, future: Any, chunk: tuple[int, ...]) -> None:
        """Look at what became of a chunk."""
        from distributed import KilledWorker

        try:
            result = future.result()
        except KilledWorker as error:
            deaths, left = self._deaths.get(chunk[0], (0, -1))
            deaths = deaths + 1 if self._left[chunk[0]] == left else 1
            if deaths > MOST_DEATHS:
                cameras = f"{chunk[0]}-{chunk[-1]}"
                raise WorkerError(
                    f"cameras {cameras}: workers died on them again and again, most likely of too little memory; "
                    "see what they say, or have fewer workers"
                ) from error
            self._deaths[chunk[0]] = deaths, self._left[chunk[0]]
            self._waiting.append(chunk)
            return
        except ImportError as error:
            raise WorkerError(f"a worker lacks framearray {self._common['version']} ({error}); install it") from error
        if "error" in result:
            raise self._error(result)
        self._hear_left(chunk[0], 0)
        self.notes = tuple(dict.fromkeys((*self.notes, *result["notes"])))
        self.peak_memory = max(self.peak_memory, result["peak_memory"])

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

    def _hear(self, event: tuple[float, dict[str, Any]]) -> None:
        """Take a message of a worker; in a thread of Dask."""
        message = event[1]
        if "left" in message:
            self._hear_left(message["chunk"], message["left"])
        for kind in ("ambient", "target"):
            if kind in message and kind not in self._said:
                self._said.add(kind)
                self._listener.heard(message[kind])
        if "compiling" in message and "compiling" not in self._said:
            self._said.add("compiling")
            self._listener.compiling()

    def _hear_left(self, chunk: int, left: int) -> None:
        written, self._left[chunk] = self._left[chunk] - left, left
        if written:
            self.images += written
            self._listener.written(written)

    def stop(self) -> None:
        """Take all chunks back, and wait a moment until workers have let go of the folder."""
        with suppress(Exception):  # the scheduler may be gone; what stopped the render is told
            self._client.cancel(list(self._at_work), force=True)
        end = time.monotonic() + STOPPING
        with suppress(OutputError):
            while time.monotonic() < end:
                with self._place.alone():
                    if not self._place.others():
                        return
                time.sleep(0.1)


def _summary(start: Begun, work: _HandedOut, seconds: float) -> Summary:
    """Put together what all chunks left in the folder, and write the manifest of the whole."""
    prepared, folder = start.prepared, start.prepared.job.output.directory
    before = start.found
    with Folder(folder).alone():
        records = read_records(folder, start.identity.fingerprint)
        rays = sum((Counter(session.rays) for session in records.sessions), Counter[str]())
        rays -= sum((Counter(session.rays) for session in before.records.sessions), Counter[str]())
        rays["ambient"] += 0
        summary = summed(prepared, records, images=0, seconds=seconds, rays=rays, stages={}, notes=work.notes)
        summary = replace(summary, images=work.images, peak_memory=work.peak_memory)
        manifest = replace(read_manifest(folder), job=start.identity.job)
        write_manifest(folder, with_summary(manifest, summary))
    return summary
