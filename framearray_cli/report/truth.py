"""Images of the true light, and how far others are from them.

True light is the light of paths with all bounces, which the program follows itself: `indirect.exact`, without reuse.
Errors against two halves of such an image are multiplied, not squared: noise of the halves is independent, and no part
of the mean of the product.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image, Images
from framearray_cli.base.files import fingerprint
from framearray_cli.base.forms.table import changed
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.loop import window_of
from framearray_cli.job.job import Job
from framearray_cli.job.method import IndirectTable, SamplesTable
from framearray_cli.render.identity import job_fingerprint
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import prepared_from

from .case import Case, Probes, with_lights
from .metrics import rmse
from .reference import kept_arrays

# Native hits per pixel in one pass, and paths from each: hits also average direct light and edges.
HITS, PATHS = 4, 2
# Passes of each half. Noise of the halves is no part of an error, so few are enough.
PASSES = 4
SEEDS = (2_000_000_000, 3_000_000_000)  # of the first and of the second half; no job uses them
# Images with true light, at most; paths are dear.
MOST_CAMERAS, MOST_LIGHTS = 2, 3
SQUARE = 4  # pixels along an edge of the squares whose means are compared, too


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """One frame in true light, under some light positions.

    Attributes:
        images: (2, n_lights, h, w, 3) radiance of each half.
        rows: which of the report's light positions these are.
    """

    images: Float32
    rows: tuple[int, ...]

    @property
    def noise(self) -> float:
        """Mean RMSE of the mean of both halves over its mean; 0 where all is black."""
        means = self.images.mean(axis=(0, 2, 3, 4), dtype=np.float64)
        apart = [rmse(self.images[0, i], self.images[1, i]) / 2 / m for i, m in enumerate(means) if m > 0]
        return float(np.mean(apart)) if apart else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthError:
    """Distance of images from true light, whose noise is no part of it.

    Attributes:
        square, square_error: mean squared error over the squared mean of the truth, and its standard error from noise
            of the truth, which may make the first negative.
        coarse_square: mean squared error of means over SQUARE x SQUARE pixels, over their mean square.
        mean_off: mean of I - T over the mean of the truth.
    """

    square: float
    square_error: float
    coarse_square: float
    mean_off: float

    @property
    def rmse(self) -> float:
        """Root mean square error over the mean of the truth."""
        return float(np.sqrt(max(self.square, 0.0)))

    @property
    def rmse_error(self) -> float:
        """Standard error of `rmse`."""
        if self.square <= self.square_error:
            return float(np.sqrt(self.square_error)) / 2
        return self.square_error / (2 * self.rmse)

    @property
    def coarse(self) -> float:
        """Root mean square error of means over SQUARE x SQUARE pixels, over their root mean square."""
        return float(np.sqrt(max(self.coarse_square, 0.0)))


def reason_without(job: Job) -> str | None:
    """Return why a report of a job compares nothing with true light, as a sentence; None: it does."""
    if job.indirect.exact:
        return "The table below has the errors with respect to true light: the job follows paths itself."
    if job.ambient.intensity is not None and job.indirect.method == "obscurance":
        return "Nothing is compared with true light, because the job fixes its ambient light: ambient.intensity."
    return None


def true_case(case: Case) -> Case:
    """Return the job as images in true light are made: by paths, without reuse."""
    prepared = case.prepared
    job = changed(
        prepared.job,
        indirect=IndirectTable(method="cells", exact=True),
        samples=SamplesTable(hits=HITS, obscurance=PATHS),
        reuse=changed(prepared.job.reuse, n_r=0, weights="average"),
        specular=changed(prepared.job.specular, hits=HITS),
        output=changed(prepared.job.output, layers=False, alpha=None),
    )
    prepared = prepared_from(job, prepared.scene, prepared.eyes, prepared.lights)
    setup, ambient = plan_work(prepared, case.embree)
    return replace(case, prepared=prepared, setup=setup, ambient=ambient)


def true_places(probes: Probes) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Choose the frames to render in true light, and the rows of light positions, from the probes of a report."""
    seconds = {second for _, second in probes.light_pairs}
    firsts = [run[0] for run in probes.cameras]
    rows = [i for i in range(len(probes.lights)) if i not in seconds]
    return _spread(firsts, MOST_CAMERAS), _spread(rows, MOST_LIGHTS)


