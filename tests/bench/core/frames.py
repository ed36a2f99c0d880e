"""One frame of a case for one seed, from its whole window, to compare with references."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from framearray_cli.engine.features.surface import SurfaceLayers
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.loop import window_of

from .cases import Case


def frame(case: Case, c: int, seed: int, *, layers: bool = False, threads: int | None = None) -> Composed:
    """Find the hits of all eyes of the window of frame c, and compose it; its images are not rounded to halves.

    Args:
        threads: None: those of the case.
    """
    features = (*case.setup.without_layers().features, *[SurfaceLayers()] * layers)
    setup = replace(case.setup, seed=seed, features=features)
    out = np.empty((setup.lights.n_lights, setup.cams.height, setup.cams.width, 3), np.float32)
    with TracePool(setup, threads or case.threads) as pool:
        return window_of(c, setup, case.ambient, pool).compose(c, out)


def frames(case: Case, c: int, seeds: Sequence[int], *, layers: bool = False) -> list[Composed]:
    """Frame c for many seeds, each on one thread: small pictures cannot keep two threads busy.

    Args:
        layers: of the first seed.
    """

    def one(i: int) -> Composed:
        return frame(case, c, seeds[i], layers=layers and i == 0, threads=1)

    first = one(0)  # compiles all kernels once
    with ThreadPoolExecutor(case.threads) as pool:
        return [first, *pool.map(one, range(1, len(seeds)))]
