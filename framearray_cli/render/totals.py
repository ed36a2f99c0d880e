"""One run of a render: finished frames in the record, counts of rays, and the time that is left."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from threading import Lock

from framearray_cli.array.integrity import OnDisk
from framearray_cli.array.record import Entry, RecordWriter, read_records
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient

from .division import RenderPart
from .events import FramesBegun, FrameWritten, ImagesWritten, Report, TimeLeft
from .pace import NO_WORK, Expected, Pace, block_work, hit_cost, pixel_cost
from .prepare import Prepared
from .rows import codes_rows
from .summary import Summary, summarize
from .trial import AnyImage, writing_cost
from .writer import ArrayTarget, ArrayWriter


class RunTotals:
    """One run of the program: records finished frames, and counts rays and time."""

    def __init__(
        self, prepared: Prepared, record: RecordWriter, report: Report, rays: Counter[str], started: float
    ) -> None:
        self.prepared, self._record, self._report, self._started = prepared, record, report, started
        self._rays, self._stages = rays, Counter[str]()
        self._images, self._done, self._lock = 0, set[int](), Lock()
        self._pool: TracePool | None = None
        self.pace: Pace  # from `begin` on

    def begin(self, setup: FrameSetup, sample: AnyImage, parts: Sequence[RenderPart]) -> None:
        """Begin to measure how long the frames take, in some parts."""
        prepared = self.prepared
        work = sum((block_work(part.setup, part.wanted, still=prepared.still) for part in parts), NO_WORK)
        n = len(parts[0].lights) if parts else 1
        expected = Expected(
            plane=pixel_cost(setup, n) * setup.n_pixels / hit_cost(setup, n),
            image=writing_cost(prepared, sample),
            busy=prepared.threads,
        )
        self.pace = Pace(work, expected, report=lambda left: self._report(TimeLeft(seconds=left)))
        self._report(FramesBegun())

    def _stored(self, images: int) -> None:
        """Count the images of a file that is on disk; called from any thread."""
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

    def open_writer(self, target: ArrayTarget, part: RenderPart) -> ArrayWriter:
        """Return a writer that reports images and records finished frames."""
        done, filed = (self.pace.written, self._stored, self._finished), not codes_rows(self.prepared.job)
        return ArrayWriter(target, part.lights, self.prepared.threads, *done, part.strips, part.slices, filed=filed)

    def _finished(self, entry: Entry) -> None:
        """Record that all files of a camera are on disk; called from any thread."""
        pool, images = self._pool, len(range(*entry.lights))
        rays = self._rays + (pool.rays() if pool else Counter[str]())
        self._record.add(entry, rays, time.perf_counter() - self._started)
        with self._lock:
            self._done.add(entry.c)
            self._images += images
        self._report(FrameWritten(camera=entry.c, images=images))

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
