"""Render in parts: chunks of the camera path on workers, of this machine or others that share its folders."""

import secrets
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any

from framearray_cli import __version__
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import FOLDER, read_records
from framearray_cli.base.errors import JobError, OutputError, SceneError
from framearray_cli.base.files import digest, reason
from framearray_cli.base.forms.table import changed
from framearray_cli.base.memory import free_memory
from framearray_cli.base.platform import set_alarm
from framearray_cli.base.units import counted
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table

from ..automatic import require_least_memory
from ..events import Chunks, ChunksBegun, ImagesWritten, Report, Working, ignore, note
from ..manifest import Summary, summarize
from ..pilots.warn import find_warnings
from ..plan import plan_work
from ..prepare import Prepared
from ..preview import coarse_beside
from ..render import report_lacking_space, report_warnings
from ..session import RenderSession, complete_manifest, open_session, write_summary
from .dask import connect
from .queue import LOOK_EVERY, ChunkQueue, Crew, default_size, plan_chunks, start_local

# Share of the free memory for workers; the rest is for the file cache of the system.
SHARE = 0.9
PROBE = ".parts-"  # prefix of a file in the folder that workers look for


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerOptions:
    """Workers that render.

    Attributes:
        workers: number of processes of this machine, if no scheduler is given.
        address: of a Dask scheduler.
        chunk: most frames per chunk; None: `default_size`.
    """

    workers: int = 1
    address: str | None = None
    chunk: int | None = None


def render_in_parts(
    job: Job,
    options: WorkerOptions,
    report: Report = ignore,
    *,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    coarse: bool = False,
    strict: bool = False,
) -> Summary:
    """Render as `render.render` does, with the same bytes; each chunk of the camera path is rendered by one worker.

    When a worker dies, only the frames in progress are lost: its chunk is submitted again and continues.

    Raises:
        JobError, SceneError, OutputError: as `render`; also where no scheduler answers.
        MissingExtraError: an address is given, and Dask is not installed.
        WorkerError: workers cannot see their files, or die repeatedly.
    """
    started = time.perf_counter()
    with ExitStack() as stack:
        crew: Crew | None = stack.enter_context(connect(options.address)) if options.address else None
        with open_session(job, report, restart=restart, cameras=cameras) as session:
            if not session.wanted:
                return complete_manifest(session, time.perf_counter() - started)
            share = session.cells.take  # workers find the cells in the folder
            planned = plan_work(session.prepared, session.embree, share=share)
            warnings = find_warnings(session.prepared, *planned)
            report_warnings(job, warnings, report, strict=strict)
            report_lacking_space(session, *planned, report, strict=strict)
            if coarse:
                stack.enter_context(coarse_beside(session, report))
            memory = None if options.address else _memory(session.prepared, options.workers)
        if crew is None:
            report(Working(text="starting workers"))
            crew = stack.enter_context(start_local(options.workers))
        n_workers = _await_workers(crew, options, report)
        common = stack.enter_context(_share(job, session, options, memory))
        crew.require_fit(common)
        chunks = _split(session, options, n_workers)
        report(ChunksBegun(workers=n_workers, chunks=chunks))
        queue = ChunkQueue(crew, common, chunks, session, report)
        try:
            queue.render_all()
        except BaseException:
            set_alarm(0.0)  # an earlier signal must not interrupt what follows
            queue.stop()
            with suppress(OutputError):  # report the first error, not one from here
                summary = _summarize(session, queue, time.perf_counter() - started)
                if missed := summary.there - session.on_disk.images - queue.images:  # images that no message reported
                    report(ImagesWritten(images=missed))
                _write_manifest(session, summary, warnings)
            raise
    summary = _summarize(session, queue, time.perf_counter() - started)
    _write_manifest(session, summary, warnings)
    return summary


