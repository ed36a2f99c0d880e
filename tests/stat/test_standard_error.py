"""The standard error that an image reports, against the spread of the same image over seeds.

D^2 (`framearray_cli/engine/images/standard_error.py`) averaged over seeds is the variance of a pixel, so
over pixels and seeds its root mean square is that of the spread. Two light positions, so that sums and differences of
images are judged too.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import tiny
from support.stages import quad, stage_job, write_stage

from framearray_cli.engine.images.standard_error import standard_error
from framearray_cli.job.job import Job
from framearray_cli.render.errortarget import allot_hits
from framearray_cli.render.prepare import prepare

Array = NDArray[np.float64]

LAMP = {
    "type": "point",
    "keys": [
        {"frame": 0, "position": [0.6, 1.6, 0.3], "intensity": [1.2, 1.0, 0.8]},
        {"frame": 1, "position": [-1.0, 1.2, 0.5], "intensity": [0.4, 0.6, 1.2]},
    ],
}
FRAMES, MIDDLE, SEEDS, SIZE = 9, 4, 40, (32, 24)
# The standard error must neither flatter nor scare: within this share of the spread. Its own standard error here: the
# mean of 40 x 768 values of one degree of freedom each, so well below 1 %.
SHARE = 0.2


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The stage before a wall."""
    return write_stage(tmp_path_factory.mktemp("halves"), 3.0, quad("Wall", [-3, 0, -2], [6, 0, 0], [0, 3, 0]))


def job_of(scene: Path, out: Path, **changes: dict[str, Any]) -> Job:
    tables: dict[str, dict[str, Any]] = {
        "samples": {"hits": 2, "obscurance": 2, "halves": True},
        "reuse": {"n_r": 3, "weights": "balance"},
        "specular": {"hits": 16},
        "obscurance": {"range": 0.6},
    }
    tables = {name: {**table, **changes.get(name, {})} for name, table in tables.items()}
    return stage_job(scene, out, FRAMES, SIZE, lights=[LAMP], light_frames=2, **tables)


def over_seeds(job: Job, seeds: int = SEEDS) -> tuple[Array, Array, Array]:
    """Images and differences of the middle frame, and the errors that are written: (seeds, lights, values) each."""
    images, differences, errors = [], [], []
    for frame in tiny.frames_of_seeds(prepare(job), MIDDLE, range(seeds)):
        assert frame.differences is not None
        images.append(frame.images.reshape(2, -1))
        differences.append(frame.differences.reshape(2, -1))
        hits = frame.hits.reshape(SIZE[1], SIZE[0])
        errors.append([standard_error(image, hits).ravel() for image in frame.differences])
    return np.array(images, float), np.array(differences, float), np.array(errors, float)


def reported_to_true(images: Array, reported: Array) -> float:
    """Root mean square of the reported error over that of the spread."""
    return float(np.sqrt((reported**2).mean() / images.var(axis=0, ddof=1).mean()))


CASES: dict[str, dict[str, dict[str, Any]]] = {
    "balance": {},
    "average": {"reuse": {"weights": "average"}},
    "area": {"reuse": {"weights": "area"}},
    "area, one hit": {"reuse": {"weights": "area"}, "samples": {"hits": 1}},
    "area, many hits": {"reuse": {"weights": "area"}, "samples": {"hits": 16}},
    "area, no reuse": {"reuse": {"n_r": 0, "weights": "area"}, "samples": {"hits": 8}},
    "a wide window": {"reuse": {"n_r": 4}, "samples": {"hits": 1}},
    "many hits": {"samples": {"hits": 16}},  # little noise: nothing else may be taken for it
    "many hits, average": {"samples": {"hits": 16}, "reuse": {"weights": "average"}},
    "three hits": {"samples": {"hits": 3}},
    "few hits": {"samples": {"hits": 0.5}},
    "a third of a hit": {"samples": {"hits": 1 / 3}},
    "no reuse": {"reuse": {"n_r": 0}, "samples": {"hits": 8}},
    "no reuse, two hits": {"reuse": {"n_r": 0}, "samples": {"hits": 2}},
    "no mirrors": {"specular": {"depth": 0}},
}
LONG = dict.fromkeys(["many hits", "many hits, average", "area, many hits"], pytest.mark.slow)


