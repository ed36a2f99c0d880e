"""Making the pictures of some settings, and timing them."""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float32, Int32
from framearray_cli.engine.frames.frame import FrameHits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.estimate import Ambient

from .case import Case, under, varied
from .quality import Quality, mean_quality, quality
from .reference import Reference
from .settings import Named, Settings

# Seeds of the two runs that are compared with the two halves of a reference.
SEEDS = (101, 202)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """Frames in a row, made with some settings.

    Attributes:
        images: (n_frames, n_lights, h, w, 3) radiance.
        seconds: wall time of an interior frame, finding and composing, without writing.
        hits: (n_frames, n_pixels) hits that each pixel rests on.
    """

    images: Float32
    seconds: float
    hits: Int32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """Cost and error of some settings.

    Attributes:
        ms: wall time an image, before writing.
        quality: means over all probe images.
        hits: accepted hits a pixel: mean and 1st percentile.
        example: (h, w, 3) the first probe image, of the first run.
    """

    named: Named
    ms: float
    quality: Quality
    hits: tuple[float, float]
    example: Float32


class TimedWindow(Window):
    """A window that takes the time until each frame is found.

    Attributes:
        started: when the search for the next frame began; whoever composes between two frames sets it anew.
        finding: seconds of each frame.
    """

    def __init__(self, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> None:
        super().__init__(setup, ambient, pool)
        self.started, self.finding = time.perf_counter(), list[float]()

    def add(self, frame: FrameHits) -> None:
        """Take in the hits of the next frame, and note what it took to find them."""
        self.finding.append(time.perf_counter() - self.started)
        super().add(frame)
        self.started = time.perf_counter()

    def fill_holes(self, j: int) -> None:
        """Fill the holes of frame j, as a part of finding the hits that complete it."""
        super().fill_holes(j)
        self.finding[-1] += time.perf_counter() - self.started
        self.started = time.perf_counter()


def run(case: Case, settings: Settings, cameras: Sequence[int], lights: Sequence[int], seed: int) -> Run:
    """Make frames in a row with some settings, as a render does, window and all.

    Args:
        cameras: frames in a row.
        lights: light positions whose images are handed back.
    """
    changed = varied(case, settings)
    changed = under(changed, lights) if settings.one_light else changed
    setup = replace(changed.setup, seed=seed)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    block = np.empty(shape, np.float16)
    exact = np.empty(shape, np.float32)
    kept = range(len(lights)) if settings.one_light else lights
    images, hits, composing = [], [], []
    with TracePool(setup, changed.threads) as pool:
        window = TimedWindow(setup, changed.ambient, pool)
        for j in ready_frames(window, setup, range(cameras[0], cameras[-1] + 1), pool):
            started = time.perf_counter()
            window.compose(j, block)  # as a render composes it; what is compared is not rounded to halves
            composing.append(time.perf_counter() - started)
            hits.append(window.compose(j, exact).hits)
            images.append(exact[list(kept)])
            window.started = time.perf_counter()
    return Run(
        images=np.stack(images),
        seconds=statistics.median(window.finding) + statistics.median(composing),
        hits=np.stack(hits),
    )


def measure(
    case: Case, named: Named, cameras: Sequence[Sequence[int]], lights: Sequence[int],
    pairs: Sequence[tuple[int, int]], references: dict[int, Reference],
) -> Measured:  # fmt: skip
    """Make the probe images of some settings twice, and compare them with the references."""
    found, seconds, hits, example = [], [], [], None
    for frames in cameras:
        runs = [run(case, named.settings, frames, lights, seed) for seed in SEEDS]
        seconds += [r.seconds for r in runs]
        hits.append(runs[0].hits)
        pictures = (runs[0].images, runs[1].images)
        found += quality(pictures, [references[c] for c in frames], case.ambient, lights, pairs)
        example = runs[0].images[0, 0] if example is None else example
    assert example is not None
    all_hits = np.concatenate([h.ravel() for h in hits])
    return Measured(
        named=named,
        ms=1e3 * statistics.median(seconds) / case.setup.lights.n_lights,
        quality=mean_quality(found),
        hits=(float(all_hits.mean()), float(np.percentile(all_hits, 1))),
        example=example,
    )


def measure_alone(
    case: Case, named: Named, cameras: Sequence[Sequence[int]], lights: Sequence[int], twin: Measured
) -> Measured:
    """Time images that are made for one light position each; their pictures are those of `twin`, which shares hits."""
    seconds = [run(case, named.settings, frames[:1], lights[:1], SEEDS[0]).seconds for frames in cameras]
    return replace(twin, named=named, ms=1e3 * statistics.median(seconds))