def _spread(values: Sequence[int], most: int) -> tuple[int, ...]:
    at = np.linspace(0, len(values) - 1, min(len(values), most)).round().astype(int)
    return tuple(values[i] for i in at)


def make_truth(case: Case, c: int, lights: Sequence[int], rows: Sequence[int], folder: Path) -> Truth:
    """Read frame c in true light from a folder, or render and write it.

    Args:
        case: of `true_case`.
        lights: light positions of the report; `rows`: which of them are rendered.

    Raises:
        OutputError: the file cannot be written.
    """
    at = [lights[i] for i in rows]
    key = fingerprint(job_fingerprint(case.prepared).encode(), repr((c, at, PASSES)).encode())
    arrays = kept_arrays(folder, "truth", key, lambda: {"images": _render_truth(with_lights(case, at), c)})
    return Truth(images=arrays["images"], rows=tuple(rows))


def _render_truth(case: Case, c: int) -> Float32:
    cams = case.setup.cams
    shape = (case.setup.lights.n_lights, cams.height, cams.width, 3)
    sums: Float64 = np.zeros((2, *shape))
    image = np.empty(shape, np.float32)
    for half, seed in enumerate(SEEDS):
        for i in range(PASSES):
            setup = replace(case.setup, seed=seed + i)
            with TracePool(setup, case.threads) as pool:
                window_of(c, setup, case.ambient, pool).compose(c, image)
            sums[half] += image
    return np.asarray(sums / PASSES, np.float32)


def compare_with_truth(runs: Sequence[Images], truth: Truth) -> list[TruthError]:
    """Compare a frame with true light, image by image; a black truth has no error over its mean.

    Args:
        runs: (n_lights, h, w, 3) images at all light positions of the report, of each run.
    """
    found = []
    for i, row in enumerate(truth.rows):
        halves = truth.images[0, i], truth.images[1, i]
        if float(np.add(*halves).mean(dtype=np.float64)) > 0:
            found += [_error(run[row], halves) for run in runs]
    return found


def _error(image: Image, halves: tuple[Image, Image]) -> TruthError:
    level = float(np.add(*halves).mean(dtype=np.float64)) / 2
    product = (image - halves[0]).astype(np.float64) * (image - halves[1])
    # The noise of a pixel's product: e (a + b) + a b, for an error e and noise a, b. This has the same variance,
    # as a - b and a + b have, and the image less the mean of the halves is e - (a + b) / 2.
    noise = ((image - (halves[0] + halves[1]) / 2).astype(np.float64) * (halves[0] - halves[1])).mean(axis=-1)
    coarse, first, second = (_square_means(picture) for picture in (image, *halves))
    return TruthError(
        square=float(product.mean()) / level**2,
        square_error=float(np.sqrt((noise**2).sum())) / noise.size / level**2,
        coarse_square=float(((coarse - first) * (coarse - second)).mean() / ((first + second) ** 2 / 4).mean()),
        mean_off=float(image.mean(dtype=np.float64)) / level - 1,
    )


def _square_means(image: Image) -> Float64:
    """Means over squares of pixels; borders that fill no square are left out."""
    h, w = image.shape[:2]
    high, wide = min(SQUARE, h), min(SQUARE, w)
    whole = image[: h // high * high, : w // wide * wide].astype(np.float64)
    found: Float64 = whole.reshape(h // high, high, w // wide, wide, -1).mean(axis=(1, 3))
    return found


def mean_truth_error(found: Sequence[TruthError]) -> TruthError | None:
    """Average errors over images; None without any."""
    if not found:
        return None
    n = len(found)
    return TruthError(
        square=sum(one.square for one in found) / n,
        square_error=float(np.sqrt(sum(one.square_error**2 for one in found))) / n,
        coarse_square=sum(one.coarse_square for one in found) / n,
        mean_off=sum(one.mean_off for one in found) / n,
    )
