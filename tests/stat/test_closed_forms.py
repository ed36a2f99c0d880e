"""The formulas themselves: closed forms against quadrature, and statistics that must be able to say no."""

import numpy as np
import pytest
from support import closed_forms as forms
from support import ztests

from framearray_cli.engine.terms.obscurance import FALLOFFS


@pytest.mark.parametrize("k", [0.1, 0.4, 1.0, 3.0, 200.0])
@pytest.mark.parametrize("falloff", FALLOFFS)
def test_chords_of_a_sphere(falloff: str, k: float) -> None:
    closed = forms.sphere_obscurance(falloff, 0.7, k)
    assert closed == pytest.approx(forms.sphere_obscurance_numerically(falloff, 0.7, k), rel=1e-7, abs=1e-12)


def test_the_sphere_has_the_form_that_the_design_gives() -> None:
    r, d_max = 1.3, 4.0
    assert forms.sphere_obscurance("sqrt", 0.5, 2 * r / d_max) == pytest.approx(0.8 * 0.5 * (2 * r / d_max) ** 0.5)


@pytest.mark.parametrize("s", [0.1, 0.5, 0.9])
def test_wall_and_disc_by_linear_falloff(s: float) -> None:
    assert forms.wall_obscurance("linear", 0.7, 0.4, s) == pytest.approx(forms.wall_obscurance_linear(0.7, 0.4, s))
    numeric = forms.disc_obscurance("linear", 0.7, 0.4, 0.8, s, 1.5)
    assert numeric == pytest.approx(forms.disc_obscurance_linear(0.7, 0.4, 0.8, s, 1.5))


def test_limits_of_wall_and_disc() -> None:
    assert forms.wall_share(1.0) == 0  # a wall at d_max is not met within it
    assert forms.wall_share(1e-9) == pytest.approx(0.5)  # one at the foot hides half the sky
    assert forms.disc_share(1.0, 1e-6) == pytest.approx(1.0)


def test_sidak_keeps_the_chance_of_a_family() -> None:
    assert 1 - (1 - ztests.sidak(500)) ** 500 == pytest.approx(ztests.CHANCE)
    assert ztests.sidak_z(1) == pytest.approx(3.0)
    assert ztests.sidak_z(1000) > 4.5


def test_differing_finds_what_differs_and_nothing_else() -> None:
    random = np.random.default_rng(1)
    a, b = random.normal(size=(20, 300)), random.normal(size=(30, 300))
    assert ztests.differing(a, b).max() < 1
    b[:, 7] += 3.0  # some ten standard errors
    assert (ztests.differing(a, b) > 1).nonzero()[0].tolist() == [7]
    assert ztests.differing(np.zeros((5, 1)), np.ones((5, 1)))[0] > 1e4  # values without any spread


def test_off_finds_wrong_means_and_nothing_else() -> None:
    a = np.random.default_rng(2).normal(size=(20, 300))
    right = np.zeros(300)
    assert ztests.off(a, right).max() < 1
    right[7] = 3.0
    assert (ztests.off(a, right) > 1).nonzero()[0].tolist() == [7]
    assert ztests.off(np.zeros((5, 1)), np.ones(1))[0] > 1e4


@pytest.mark.parametrize("test", ["off", "differing"])
def test_pixel_tests_are_as_strict_as_they_say(test: str) -> None:
    """Of 400 families of 50 values each that nothing is wrong with, about CHANCE = 1 in 370 may fail: at most 6.

    More have a chance of 1e-3 (Poisson). A test that is too strict, or that lets too much pass, shows in half of it:
    the largest of 50 deviations is beyond half of what is allowed in more than a tenth of all families.
    """
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 400, 40, 50))
    worst = np.array(
        [
            ztests.off(x, np.zeros(50)).max() if test == "off" else ztests.differing(x, y).max()
            for x, y in zip(a, b, strict=True)
        ]
    )
    assert (worst > 1).sum() <= 6
    assert 0.1 < (worst > 0.5).mean() < 0.99


def test_z_of_an_estimate_without_error() -> None:
    sure = ztests.estimate(np.ones(10))
    assert sure.z(1.0) == 0
    assert sure.z(1.1) == -np.inf
