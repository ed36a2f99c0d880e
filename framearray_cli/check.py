"""What a job will take, without rendering it: `framearray check`."""

import os
import shutil
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import psutil

from .filepatterns import file_patterns
from .frame import Crew, Work, find_frame
from .job import Job
from .memory import window_memory
from .prepare import Prepared, open_embree, plan_work, prepare
from .render import image_format
from .terms.ambient import Ambient
from .window import Window
from .writer import ArrayWriter

# The probe renders at a resolution divided by this: coarse enough to be quick, fine enough that neighbouring rays
# stay neighbours.
PROBE_DIVISOR = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What a job takes.

    Attributes:
        memory: bytes of the frames under way; `available`: bytes the machine has free.
        disk: bytes of all images and layers; `free`: bytes free where they go.
        seconds: from start to end, writing included.
    """

    prepared: Prepared
    ambient: Ambient
    memory: int
    available: int
    disk: int
    free: int
    seconds: float

    @property
    def warnings(self) -> tuple[str, ...]:
        """What would go wrong."""
        found = []
        if self.memory > self.available:
            found.append("the job needs more memory than is free; fewer lights, a smaller n_r or resolution take less")
        if self.disk > self.free:
            found.append("the images need more space than the disk has free")
        return tuple(found)


def check(job: Job) -> Estimate:
    """Read everything that a job names, and estimate what it takes from a few small frames that are thrown away.

    Raises:
        JobError, SceneError: the job cannot be rendered.
    """
    started = time.perf_counter()
    prepared = prepare(job)
    with open_embree(prepared) as embree:
        work, ambient = plan_work(prepared, embree)
        before_first_frame = time.perf_counter() - started
        seconds_a_hit, bytes_a_pixel = _probe(prepared, work, ambient)
    hits = float(work.per_pixel.sum()) * work.n_pixels
    return Estimate(
        prepared=prepared,
        ambient=ambient,
        memory=window_memory(work),
        available=psutil.virtual_memory().available,
        disk=int(bytes_a_pixel * work.n_pixels * prepared.n_cameras),
        free=shutil.disk_usage(_existing(job.output.directory)).free,
        seconds=before_first_frame + seconds_a_hit * hits,
    )


def _probe(prepared: Prepared, work: Work, ambient: Ambient) -> tuple[float, float]:
    """Render and write small frames from the middle of the path: seconds a native hit, and bytes a pixel a camera."""
    n = min(2 * work.n_r + 2, work.n_frames)
    first = (work.n_frames - n) // 2
    cams, span = work.cams, slice(first, first + n)
    width, height = (max(1, -(-side // PROBE_DIVISOR)) for side in (cams.width, cams.height))
    small = replace(
        work,
        cams=cams._replace(
            position=cams.position[span],
            right=cams.right[span],
            up=cams.up[span],
            forward=cams.forward[span],
            focal=cams.focal * height / cams.height,
            width=width,
            height=height,
        ),
        per_pixel=work.per_pixel[span],
    )
    job = prepared.job
    patterns = file_patterns(job.name, prepared.n_cameras, prepared.n_lights, job.output.format)
    crew = Crew(small, job.render.threads or os.cpu_count() or 1)
    try:
        with tempfile.TemporaryDirectory() as folder:
            find_frame(small, 0, crew)  # compiles what is not compiled yet
            started = time.perf_counter()
            with ArrayWriter(
                Path(folder),
                patterns,
                prepared.eyes,
                (width, height),
                job.output.fps,
                image_format(job),
                prepared.n_lights,
                crew.threads,
                lambda images: None,
            ) as writer:
                window = Window(small, ambient, crew)
                for c in range(n):
                    window.add(find_frame(small, c, crew))
                    for j in window.complete():
                        writer.write(window.compose(j, writer.block()), range(j, j + 1))
                writer.finish()
            seconds = time.perf_counter() - started
            written = sum(file.stat().st_size for file in Path(folder).iterdir())
    finally:
        crew.close()
    return seconds / (float(np.sum(small.per_pixel)) * width * height), written / (n * width * height)


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that exists."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder
