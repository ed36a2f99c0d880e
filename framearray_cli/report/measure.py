"""Render frames with some settings, time them, and compare them with references."""

import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float32, Int32
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import ArrayPool, FrameHits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.intensity import Ambient

from .case import Case, with_lights, with_settings
from .reference import Quality, Reference, compare_frames, mean_quality
from .settings import NamedSettings, Settings
from .truth import Truth, TruthError, compare_with_truth, mean_truth_error

# Seeds of the two runs to compare with the two halves of a reference.
SEEDS = (101, 202)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimedFrames:
    """Consecutive frames, rendered with some settings.

    Attributes:
        images: (n_frames, n_lights, h, w, 3) radiance.
        seconds: wall time per interior frame, to trace and to compose, without writing.
        hits: (n_frames, n_pixels) number of hits of each pixel.
    """

    images: Float32
    seconds: float
    hits: Int32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """Cost and error of some settings.

    Attributes:
        ms: wall time per image, before writing.
        quality: mean over all probe images.
        truth: error with respect to true light, where the report has any.
        hits: accepted hits per pixel: mean and 1st percentile.
        example: (h, w, 3) the first probe image, of the first run.
    """

    named: NamedSettings
    ms: float
    quality: Quality
    hits: tuple[float, float]
    example: Float32
    truth: TruthError | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredMethod:
    """Cost and error of settings with another way to find indirect light.

    Attributes:
        ms: wall time per image, before writing.
        truth: error with respect to true light.
    """

    named: NamedSettings
    ms: float
    truth: TruthError


class TimedWindow(Window):
    """A window that measures how long tracing each frame takes.

    Attributes:
        started: start time of the next frame; reset it after composing between two frames.
        tracing: seconds of each frame.
    """

    def __init__(self, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> None:
        super().__init__(setup, ambient, pool)
        self.started, self.tracing = time.perf_counter(), list[float]()

    def add(self, frame: FrameHits) -> None:
        """Add the hits of the next frame, and note the time since the last one."""
        self.tracing.append(time.perf_counter() - self.started)
        super().add(frame)
        self.started = time.perf_counter()

    def fill_holes(self, j: int) -> None:
        """Fill the holes of frame j, and add the time to the frame that completes its window."""
        super().fill_holes(j)
        self.tracing[-1] += time.perf_counter() - self.started
        self.started = time.perf_counter()


def render_frames(
    case: Case, settings: Settings, cameras: Sequence[int], lights: Sequence[int], seed: int, arrays: ArrayPool
) -> TimedFrames:
    """Render consecutive frames with some settings and a window, as a render does.

    Args:
        cameras: indices of the frames.
        lights: light positions of the returned images.
        arrays: memory for hits, which the next run reuses.
    """
    changed = with_settings(case, settings)
    changed = with_lights(changed, lights) if settings.one_light else changed
    setup = replace(changed.setup, seed=seed)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    block = np.full(shape, 0, np.float16)  # the first write to memory costs time per page
    exact = np.empty(shape, np.float32)
    kept = range(len(lights)) if settings.one_light else lights
    images, hits, composing = [], [], []
    with TracePool(setup, changed.threads) as pool:
        pool.arrays = arrays
        window = TimedWindow(setup, changed.ambient, pool)
        for j in ready_frames(window, setup, range(cameras[0], cameras[-1] + 1), pool):
            started = time.perf_counter()
            window.compose(j, block)  # timed as a render composes; the images to compare are not rounded to halves
            composing.append(time.perf_counter() - started)
            hits.append(window.compose(j, exact).hits)
            images.append(exact[list(kept)])
            window.started = time.perf_counter()
    return TimedFrames(
        images=np.stack(images),
        seconds=statistics.median(window.tracing) + statistics.median(composing),
        hits=np.stack(hits),
    )


def measure(
    case: Case, named: NamedSettings, cameras: Sequence[Sequence[int]], lights: Sequence[int],
    pairs: Sequence[tuple[int, int]], references: dict[int, Reference], truths: Mapping[int, Truth],
) -> Measured:  # fmt: skip
    """Render the probe images of some settings twice, and compare them with the references, and with true light."""
    found, seconds, hits, example = [], [], [], None
    true_errors: list[TruthError] = []
    arrays = ArrayPool()
    for frames in cameras:
        runs = [render_frames(case, named.settings, frames, lights, seed, arrays) for seed in SEEDS]
        seconds += [r.seconds for r in runs]
        hits.append(runs[0].hits)
        pictures = (runs[0].images, runs[1].images)
        found += compare_frames(pictures, [references[c] for c in frames], case.ambient, lights, pairs)
        for i, c in enumerate(frames):
            if c in truths:
                true_errors += compare_with_truth([pictures[0][i], pictures[1][i]], truths[c])
        example = runs[0].images[0, 0] if example is None else example
    assert example is not None
    all_hits = np.concatenate([h.ravel() for h in hits])
    return Measured(
        named=named,
        ms=1e3 * _steady(seconds) / case.setup.lights.n_lights,
        quality=mean_quality(found),
        hits=(float(all_hits.mean()), float(np.percentile(all_hits, 1))),
        example=example,
        truth=mean_truth_error(true_errors),
    )


def measure_method(
    case: Case, named: NamedSettings, lights: Sequence[int], truths: Mapping[int, Truth]
) -> MeasuredMethod | None:
    """Render the frames that there are in true light with another method, and compare them; None where all is black.

    Args:
        case: of `with_method`.
    """
    arrays = ArrayPool()
    runs = {c: render_frames(case, named.settings, [c], lights, SEEDS[0], arrays) for c in truths}
    found = [error for c, run in runs.items() for error in compare_with_truth([run.images[0]], truths[c])]
    truth = mean_truth_error(found)
    if truth is None:
        return None
    ms = 1e3 * _steady([run.seconds for run in runs.values()]) / case.setup.lights.n_lights
    return MeasuredMethod(named=named, ms=ms, truth=truth)


def measure_single_lights(
    case: Case, named: NamedSettings, cameras: Sequence[Sequence[int]], lights: Sequence[int], twin: Measured
) -> Measured:
    """Time images rendered for one light position each; copy their errors from `twin`, which has the same pixels."""
    arrays = ArrayPool()
    runs = [render_frames(case, named.settings, frames[:1], lights[:1], SEEDS[0], arrays) for frames in cameras]
    return replace(twin, named=named, ms=1e3 * _steady([run.seconds for run in runs]))


def _steady(seconds: Sequence[float]) -> float:
    """The median of runs that share memory, without the first, if there are more: a long render has all its pages."""
    return statistics.median(seconds[1:] or seconds)
