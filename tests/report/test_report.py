"""The parts of a report that need no render; tests/cli/test_report.py makes whole reports."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.errors import JobError, MissingExtraError
from framearray_cli.report import metrics, read_vary
from framearray_cli.report.case import choose_probes
from framearray_cli.report.measure import Measured
from framearray_cli.report.page import _heat_map, _signed_map, _worst_crop
from framearray_cli.report.reference import HITS, Quality, mean_quality, passes_for
from framearray_cli.report.settings import LIGHT_REUSE, SCRATCH, NamedSettings, Settings, baselines, settings_to_try
from framearray_cli.report.survey import advise, best_front, model_error, times_faster

JOB = tiny.job(camera=tiny.WALK, reuse={"n_r": 2})
BASE = Settings.of(JOB)


def result(name: str, ms: float, rmse: float, family: str = "job", **changes: Any) -> Measured:
    """Make up the cost and error of some settings."""
    settings = replace(BASE, **({"one_light": True} if family == SCRATCH else {}), **changes)
    numbers = {"rmse": rmse, "flicker_camera": None, "flicker_light": None}
    quality = Quality(**{name: numbers.get(name, 0.0) for name in Quality.__dataclass_fields__})
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


def test_lines_to_paste_say_what_differs_and_nothing_else() -> None:
    other = replace(BASE, n_r=7, weights="average", hits=0.5, obscurance=7)
    assert other.lines(BASE) == [
        "[reuse]", "n_r = 7", 'weights = "average"', "[samples]", "hits = 0.5", "obscurance = 7",
    ]  # fmt: skip
    assert BASE.lines(BASE) == []
    left_open = Settings.of(tiny.job(camera=tiny.WALK, reuse={"n_r": "auto"}, samples={"hits": "auto"}))
    assert BASE.lines(left_open) == ["[reuse]", "n_r = 2", "[samples]", "hits = 2"]


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
    tried = settings_to_try(BASE, 41, {"reuse.weights": ["average", "area"]}, only=True)
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


def test_values_to_vary_replace_the_defaults() -> None:
    tried = settings_to_try(BASE, 41, {"samples.hits": [3]})
    assert [one.settings.hits for one in tried if one.family == "samples.hits"] == [3]


def test_baselines_reach_the_hits_of_the_window() -> None:
    for family in (LIGHT_REUSE, SCRATCH):
        of_family = [one.settings for one in baselines(BASE) if one.family == family]
        assert BASE.window_hits in [s.hits for s in of_family]
        assert all(s.n_r == 0 and s.one_light == (family == SCRATCH) for s in of_family)
        assert {s.weights for s in of_family} == {"average"}


def test_baselines_weigh_by_area_where_the_job_does() -> None:
    """Native hits gain by it, too: the comparison is with the best way to render from scratch."""
    assert {one.settings.weights for one in baselines(replace(BASE, weights="area"))} == {"area"}


def test_probes_come_with_their_neighbours() -> None:
    found = choose_probes(90, 48)
    assert found.cameras == ((30, 31), (60, 61))
    assert found.lights == (8, 9, 24, 25, 40, 41)
    assert found.light_pairs == ((0, 1), (2, 3), (4, 5))


def test_probes_of_small_arrays() -> None:
    one = choose_probes(1, 1)
    assert (one.cameras, one.lights, one.light_pairs) == (((0,),), (0,), ())
    two = choose_probes(2, 2)
    assert (two.cameras, two.lights, two.light_pairs) == (((0, 1),), (0, 1), ((0, 1),))


def test_probes_that_the_user_chooses() -> None:
    found = choose_probes(90, 48, [89, 5, 5], [47, 3])
    assert found.cameras == ((5, 6), (89,))
    assert found.lights == (3, 4, 47) and found.light_pairs == ((0, 1),)


def test_no_settings_beat_the_front() -> None:
    points = [result("a", 2, 0.1), result("b", 1, 0.2), result("c", 3, 0.15), result("d", 4, 0.05), result("e", 2, 0.3)]
    assert [one.named.name for one in best_front(points, model_error)] == ["b", "a", "d"]


def test_advice_is_the_cheapest_of_those_good_enough() -> None:
    points = [result("a", 2, 0.1), result("b", 1, 0.2), result("d", 4, 0.05), result("s", 0.1, 0.05, SCRATCH)]
    found = advise(points, [0.2, 0.1, 0.0995, 0.06, 0.01], model_error)
    assert [one.best and one.best.named.name for one in found] == ["b", "a", "a", "d", None]


def test_speed_up_at_equal_error_follows_the_curve_of_images_from_scratch() -> None:
    """Noise falls with the root of the hits, and time grows in proportion: 40x at every error."""
    scratch = [result(f"s{n}", 40.0 * n, n**-0.5, SCRATCH) for n in (1, 2, 8, 14)]
    for n in (0.3, 1, 3, 5, 14, 60):
        one = result("own", float(n), n**-0.5)
        assert times_faster(one, [one, *scratch]) == pytest.approx(40.0)
    assert times_faster(result("own", 1, 0.1), []) is None


def test_a_reference_has_the_samples_that_the_user_asks_for() -> None:
    for times, window_hits in ((100, 14), (1, 0.5), (7, 10)):
        hits = 2 * HITS * passes_for(times, window_hits)
        assert times * window_hits <= hits < times * window_hits + 2 * HITS


def test_means_of_measures() -> None:
    a, b = (replace(result("", 1, rmse).quality, squared_bias_error=0.3, edge_max=rmse) for rmse in (0.3, 0.4))
    found = mean_quality([a, replace(b, flicker_light=2.0)])
    assert found.rmse == pytest.approx(np.sqrt(0.125))
    assert found.squared_bias_error == pytest.approx(0.3 / 2**0.5)
    assert (found.edge_max, found.flicker_light, found.flicker_camera) == (0.4, 2.0, None)
    assert replace(found, squared_bias=-1.0).bias == 0 and replace(found, squared_bias=-1.0).noise == found.rmse
    assert replace(found, squared_bias=0.04).bias == pytest.approx(0.2)


def test_flip_is_0_for_equal_pictures_and_grows_with_the_difference() -> None:
    pytest.importorskip("flip_evaluator")
    rng = np.random.default_rng(1)
    picture = rng.random((40, 60, 3)).astype(np.float32)
    same, near, far = (metrics.flip_map(picture * k, picture) for k in (np.float32(1), np.float32(1.05), np.float32(2)))
    assert same.shape == (40, 60) and not same.any()
    assert 0 < near.mean() < far.mean() <= 1


def test_missing_libraries_are_reported_with_their_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "jinja2" else object())
    with pytest.raises(MissingExtraError, match=r'needs jinja2.*pip install .*\[report\]"'):
        metrics.require_extra()


def test_the_crop_is_where_the_error_is() -> None:
    error = np.zeros((300, 400), np.float32)
    error[150:160, 250:260] = 1
    top, left = _worst_crop(error)
    assert top <= 150 and left <= 250 and top + 96 >= 160 and left + 96 >= 260
    assert _worst_crop(np.zeros((20, 30), np.float32)) == (0, 0)  # an image smaller than a crop


def test_colours_of_maps() -> None:
    assert _heat_map(np.float32([[0, 1, 2]])).tolist() == [[[0, 0, 0], [255, 255, 255], [255, 255, 255]]]
    white, red, blue = _signed_map(np.float32([[0, 1, -1]]))[0]
    assert white.tolist() == [255] * 3 and red[0] > red[2] and blue[2] > blue[0]
