"""One frame of a case for one seed, from its whole window, to compare with others."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.loop import window_of

from .cases import Case


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
