"""Reference images, with reuse off and many hits per pixel, in two halves of different seeds; quality against them.

A pixel is linear in the ambient light: light + I_A[l] * indirect. Keep both parts, so that a reference stays valid when
the estimate of I_A changes, and shows direct light separately.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image, Rgb
from framearray_cli.base.files import fingerprint, make_folder, whole_file
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.loop import window_of
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.identity import job_fingerprint

from .case import Case, with_lights

# Native hits per pixel in one pass, limited by memory; PASSES of both halves make TIMES the hits of the array.
HITS = 28
PASSES = 25
TIMES = 100  # samples of a reference over samples of a picture
# relMSE divides by R^2 + EPSILON, so an error at a radiance far below 0.1 counts as one at 0.1.
EPSILON = 0.01
# Seeds of the first and of the second half; no job uses them.
SEEDS = (2_000_000_000, 3_000_000_000)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """One frame under some light positions.

    Attributes:
        light: (2, n_lights, h, w, 3) radiance without ambient light, of each half.
        indirect: (2, h, w, 3) radiance of an ambient light of 1, of each half.
        hits: native hits per pixel in each half.
    """

    light: Float32
    indirect: Float32
    hits: int

    def half(self, i: int, l: int, ambient: Rgb) -> Image:
        """Return half i at the l-th of its light positions, with I_A of that position, (3,)."""
        return np.asarray(self.light[i, l] + ambient * self.indirect[i], np.float32)

    def image(self, l: int, ambient: Rgb) -> Image:
        """Return the mean of both halves."""
        return np.asarray((self.half(0, l, ambient) + self.half(1, l, ambient)) / 2, np.float32)


def passes_for(hits: float) -> int:
    """Return the passes per half that give a reference TIMES the samples of a pixel with that many hits."""
    return max(math.ceil(TIMES * hits / (2 * HITS)), 1)


def make_reference(
    case: Case, c: int, l: Sequence[int], folder: Path, passes: int = PASSES, hits: int = HITS
) -> Reference:
    """Read the reference of frame c at light positions l from a folder, or render and write it.

    Its file is named by all inputs of its pixels except the program: delete the folder when the method changes.
    """
    average = case.setup.indirect.settings.average.tobytes()
    pixels = job_fingerprint(case.prepared).encode()  # includes the seed, which does no harm
    key = fingerprint(pixels, average, repr((c, list(l), hits, passes, case.setup.cams.width)).encode())
    file = folder / f"reference-{sha256(key.encode()).hexdigest()[:16]}.npz"
    if os.path.isfile(file):
        with np.load(file) as kept:
            return Reference(light=kept["light"], indirect=kept["indirect"], hits=hits * passes)
    light, indirect = _render_reference(with_lights(case, l), c, passes, hits)
    make_folder(folder)
    with whole_file(file) as part, part.open("wb") as stream:
        np.savez(stream, light=light, indirect=indirect)
    return Reference(light=light, indirect=indirect, hits=hits * passes)


def _render_reference(case: Case, c: int, passes: int, hits: int) -> tuple[Float32, Float32]:
    setup = replace(
        case.setup,
        n_r=0,
        per_pixel=np.full_like(case.setup.per_pixel, hits),
        weights="average",
        features=case.setup.without_layers().features,
    )
    shape = (setup.cams.height, setup.cams.width, 3)
    light: Float64 = np.zeros((2, setup.lights.n_lights, *shape))
    indirect: Float64 = np.zeros((2, *shape))
    images = np.empty((2, setup.lights.n_lights, *shape), np.float32)  # without ambient light, and with one of 1
    for half, seed in enumerate(SEEDS):
        for i in range(passes):
            seeded = replace(setup, seed=seed + i)
            with TracePool(seeded, case.prepared.threads) as pool:
                window = window_of(c, seeded, case.ambient, pool)
                for ambient in (0, 1):
                    fixed = replace(case.ambient, intensity=np.full_like(case.ambient.intensity, ambient))
                    window.with_ambient(fixed).compose(c, images[ambient])
            light[half] += images[0] / passes
            indirect[half] += (images[1, 0] - images[0, 0]) / passes
    return light.astype(np.float32), indirect.astype(np.float32)


def rmse(image: Image, reference: Image) -> float:
    """Return the root mean square error, radiance."""
    return float(np.sqrt(np.mean(np.square(image - reference, dtype=np.float64))))


def relmse(image: Image, reference: Image) -> float:
    """Return the mean of (I - R)^2 / (R^2 + EPSILON)."""
    squares = np.square(image - reference, dtype=np.float64) / (np.square(reference, dtype=np.float64) + EPSILON)
    return float(squares.mean())


def squared_bias(runs: tuple[Image, Image], halves: tuple[Image, Image]) -> float:
    """Estimate the mean squared difference between the limits of runs and halves.

    All four images are independent, so the noise of (run 0 - half 0) and of (run 1 - half 1) is uncorrelated, and the
    expected mean of their product is the squared bias. Noise may make it negative.
    """
    return float(((runs[0] - halves[0]).astype(np.float64) * (runs[1] - halves[1])).mean())


def reference_noise(references: Sequence[Reference], case: Case, l: Sequence[int]) -> float:
    """Return the mean RMSE of references over their mean: half the RMSE between their halves; 0 where all is black."""
    shares = []
    for wanted in references:
        for k in range(len(l)):
            ambient = case.ambient.intensity[l[k]]
            mean = float(wanted.image(k, ambient).mean(dtype=np.float64))
            if mean > 0:
                shares.append(rmse(wanted.half(0, k, ambient), wanted.half(1, k, ambient)) / 2 / mean)
    return float(np.mean(shares)) if shares else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """Distances of images from their references.

    Attributes:
        rmse: root mean square error over the mean of the reference.
        relmse: mean of (I - R)^2 / (R^2 + EPSILON).
        mean_off: mean of I - R over the mean of the reference.
        squared_bias: over the squared mean of the reference; noise may make it negative.
    """

    rmse: float
    relmse: float
    mean_off: float
    squared_bias: float

    @property
    def bias(self) -> float:
        """Root of the squared bias; 0 where noise hides it."""
        return float(np.sqrt(max(self.squared_bias, 0.0)))

    @property
    def noise(self) -> float:
        """Standard deviation over the mean of the reference: the rest of `rmse` without the bias."""
        return float(np.sqrt(max(self.rmse**2 - max(self.squared_bias, 0.0), 0.0)))


def compare_frame(
    runs: tuple[Float32, Float32], reference: Reference, ambient: Ambient, lights: Sequence[int]
) -> list[Quality]:
    """Compare a frame with its reference, image by image.

    Args:
        runs: two runs with different seeds, (n_lights, h, w, 3) each.
        lights: light positions of the images.
    """
    found = []
    for k, l in enumerate(lights):
        image, i_a = runs[0][k], ambient.intensity[l]
        wanted, halves = reference.image(k, i_a), (reference.half(0, k, i_a), reference.half(1, k, i_a))
        mean = float(wanted.mean(dtype=np.float64))
        found.append(
            Quality(
                rmse=rmse(image, wanted) / mean,
                relmse=relmse(image, wanted),
                mean_off=float((image - wanted).mean(dtype=np.float64)) / mean,
                squared_bias=squared_bias((image, runs[1][k]), halves) / mean**2,
            )
        )
    return found


def mean_quality(found: Sequence[Quality]) -> Quality:
    """Average every measure over some images: the root mean square of RMSE."""
    means = {f.name: float(np.mean([getattr(one, f.name) for one in found])) for f in fields(Quality)}
    return Quality(**means | {"rmse": float(np.sqrt(np.mean([one.rmse**2 for one in found])))})
