"""How much memory this process used, and how much a job will need."""

import sys

import psutil

from .errors import JobError
from .plan import frame_hits
from .prepare import Prepared
from .terms.ambient import BATCH
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


def require_memory(prepared: Prepared) -> None:
    """Refuse a job that does not fit into memory; the system would end the program without a word.

    Raises:
        JobError: it does not.
    """
    needed, free = max(window_memory(prepared), ambient_memory(prepared)), free_memory()
    if needed > free:
        problem = (
            f"rendering needs about {needed / 2**30:.1f} GiB of memory, {free / 2**30:.1f} GiB are free; "
            "a smaller camera.resolution, reuse.n_r or samples.hits, or fewer light.frames, take less"
        )
        raise JobError(prepared.job.file or prepared.job.name, [problem])


def ambient_memory(prepared: Prepared) -> int:
    """Bytes that a batch of walks takes: what each gathers of every light, in float32 and twice in float64."""
    return BATCH * prepared.n_lights * 3 * (4 + 8 + 8)


def window_memory(prepared: Prepared) -> int:
    """Bytes that the window of frames and the images under way will take, mirrors left out.

    A hit takes its irradiance under every light, reflectivity, W, and its place and weight in every frame that uses it.
    """
    job, n_lights = prepared.job, prepared.n_lights
    n_frames, n_r = (1, 0) if prepared.still else (prepared.n_cameras, job.reuse.n_r)
    width, height = job.camera.resolution
    per_pixel = frame_hits(n_frames, job.reuse.n_r, job.samples.hits)
    held = max(float(per_pixel[max(j - n_r, 0) : j + n_r + 1].sum()) for j in range(n_frames))
    frames = min(2 * n_r + 1, n_frames)
    balance, has_constant = job.reuse.weights == "balance" and n_r > 0, any(job.scene.background)
    per_hit = 4 * (prepared.light_arrays.channels * n_lights + 6 + 3 * has_constant + 4 * job.output.layers)
    per_hit += frames * (8 if balance else 4)
    per_image_pixel = frames * frames * 4 + BLOCKS * 12 * n_lights
    return int(width * height * (held * per_hit + per_image_pixel))
