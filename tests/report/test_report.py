"""Reports: settings, metrics, and true light."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.errors import JobError
from framearray_cli.engine.frames.records import ArrayPool
from framearray_cli.report import read_vary
from framearray_cli.report.case import choose_images, plan_case, with_method, with_settings
from framearray_cli.report.measure import Measured, render_frame
from framearray_cli.report.page import _worst_crop
from framearray_cli.report.reference import (
    HITS,
    TIMES,
    Quality,
    Reference,
    compare_frame,
    make_reference,
    mean_quality,
    passes_for,
    reference_noise,
    relmse,
    rmse,
    squared_bias,
)
from framearray_cli.report.settings import (
    LIGHT_REUSE,
    METHODS,
    SCRATCH,
    NamedSettings,
    Settings,
    baselines,
    methods_to_try,
    settings_to_try,
)
from framearray_cli.report.survey import TrueLight, times_faster
from framearray_cli.report.truth import HITS as TRUE_HITS
from framearray_cli.report.truth import (
    MOST_CAMERAS,
    MOST_LIGHTS,
    PASSES,
    TruthError,
    compare_with_truth,
    mean_truth_error,
    reason_without,
    true_case,
    true_places,
)

JOB = tiny.job(camera=tiny.WALK, reuse={"n_r": 2})
BASE = Settings.of(JOB)


def result(name: str, ms: float, rmse: float, family: str = "job", **changes: Any) -> Measured:
    """Make up the cost and error of some settings."""
    settings = replace(BASE, **({"one_light": True} if family == SCRATCH else {}), **changes)
    quality = Quality(rmse=rmse, relmse=0.0, mean_off=0.0, squared_bias=0.0)
    return Measured(
        named=NamedSettings(name=name, family=family, settings=settings), ms=ms, quality=quality, hits=(1.0, 1.0),
        example=np.zeros((2, 2, 3), np.float32),
    )  # fmt: skip


def test_settings_are_those_of_the_job_and_can_be_applied_to_it() -> None:
    assert (BASE.n_r, BASE.hits, BASE.obscurance, BASE.weights) == (2, 2, 5, "balance")
    assert BASE.window_hits == 10
    other = replace(BASE, n_r=1, weights="average", hits=0.5, obscurance=9)
    assert Settings.of(other.apply_to(JOB)) == other
    assert Settings.of(JOB) == BASE  # the job itself stays


def test_values_to_vary() -> None:
    assert read_vary("samples.hits=0.5, 1,4", JOB) == ("samples.hits", [0.5, 1, 4])
    assert read_vary('reuse.weights="average",balance', JOB) == ("reuse.weights", ["average", "balance"])


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("samples.hit=1", "expected one of reuse.n_r"),
        ("samples.hits", "expected one of reuse.n_r"),
        ("samples.hits=", "expected one of reuse.n_r"),
        ("samples.hits=0.3", "samples.hits = 0.3"),
        ("samples.hits=2,auto", "samples.hits = 'auto': expected a value to measure"),
        ("reuse.n_r=-1,2,900", "reuse.n_r = 900"),
        ("reuse.weights=best", "reuse.weights = 'best'"),
        ("samples.obscurance=nan", "samples.obscurance"),
    ],
)
def test_values_that_no_job_may_have_are_refused(option: str, words: str) -> None:
    with pytest.raises(JobError) as caught:
        read_vary(option, JOB)
    assert words in str(caught.value) and str(caught.value).startswith("--vary: ")


def test_only_the_values_that_were_asked_for() -> None:
    tried = settings_to_try(BASE, 41, {"reuse.weights": ["average", "area"]})
    others = [one for one in tried if one.family not in {"job", LIGHT_REUSE, SCRATCH}]
    assert {one.settings.weights for one in others} == {"average", "area"} - {BASE.weights}
    assert tried[0].settings == BASE and {LIGHT_REUSE, SCRATCH} <= {one.family for one in tried}


def test_default_settings_to_try() -> None:
    tried = settings_to_try(BASE, 41, {})
    assert tried[0].settings == BASE
    assert len({one.name for one in tried}) == len(tried)
    assert len({(one.settings, one.family) for one in tried}) == len(tried)
    n_r = [one.settings.n_r for one in tried if one.family == "reuse.n_r"]
    assert n_r == [0, 1, 5, 10]
    assert {one.family for one in tried} >= {LIGHT_REUSE, SCRATCH, "samples.hits", "reuse.weights", "hits for n_r"}
    for one in tried:  # a job may have all of them
        if not one.settings.one_light:
            one.settings.apply_to(JOB)


def test_a_window_is_no_longer_than_the_path() -> None:
    assert all(2 * one.settings.n_r + 1 <= 6 for one in settings_to_try(BASE, 6, {}))
    assert all(one.settings.n_r == 0 for one in settings_to_try(replace(BASE, n_r=0), 1, {}))


def test_baselines_reach_the_hits_of_the_window() -> None:
    for family in (LIGHT_REUSE, SCRATCH):
        of_family = [one.settings for one in baselines(BASE) if one.family == family]
        assert BASE.window_hits in [s.hits for s in of_family]
        assert all(s.n_r == 0 and s.one_light == (family == SCRATCH) for s in of_family)
        assert {s.weights for s in of_family} == {"average"}


def test_baselines_weigh_by_area_where_the_job_does() -> None:
    """Native hits gain by it, too: the comparison is with the best way to render from scratch."""
    assert {one.settings.weights for one in baselines(replace(BASE, weights="area"))} == {"area"}


def test_images_to_measure_are_spread_or_chosen() -> None:
    assert choose_images(90, ()) == (15, 45, 75)
    assert choose_images(2, ()) == (0, 1) and choose_images(1, ()) == (0,)
    assert choose_images(90, [89, 5, 5]) == (5, 89)


def test_no_settings_beat_the_front() -> None:
    """Errors with respect to true light are the same here as those with respect to the reference."""
    points = [result("a", 2, 0.1), result("b", 1, 0.2), result("c", 3, 0.15), result("d", 4, 0.05), result("e", 2, 0.3)]
    truths = [
        TruthError(square=one.quality.rmse**2, square_error=0.0, coarse_square=0.0, mean_off=0.0) for one in points
    ]
    measured = tuple(replace(one, truth=truth) for one, truth in zip(points, truths, strict=True))
    found = TrueLight(cameras=(0,), lights=(0,), hits=1, noise=0.0, measured=measured)
    assert [one.named.name for one in found.front] == ["b", "a", "d"]


def test_speed_up_at_equal_error_follows_the_curve_of_images_from_scratch() -> None:
    """Noise falls with the root of the hits, and time grows in proportion: 40x at every error."""
    scratch = [result(f"s{n}", 40.0 * n, n**-0.5, SCRATCH) for n in (1, 2, 8, 14)]
    for n in (0.3, 1, 3, 5, 14, 60):
        one = result("own", float(n), n**-0.5)
        assert times_faster(one, [one, *scratch]) == pytest.approx(40.0)
    assert times_faster(result("own", 1, 0.1), []) is None


def test_a_reference_has_a_hundred_times_the_samples_of_a_picture() -> None:
    for window_hits in (14, 0.5, 10):
        assert TIMES * window_hits <= 2 * HITS * passes_for(window_hits) < TIMES * window_hits + 2 * HITS


def test_means_of_measures() -> None:
    a, b = (result("", 1, rmse).quality for rmse in (0.3, 0.4))
    found = mean_quality([a, replace(b, squared_bias=0.08)])
    assert found.rmse == pytest.approx(np.sqrt(0.125)) and found.bias == pytest.approx(0.2)
    assert replace(found, squared_bias=-1.0).bias == 0 and replace(found, squared_bias=-1.0).noise == found.rmse


def test_the_crop_is_where_the_error_is() -> None:
    error = np.zeros((300, 400), np.float32)
    error[150:160, 250:260] = 1
    top, left = _worst_crop(error)
    assert top <= 150 and left <= 250 and top + 96 >= 160 and left + 96 >= 260
    assert _worst_crop(np.zeros((20, 30), np.float32)) == (0, 0)  # an image smaller than a crop


def flat(value: float, shape: tuple[int, int] = (40, 60)) -> np.ndarray:
    return np.full((*shape, 3), value, np.float32)


def test_rmse_and_relmse_of_constants():
    assert rmse(flat(1.5), flat(1.0)) == pytest.approx(0.5)
    assert relmse(flat(1.5), flat(1.0)) == pytest.approx(0.25 / 1.01)
    assert relmse(flat(0.0), flat(0.0)) == 0


def test_errors_are_relative_to_the_mean():
    image, right = flat(2.0)[None], flat(2.0)
    image[0, 0, 0] = 5.0
    wanted = Reference(light=np.stack([right, right])[:, None], indirect=np.zeros((2, *right.shape)), hits=1)
    (found,) = compare_frame((image, image), wanted, SimpleNamespace(intensity=np.ones((1, 3))), [0])
    assert found.mean_off == pytest.approx(1.5 / 2400)
    assert found.rmse == pytest.approx(1.5 / np.sqrt(2400))
    assert found.bias == pytest.approx(found.rmse)  # as both runs have the same error


def test_squared_bias_is_free_of_noise():
    """The product of a pixel has a variance of 2 * 2 + 2 * 0.09 * 2, and there are 120,000 values."""
    rng = np.random.default_rng(1)
    noise = [rng.normal(0, 1, (200, 200, 3)).astype(np.float32) for _ in range(4)]
    spread = np.sqrt(4.36 / 120_000)
    assert abs(squared_bias((1.3 + noise[0], 1.3 + noise[1]), (1 + noise[2], 1 + noise[3])) - 0.09) < 4 * spread
    assert abs(squared_bias((noise[0], noise[1]), (noise[2], noise[3]))) < 4 * spread


TRUE_JOB = tiny.job(camera=tiny.WALK, reuse={"n_r": 1})
RNG = np.random.default_rng(7)
SHAPE = (40, 60, 3)


def truth_of(right: np.ndarray, noise: float) -> Reference:
    halves = np.asarray([right + noise * RNG.standard_normal(right.shape) for _ in range(2)], np.float32)
    return Reference(light=halves[:, None], indirect=np.zeros_like(halves), hits=1)


def measured(image: np.ndarray, truth: Reference) -> TruthError:
    (found,) = compare_with_truth([np.asarray(image[None], np.float32)], truth, [0])
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
    assert compare_with_truth([np.ones((1, *SHAPE), np.float32)], black, [0]) == []
    case = SimpleNamespace(ambient=SimpleNamespace(intensity=np.ones((1, 3))))
    assert mean_truth_error([]) is None and reference_noise([black], case, [0]) == 0


def test_means_of_errors() -> None:
    one = TruthError(square=0.04, square_error=0.003, coarse_square=0.01, mean_off=0.1)
    two = replace(one, square=0.12, square_error=0.004, coarse_square=0.03, mean_off=-0.2)
    found = mean_truth_error([one, two])
    assert found is not None
    assert found.rmse == pytest.approx(0.08**0.5) and found.coarse == pytest.approx(0.02**0.5)
    assert found.square_error == pytest.approx(0.0025) and found.mean_off == pytest.approx(-0.05)


def test_few_images_are_rendered_in_true_light() -> None:
    assert true_places((15, 45, 75), (8, 24, 40)) == ((15, 75), (0, 1, 2))
    cameras, rows = true_places(range(0, 90, 2), range(0, 48, 3))
    assert len(cameras) == MOST_CAMERAS and len(rows) == MOST_LIGHTS
    assert true_places((0,), (0,)) == ((0,), (0,))


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
    base = Settings.of(TRUE_JOB)
    tried = methods_to_try(base, {})
    assert list(tried) == [method for method in METHODS if method != base.indirect]
    for method, some in tried.items():
        assert [one.settings.hits for one in some] == [base.hits / 2, base.hits, 2 * base.hits]
        assert {one.settings.indirect for one in some} == {method} == {one.family for one in some}
    assert methods_to_try(base, {"samples.hits": [1]}) == {}
    assert list(methods_to_try(base, {"indirect.method": ["cells"]})) == ["cells"]


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
        truth = make_reference(true_case(case), 0, lights, tmp_path, PASSES, TRUE_HITS)
        errors = {}
        for method in ("obscurance", "cells"):
            of_method = case if method == "cells" else with_method(case, "obscurance")
            assert (of_method.setup.indirect.cells is None) == (method == "obscurance")
            same = with_settings(of_method, of_method.settings).setup
            light, other = of_method.setup.indirect, same.indirect
            assert other.cells is light.cells and getattr(other, "smooth", 0) == getattr(light, "smooth", 0)
            images = render_frame(of_method, of_method.settings, 0, lights, 5, ArrayPool()).images
            errors[method] = mean_truth_error(compare_with_truth([images], truth, lights))
        again = make_reference(true_case(case), 0, lights, tmp_path, PASSES, TRUE_HITS)
    assert np.array_equal(again.light, truth.light) and not truth.indirect.any()
    assert truth.hits == again.hits == PASSES * TRUE_HITS
    assert len(list(tmp_path.iterdir())) == 1
    obscurance, cells = errors["obscurance"], errors["cells"]
    assert obscurance is not None and cells is not None
    assert cells.coarse < 0.5 * obscurance.coarse and abs(cells.mean_off) < 0.5 * abs(obscurance.mean_off)
