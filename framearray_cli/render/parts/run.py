"""A render whose chunks are handed out to Dask workers, on this machine or on others that share its folders."""

import secrets
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

from framearray_cli import __version__
from framearray_cli.array.manifest_toml import read_manifest, write_manifest
from framearray_cli.array.record import FOLDER, read_records
from framearray_cli.base.errors import JobError, OutputError, SceneError, WorkerError
from framearray_cli.base.files import reason
from framearray_cli.base.forms.table import changed
from framearray_cli.base.hashing import digest
from framearray_cli.base.memory import free_memory
from framearray_cli.base.signals import cancel_alarm
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table

from ..automatic.choose import require_least_memory
from ..messages import workers_text
from ..prepare import Prepared
from ..session import RenderSession, complete_manifest, open_session
from ..summary import Summary, summarize, with_summary
from .chunks import Chunks, default_size, plan_chunks
from .dask import connect, require_dask, start_local
from .progress import PartEvents
from .queue import LOOK_EVERY, ChunkQueue, count_workers, lacks_program

# Share of the free memory that workers get; the rest is for files that the system keeps in memory.
SHARE = 0.9
PROBE = ".parts-"  # begins the name of a file in the folder, which workers look for


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerOptions:
    """Which workers render.

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
    events: PartEvents,
    options: WorkerOptions,
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
        client = stack.enter_context(connect(options.address)) if options.address else None
        with open_session(job, events, restart=restart, cameras=cameras) as session:
            if not session.wanted:
                return complete_manifest(session, time.perf_counter() - started)
            memory = None if options.address else _memory(session.prepared, options.workers)
        if client is None:
            events.starting_workers()
            client = stack.enter_context(start_local(options.workers))
        n_workers = _await_workers(client, options, events)
        common = stack.enter_context(_share(job, session, options, memory))
        _require_fit_workers(client, common)
        chunks = _split(session, options, n_workers)
        events.chunked(n_workers, chunks)
        queue = ChunkQueue(client, common, chunks, session, events)
        try:
            queue.render_all()
        except BaseException:
            cancel_alarm()  # a signal that was heard must not break off what follows
            queue.stop()
            with suppress(OutputError):  # report the first error, not one from here
                summary = _summarize(session, queue, time.perf_counter() - started)
                if missed := summary.there - session.on_disk.images - queue.images:  # of which no message came
                    events.written(missed)
                _write_manifest(session, summary)
            raise
    summary = _summarize(session, queue, time.perf_counter() - started)
    _write_manifest(session, summary)
    return summary


def _split(session: RenderSession, options: WorkerOptions, n_workers: int) -> Chunks:
    prepared, n = session.prepared, len(session.wanted)
    n_r = 0 if prepared.still else prepared.job.n_r
    size = options.chunk or (n if prepared.still else default_size(n, n_r, n_workers))
    return plan_chunks(session.wanted, size, prepared.n_cameras, n_r, still=prepared.still)


def _memory(prepared: Prepared, workers: int) -> int:
    """Bytes that each worker of this machine may take.

    Raises:
        JobError: the job does not fit into that.
    """
    limit = prepared.job.render.memory
    each = (limit or int(SHARE * free_memory())) // workers
    table = changed(prepared.job.render, memory=max(each, 1))
    try:
        require_least_memory(replace(prepared, job=changed(prepared.job, render=table)))
    except JobError as error:
        more = f"; {workers_text(workers)} share {(limit or each * workers) / 2**30:.1f} GiB, fewer have more each"
        raise JobError(error.file, [f"{problem}{more}" for problem in error.problems]) from error
    return each


def _await_workers(client: Any, options: WorkerOptions, events: PartEvents) -> int:
    """How many workers there are, once there is one."""
    if not count_workers(client):
        events.awaiting_workers(options.address)
    while not (n := count_workers(client)):
        time.sleep(LOOK_EVERY)
    return max(n, 1 if options.address else options.workers)


@contextmanager
def _share(job: Job, session: RenderSession, options: WorkerOptions, memory: int | None) -> Iterator[dict[str, Any]]:
    """What all chunks share; a file in the output folder, there meanwhile, shows workers that it is this one."""
    from .worker import Common

    folder, scene = job.output.directory, job.scene.file
    token = secrets.token_hex(4)
    probe = folder / FOLDER / f"{PROBE}{token}"
    threads = None if options.address else job.render.threads or max(session.prepared.threads // options.workers, 1)
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
        with session.folder.exclusive():
            if not session.folder.other_locks():  # nobody works here, so what a killed program left may go
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


def _require_fit_workers(client: Any, common: dict[str, Any]) -> None:
    """Look whether all workers can render the job.

    Raises:
        WorkerError: one cannot.
    """
    from .worker import worker_problem

    for address, found in client.run(worker_problem, common, on_error="return").items():
        if isinstance(found, BaseException) and lacks_program(found):
            found = f"worker {address}: lacks framearray {common['version']}; install it there"
        elif isinstance(found, BaseException):
            found = f"worker {address}: {found}"
        if found:
            raise WorkerError(found)


def _summarize(session: RenderSession, queue: ChunkQueue, seconds: float) -> Summary:
    """Put together what all chunks left in the folder."""
    prepared, before = session.prepared, session.on_disk.records
    records = read_records(prepared.job.output.directory, session.identity.fingerprint)
    rays = sum((Counter(run.rays) for run in records.runs), Counter[str]())
    rays -= sum((Counter(run.rays) for run in before.runs), Counter[str]())
    rays["ambient"] += 0
    summary = summarize(
        prepared, records, images=queue.images, seconds=seconds, rays=rays, stages={}, notes=queue.notes
    )
    return replace(summary, peak_memory=queue.peak_memory)


def _write_manifest(session: RenderSession, summary: Summary) -> None:
    """Write the manifest of the whole over those of the chunks."""
    folder = session.prepared.job.output.directory
    with session.folder.exclusive():
        manifest = replace(read_manifest(folder), job=session.identity.job)
        write_manifest(folder, with_summary(manifest, summary))
