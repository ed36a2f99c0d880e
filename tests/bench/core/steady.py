"""Runs the frame loop in its steady state, and measures it.

A run takes some cameras from the job's path. The window is filled before the clock starts and nothing is compiled
while it runs, so the result is the cost of an interior frame.
"""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from framearray_cli.array.images import ImageFormat
from framearray_cli.array.manifest import file_patterns
from framearray_cli.base.arrays import Images, Int32
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup, Scratch
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.render.writer import BLOCKS, ArrayNames, ArrayWriter, PlaneFiles, array_target

from .cases import Case
from .results import Table, median

# Stages that lie within another one: their time is counted there.
WITHIN_MIRROR = ("mirror obscurance", "mirror shadow")


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """The cost of a steady run.

    Attributes:
        images: that were made while the clock ran.
        ms: wall time per image, and `cpu_ms`: time of all threads per image.
        stages: thread time per image by stage, ms; "rest" is all other time of the threads, with waiting. "writing"
            is processor time; it runs beside the others.
        rays: rays per pixel and image, by kind.
        hits: accepted hits per pixel of a frame: mean and 1st percentile.
        serial: share of the wall time in which no thread of the pool works; with one thread it is Amdahl's figure.
    """

    images: int
    ms: float
    cpu_ms: float
    stages: dict[str, float]
    rays: dict[str, float]
    hits: list[float]
    serial: float

    def table(self) -> Table:
        """As a plain table."""
        return asdict(self)


class TimedPool(TracePool):
    """A pool that knows how long it worked, seconds of the thread that calls it."""

    def __init__(self, setup: FrameSetup, threads: int) -> None:
        self.worked = 0.0
        super().__init__(setup, threads)

    def run(self, task: Callable[[Any, Scratch], Any], items: Iterable[Any]) -> list[Any]:
        """Run the tasks, and add the time until all are done."""
        started = time.perf_counter()
        try:
            return super().run(task, items)
        finally:
            self.worked += time.perf_counter() - started


class TimedWriter(ArrayWriter):
    """A writer that knows how much processor time its threads took."""

    def __init__(self, *args: Any, writes: bool) -> None:
        self.seconds = 0.0
        self._writes = writes
        self._lock = Lock()
        super().__init__(*args, self._count)

    def take(self, composed: Composed, c: int) -> None:
        """Write a frame, or drop it."""
        if self._writes:
            self.write(composed, range(c, c + 1), composed.images)
        else:
            self.give_back(composed.images)

    def give_back(self, block: Images) -> None:
        """Take a block back that is not to be written."""
        self._free.put(block)

    def _count(self, _images: float, seconds: float) -> None:
        with self._lock:
            self.seconds += seconds


def start_of(case: Case, frames: int, place: float) -> int:
    """The first camera of a run whose measured cameras lie about a place of the path, 0 to 1."""
    before = 2 * case.setup.n_r + 1
    last = case.setup.n_frames - frames - before
    if last < 0:
        raise ValueError(f"{frames} frames with n_r = {case.setup.n_r} do not fit a path of {case.setup.n_frames}")
    return min(max(round(place * case.setup.n_frames) - frames // 2 - case.setup.n_r - 1, 0), last)


def steady(case: Case, frames: int, image_format: ImageFormat | None = None, place: float = 0.5) -> Measured:
    """Make the images of `frames` interior frames.

    Args:
        image_format: how images are written, or None: they are composed and dropped.
        place: where on the path, 0 to 1.
    """
    setup, n_r = case.setup, case.setup.n_r
    first = start_of(case, frames, place) + n_r
    with TimedPool(setup, case.prepared.threads) as pool:
        window = Window(setup, case.ambient, pool)
        ready = ready_frames(window, setup, range(first, first + 1 + frames), pool)
        with _writer(case, Path(), None) as nothing:
            _compose(window, islice(ready, 1), nothing)  # fills the window, and compiles the kernels
        return _measured(case, window, ready, pool, image_format)


def _measured(
    case: Case, window: Window, ready: Iterator[int], pool: TimedPool, image_format: ImageFormat | None
) -> Measured:
    """Time the remaining frames."""
    setup = case.setup
    with tempfile.TemporaryDirectory() as folder, _writer(case, Path(folder), image_format) as writer:
        rays, seconds, worked = pool.rays(), pool.seconds(), pool.worked
        started, cpu = time.perf_counter(), time.process_time()
        hits = _compose(window, ready, writer)
        wall, cpu = time.perf_counter() - started, time.process_time() - cpu
        spent = {stage: t - seconds.get(stage, 0.0) for stage, t in pool.seconds().items()}
        images = len(hits) * setup.lights.n_lights
        spent = {stage: t for stage, t in spent.items() if stage not in WITHIN_MIRROR}
        spent["rest"] = case.prepared.threads * wall - sum(spent.values())
        spent["writing"] = writer.seconds
        serial = 1.0 - (pool.worked - worked) / wall
    all_hits = np.concatenate(hits)
    return Measured(
        images=images,
        ms=1e3 * wall / images,
        cpu_ms=1e3 * cpu / images,
        stages={stage: 1e3 * t / images for stage, t in spent.items()},
        rays={kind: (n - rays[kind]) / images / setup.n_pixels for kind, n in pool.rays().items()},
        hits=[float(all_hits.mean()), float(np.percentile(all_hits, 1))],
        serial=serial,
    )


def _compose(window: Window, ready: Iterator[int], writer: TimedWriter) -> list[Int32]:
    """Find and compose frames, as the program does; returns hits by pixel."""
    hits: list[Int32] = []
    for j in ready:
        composed = window.compose(j, writer.block())
        hits.append(composed.hits)
        writer.take(composed, j)
    writer.finish()
    return hits


def steady_mean(cases: Sequence[Case], frames: int, formats: Sequence[ImageFormat | None], place: float) -> list[Table]:
    """Run every case once per format, with the same cameras.

    Returns:
        for each format, the mean over the cases, which all make the same number of images.
    """
    return [mean([steady(case, frames, stored, place).table() for case in cases]) for stored in formats]


def mean(tables: Sequence[Table]) -> Table:
    """The mean of equal tables of numbers, number by number; `images` is their sum."""
    return {**median(tables, statistics.fmean), "images": sum(table["images"] for table in tables)}


def _writer(case: Case, folder: Path, image_format: ImageFormat | None) -> TimedWriter:
    prepared, n_lights = case.prepared, case.setup.lights.n_lights
    stored = image_format or ImageFormat()
    pattern, layers = file_patterns(prepared.job.name, prepared.n_cameras, n_lights, stored.format)
    names = ArrayNames(images=tuple(PlaneFiles(pattern, l, "") for l in range(n_lights)), layers=layers)
    writer = TimedWriter(
        replace(array_target(prepared), directory=folder, names=names, format=stored),
        range(n_lights),
        case.prepared.threads,
        writes=image_format is not None,
    )
    for block in [writer.block() for _ in range(BLOCKS)]:  # the first write to memory costs time per page
        block.fill(0)
        writer.give_back(block)
    return writer
