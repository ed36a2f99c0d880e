"""Errors with respect to true light, which has noise; tests/cli/test_report.py makes whole reports."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import tiny

from framearray_cli.engine.frames.records import ArrayPool
from framearray_cli.report.case import Probes, choose_probes, plan_case, with_method, with_settings
from framearray_cli.report.measure import render_frames
from framearray_cli.report.settings import METHODS, Settings, methods_to_try
from framearray_cli.report.truth import (
    MOST_CAMERAS,
    MOST_LIGHTS,
    Truth,
    TruthError,
    compare_with_truth,
    make_truth,
    mean_truth_error,
    reason_without,
    true_case,
    true_places,
)

JOB = tiny.job(camera=tiny.WALK, reuse={"n_r": 1})
RNG = np.random.default_rng(7)
SHAPE = (40, 60, 3)


def truth_of(right: np.ndarray, noise: float) -> Truth:
    halves = [right + noise * RNG.standard_normal(right.shape) for _ in range(2)]
    return Truth(images=np.asarray(halves, np.float32)[:, None], rows=(0,))


def measured(image: np.ndarray, truth: Truth) -> TruthError:
    (found,) = compare_with_truth([np.asarray(image[None], np.float32)], truth)
    return found


def test_noise_of_the_truth_is_no_part_of_an_error() -> None:
    """The error of an image is 0.3, that of the halves twice as much; over 60 truths it is within its own error."""
    right = 2.0 + RNG.random(SHAPE)
    wrong = 0.3 * RNG.standard_normal(SHAPE)
    square = float((wrong**2).mean()) / float(right.mean()) ** 2
    found = [measured(right + wrong, truth_of(right, 0.6)) for _ in range(60)]
    z = [(one.square - square) / one.square_error for one in found]
    assert abs(np.mean(z)) < 3 / 60**0.5
    assert 0.7 < np.std(z) < 1.3  # 3 standard errors of 60 values
    assert np.mean([one.rmse for one in found]) == pytest.approx(square**0.5, rel=0.02)


def test_an_image_without_error() -> None:
    right = 1.0 + RNG.random(SHAPE)
    found = measured(right, truth_of(right, 0.5))
    assert abs(found.square) < 4 * found.square_error and found.rmse_error > 0
    exact = measured(right, truth_of(right, 0.0))
    assert exact.rmse == exact.coarse == 0 and exact.mean_off == pytest.approx(0, abs=1e-6)


def test_means_over_squares_have_less_noise_and_the_same_offset() -> None:
    right = np.ones(SHAPE)
    noisy = measured(right + 0.4 * RNG.standard_normal(SHAPE), truth_of(right, 0.0))
    assert noisy.rmse == pytest.approx(0.4, rel=0.05) and noisy.coarse == pytest.approx(0.1, rel=0.15)
    brighter = measured(1.25 * right, truth_of(right, 0.0))
    assert brighter.rmse == pytest.approx(0.25) and brighter.coarse == pytest.approx(0.25)
    assert brighter.mean_off == pytest.approx(0.25)


def test_pictures_smaller_than_a_square() -> None:
    found = measured(np.full((2, 3, 3), 1.5), truth_of(np.ones((2, 3, 3)), 0.0))
    assert found.coarse == pytest.approx(0.5)


def test_black_truth_has_no_relative_error() -> None:
    black = truth_of(np.zeros(SHAPE), 0.0)
    assert compare_with_truth([np.ones((1, *SHAPE), np.float32)], black) == []
    assert mean_truth_error([]) is None and black.noise == 0


def test_means_of_errors() -> None:
    one = TruthError(square=0.04, square_error=0.003, coarse_square=0.01, mean_off=0.1)
    two = replace(one, square=0.12, square_error=0.004, coarse_square=0.03, mean_off=-0.2)
    found = mean_truth_error([one, two])
    assert found is not None
    assert found.rmse == pytest.approx(0.08**0.5) and found.coarse == pytest.approx(0.02**0.5)
    assert found.square_error == pytest.approx(0.0025) and found.mean_off == pytest.approx(-0.05)


def test_few_images_are_rendered_in_true_light() -> None:
    assert true_places(choose_probes(90, 48)) == ((30, 60), (0, 2, 4))
    many = choose_probes(90, 48, range(0, 90, 2), range(0, 48, 3))
    cameras, rows = true_places(many)
    assert len(cameras) == MOST_CAMERAS and len(rows) == MOST_LIGHTS
    assert {c for c in cameras} <= {run[0] for run in many.cameras}
    assert true_places(Probes(cameras=((0,),), lights=(0,))) == ((0,), (0,))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, None),
        ({"indirect": {"method": "cells"}}, None),
        ({"ambient": {"paths": None, "intensity": [0.1, 0.1, 0.1]}}, "ambient.intensity"),
        ({"indirect": {"method": "cells", "exact": True}}, "follows paths itself"),
    ],
)
def test_jobs_that_true_light_says_nothing_about(changes: dict[str, object], words: str | None) -> None:
    reason = reason_without(tiny.job(**{"ambient": {"paths": None}, **changes}))
    assert (reason is None) if words is None else (reason is not None and words in reason)


def test_methods_to_try() -> None:
    base = Settings.of(JOB)
    tried = methods_to_try(base, {})
    assert list(tried) == [method for method in METHODS if method != base.indirect]
    for method, some in tried.items():
        assert [one.settings.hits for one in some] == [base.hits / 2, base.hits, 2 * base.hits]
        assert {one.settings.indirect for one in some} == {method} == {one.family for one in some}
    assert methods_to_try(base, {}, only=True) == {}
    assert list(methods_to_try(base, {"indirect.method": ["cells"]}, only=True)) == ["cells"]
    assert tried["cells"][1].settings.lines(base) == ["[indirect]", 'method = "cells"']


@pytest.mark.parametrize("method", METHODS)
def test_a_method_takes_no_keys_of_another(method: str) -> None:
    """A job that has them can be written with any method, and comes back as it was."""
    keys = {"method": "cells", "cell": 0.2, "samples": 5000, "filter": 1}
    job = tiny.job(indirect=keys)
    changed = replace(Settings.of(job), indirect=method).apply_to(job)
    assert changed.indirect.method == method
    assert Settings.of(job).apply_to(job).indirect == job.indirect


def test_cells_are_nearer_to_true_light_than_obscurances(tmp_path: Path) -> None:
    """The comparison that a report makes, in a small room; truth that was made is read again."""
    job = tiny.job(camera={"resolution": [32, 24]}, samples={"hits": 16}, indirect=tiny.CELLS | {"samples": 2**16})
    with plan_case(tiny.prepared(job)) as case:
        lights = range(case.setup.lights.n_lights)
        truth = make_truth(true_case(case), 0, lights, lights, tmp_path)
        errors = {}
        for method in ("obscurance", "cells"):
            of_method = case if method == "cells" else with_method(case, "obscurance")
            assert (of_method.setup.indirect.cells is None) == (method == "obscurance")
            same = with_settings(of_method, of_method.settings).setup
            light, other = of_method.setup.indirect, same.indirect
            assert other.cells is light.cells and getattr(other, "smooth", 0) == getattr(light, "smooth", 0)
            images = render_frames(of_method, of_method.settings, [0], lights, 5, ArrayPool()).images[0]
            errors[method] = mean_truth_error(compare_with_truth([images], truth))
        again = make_truth(true_case(case), 0, lights, lights, tmp_path)
    assert np.array_equal(again.images, truth.images) and len(list(tmp_path.iterdir())) == 1
    obscurance, cells = errors["obscurance"], errors["cells"]
    assert obscurance is not None and cells is not None
    assert cells.coarse < 0.5 * obscurance.coarse and abs(cells.mean_off) < 0.5 * abs(obscurance.mean_off)
