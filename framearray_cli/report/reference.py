"""Reference images, with reuse off and many hits per pixel, in two halves of different seeds.

A pixel is linear in the ambient light: light + I_A[l] * indirect. Keep both parts, so that a reference stays valid when
the estimate of I_A changes, and shows direct light separately.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image, Rgb
from framearray_cli.base.files import fingerprint, make_folder, whole_file
from framearray_cli.engine.features.surface import SurfaceLayers
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.loop import window_of
from framearray_cli.render.identity import job_fingerprint

from .case import Case, with_lights
from .metrics import rmse

# Native hits per pixel in one pass, limited by memory; PASSES of both halves make 100 times those of the frame array.
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
        reflectivity, normal: (h, w, 3) and depth: (h, w), means; see `Layers`.
        hits: native hits per pixel in each half.
    """

    light: Float32
    indirect: Float32
    reflectivity: Float32
    normal: Float32
    depth: Float32
    hits: int

    def half(self, i: int, l: int, ambient: Rgb) -> Image:
        """Return half i at the l-th of its light positions, with I_A of that position, (3,)."""
        return np.asarray(self.light[i, l] + ambient * self.indirect[i], np.float32)

    def image(self, l: int, ambient: Rgb) -> Image:
        """Return the mean of both halves."""
        return np.asarray((self.half(0, l, ambient) + self.half(1, l, ambient)) / 2, np.float32)

    def irradiance(self, l: int) -> Float32:
        """Return the direct light at each pixel from the l-th light position, (h, w); 0 without diffuse reflection."""
        light, r = self.light[:, l].mean(axis=(0, -1)), self.reflectivity.mean(axis=-1)
        found: Float32 = np.divide(light, r, out=np.zeros_like(light), where=r > 0.01)
        return found


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
    file = folder / f"reference-{sha256(key.encode()).hexdigest()[:16]}.npz"
    names = ("light", "indirect", "reflectivity", "normal", "depth")
    if os.path.isfile(file):
        with np.load(file) as kept:
            return Reference(**{name: kept[name] for name in names}, hits=HITS * passes)
    made = _render_reference(with_lights(case, l), c, passes)
    make_folder(folder)
    with whole_file(file) as part, part.open("wb") as stream:
        np.savez(stream, **{name: getattr(made, name) for name in names})
    return made


def _render_reference(case: Case, c: int, passes: int) -> Reference:
    setup = replace(
        case.setup,
        n_r=0,
        per_pixel=np.full_like(case.setup.per_pixel, HITS),
        weights="average",
        features=(*case.setup.without_layers().features, SurfaceLayers()),
    )
    shape = (setup.cams.height, setup.cams.width, 3)
    light: Float64 = np.zeros((2, setup.lights.n_lights, *shape))
    indirect: Float64 = np.zeros((2, *shape))
    for half, seed in enumerate(SEEDS):
        for i in range(passes):
            parts = _render_pass(replace(setup, seed=seed + i), replace(case, setup=setup), c)
            light[half] += parts[0] / passes
            indirect[half] += parts[1] / passes
    layers = parts[2]
    return Reference(
        light=light.astype(np.float32),
        indirect=indirect.astype(np.float32),
        reflectivity=layers["reflectivity"],
        normal=layers["normal"],
        depth=layers["depth"],
        hits=HITS * passes,
    )


def _render_pass(setup: FrameSetup, case: Case, c: int) -> tuple[Float32, Float32, Mapping[str, Float32]]:
    """Return one image per light position without ambient light, the addition by one of 1, and the layers."""
    images = np.empty((2, setup.lights.n_lights, setup.cams.height, setup.cams.width, 3), np.float32)
    with TracePool(setup, case.threads) as pool:
        window = window_of(c, setup, case.ambient, pool)
        for ambient in (0, 1):
            fixed = replace(case.ambient, intensity=np.full_like(case.ambient.intensity, ambient))
            layers = window.with_ambient(fixed).compose(c, images[ambient]).layers
    return images[0], images[1, 0] - images[0, 0], layers


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
