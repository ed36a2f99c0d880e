"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from threading import Lock

import numpy as np

from framearray_cli.array.images import mean_shares, require_writer
from framearray_cli.array.integrity import OnDisk
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.record import Entry, RecordWriter, read_records, record_file
from framearray_cli.base.arrays import Images
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.units import agree, counted
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.kernels.second_process import stop as stop_compiling_beside
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job

from .cells import cells_digest
from .coarse import coarse_beside
from .errortarget import allot_hits
from .events import (
    AmbientEstimated,
    FramesBegun,
    FrameWritten,
    HitsAllotted,
    ImagesWritten,
    KernelsLoaded,
    Report,
    TimeLeft,
    Warned,
    Working,
    ignore,
)
from .lamps import draw_visible
from .manifest import initial_manifest
from .memory import light_blocks, mirror_share, require_memory
from .pace import Expected, Pace, block_work, eye_work, plane_cost, total_work
from .pilots.warn import find_warnings
from .plan import image_ambient, plan_work
from .prepare import Prepared
from .session import RenderSession, complete_manifest, open_session, write_summary
from .summary import Summary, summarize, with_summary
from .trial import AnyImage, load_kernels, writing_cost
from .writer import ArrayTarget, ArrayWriter, FinishedFiles, array_target, group_sums


def render(
    job: Job,
    report: Report = ignore,
    *,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    pilots: bool = True,
    coarse: bool = False,
    strict: bool = False,
) -> Summary:
    """Render a frame array, or some of its cameras; images that lie in the job's folder already are kept.

    Images are the same to the last bit, whether rendered in one run or in several.

    Args:
        restart: first remove the array in the job's folder; otherwise another array there is an error.
        cameras: those to render, in rising order; None: all.
        pilots: whether to look for what would make the array useless; False for parts of a render that did.
        report: receives events, in any thread; an error that it raises ends the render.
        coarse: whether small pictures come first, next to the array, until it is there; see `render/coarse.py`.
        strict: warnings are errors.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: a file could not be written; finished images stay, and the next run renders the rest.
    """
    started = time.perf_counter()
    with open_session(job, report, restart=restart, cameras=cameras) as session:
        if not session.wanted:
            return complete_manifest(session, time.perf_counter() - started)
        with coarse_beside(session, report) if coarse else nullcontext():
            return _render(session, report, started, pilots=pilots, strict=strict)


def _render(session: RenderSession, report: Report, started: float, *, pilots: bool, strict: bool) -> Summary:
    """Render what is missing; `started` is when the run began, by `time.perf_counter`."""
    prepared, on_disk, directory = session.prepared, session.on_disk, session.prepared.job.output.directory
    setup, ambient, manifest, rays, sample = _plan(session, report, pilots=pilots, strict=strict)
    with _begin_record(session, setup, manifest) as record:
        run = _Run(prepared, record, report, rays, started)
        try:
            blocks = light_blocks(prepared, mirror_share(setup), per_pixel=setup.per_pixel, setup=setup)
            parts = [(block, wanted) for block in blocks if (wanted := on_disk.missing(session.chosen, block))]
            run.begin(setup, sample, parts)
            for block, wanted in parts:
                _render_block(run, setup.for_block(block), ambient, block, wanted)
        except BaseException:
            with suppress(OutputError), session.folder.exclusive():  # report the first error, not one from here
                write_manifest(directory, with_summary(manifest, run.summary(on_disk, ambient)))
            raise
    with session.folder.exclusive():
        summary = run.summary(on_disk, ambient)
        write_summary(directory, manifest, summary)
    return summary


def _begin_record(session: RenderSession, setup: FrameSetup, manifest: Manifest) -> RecordWriter:
    """Write the manifest of an array that begins, and note this run in its record.

    Raises:
        OutputError: images that are there, or runs that go on, have other cells.
    """
    directory, cells = session.prepared.job.output.directory, cells_digest(setup.indirect.cells)
    with session.folder.exclusive():
        if cells:
            session.cells.require_same(cells)
        write_manifest(directory, manifest)
        path, run = record_file(directory, session.run.cameras), replace(session.run, cells=cells)
        return RecordWriter(path, session.identity.fingerprint, run)