@pytest.mark.parametrize("case", [pytest.param(case, marks=LONG.get(case, ())) for case in CASES])
def test_what_an_image_tells_of_its_error_is_its_spread(case: str, scene: Path, tmp_path: Path) -> None:
    images, differences, errors = over_seeds(job_of(scene, tmp_path, **CASES[case]))
    for reported in (differences, errors):  # averaging over neighbours moves errors, and keeps their sum
        assert abs(reported_to_true(images, reported) - 1) < SHARE


def test_in_mirrors_too(scene: Path, tmp_path: Path) -> None:
    """Only those pixels: what mirrors show rests on samples of one frame."""
    looks = [over_seeds(job_of(scene, tmp_path, specular={"depth": depth}), 4)[0].mean(axis=0) for depth in (4, 0)]
    shown = abs(looks[0] - looks[1]) > 0.005
    assert 60 < shown.sum() < 0.3 * shown.size
    images, differences, _ = over_seeds(job_of(scene, tmp_path))
    assert abs(reported_to_true(images[:, shown], differences[:, shown]) - 1) < SHARE


def test_a_wrong_error_is_found(scene: Path, tmp_path: Path) -> None:
    """The comparison fails for what is a third too large, and for what is a quarter too small."""
    images, differences, _ = over_seeds(job_of(scene, tmp_path))
    for factor in (4 / 3, 3 / 4):
        assert abs(reported_to_true(images, factor * differences) - 1) > SHARE


@pytest.mark.parametrize("combine", [lambda a, b: a - b, lambda a, b: 0.3 * a + 2.0 * b], ids=["minus", "sum"])
def test_images_of_two_lights_combined_tell_their_error(
    combine: Callable[[Array, Array], Array], scene: Path, tmp_path: Path
) -> None:
    """Hits are shared by lights, so errors are not independent; differences know that."""
    images, differences = (combine(both[:, 0], both[:, 1]) for both in over_seeds(job_of(scene, tmp_path))[:2])
    assert abs(reported_to_true(images, differences) - 1) < SHARE


@pytest.mark.parametrize(("error", "weights"), [(0.05, "balance"), (0.1, "balance"), (0.1, "average"), (0.05, "area")])
def test_a_wanted_error_is_reached(error: float, weights: str, scene: Path, tmp_path: Path) -> None:
    """`samples.error` against the spread over seeds, each with a pilot of its own; mirrors are left out of both."""
    changes = {"specular": {"depth": 0}, "reuse": {"weights": weights}}
    table = job_of(scene, tmp_path, **changes)
    wide, high = 3 * SIZE[0], 3 * SIZE[1]  # more blocks, so that it is not the pilot's own luck that is judged
    updates = {
        "samples": table.samples.model_copy(update={"error": error, "most_hits": 64}),
        "camera": table.camera.model_copy(update={"resolution": (wide, high)}),
    }
    prepared, images, radiance = prepare(table.model_copy(update=updates)), [], []
    with tiny.planned(prepared) as (planned, ambient):
        for seed in range(8):
            setup, target = allot_hits(prepared, replace(planned, seed=seed), ambient)
            assert target is not None and target.capped < 0.02 and abs(target.expected / error - 1) < 0.05
            images.append(tiny.composed(setup, ambient, MIDDLE).images)
            radiance.append(target.radiance)
    spread = np.sqrt(np.array(images, float).var(axis=0, ddof=1).mean())
    assert abs(spread / (error * np.mean(radiance)) - 1) < SHARE
