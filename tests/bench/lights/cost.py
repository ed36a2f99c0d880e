"""The cost of an image under lights of every kind, frame by frame in turns with a light without size."""

import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import numpy as np

from bench.core.cases import Case, open_case
from bench.core.machine import describe, quiet
from bench.core.results import Table
from bench.core.steady import start_of
from bench.speed.speed import log
from framearray_cli.base.arrays import Images
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.job.job import Job
from framearray_cli.render.frames import visible_lamps

from .sources import KNOWN_AMBIENT, job_at, job_with, sources_of

RESOLUTION, QUICK_RESOLUTION = (240, 180), (48, 36)
FRAMES, QUICK_FRAMES = 9, 1
PLACE = 0.4  # of the camera path
# By part: the job, and the sources that take turns; the first is what the others are compared with.
PARTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "cost-sun": ("kitchen", ("direction", "sun", "sun, visible")),
    "cost-sky": ("kitchen", ("direction", "two directions", "sky", "sky and sun")),
    "cost-lamps": ("cabin", ("point", "sphere", "sphere, visible", "spot", "IES")),
    "cost-panels": ("cabin", ("point", "square", "square of 40 cm", "disc", "mesh")),
}


@dataclass(kw_only=True, eq=False)
class Taker:
    """A job that makes one frame when its turn comes.

    Attributes:
        ms: per image, of each frame.
    """

    case: Case
    pool: TracePool
    window: Window
    ready: Iterator[int]
    images: Images
    ms: list[float] = field(default_factory=list)

    def take(self) -> float:
        """Find the hits of one eye and compose one frame, as a render does between two files; ms per image."""
        started = time.perf_counter()
        j = next(self.ready)
        composed = self.window.compose(j, self.images)
        planes = range(len(self.images))
        if lamps := visible_lamps(self.case.prepared, self.case.setup, j, planes, self.pool):
            lamps.draw(composed.images, composed.rows)
        return 1e3 * (time.perf_counter() - started) / len(self.images)


def measure(part: str, quick: bool, folder: Path, patience: float = 0.0) -> Table:
    """Measure a part: source -> medians over frames; `ratio` is over the first source, frame by frame."""
    name, sources = PARTS[part]
    resolution = QUICK_RESOLUTION if quick else RESOLUTION
    job, known = job_at(name, resolution), sources_of(name, folder / "lights")
    jobs = {source: job_with(job, known[source], KNOWN_AMBIENT) for source in sources}
    share = quiet(patience)
    found = in_turns(part, jobs, QUICK_FRAMES if quick else FRAMES, PLACE)
    return {
        "machine": describe(), "job": name, "resolution": list(resolution), "busy": share, "sources": found,
        "hits": job.samples.hits,
    }  # fmt: skip


def in_turns(part: str, jobs: Mapping[str, Job], frames: int, place: float) -> dict[str, Table]:
    """Make `frames` interior frames of each job of a part, one of each in turn, all with the same cameras.

    Returns:
        by job: frames, the ms per image of each frame; ms, their median; rays per pixel and image by kind; stages,
        thread ms per image; ratio, the median over the first job, frame by frame.
    """
    with ExitStack() as stack:
        takers = {name: _open(stack, job, frames, place) for name, job in jobs.items()}
        before = {name: (taker.pool.rays(), taker.pool.seconds()) for name, taker in takers.items()}
        order = list(takers)
        for _ in range(frames):
            for name in order:
                takers[name].ms.append(takers[name].take())
            order = order[1:] + order[:1]
        found = {name: _table(taker, *before[name]) for name, taker in takers.items()}
    first = next(iter(takers.values())).ms
    for name, table in found.items():
        table["ratio"] = median(a / b for a, b in zip(table["frames"], first, strict=True))
        log(f"{part}: {name} {table['ms']:.3g} ms, {table['ratio']:.3f}x")
    return found


def _open(stack: ExitStack, job: Job, frames: int, place: float) -> Taker:
    """Fill the window of a job, and compile its kernels."""
    case = stack.enter_context(open_case(job))
    setup = case.setup
    pool = stack.enter_context(TracePool(setup, case.prepared.threads))
    window = Window(setup, case.ambient, pool)
    first = start_of(case, frames, place) + setup.n_r
    images = np.zeros((setup.lights.n_lights, setup.cams.height, setup.cams.width, 3), np.float16)
    ready = ready_frames(window, setup, range(first, first + 1 + frames), pool)
    taker = Taker(case=case, pool=pool, window=window, ready=ready, images=images)
    taker.take()
    return taker


def _table(taker: Taker, rays: Mapping[str, int], seconds: Mapping[str, float]) -> Table:
    images = len(taker.ms) * len(taker.images)
    pixels = taker.case.setup.n_pixels
    return {
        "frames": taker.ms,
        "ms": median(taker.ms),
        "rays": {kind: (n - rays.get(kind, 0)) / images / pixels for kind, n in taker.pool.rays().items()},
        "stages": {kind: 1e3 * (t - seconds.get(kind, 0.0)) / images for kind, t in taker.pool.seconds().items()},
    }