def _split(session: RenderSession, options: WorkerOptions, n_workers: int) -> Chunks:
    prepared, n = session.prepared, len(session.wanted)
    n_r = 0 if prepared.still else prepared.job.n_r
    size = options.chunk or (n if prepared.still else default_size(n, n_r, n_workers))
    return plan_chunks(session.wanted, size, n_r, still=prepared.still)


def _memory(prepared: Prepared, workers: int) -> int:
    """Return the bytes that each worker of this machine may take.

    Raises:
        JobError: the job does not fit into that.
    """
    limit = prepared.job.render.memory
    each = (limit or int(SHARE * free_memory())) // workers
    table = changed(prepared.job.render, memory=max(each, 1))
    try:
        require_least_memory(replace(prepared, job=changed(prepared.job, render=table)))
    except JobError as error:
        more = f"; {counted(workers, 'worker')} share {(limit or each * workers) / 2**30:.1f} GiB, fewer have more each"
        raise JobError(error.file, [f"{problem}{more}" for problem in error.problems]) from error
    return each


def _await_workers(crew: Crew, options: WorkerOptions, report: Report) -> int:
    """Wait for a worker; return the number of workers."""
    if not crew.count():
        note(report, [f"waiting for workers of {options.address or 'this machine'}"])
    while not (n := crew.count()):
        time.sleep(LOOK_EVERY)
    return n


@contextmanager
def _share(job: Job, session: RenderSession, options: WorkerOptions, memory: int | None) -> Iterator[dict[str, Any]]:
    """Put together what all chunks share, with a temporary file by which workers recognize the output folder."""
    folder, scene = job.output.directory, job.scene.file
    token = secrets.token_hex(4)
    probe = folder / FOLDER / f"{PROBE}{token}"
    threads = None if options.address else job.render.threads or max(session.prepared.threads // options.workers, 1)
    try:
        known = digest(scene)
    except OSError as error:
        raise SceneError(f"{scene}: cannot be read: {reason(error)}") from error
    common = {
        "version": __version__,
        "table": job_table(job),
        "file": str(job.file or job.name),  # for messages
        "folder": str(folder),
        "probe": str(probe),  # a file that only workers see which see the folder
        "scene": known,  # size and checksum of the file
        "threads": threads,  # per chunk; None: as the worker has
        "memory": memory,  # bytes per chunk; None: as the job says
        "topic": f"framearray-{token}",  # of messages
    }
    try:
        with session.folder.exclusive():
            if not session.folder.other_locks():  # no run is active, so files of killed programs can go
                for old in probe.parent.glob(f"{PROBE}*"):
                    old.unlink()
        probe.touch()
    except OSError as error:
        raise OutputError(f"{probe}: cannot be written: {reason(error)}") from error
    try:
        yield common
    finally:
        with suppress(OSError):
            probe.unlink()


def _summarize(session: RenderSession, queue: ChunkQueue, seconds: float) -> Summary:
    """Summarize the records of all chunks in the folder."""
    prepared, before = session.prepared, session.on_disk.records
    records = read_records(prepared.job.output.directory, session.identity.fingerprint)
    rays = sum((Counter(run.rays) for run in records.runs), Counter[str]())
    rays -= sum((Counter(run.rays) for run in before.runs), Counter[str]())
    rays["ambient"] += 0
    summary = summarize(prepared, records, images=queue.images, seconds=seconds, rays=rays, notes=queue.notes)
    return replace(summary, peak_memory_bytes=queue.peak_memory)


def _write_manifest(session: RenderSession, summary: Summary, warnings: Sequence[str]) -> None:
    """Replace the manifests of the chunks by the manifest of the whole render."""
    folder = session.prepared.job.output.directory
    with session.folder.exclusive():
        manifest = read_manifest(folder)
        known = manifest.summary | ({"warnings": list(warnings)} if warnings else {})
        manifest = replace(manifest, job=session.identity.job, summary=known)
        write_summary(folder, manifest, summary)
