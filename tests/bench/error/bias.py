"""The bias of camera reuse, however many runs are averaged, with all kinds of weights; see docs/quality/bias.csv.

Frames of a camera path are rendered many times with independent seeds, of the hits of their whole window, and without
reuse with many more hits: the parts of their reference. Ambient light, average reflectivity and light positions are
the same in all of them, so that reuse is all that differs.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bench.core.cases import USUAL_SETTINGS, Case, job_named, open_case, with_lights, with_resolution, with_settings
from bench.core.frames import frames
from bench.core.machine import busy
from bench.core.results import Table
from bench.core.steady import mean, steady
from bench.speed.speed import log
from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.engine.inputs.cameras import Cameras

from .camera_paths import CAMERAS, MIDDLE, N_R, seen_by
from .regions import Mask, edges_of_shadows, regions
from .squares import products, squares

PLACES = (0.4, 0.6)  # of the camera path
LIGHTS = tuple((i + 0.5) / 6 for i in range(6))  # of the light path
WEIGHTS = ("average", "balance", "area")
PART_HITS = 28  # of a pixel in one part of a reference
SEEDS = {"average": 10_000, "balance": 20_000, "area": 30_000, "reference": 2_000_000_000}
EPSILON = 0.01  # of relative squares: (I - R)^2 / (R^2 + EPSILON)
USUAL = 2  # native hits per pixel and frame, as in jobs
# Times as many runs as the cabin needs: patches of sunlight make most of the noise.
MORE = {"kitchen": 9, "stairs": 2, "cabin": 1}
# Parts of a picture beside those of `regions`: all of it, all of it with relative squares, and edges of shadows.
WHOLE, RELATIVE = "all", "relative"
SHADOWS = "shadow edges"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How much is rendered.

    Attributes:
        resolution: of all pictures, or None: the job's own.
        places: frames, as shares of the path.
        hits: native hits per pixel and frame.
        runs: by weights, with one hit; with more hits less noise, so fewer runs.
        parts: of a reference.
        fewest: runs in any case.
        more: times as many runs with the usual hits, which all tables but one are about.
    """

    resolution: tuple[int, int] | None
    places: tuple[float, ...] = PLACES
    hits: tuple[int, ...] = (1, 2, 4, 8)
    runs: Mapping[str, int] = field(default_factory=lambda: {"average": 16, "balance": 40, "area": 40})
    parts: int = 50
    fewest: int = 4
    more: int = 1

    def seeds(self, weights: str, hits: int) -> range:
        """Seeds of the runs."""
        n = max(self.runs[weights] // hits, self.fewest) * (self.more if hits == USUAL else 1)
        return range(SEEDS[weights], SEEDS[weights] + n)


SMALL = Plan(resolution=(128, 96))
OWN = Plan(resolution=None, places=PLACES[:1], hits=(1, 2, 4), runs={"average": 4, "balance": 4, "area": 4}, parts=8)
QUICK = Plan(resolution=(48, 36), runs={"average": 6, "balance": 8, "area": 8}, parts=6)
# Measurements of a job: a camera of `CAMERAS` in small, the unchanged job at its own size, and time.
MEASURES = (*CAMERAS, "own-size", "time")
TIMED_PLACES = (1 / 3, 2 / 3)  # of the camera path
TIMED_FRAMES = 2


class Sums:
    """Products of runs and parts of references, summed over pictures; by weights, hits and part of the picture."""

    def __init__(self) -> None:
        self._grams: dict[tuple[str, int, str], Float64] = {}
        self._values: dict[tuple[str, int, str], int] = {}
        self._runs: dict[tuple[str, int, str], int] = {}

    def add(self, weights: str, hits: int, part: str, images: Float32, right: Float32) -> None:
        """Take in values of a picture: of runs (k, ...) and of parts of its reference (m, ...)."""
        key = (weights, hits, part)
        gram, n = products(images.reshape(len(images), -1), right.reshape(len(right), -1))
        self._grams[key] = self._grams.get(key, 0.0) + gram
        self._values[key] = self._values.get(key, 0) + n
        self._runs[key] = len(images)

    def table(self) -> list[Table]:
        """One row each: the error of the runs."""
        rows = []
        for key, gram in self._grams.items():
            weights, hits, part = key
            found = squares(gram, self._values[key], self._runs[key])
            share = self._values[key] / self._values[weights, hits, WHOLE]
            row = {"weights": weights, "hits": hits, "part": part, "share": share, "runs": self._runs[key]}
            rows.append({**row, "bias": found.bias, "error": found.error, "variance": found.variance})
        return rows


def measure_part(name: str, part: str, quick: bool) -> Table:
    """One of `MEASURES`."""
    own = replace(QUICK, hits=OWN.hits) if quick else OWN
    if part == "time":
        return costs(name, own)
    if part == "own-size":
        return measure(name, "slow", own)
    plan = QUICK if quick else replace(SMALL, more=MORE[name])
    return measure(name, part, replace(plan, hits=(USUAL,)) if part == "close" else plan)


def measure(name: str, camera: str, plan: Plan) -> Table:
    """Squared bias and variance for a job and one of `CAMERAS`, by weights, hits and part of the picture."""
    started, sums = time.perf_counter(), Sums()
    job = job_named(name, False)
    job = with_resolution(job, plan.resolution) if plan.resolution else job
    with open_case(job) as case:
        cameras = [round(place * case.setup.n_frames) for place in plan.places]
        lights = [int(share * case.setup.lights.n_lights) for share in LIGHTS]
        for c in cameras:
            _add_frame(with_lights(case, lights), c, camera, plan, sums)
            log(f"{name}, {camera}: camera {c}: {time.perf_counter() - started:.0f} s")
    return {
        "cameras": cameras,
        "lights": lights,
        "resolution": list(job.camera.resolution),
        "reference": plan.parts * PART_HITS,
        "found": sums.table(),
        "seconds": time.perf_counter() - started,
    }


def _add_frame(case: Case, c: int, camera: str, plan: Plan, sums: Sums) -> None:
    """Render frame c of a camera in all ways, and add the results."""
    cams = CAMERAS[camera](case, c)
    right, geometry = reference(case, cams, plan.parts)
    scale = right.mean(axis=(0, 2, 3, 4))[:, None, None, None]  # the mean of each picture
    dark = 1 / np.sqrt(np.square(right.mean(axis=0)) + EPSILON)
    masks: dict[str, Mask] = {}  # (h, w), or (n_lights, h, w)
    for hits in sorted(plan.hits, key=lambda hits: hits != USUAL):  # it shows first which pixels rest on few hits
        for weights in reversed(WEIGHTS):
            images, share = runs(case, cams, weights, hits, plan.seeds(weights, hits))
            if not masks:
                masks = dict(regions(*geometry, share, cams, MIDDLE, N_R))
                masks[SHADOWS] = edges_of_shadows(right.mean(axis=0), *geometry)
            sums.add(weights, hits, WHOLE, images / scale, right / scale)
            sums.add(weights, hits, RELATIVE, images * dark, right * dark)
            for part, mask in masks.items():
                if mask.any():
                    where = np.broadcast_to(mask, right.shape[1:4])
                    sums.add(weights, hits, part, (images / scale)[:, where], (right / scale)[:, where])


def reference(case: Case, cams: Cameras, parts: int) -> tuple[Float32, tuple[Float32, Float32, Float32]]:
    """Independent pictures of the middle frame without reuse, and its geometry.

    Returns:
        (parts, n_lights, h, w, 3), and normal, depth and reflectivity, see `SurfaceLayers`.
    """
    changed = seen_by(with_settings(case, replace(USUAL_SETTINGS, n_r=0, hits=PART_HITS)), cams)
    seeds = range(SEEDS["reference"], SEEDS["reference"] + parts)
    made = frames(changed, MIDDLE, seeds, layers=True)
    layers = made[0].layers
    return np.stack([one.images for one in made]), (layers["normal"], layers["depth"], layers["reflectivity"])


def runs(case: Case, cams: Cameras, weights: str, hits: int, seeds: Sequence[int]) -> tuple[Float32, Float64]:
    """Independent pictures of the middle frame, (k, n_lights, h, w, 3).

    Also the hits of a pixel, (h, w): their mean, relative to the hits of a pixel that every eye of the window sees.
    """
    changed = seen_by(with_settings(case, replace(USUAL_SETTINGS, n_r=N_R, hits=hits, weights=weights)), cams)
    made = frames(changed, MIDDLE, seeds)
    share = np.mean([one.hits for one in made], axis=0) / ((2 * N_R + 1) * hits)
    return np.stack([one.images for one in made]), share.reshape(cams.height, cams.width)


def costs(name: str, plan: Plan) -> Table:
    """Time the images of a job in its steady state, under all of its lights, by weights and hits."""
    rows, shares = [], []
    job = job_named(name, False)
    with open_case(with_resolution(job, plan.resolution) if plan.resolution else job) as case:
        for hits in plan.hits:
            found: dict[str, list[Table]] = {weights: [] for weights in WEIGHTS}
            for place in TIMED_PLACES:  # in turn, so that other programs disturb both equally
                for weights in WEIGHTS:
                    way = with_settings(case, replace(USUAL_SETTINGS, n_r=N_R, hits=hits, weights=weights))
                    found[weights].append(steady(way, TIMED_FRAMES, place=place).table())
            shares.append(busy())
            for weights, tables in found.items():
                both = mean(tables)
                rows.append({"weights": weights, "hits": hits, "ms": both["ms"], "cpu_ms": both["cpu_ms"]})
                log(f"{name}, {weights}, {hits} hits: {both['ms']:.2f} ms per image")
    return {"found": rows, "busy": shares}
