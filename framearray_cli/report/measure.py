"""Render frames with some settings, time them, and compare them with references."""

import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float32, Int32
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import ArrayPool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames

from .case import Case, with_lights, with_settings
from .reference import Quality, Reference, compare_frame, mean_quality
from .settings import NamedSettings, Settings
from .truth import TruthError, compare_with_truth, mean_truth_error

# Seeds of the two runs to compare with the two halves of a reference.
SEEDS = (101, 202)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimedFrame:
    """A frame, rendered with some settings.

    Attributes:
        images: (n_lights, h, w, 3) radiance.
        seconds: wall time to trace and to compose an interior frame, without writing.
        hits: (n_pixels,) number of hits of each pixel.
    """

    images: Float32
    seconds: float
    hits: Int32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredMethod:
    """Cost of some settings, and their error with respect to true light.

    Attributes:
        ms: wall time per image, before writing.
        truth: error with respect to true light, where the report has any.
    """

    named: NamedSettings
    ms: float
    truth: TruthError | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured(MeasuredMethod):
    """Cost and error of settings with the job's own way to find indirect light.

    Attributes:
        quality: mean over all images.
        hits: accepted hits per pixel: mean and 1st percentile.
        example: (h, w, 3) the first image, of the first run.
    """

    quality: Quality
    hits: tuple[float, float]
    example: Float32


def render_frame(
    case: Case, settings: Settings, c: int, lights: Sequence[int], seed: int, arrays: ArrayPool
) -> TimedFrame:
    """Render a frame with some settings and a window, as a render does.

    Args:
        lights: light positions of the returned images.
        arrays: memory for hits, which the next run reuses.
    """
    changed = with_settings(case, settings)
    changed = with_lights(changed, lights) if settings.one_light else changed
    setup = replace(changed.setup, seed=seed)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    block = np.full(shape, 0, np.float16)  # the first write to memory costs time per page
    exact = np.empty(shape, np.float32)
    with TracePool(setup, changed.prepared.threads) as pool:
        pool.arrays = arrays
        window, times = Window(setup, changed.ambient, pool), [time.perf_counter()]
        next(ready_frames(window, setup, [c], pool, lambda eye: times.append(time.perf_counter())))
        window.compose(c, block)  # timed as a render composes; the images to compare are not rounded to halves
        composing = time.perf_counter() - times[-1]
        hits = window.compose(c, exact).hits
    images = exact if settings.one_light else exact[list(lights)]
    return TimedFrame(images=images, seconds=float(np.median(np.diff(times))) + composing, hits=hits)


def measure(
    case: Case, named: NamedSettings, lights: Sequence[int], references: Mapping[int, Reference],
    truths: Mapping[int, Reference], rows: Sequence[int],
) -> Measured:  # fmt: skip
    """Render the images of some settings twice, and compare them with the references, and with true light.

    Args:
        references: by frame; `truths`: of some frames, at the light positions `rows` of `lights`.
    """
    found, true_errors, arrays = [], list[TruthError](), ArrayPool()
    runs = {c: [render_frame(case, named.settings, c, lights, seed, arrays) for seed in SEEDS] for c in references}
    for c, (first, second) in runs.items():
        found += compare_frame((first.images, second.images), references[c], case.ambient, lights)
        if c in truths:
            true_errors += compare_with_truth([first.images, second.images], truths[c], rows)
    all_hits = np.concatenate([first.hits for first, _ in runs.values()])
    return Measured(
        named=named,
        ms=1e3 * _steady([run.seconds for pair in runs.values() for run in pair]) / case.setup.lights.n_lights,
        quality=mean_quality(found),
        hits=(float(all_hits.mean()), float(np.percentile(all_hits, 1))),
        example=next(iter(runs.values()))[0].images[0],
        truth=mean_truth_error(true_errors),
    )


def measure_method(
    case: Case, named: NamedSettings, lights: Sequence[int], truths: Mapping[int, Reference], rows: Sequence[int]
) -> MeasuredMethod:
    """Render the frames that there are in true light with another method, and compare them."""
    arrays = ArrayPool()
    runs = {c: render_frame(case, named.settings, c, lights, SEEDS[0], arrays) for c in truths}
    found = [error for c, run in runs.items() for error in compare_with_truth([run.images], truths[c], rows)]
    ms = 1e3 * _steady([run.seconds for run in runs.values()]) / case.setup.lights.n_lights
    return MeasuredMethod(named=named, ms=ms, truth=mean_truth_error(found))


def measure_single_lights(
    case: Case, named: NamedSettings, cameras: Sequence[int], lights: Sequence[int], twin: Measured
) -> Measured:
    """Time images rendered for one light position each; copy their errors from `twin`, which has the same pixels."""
    arrays = ArrayPool()
    runs = [render_frame(case, named.settings, c, lights[:1], SEEDS[0], arrays) for c in cameras]
    return replace(twin, named=named, ms=1e3 * _steady([run.seconds for run in runs]))


def _steady(seconds: Sequence[float]) -> float:
    """The median of runs that share memory, without the first, if there are more: a long render has all its pages."""
    return statistics.median(seconds[1:] or seconds)
