"""One frame of a case for one seed, from its whole window, to compare with others."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.loop import window_of
from framearray_cli.job.job import Job

from .cases import Case, open_case


def frame(case: Case, c: int, seed: int, *, threads: int | None = None) -> Composed:
    """Find the hits of all eyes of the window of frame c, and compose it; its images are not rounded to halves.

    Args:
        threads: None: those of the case.
    """
    setup = replace(case.setup.without_layers(), seed=seed)
    out = np.empty((setup.lights.n_lights, setup.cams.height, setup.cams.width, 3), np.float32)
    with TracePool(setup, threads or case.prepared.threads) as pool:
        return window_of(c, setup, case.ambient, pool).compose(c, out)


def frames(case: Case, c: int, seeds: Sequence[int]) -> list[Composed]:
    """Frame c for many seeds, each on one thread: small pictures cannot keep two threads busy."""
    first = frame(case, c, seeds[0], threads=1)  # compiles all kernels once
    with ThreadPoolExecutor(case.prepared.threads) as pool:
        return [first, *pool.map(lambda seed: frame(case, c, seed, threads=1), seeds[1:])]


def image_of(job: Job, c: int, l: int) -> Float32:
    """One image of a job with reuse, as it would be rendered."""
    with open_case(job) as case:
        image: Float32 = frame(case, c, job.seed, threads=1).images[l]
        return image
