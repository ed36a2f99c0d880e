"""Whole pictures with the ambient light of each method, against path-traced ones.

With enough samples, little noise is left, and the rest is the error of the model: obscurances are no path tracing.
Beside it stands the picture that the job's own settings give, whose error is that of the model and of sampling.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter

from bench.core.results import Table, load
from bench.speed.speed import log
from framearray_cli.base.arrays import Float32, Float64, Image
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.loop import window_of
from framearray_cli.report.case import Case, plan_case, with_lights
from framearray_cli.report.metrics import EPSILON
from framearray_cli.report.reference import make_reference, reference_noise

from .levels import METHODS
from .pathtraced import SMALL
from .scenes import Probe, resized, under_one, with_ambient

PATHS = {"eye": 1 << 18, "fit": 1 << 18}  # of the pictures with little noise
PASSES, QUICK_PASSES = 6, 1  # of each half: 28 hits per pixel each, see `reference.py`
SHOWN = ("eye", "fit")  # methods whose pictures are kept
SMOOTH = 5  # pixels
OWN_LEVEL = "picture"  # stands for the I_A that makes the mean of this one picture right


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wanted:
    """A path-traced picture in two independent halves, (2, h, w, 3), and the standard error of its mean, radiance."""

    halves: Float32
    error: float

    @property
    def image(self) -> Image:
        """Both halves."""
        return np.asarray(self.halves.mean(axis=0), np.float32)

    @property
    def mean(self) -> float:
        """Over the picture and its channels."""
        return float(self.image.mean(dtype=np.float64))

    @property
    def noise(self) -> float:
        """RMSE of the mean of the halves, over the mean."""
        return float(np.sqrt(np.square(self.halves[0] - self.halves[1], dtype=np.float64).mean())) / 2 / self.mean


def against(image: Image, wanted: Wanted) -> Table:
    """Distance of an image from a path-traced one, of which the noise of the latter is no part.

    The errors against two halves are multiplied, not squared: their noise does not go together, so the mean of the
    product has none of it. Where there is little to find it may come out below zero, which counts as 0.

    Returns:
        rmse: over the mean of the reference.
        relmse: mean of (I - R)^2 / (R^2 + EPSILON); the R below the line is the mean of the pixels around,
            whose noise does not go together with that above it.
        ratio: mean of the image to that of the reference; `ratio_error` is that of only the reference.
    """
    product = (image - wanted.halves[0]).astype(np.float64) * (image - wanted.halves[1])
    squares = np.square(around(wanted.image))
    ratio = float(image.mean(dtype=np.float64)) / wanted.mean
    return {
        "rmse": float(np.sqrt(max(product.mean(), 0.0))) / wanted.mean,
        "relmse": float((product / (squares + EPSILON)).mean()),
        "ratio": ratio,
        "ratio_error": ratio * wanted.error / wanted.mean,
    }


def around(image: Image) -> Float64:
    """Means over the square of SMOOTH pixels around each pixel without itself; the border's pixels stand for others."""
    values, n = image.astype(np.float64), SMOOTH**2
    mean = uniform_filter(values, size=(SMOOTH, SMOOTH, 1), mode="nearest")
    found: Float64 = (n * mean - values) / (n - 1)
    return found


def own_level(indirect: Image, wanted: Wanted) -> Float64:
    """The I_A that makes a picture's indirect light right on average, (3,); `indirect` is that of an I_A of 1."""
    found: Float64 = wanted.image.mean(axis=(0, 1), dtype=np.float64) / indirect.mean(axis=(0, 1), dtype=np.float64)
    return found


