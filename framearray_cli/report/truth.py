"""Errors of images with respect to true light.

True light is the light of paths with all bounces, which the program follows itself: `indirect.exact`, without reuse.
Errors against two halves of such an image are multiplied, not squared: noise of the halves is independent, and no part
of the mean of the product.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from framearray_cli.base.arrays import Float64, Image, Images
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job
from framearray_cli.job.method import IndirectTable, SamplesTable
from framearray_cli.render.automatic import evenly_from_end_to_end
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import prepared_from

from .case import Case
from .reference import Reference

# Native hits per pixel in one pass, and paths from each: hits also average direct light and edges.
HITS, PATHS = 4, 2
# Passes of each half. Noise of the halves is no part of an error, so few are enough.
PASSES = 4
# Images with true light, at most; paths are dear.
MOST_CAMERAS, MOST_LIGHTS = 2, 3
SQUARE = 4  # pixels along an edge of the squares whose means are compared, too


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


def true_places(cameras: Sequence[int], lights: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Choose the frames to render in true light, and the rows of light positions, from the images of a report."""
    chosen = [cameras[i] for i in evenly_from_end_to_end(len(cameras), MOST_CAMERAS)]
    return tuple(chosen), tuple(evenly_from_end_to_end(len(lights), MOST_LIGHTS))


def compare_with_truth(runs: Sequence[Images], truth: Reference, rows: Sequence[int]) -> list[TruthError]:
    """Compare a frame with true light, image by image; a black truth has no error over its mean.

    Args:
        runs: (n_lights, h, w, 3) images at all light positions of the report, of each run.
        rows: the light positions of `truth` among these.
    """
    found = []
    for i, row in enumerate(rows):
        halves = truth.light[0, i], truth.light[1, i]
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
    means = {f.name: sum(getattr(one, f.name) for one in found) / n for f in fields(TruthError)}
    return TruthError(**means | {"square_error": float(np.sqrt(sum(one.square_error**2 for one in found))) / n})
