"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import gc
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from threading import Lock

from framearray_cli.array.integrity import OnDisk
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.record import ArrayRecords, Entry, RecordWriter, read_records
from framearray_cli.base.arrays import Images
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.memory import is_scarce, resident_memory
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job

from .division import RenderPart, find_parts
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
    note,
)
from .frames import compose_frames
from .manifest import Summary, initial_manifest, summarize, with_summary
from .memory import require_memory
from .pace import NO_WORK, Expected, Pace, block_work, eye_work, hit_cost, pixel_cost
from .pilots.warn import find_warnings
from .plan import plan_work
from .preview import coarse_beside
from .rows import codes_rows
from .sensors import write_sensors
from .session import RenderSession, begin_record, complete_manifest, open_session, write_summary
from .trial import find_lacking_space, load_kernels, writing_cost
from .writer import ArrayWriter, array_target

MOST_DIVISIONS = 8  # anew, of one run, on a machine whose memory comes and goes


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
        coarse: whether small pictures come first, next to the array, until it is there; see `render/preview.py`.
        strict: warnings are errors.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: a file could not be written; finished images stay, and the next run renders the rest.
    """
    started = time.perf_counter()
    with open_session(job, report, restart=restart, cameras=cameras) as session:
        if not session.wanted:
            write_sensors(session, report)
            return complete_manifest(session, time.perf_counter() - started)
        with coarse_beside(session, report) if coarse else nullcontext():
            return _render(session, report, started, pilots=pilots, strict=strict)


def _render(session: RenderSession, report: Report, started: float, *, pilots: bool, strict: bool) -> Summary:
    """Render what is missing; `started` is when the run began, by `time.perf_counter`."""
    directory = session.prepared.job.output.directory
    setup, ambient, manifest, rays, sample = _plan(session, report, pilots=pilots, strict=strict)
    write_sensors(session, report)
    with begin_record(session, setup, manifest) as record:
        run = _Run(session, record, report, ambient, rays, started)
        try:
            parts = find_parts(session, setup, report)
            run.begin(setup, sample, parts)
            report(FramesBegun())
            while parts:
                part = parts.pop(0)
                if not run.render_part(part):
                    parts = run.divide_anew(part, setup, sample)
        except BaseException:
            with suppress(OutputError), session.folder.exclusive():  # report the first error, not one from here
                write_manifest(directory, with_summary(manifest, run.summary()))
            raise
    with session.folder.exclusive():
        summary = run.summary()
        write_summary(directory, manifest, summary)
    return summary


def _plan(
    session: RenderSession, report: Report, *, pilots: bool, strict: bool
) -> tuple[FrameSetup, Ambient, Manifest, Counter[str], Images]:
    """Estimate the ambient light, render pilots, allot hits, and build the manifest; count the rays traced."""
    prepared = session.prepared
    setup, ambient = plan_work(prepared, session.embree, share=session.cells.take)
    report(AmbientEstimated.of(ambient))
    report(Working(text="loading kernels"))
    sample = load_kernels(prepared, setup, ambient)
    report(KernelsLoaded())
    report(Working(text="preparing frames"))
    if pilots and (0 in session.chosen or not session.on_disk.records.entries):  # later parts need not look again
        warnings = find_warnings(prepared, setup, ambient)
        report_warnings(prepared.job, warnings, report, strict=strict)
    else:
        warnings = session.known_warnings()
    setup, target = allot_hits(prepared, setup, ambient)
    rays = Counter({"ambient": ambient.rays})
    if target:
        require_memory(prepared, setup.per_pixel, setup)
        report(HitsAllotted(target=target))
        rays["target"] = target.rays
    if pilots:
        report_lacking_space(session, setup, ambient, report, strict=strict)
    manifest = initial_manifest(prepared, ambient, session.identity, session.settings, target, warnings)
    return setup, ambient, manifest, rays, sample


def report_warnings(job: Job, warnings: Sequence[str], report: Report, *, strict: bool) -> None:
    """Report warnings.

    Raises:
        JobError: there are some, and they are errors.
    """
    if strict and warnings:
        raise JobError(job.file or job.name, warnings)
    for text in warnings:
        report(Warned(text=text))


def report_lacking_space(
    session: RenderSession, setup: FrameSetup, ambient: Ambient, report: Report, *, strict: bool
) -> None:
    """Report if the missing files need more space than the disk has free.

    Raises:
        JobError: as `report_warnings`.
        OutputError: as `find_lacking_space`.
    """
    prepared, n = session.prepared, session.prepared.n_lights
    missing = session.on_disk.missing_images(session.wanted, n) / n  # a part of a camera position counts as its share
    found = find_lacking_space(prepared, setup, ambient, missing)
    report_warnings(prepared.job, found, report, strict=strict)


class _Run:
    """One run of the program: renders frames and records them, and counts rays and time."""

    def __init__(
        self,
        session: RenderSession,
        record: RecordWriter,
        report: Report,
        ambient: Ambient,
        rays: Counter[str],
        started: float,
    ) -> None:
        self._session, self._prepared, self._record, self._report = session, session.prepared, record, report
        self._ambient, self._rays, self._stages, self._started = ambient, rays, Counter[str](), started
        self._images, self._done, self._lock = 0, set[int](), Lock()
        self._divided = 0  # times anew
        self._pool: TracePool | None = None
        self._pace: Pace  # from `begin` on

    def begin(self, setup: FrameSetup, sample: Images, parts: Sequence[RenderPart]) -> None:
        """Begin to measure how long the frames of some parts take."""
        prepared = self._prepared
        work = sum((block_work(part.setup, part.wanted, still=prepared.still) for part in parts), NO_WORK)
        n = len(parts[0].lights) if parts else 1
        expected = Expected(
            plane=pixel_cost(setup, n) * setup.n_pixels / hit_cost(setup, n),
            image=writing_cost(prepared, sample),
            busy=prepared.threads,
        )
        self._pace = Pace(work, expected, report=lambda left: self._report(TimeLeft(seconds=left)))

    def divide_anew(self, part: RenderPart, setup: FrameSetup, sample: Images) -> list[RenderPart]:
        """Divide what is missing by the memory that is free now, after a part was given up for other programs."""
        note(self._report, ["other programs need memory; the images that are missing take less from here on"])
        self._divided += 1
        gc.collect()  # of what refers to itself
        now = replace(self._session, on_disk=OnDisk(records=self._records()))
        parts = find_parts(now, setup, self._report, part.strips.all[: part.strips.now])
        self.begin(setup, sample, parts)
        return parts

    def render_part(self, part: RenderPart) -> bool:
        """Render the wanted cameras at a block of light positions [FA alg. 1].

        Trace the hits of each frame, compose a frame as soon as the hits of its window are there, and write it.

        Returns:
            False if it was given up, as other programs need memory; never if the job has a limit of its own, nor where
            parts have a few light positions only, as their rows are few already. Frames composed before are written.
        """
        setup, lights, wanted, pace = part.setup, part.lights, part.wanted, self._pace
        prepared, still, target = self._prepared, self._prepared.still, array_target(self._prepared)
        keeps = prepared.job.render.memory or len(lights) < prepared.n_lights or self._divided == MOST_DIVISIONS
        before, given_up = resident_memory(), False

        def stops() -> bool:
            nonlocal given_up
            given_up = not keeps and is_scarce(resident_memory() - before)
            return given_up

        done = pace.written, lambda: self._report(ImagesWritten(images=1)), self._finished
        more, filed = (part.strips, part.slices), not codes_rows(prepared.job)
        writing = partial(ArrayWriter, target, lights, prepared.threads, *done, *more, filed=filed)
        with self._open_pool(setup) as pool, writing() as writer:
            frames = compose_frames(
                prepared, setup, self._ambient, pool, [0] if still else wanted, writer.block, lights,
                slices=part.slices, found=lambda c: pace.lap(hits=eye_work(setup, c)), stops=stops,
            )  # fmt: skip
            for composed, images in frames:
                pace.lap(planes=len(lights) * len(composed.rows) / setup.cams.height)
                writer.write(composed, wanted if still else [composed.c], images)
            writer.finish()
        return not given_up

    @contextmanager
    def _open_pool(self, setup: FrameSetup) -> Iterator[TracePool]:
        """Open a pool whose rays and processor seconds count for this run."""
        self._pool = pool = TracePool(setup, self._prepared.threads)
        try:
            with pool:
                yield pool
        finally:
            self._rays += pool.rays()
            self._stages.update(pool.seconds())
            self._pool = None

    def _finished(self, entry: Entry) -> None:
        """Record that all files of a camera are on disk; called from any thread."""
        pool, images = self._pool, len(range(*entry.lights))
        rays = self._rays + (pool.rays() if pool else Counter[str]())
        self._record.add(entry, rays, time.perf_counter() - self._started)
        with self._lock:
            self._done.add(entry.c)
            self._images += images
        self._report(FrameWritten(camera=entry.c, images=images))

    def _records(self) -> ArrayRecords:
        """Return the records of all runs; files found damaged count once they are rendered again."""
        records = read_records(self._prepared.job.output.directory, self._record.fingerprint)
        bad = {name for name, _ in self._session.on_disk.damaged}
        whole = tuple(e for e in records.entries if e.c in self._done or bad.isdisjoint(e.files))
        return replace(records, entries=whole)

    def summary(self) -> Summary:
        """Summarize this and all other runs."""
        return summarize(
            self._prepared,
            self._records(),
            images=self._images,
            seconds=time.perf_counter() - self._started,
            rays=self._rays,
            stages=self._stages,
            notes=self._ambient.notes,
        )