def measure(probe: Probe, quick: bool, folder: Path) -> Table:
    """Compare a probe's picture with its path-traced one; {"skipped": why} where that is missing."""
    traced = load(folder, f"traced-{probe.traced}") or {"skipped": "it was not traced"}
    if "skipped" in traced:
        return traced
    total, indirect, light = _wanted(folder / traced["file"])
    found: Table = {
        "words": probe.words,
        "camera": probe.c,
        "light": probe.l,
        "epsilon": EPSILON,
        "traced": traced,
        "mean": total.mean,
        "share": indirect.mean / total.mean,
        "noise": {"whole": total.noise, "indirect": indirect.noise},
        "model": {},
        "own": {},
    }
    shown: dict[str, Image] = {"traced": total.image}
    prepared = probe.prepared()
    for method in METHODS:
        paths = PATHS[method] >> (5 if quick else 0)
        with plan_case(under_one(with_ambient(prepared, method, paths), probe.l)) as case:
            made = make_reference(case, probe.c, [0], folder, QUICK_PASSES if quick else PASSES)
            level = case.ambient.intensity[0]
            direct, one = made.light.mean(axis=0)[0], made.indirect.mean(axis=0)
            found["model"][method] = {
                **_both(direct, level * one, total, indirect),
                "level": level.tolist(),
                "error": float(case.ambient.standard_error[0]),
                "noise": reference_noise([made], case, [0]),
            }
        if method in SHOWN:
            shown[method] = np.asarray(direct + level * one, np.float32)
        if method == "fit":
            level = own_level(one, indirect).astype(np.float32)
            found["model"][OWN_LEVEL] = {**_both(direct, level * one, total, indirect), "level": level.tolist()}
            found["direct"] = {**against(direct, light), "noise": light.noise}
        found["own"][method] = _sampled(probe, method, total, indirect)
        log(f"{probe.name}: {method}: indirect light is {found['model'][method]['indirect']['ratio']:.3f} of right")
    np.savez(folder / f"ambient-shown-{probe.name}.npz", **shown)
    return found


def along(probe: Probe, means: Table, quick: bool, folder: Path) -> Table:
    """Mean indirect light of each method at some cameras of a path, over the path-traced `means`."""
    if "skipped" in means:
        return means
    right = np.array(means["indirect"])
    found: Table = {**means, "words": probe.words, "methods": {}}
    prepared = under_one(resized(probe.prepared(), SMALL), probe.l)
    for method in METHODS:
        with plan_case(with_ambient(prepared, method, PATHS[method] >> (5 if quick else 0))) as case:
            level, ours = case.ambient.intensity[0], []
            for c in means["cameras"]:
                one = make_reference(case, c, [0], folder, 1).indirect
                ours.append(float((level * one).mean(dtype=np.float64)))
        ratio = float(np.sum(ours) / right.sum())
        found["methods"][method] = {"ratios": (np.array(ours) / right).tolist(), "ratio": ratio}
        log(f"{probe.name}: {method}: indirect light of {len(ours)} cameras is {ratio:.3f} of right")
    return found


def _wanted(file: Path) -> tuple[Wanted, Wanted, Wanted]:
    """All light, indirect light, and light straight from the sources, as traced."""
    with np.load(file) as kept:
        total, light = kept["total"], kept["light"]
        parts = {"total": total, "indirect": total - light, "light": light}
        found = [Wanted(halves=halves, error=float(kept[f"{name}_error"])) for name, halves in parts.items()]
    return found[0], found[1], found[2]


def _both(direct: Image, ambient: Image, total: Wanted, indirect: Wanted) -> dict[str, Table]:
    return {"whole": against(direct + ambient, total), "indirect": against(ambient, indirect)}


def _sampled(probe: Probe, method: str, total: Wanted, indirect: Wanted) -> Table:
    """The picture as the job's own settings make it, the number of walks left to the program."""
    with plan_case(with_ambient(probe.prepared(), method)) as planned_case:
        case = with_lights(planned_case, [probe.l])
        direct, one = _parts(case, probe.c if not case.prepared.still else 0)
        level = case.ambient.intensity[0]
        return {
            **_both(direct, level * one, total, indirect),
            "level": level.tolist(),
            "error": float(case.ambient.standard_error[0]),
            "paths": planned_case.ambient.paths,
        }


def _parts(case: Case, c: int) -> tuple[Image, Image]:
    """Frame c with its neighbours' hits: without ambient light, and the share of an ambient light of 1."""
    setup = replace(case.setup, layers=False)
    images = np.empty((2, 1, setup.cams.height, setup.cams.width, 3), np.float32)
    with TracePool(setup, case.threads) as pool:
        window = window_of(c, setup, case.ambient, pool)
        for image, level in zip(images, (0, 1), strict=True):
            fixed = replace(case.ambient, intensity=np.full_like(case.ambient.intensity, level))
            window.with_ambient(fixed).compose(c, image)
    return images[0, 0], images[1, 0] - images[0, 0]
