"""Reference images, with reuse off and many hits per pixel, in two halves of different seeds; quality against them.

A pixel is linear in the ambient light: light + I_A[l] * indirect. Keep both parts, so that a reference stays valid when
the estimate of I_A changes, and shows direct light separately.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image, Rgb
from framearray_cli.base.files import fingerprint, make_folder, whole_file
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.loop import window_of
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.identity import job_fingerprint

from .case import Case, with_lights
from .metrics import EPSILON, Errors, errors, rmse, squared_bias

# Native hits per pixel in one pass, limited by memory; PASSES of both halves make 100 times the hits of the array.
HITS = 28
PASSES = 25
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


def passes_for(times: float, hits: float) -> int:
    """Return the passes per half that give a reference `times` the samples of a pixel with that many hits."""
    return max(math.ceil(times * hits / (2 * HITS)), 1)


def make_reference(case: Case, c: int, l: Sequence[int], folder: Path, passes: int = PASSES) -> Reference:
    """Read the reference of frame c at light positions l from a folder, or render and write it.

    Its file is named by all inputs of its pixels except the program: delete the folder when the method changes.

    Raises:
        OutputError: the file cannot be written.
    """
    average = case.setup.indirect.settings.average.tobytes()
    pixels = job_fingerprint(case.prepared).encode()  # includes the seed, which does no harm
    key = fingerprint(pixels, average, repr((c, list(l), HITS, passes, case.setup.cams.width)).encode())
    arrays = kept_arrays(folder, "reference", key, lambda: _render_reference(with_lights(case, l), c, passes))
    return Reference(light=arrays["light"], indirect=arrays["indirect"], hits=HITS * passes)


def kept_arrays(folder: Path, name: str, key: str, make: Callable[[], Mapping[str, Float32]]) -> Mapping[str, Float32]:
    """Read arrays from a file whose name contains a digest of `key`; make and write them if it is missing."""
    file = folder / f"{name}-{sha256(key.encode()).hexdigest()[:16]}.npz"
    if os.path.isfile(file):
        with np.load(file) as kept:
            return dict(kept)
    made = make()
    make_folder(folder)
    with whole_file(file) as part, part.open("wb") as stream:
        np.savez(stream, **made)  # type: ignore[arg-type]  # names of arrays, and no options
    return made


def _render_reference(case: Case, c: int, passes: int) -> Mapping[str, Float32]:
    setup = replace(
        case.setup,
        n_r=0,
        per_pixel=np.full_like(case.setup.per_pixel, HITS),
        weights="average",
        features=case.setup.without_layers().features,
    )
    shape = (setup.cams.height, setup.cams.width, 3)
    light: Float64 = np.zeros((2, setup.lights.n_lights, *shape))
    indirect: Float64 = np.zeros((2, *shape))
    for half, seed in enumerate(SEEDS):
        for i in range(passes):
            parts = _render_pass(replace(setup, seed=seed + i), replace(case, setup=setup), c)
            light[half] += parts[0] / passes
            indirect[half] += parts[1] / passes
    return {"light": light.astype(np.float32), "indirect": indirect.astype(np.float32)}


def _render_pass(setup: FrameSetup, case: Case, c: int) -> tuple[Float32, Float32]:
    """Return one image per light position without ambient light, and the addition by one of 1."""
    images = np.empty((2, setup.lights.n_lights, setup.cams.height, setup.cams.width, 3), np.float32)
    with TracePool(setup, case.threads) as pool:
        window = window_of(c, setup, case.ambient, pool)
        for ambient in (0, 1):
            fixed = replace(case.ambient, intensity=np.full_like(case.ambient.intensity, ambient))
            window.with_ambient(fixed).compose(c, images[ambient])
    return images[0], images[1, 0] - images[0, 0]


def reference_noise(references: Sequence[Reference], case: Case, l: Sequence[int]) -> float:
    """Return the mean RMSE of references over their mean: half the RMSE between their halves."""
    shares = []
    for wanted in references:
        for k in range(len(l)):
            ambient = case.ambient.intensity[l[k]]
            right = wanted.image(k, ambient)
            apart = rmse(wanted.half(0, k, ambient), wanted.half(1, k, ambient))
            shares.append(apart / 2 / float(right.mean(dtype=np.float64)))
    return sum(shares) / len(shares)


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality(Errors):
    """Distances of images from their references.

    Attributes:
        squared_bias, squared_bias_error: squared bias and its standard error, over the squared mean of the reference;
            noise may make it negative.
        flicker_camera, flicker_light: relMSE of the change from one image to the next along either path; None without
            two consecutive images.
    """

    squared_bias: float
    squared_bias_error: float
    flicker_camera: float | None
    flicker_light: float | None

    @property
    def bias(self) -> float:
        """Root of the squared bias; 0 where noise hides it."""
        return float(np.sqrt(max(self.squared_bias, 0.0)))

    @property
    def noise(self) -> float:
        """Standard deviation over the mean of the reference: the rest of `rmse` without the bias."""
        return float(np.sqrt(max(self.rmse**2 - max(self.squared_bias, 0.0), 0.0)))


def compare_frames(
    runs: tuple[Float32, Float32], references: Sequence[Reference], ambient: Ambient, lights: Sequence[int],
    pairs: Sequence[tuple[int, int]],
) -> list[Quality]:  # fmt: skip
    """Compare consecutive frames with their references, image by image.

    Args:
        runs: two runs with different seeds, (n_frames, n_lights, h, w, 3) each.
        references: one per frame.
        lights: light positions of the images.
        pairs: indices in `lights` of neighbours on the light path.
    """
    right = np.stack([[r.image(k, ambient.intensity[l]) for k, l in enumerate(lights)] for r in references])
    found = []
    for c, reference in enumerate(references):
        for k, l in enumerate(lights):
            image, wanted = runs[0][c, k], right[c, k]
            halves = (reference.half(0, k, ambient.intensity[l]), reference.half(1, k, ambient.intensity[l]))
            square, spread = squared_bias((image, runs[1][c, k]), halves)
            scale = float(wanted.mean(dtype=np.float64)) ** 2
            after = next((second for first, second in pairs if first == k), None)
            found.append(
                Quality(
                    **asdict(errors(image, wanted)),
                    squared_bias=square / scale,
                    squared_bias_error=spread / scale,
                    flicker_camera=_flicker(image, wanted, runs[0][c + 1, k], right[c + 1, k])
                    if c + 1 < len(references)
                    else None,
                    flicker_light=_flicker(image, wanted, runs[0][c, after], right[c, after])
                    if after is not None
                    else None,
                )
            )
    return found


def _flicker(image: Image, wanted: Image, next_image: Image, next_wanted: Image) -> float:
    """Return the relMSE of the change from one image to the next."""
    change: Float64 = (next_image - image).astype(np.float64) - (next_wanted - wanted)
    return float((change**2 / (wanted.astype(np.float64) ** 2 + EPSILON)).mean())


def mean_quality(found: Sequence[Quality]) -> Quality:
    """Average every measure over the images that have it: the root mean square of RMSE."""
    means: dict[str, float | None] = {}
    for f in fields(Quality):
        values = [value for value in (getattr(one, f.name) for one in found) if value is not None]
        means[f.name] = float(np.mean(values)) if values else None
    spreads = [one.squared_bias_error for one in found]
    means["squared_bias_error"] = float(np.sqrt(np.sum(np.square(spreads))) / len(spreads))
    means["rmse"] = float(np.sqrt(np.mean([one.rmse**2 for one in found])))
    return Quality(**means)  # type: ignore[arg-type]  # None only where a field may be None