def _plan(
    session: RenderSession, report: Report, *, pilots: bool, strict: bool
) -> tuple[FrameSetup, Ambient, Manifest, Counter[str], AnyImage]:
    """Estimate the ambient light, render pilots, allot hits, and build the manifest; count the rays traced."""
    prepared, output = session.prepared, session.prepared.job.output
    for name in {output.format, "exr"} if output.layers else {output.format}:
        require_writer(name)
    setup, ambient = plan_work(prepared, session.embree, share=session.cells.take)
    report(AmbientEstimated.of(ambient))
    report(Working(text="loading kernels"))
    sample = load_kernels(prepared, setup, ambient)
    stop_compiling_beside()
    report(KernelsLoaded())
    report(Working(text="preparing frames"))
    warnings = _look(session, setup, ambient, report, strict=strict) if pilots else session.known_warnings()
    setup, target = allot_hits(prepared, setup, ambient)
    rays = Counter({"ambient": ambient.rays})
    if target:
        require_memory(prepared, setup.per_pixel, setup)
        report(HitsAllotted(target=target))
        rays["target"] = target.rays
    manifest = initial_manifest(prepared, ambient, session.identity, session.settings, target, warnings)
    return setup, ambient, manifest, rays, sample


def _look(
    session: RenderSession, setup: FrameSetup, ambient: Ambient, report: Report, *, strict: bool
) -> tuple[str, ...]:
    """Return the warnings of pilots, after reporting them; of a part only if it is the first one."""
    if session.on_disk.records.entries and 0 not in session.chosen:
        return session.known_warnings()
    warnings = find_warnings(session.prepared, setup, ambient)
    report_warnings(session.prepared.job, warnings, report, strict=strict)
    return warnings


def report_warnings(job: Job, warnings: Sequence[str], report: Report, *, strict: bool) -> None:
    """Report warnings.

    Raises:
        JobError: there are some, and they are errors.
    """
    if strict and warnings:
        raise JobError(job.file or job.name, warnings)
    for text in warnings:
        report(Warned(text=text))


def _render_block(run: "_Run", setup: FrameSetup, ambient: Ambient, lights: range, wanted: Sequence[int]) -> None:
    """Render the wanted cameras at a block of light positions [FA alg. 1].

    Trace the hits of each frame, compose a frame as soon as the hits of its window are there, and write it.

    Args:
        setup: for the block of light positions, `lights`.
        ambient: for all light positions.
    """
    target, still = array_target(run.prepared), run.prepared.still
    if len(lights) == run.prepared.n_lights:  # else no block has all that a picture is made of
        target = replace(target, sums=group_sums(run.prepared.lights, ambient.intensity))
    i_a = image_ambient(ambient, run.prepared.lights)
    if len(lights) < run.prepared.n_lights:
        i_a = i_a.at(lights)
    with run.open_pool(setup) as pool, run.open_writer(target, lights) as writer:
        window = Window(setup, i_a, pool)

        def compose(j: int, images: Images) -> Composed:
            composed = window.compose(j, images)
            composed.beyond += draw_visible(run.prepared, setup, j, lights, composed.images, pool)
            return composed

        for j in ready_frames(window, setup, [0] if still else wanted, pool, lambda c: run.found(eye_work(setup, c))):
            images = writer.block()
            composed = compose(j, images)
            if composed.beyond and target.format.half == "auto":  # too bright for halves: some will be floats
                composed = compose(j, np.empty(images.shape, np.float32))
            run.composed(len(lights))
            writer.write(composed, wanted if still else [j], images)
        writer.finish()


