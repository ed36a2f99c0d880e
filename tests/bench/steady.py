"""Runs the frame loop in its steady state, and measures it.

A run takes `frames` cameras from the middle of a job's path. The window is filled before the clock starts and nothing
is compiled while it runs, so that what is measured is the cost of an interior frame.
"""

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from framearray_cli.arrays import Int32
from framearray_cli.embree import EmbreeScene
from framearray_cli.filepatterns import file_patterns
from framearray_cli.frame import Crew, Work, find_frame
from framearray_cli.images import ImageFormat
from framearray_cli.job import Job
from framearray_cli.prepare import Prepared, open_embree, plan_work, prepare
from framearray_cli.terms.ambient import Ambient
from framearray_cli.window import Window
from framearray_cli.writer import ArrayWriter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A job, opened and planned."""

    prepared: Prepared
    embree: EmbreeScene
    work: Work
    ambient: Ambient
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What a steady run cost.

    Attributes:
        images: that were made while the clock ran.
        ms: wall time an image.
        stages: thread time an image by stage, ms.
        rays: rays a pixel an image, by kind.
        hits: accepted hits a pixel of a frame: mean and 1st percentile.
    """

    images: int
    ms: float
    stages: dict[str, float]
    rays: dict[str, float]
    hits: tuple[float, float]


@contextmanager
def opened(job: Job) -> Iterator[Case]:
    """Open a job for measuring."""
    prepared = prepare(job)
    with open_embree(prepared) as embree:
        work, ambient = plan_work(prepared, embree)
        yield Case(prepared=prepared, embree=embree, work=work, ambient=ambient)


def interior(work: Work) -> Work:
    """The same work with every frame an interior one: no frame is given more hits because the path ends."""
    return replace(work, per_pixel=np.full_like(work.per_pixel, work.per_pixel[work.n_frames // 2]))


def steady(case: Case, frames: int, image_format: ImageFormat | None) -> Measured:
    """Render `frames` interior frames.

    Args:
        image_format: how images are written, or None: they are composed and dropped.
    """
    work, n_r = interior(case.work), case.work.n_r
    before = 2 * n_r + 1  # frames that fill the window and compose one frame, so that all is compiled
    first = max(0, (work.n_frames - frames - before) // 2)
    crew = Crew(work, case.threads)
    window = Window(work, case.ambient, crew, first=min(first + n_r, work.n_frames - 1))
    hits: list[Int32] = []
    try:
        with tempfile.TemporaryDirectory() as folder, _writer(case, Path(folder), image_format) as writer:
            for c in range(first, first + before + frames):
                if c == first + before:
                    writer.finish()
                    hits.clear()
                    rays, seconds, started = crew.rays(), crew.seconds(), time.perf_counter()
                window.add(find_frame(work, c, crew))
                for j in window.complete():
                    composed = window.compose(j, writer.block())
                    hits.append(composed.hits)
                    if image_format is None:
                        writer.give_back(composed.images)
                    else:
                        writer.write(composed, range(j, j + 1))
            writer.finish()
            wall = time.perf_counter() - started
    finally:
        crew.close()
    images = len(hits) * work.lights.n_lights
    per_image = 1.0 / images
    all_hits = np.concatenate(hits)
    return Measured(
        images=images,
        ms=1e3 * wall * per_image,
        stages={s: 1e3 * (t - seconds.get(s, 0.0)) * per_image for s, t in crew.seconds().items()},
        rays={k: (n - rays[k]) * per_image / work.n_pixels for k, n in crew.rays().items()},
        hits=(float(all_hits.mean()), float(np.percentile(all_hits, 1))),
    )


def _writer(case: Case, folder: Path, image_format: ImageFormat | None) -> ArrayWriter:
    job, prepared = case.prepared.job, case.prepared
    stored = image_format or ImageFormat()
    return ArrayWriter(
        folder,
        file_patterns(job.name, prepared.n_cameras, prepared.n_lights, stored.format),
        prepared.eyes,
        job.camera.resolution,
        job.output.fps,
        stored,
        prepared.n_lights,
        case.threads,
        lambda images: None,
    )
