"""How much memory this process used, and how much a job will need."""

import sys

import psutil

from .errors import JobError
from .frame import Work
from .job import Job
from .writer import BLOCKS


def peak_memory() -> int:
    """Largest resident size of this process so far, bytes."""
    if sys.platform == "win32":
        return int(psutil.Process().memory_info().peak_wset)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)  # bytes on macOS, KiB elsewhere


def free_memory() -> int:
    """Bytes that this process can still get, swap included."""
    return int(psutil.virtual_memory().available + psutil.swap_memory().free)


def require_memory(work: Work, job: Job) -> None:
    """Refuse a job whose frames do not fit into memory; the system would end the program without a word.

    Raises:
        JobError: they do not.
    """
    needed, free = window_memory(work), free_memory()
    if needed > free:
        problem = (
            f"the frames under way need about {needed / 2**30:.1f} GiB of memory, {free / 2**30:.1f} GiB are free; "
            "a smaller camera.resolution, reuse.n_r or samples.hits or fewer light.frames take less"
        )
        raise JobError(job.file or job.name, [problem])


def window_memory(work: Work) -> int:
    """Bytes that the window of frames and the images under way will take, mirrors left out.

    A hit takes its irradiance under every light, reflectivity, W, and its place and weight in every frame that uses it.
    """
    held = [float(work.per_pixel[work.frames_around(j, work.n_r)].sum()) for j in range(work.n_frames)]
    frames = min(2 * work.n_r + 1, work.n_frames)
    per_hit = 4 * (work.lights.channels * work.lights.n_lights + 6 + 3 * work.has_constant + 4 * work.layers)
    per_hit += frames * (8 if work.balance else 4)
    images = BLOCKS * 12 * work.lights.n_lights * work.n_pixels
    return int(max(held) * work.n_pixels * per_hit) + frames * frames * 4 * work.n_pixels + images