class _Run:
    """One run of the program: records finished frames, and counts rays and time."""

    def __init__(
        self, prepared: Prepared, record: RecordWriter, report: Report, rays: Counter[str], started: float
    ) -> None:
        self.prepared, self._record, self._report, self._started = prepared, record, report, started
        self._rays, self._stages = rays, Counter[str]()
        self._images, self._done, self._lock = 0, set[int](), Lock()
        self._pool: TracePool | None = None
        self._pace: Pace | None = None

    def begin(self, setup: FrameSetup, sample: AnyImage, parts: Sequence[tuple[range, Sequence[int]]]) -> None:
        """Begin to measure how long the frames take, at some blocks of light positions each."""
        prepared = self.prepared
        setups = [(setup.for_block(block), wanted) for block, wanted in parts]
        work = total_work(block_work(part, wanted, still=prepared.still) for part, wanted in setups)
        expected = Expected(
            plane=plane_cost(setup, len(parts[0][0])) if parts else 0.0,
            image=writing_cost(prepared, sample),
            busy=prepared.threads,
        )
        self._pace = Pace(work, expected)
        self._report(FramesBegun())

    def found(self, hits: float) -> None:
        """Count the hits of an eye."""
        if self._pace:
            self._pace.found(hits)
            self._report(TimeLeft(seconds=self._pace.left()))

    def composed(self, planes: int) -> None:
        """Count the planes of a composed frame."""
        if self._pace:
            self._pace.composed(planes)
            self._report(TimeLeft(seconds=self._pace.left()))

    def _written(self, images: int, seconds: float) -> None:
        """Count a file; called from any thread."""
        if self._pace:
            self._pace.written(images, seconds)
            self._report(TimeLeft(seconds=self._pace.left()))
        if images:
            self._report(ImagesWritten(images=images))

    @contextmanager
    def open_pool(self, setup: FrameSetup) -> Iterator[TracePool]:
        """Open a pool whose rays and processor seconds count for this run."""
        self._pool = pool = TracePool(setup, self.prepared.threads)
        try:
            with pool:
                yield pool
        finally:
            self._rays += pool.rays()
            self._stages.update(pool.seconds())
            self._pool = None

    def open_writer(self, target: ArrayTarget, lights: range) -> ArrayWriter:
        """Return a writer that reports images and records finished frames."""
        return ArrayWriter(target, lights, self.prepared.threads, self._written, self._finished)

    def _finished(self, done: FinishedFiles) -> None:
        """Record that all files of a camera are on disk; called from any thread."""
        frame, pool = done.composed, self._pool
        notes = []
        if frame.bad:
            notes = [_bad_values(frame.bad, frame.c, frame.first_bad, self.prepared.job.camera.resolution[0])]
        entry = Entry(
            c=done.c,
            lights=(done.planes.start, done.planes.stop),
            files=done.files,
            hits=float(frame.hits.mean()),
            notes=tuple(notes),
            errors=done.errors,
            shares=mean_shares(done.shares),
        )
        rays = self._rays + (pool.rays() if pool else Counter[str]())
        self._record.add(entry, rays, time.perf_counter() - self._started)
        with self._lock:
            self._done.add(done.c)
            self._images += len(done.planes)
        self._report(FrameWritten(camera=done.c, images=len(done.planes)))

    def summary(self, on_disk: OnDisk, ambient: Ambient) -> Summary:
        """Summarize this and all other runs; files found damaged count once they are rendered again."""
        prepared = self.prepared
        records = read_records(prepared.job.output.directory, self._record.fingerprint)
        bad = {name for name, _ in on_disk.damaged}
        whole = tuple(e for e in records.entries if e.c in self._done or bad.isdisjoint(e.files))
        return summarize(
            prepared,
            replace(records, entries=whole),
            images=self._images,
            seconds=time.perf_counter() - self._started,
            rays=self._rays,
            stages=dict(self._stages),
            notes=ambient.notes,
        )


def _bad_values(count: int, c: int, first: tuple[int, int] | None, width: int) -> str:
    l, pixel = first or (0, 0)
    where = f"camera {c}, light {l}, pixel ({pixel % width}, {pixel // width})"
    some = f"{counted(count, 'value')} of camera {c} {agree(count, 'was', 'were')} not finite"
    return f"{some} and {agree(count, 'was', 'were')} set to 0; the first: {where}"
