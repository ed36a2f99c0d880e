"""Error by offset in the window: a frame composed from the hits of one eye of its window at a time."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.loop import window_of

from .case import Case, with_settings
from .measure import SEEDS
from .metrics import squared_bias
from .reference import Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Offset:
    """The contribution of the hits of one eye to a frame.

    Attributes:
        offset: of the eye along the path, in frames.
        accepted: hits that the frame sees, over those that the eye found.
        covered: share of pixels with such hits.
        rmse: over covered pixels, relative to the mean of the reference there.
        squared_bias, squared_bias_error: over covered pixels, see `Quality`.
    """

    offset: int
    accepted: float
    covered: float
    rmse: float
    squared_bias: float
    squared_bias_error: float


def measure_offsets(case: Case, c: int, lights: Sequence[int], reference: Reference) -> list[Offset]:
    """Compose frame c from only one eye of its window at a time, with the job's own settings."""
    changed = with_settings(case, case.settings)
    images = np.empty((2, case.setup.lights.n_lights, case.setup.cams.height, case.setup.cams.width, 3), np.float32)
    windows, found = [], []
    with ExitStack() as pools:
        for seed in SEEDS:
            setup = replace(changed.setup, seed=seed)
            pool = pools.enter_context(TracePool(setup, changed.threads))
            windows.append(window_of(c, setup, changed.ambient, pool))
        for k in changed.setup.frames_around(c, changed.setup.n_r):
            hits = [window.compose(c, images[i], [k]).hits for i, window in enumerate(windows)]
            found.append(_compare_offset(case, k - c, hits, images, lights, reference))
    return found


def _compare_offset(
    case: Case, offset: int, hits: Sequence[np.ndarray], images: np.ndarray, lights: Sequence[int],
    reference: Reference,
) -> Offset:  # fmt: skip
    shape = reference.depth.shape
    seen = ((hits[0] > 0) & (hits[1] > 0)).reshape(shape)
    rows = []
    for i, l in enumerate(lights):
        ambient = case.ambient.intensity[l]
        right, halves = reference.image(i, ambient), [reference.half(h, i, ambient) for h in (0, 1)]
        mean = float(right[seen].mean(dtype=np.float64)) if seen.any() else 1.0
        rmse = (
            float(np.sqrt(np.mean((images[0, l][seen] - right[seen]).astype(np.float64) ** 2))) if seen.any() else 0.0
        )
        runs = [np.where(seen[..., None], images[run, l], halves[run]) for run in (0, 1)]
        square, spread = squared_bias((runs[0], runs[1]), (halves[0], halves[1]))
        share = float(seen.mean()) or 1.0
        rows.append((rmse / mean, square / share / mean**2, spread / share / mean**2))
    per_pixel = case.settings.hits
    rmse, square, spread = np.mean(rows, axis=0)
    return Offset(
        offset=offset,
        accepted=float(hits[0].mean()) / per_pixel,
        covered=float(seen.mean()),
        rmse=float(rmse),
        squared_bias=float(square),
        squared_bias_error=float(spread) / len(rows) ** 0.5,
    )
