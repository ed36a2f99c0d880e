"""How much memory this process used, and how much a job will need."""

import sys

import psutil

from .frame import Work
from .writer import BLOCKS


def peak_memory() -> int:
    """Largest resident size of this process so far, bytes."""
    if sys.platform == "win32":
        return int(psutil.Process().memory_info().peak_wset)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)  # bytes on macOS, KiB elsewhere


def window_memory(work: Work) -> int:
    """Bytes that the window of frames and the images under way will take, mirrors left out.

    A hit takes its irradiance under every light, reflectivity, W, and its place and weight in every frame that uses it.
    """
    held = [int(work.per_pixel[work.frames_around(j, work.n_r)].sum()) for j in range(work.n_frames)]
    frames = min(2 * work.n_r + 1, work.n_frames)
    per_hit = 4 * (work.lights.channels * work.lights.n_lights + 6 + 3 * work.has_constant + 4 * work.layers)
    per_hit += frames * (8 if work.balance else 4)
    images = BLOCKS * 12 * work.lights.n_lights * work.n_pixels
    return max(held) * work.n_pixels * per_hit + frames * frames * 4 * work.n_pixels + images
