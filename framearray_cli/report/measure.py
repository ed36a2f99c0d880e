"""Making the pictures of some settings, and timing them."""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Int32
from ..crew import TracePool
from ..frame import find_frame
from ..window import Window
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
    pool = TracePool(setup, changed.threads)
    window = Window(setup, changed.ambient, pool, range(cameras[0], setup.n_frames))
    images, hits, finding, composing = [], [], [], []
    try:
        first, last = setup.frames_around(cameras[0], setup.n_r)[0], setup.frames_around(cameras[-1], setup.n_r)[-1]
        for c in range(first, last + 1):
            started = time.perf_counter()
            window.add(find_frame(setup, c, pool))
            finding.append(time.perf_counter() - started)
            for j in window.complete():
                if j > cameras[-1]:
                    break
                started = time.perf_counter()
                window.compose(j, block)  # as a render composes it; what is compared is not rounded to halves
                composing.append(time.perf_counter() - started)
                hits.append(window.compose(j, exact).hits)
                images.append(exact[list(kept)])
    finally:
        pool.close()
    return Run(
        images=np.stack(images),
        seconds=statistics.median(finding) + statistics.median(composing),
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
