"""A render whose chunks are handed out to Dask workers, on this machine or on others that share its folders."""

import secrets
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

from .. import __version__
from ..auto import require_least_memory
from ..errors import JobError, OutputError, SceneError, WorkerError
from ..files import reason
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
from .cluster import connected, local, require_dask
from .handout import LOOK_EVERY, HandedOut, count_workers, lacks_program

# Share of the free memory that workers get; the rest is for files that the system keeps in memory.
SHARE = 0.9
PROBE = ".parts-"  # begins the name of a file in the folder, which workers look for


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
        work = HandedOut(client, common, chunks, start, listener)
        try:
            work.all_done()
        except BaseException:
            forget()  # a signal that was heard must not break off what follows
            work.stop()
            with suppress(OutputError):  # what stopped the render is told, not what that meets
                summary = _summed(start, work, time.perf_counter() - started)
                if missed := summary.there - start.found.images - work.images:  # of which no message came
                    listener.written(missed)
                _write_manifest(start, summary)
            raise
    summary = _summed(start, work, time.perf_counter() - started)
    _write_manifest(start, summary)
    return summary


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
    if not count_workers(client):
        listener.heard([f"waiting for workers of {hands.address or 'this machine'}"])
    while not (n := count_workers(client)):
        time.sleep(LOOK_EVERY)
    return max(n, 1 if hands.address else hands.workers)


@contextmanager
def _common(job: Job, start: Begun, hands: Hands, memory: int | None) -> Iterator[dict[str, Any]]:
    """What all chunks share; a file in the output folder, there meanwhile, shows workers that it is this one."""
    from .worker import Common

    folder, scene = job.output.directory, job.scene.file
    token = secrets.token_hex(4)
    probe = folder / FOLDER / f"{PROBE}{token}"
    threads = None if hands.address else job.render.threads or max(start.prepared.threads // hands.workers, 1)
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
        with start.place.alone():
            if not start.place.others():  # nobody works here, so what a killed program left may go
                for old in probe.parent.glob(f"{PROBE}*"):
                    old.unlink()
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
        if isinstance(found, BaseException) and lacks_program(found):
            found = f"worker {address}: lacks framearray {common['version']}; install it there"
        elif isinstance(found, BaseException):
            found = f"worker {address}: {found}"
        if found:
            raise WorkerError(found)


def _summed(start: Begun, work: HandedOut, seconds: float) -> Summary:
    """Put together what all chunks left in the folder."""
    prepared, before = start.prepared, start.found.records
    records = read_records(prepared.job.output.directory, start.identity.fingerprint)
    rays = sum((Counter(session.rays) for session in records.sessions), Counter[str]())
    rays -= sum((Counter(session.rays) for session in before.sessions), Counter[str]())
    rays["ambient"] += 0
    summary = summed(prepared, records, images=work.images, seconds=seconds, rays=rays, stages={}, notes=work.notes)
    return replace(summary, peak_memory=work.peak_memory)


def _write_manifest(start: Begun, summary: Summary) -> None:
    """Write the manifest of the whole over those of the chunks."""
    folder = start.prepared.job.output.directory
    with start.place.alone():
        manifest = replace(read_manifest(folder), job=start.identity.job)
        write_manifest(folder, with_summary(manifest, summary))
