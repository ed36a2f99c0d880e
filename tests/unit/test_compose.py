"""Sums of hits become images."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.accumulate import MOST, accumulate, sources
from framearray_cli.arrays import with_room
from framearray_cli.compose import (
    INDIRECT,
    OBSCURANCE,
    STEADY,
    WEIGHT,
    Band,
    as_stored,
    begin,
    empty_band,
    finish,
    normalise,
)
from framearray_cli.reuse import sort_by_pixel
from framearray_cli.work import Placed, Records

N_PIXELS, N_LIGHTS, NOTHING = 40, 7, np.empty(0, np.float32)


class Case:
    """Random hits, and what numpy makes of them in float64."""

    def __init__(self, channels: int, n: int = 600, constant: bool = True, weighed: bool = True, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.pixel = rng.integers(-1, N_PIXELS, n).astype(np.int32)
        self.start, self.order = np.empty(N_PIXELS + 1, np.int32), np.empty(n, np.int32)
        sort_by_pixel(self.pixel, N_PIXELS, self.start, self.order)

        def values(*shape: int) -> Any:
            return rng.random(shape).astype(np.float32)

        self.weight = values(n) if weighed else NOTHING
        self.reflectivity = values(n, 3) * (rng.random((n, 1)) < 0.8)  # some hits are black
        self.obscurance = values(n, 3)
        self.constant = values(n, 3) if constant else np.empty((0, 3), np.float32)
        self.irradiance = with_room((n, channels, N_LIGHTS), np.float32)
        self.irradiance[:] = values(n, channels, N_LIGHTS)

    def add(self, band: Band, first: int, n: int, scale: Any = NOTHING) -> None:
        placed = Placed(start=self.start, order=self.order)
        records = Records(
            reflectivity=self.reflectivity,
            obscurance=self.obscurance,
            constant=self.constant,
            irradiance=self.irradiance,
        )
        parts = sources([(placed, records, self.weight, np.float32(scale))])
        accumulate(band, first, n, parts, self.irradiance.shape[1], N_LIGHTS)

    def sums(self, values: Any, scale: Any = NOTHING) -> Any:
        """Weighed sums of values (n, ...) by pixel."""
        out, seen = np.zeros((N_PIXELS, *values.shape[1:])), self.pixel >= 0
        weight = self.weight.astype(np.float64) if len(self.weight) else np.ones(len(self.pixel))
        if len(scale):
            weight = weight * scale[np.maximum(self.pixel, 0)]
        weighed = values * weight.reshape(-1, *[1] * (values.ndim - 1))
        np.add.at(out, self.pixel[seen], weighed[seen])
        return out

    def direct(self) -> Any:
        irradiance = np.broadcast_to(self.irradiance, (len(self.pixel), 3, N_LIGHTS))
        return self.reflectivity[:, :, None].astype(np.float64) / np.pi * irradiance

    def picture(self, colour: Any, ambient: Any) -> Any:
        """(n_lights, n_pixels, 3) weighed means."""
        total = self.sums(np.ones(len(self.pixel)))
        indirect = self.sums(self.reflectivity.astype(np.float64) * self.obscurance)
        steady = self.sums(self.constant.astype(np.float64)) if len(self.constant) else 0
        direct = self.sums(self.direct())  # (n_pixels, 3, n_lights)
        value = (
            colour * direct
            + ambient * indirect[:, :, None]
            + np.reshape(steady, (-1, 3, 1) if len(self.constant) else ())
        )
        return (value / total[:, None, None]).transpose(2, 0, 1)


def lights() -> tuple[Any, Any]:
    """Colour and ambient radiance, (3, n_lights)."""
    rng = np.random.default_rng(9)
    return rng.random((3, N_LIGHTS)).astype(np.float32), rng.random((3, N_LIGHTS)).astype(np.float32)


def composed(
    case: Case, bands: Any = ((0, N_PIXELS),), dtype: Any = np.float32, brightness: float = 1.0
) -> tuple[Any, list[tuple[int, int, int, int]]]:
    colour, ambient = (np.float32(brightness) * values for values in lights())
    images, bad = np.full((N_LIGHTS, N_PIXELS, 3), np.nan, dtype), []
    band = empty_band(N_PIXELS, N_LIGHTS)
    for first, n in bands:
        begin(band, n)
        case.add(band, first, n)
        normalise(band, n)
        bad.append(finish(band, first, n, colour, ambient, np.float32(0), as_stored(images)))
    return images, bad


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("constant", [False, True])
@pytest.mark.parametrize("weighed", [False, True])
def test_images_are_weighed_means(channels: int, constant: bool, weighed: bool) -> None:
    case = Case(channels, constant=constant, weighed=weighed)
    images, bad = composed(case)
    # some tens of terms of one sign, each a few roundings
    np.testing.assert_allclose(images, case.picture(*lights()), rtol=5e-6)
    assert bad == [(0, -1, -1, 0)]


def test_sums_of_a_band() -> None:
    case, band = Case(1), empty_band(N_PIXELS, N_LIGHTS)
    begin(band, 20)
    case.add(band, 15, 20)
    pixels = slice(15, 35)
    np.testing.assert_array_equal(band.hits[:20], np.bincount(case.pixel[case.pixel >= 0], minlength=N_PIXELS)[pixels])
    expected = {
        WEIGHT: case.sums(np.ones((len(case.pixel), 1))),
        INDIRECT: case.sums(case.reflectivity.astype(np.float64) * case.obscurance),
        STEADY: case.sums(case.constant),
    }
    for first, values in expected.items():
        np.testing.assert_allclose(band.rest[:20, first : first + values.shape[1]], values[pixels], rtol=2e-6)
    # a black hit has no W; those sums count the others
    seen = (case.reflectivity > 0).any(axis=1, keepdims=True)
    np.testing.assert_allclose(
        band.rest[:20, OBSCURANCE : OBSCURANCE + 3], case.sums(case.obscurance * seen)[pixels], rtol=2e-6
    )
    np.testing.assert_allclose(band.reflectivity[:20], case.sums(case.reflectivity)[pixels], rtol=2e-6)
    np.testing.assert_allclose(band.direct[:20, :, :N_LIGHTS], case.sums(case.direct())[pixels], rtol=2e-6)


@pytest.mark.parametrize("bands", [[(0, 1), (1, 39)], [(0, 16), (16, 16), (32, 8)], [(35, 5), (0, 35)]])
def test_bands_of_any_size_give_the_same(bands: Any) -> None:
    np.testing.assert_array_equal(composed(Case(1), bands)[0], composed(Case(1))[0])


@pytest.mark.parametrize("channels", [1, 3])
def test_a_pixel_may_have_more_hits_than_are_summed_at_once(channels: int) -> None:
    case = Case(channels, n=40 * 3 * MOST, weighed=False)
    np.testing.assert_allclose(composed(case)[0], case.picture(*lights()), rtol=2e-5)


@pytest.mark.parametrize("bands", [[(0, 40)], [(0, 1), (1, 39)], [(0, 3), (3, 37)]])
def test_halves_are_the_nearest_ones(bands: Any) -> None:
    images, bad = composed(Case(1), bands, np.float16)
    np.testing.assert_array_equal(images, composed(Case(1))[0].astype(np.float16))
    assert sum(entry[3] for entry in bad) == 0


def test_values_beyond_the_largest_half_are_cut_and_counted() -> None:
    exact = composed(Case(1), brightness=1e6)[0]
    images, bad = composed(Case(1), dtype=np.float16, brightness=1e6)
    np.testing.assert_array_equal(images, np.minimum(exact, 65504).astype(np.float16))
    assert bad[0][3] == (exact > 65504).sum() > 0 and bad[0][0] == 0


def test_a_scale_a_pixel_multiplies_all_its_hits() -> None:
    """What mirrors show is added so, after the mean over all hits."""
    case, other = Case(3), Case(3, n=100, seed=2, weighed=False)
    scale = np.random.default_rng(3).random(N_PIXELS).astype(np.float32)
    colour, ambient = lights()
    band, images = empty_band(N_PIXELS, N_LIGHTS), np.empty((N_LIGHTS, N_PIXELS, 3), np.float32)
    begin(band, N_PIXELS)
    case.add(band, 0, N_PIXELS)
    normalise(band, N_PIXELS)
    other.add(band, 0, N_PIXELS, scale)
    finish(band, 0, N_PIXELS, colour, ambient, np.float32(0), images)
    more = colour * other.sums(other.direct(), scale)
    more = more + ambient * other.sums(other.reflectivity.astype(np.float64) * other.obscurance, scale)[:, :, None]
    more = more + other.sums(other.constant, scale)[:, :, None]
    np.testing.assert_allclose(images, case.picture(colour, ambient) + more.transpose(2, 0, 1), rtol=5e-6)


def test_a_pixel_without_hits_is_black() -> None:
    case = Case(1)
    case.pixel[case.pixel == 11] = -1
    sort_by_pixel(case.pixel, N_PIXELS, case.start, case.order)
    images, bad = composed(case)
    assert not images[:, 11].any() and images[:, 12].all() and bad[0][0] == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 3e38])
def test_what_is_not_a_radiance_is_counted_located_and_black(value: float) -> None:
    case = Case(3, weighed=False)
    hit = case.order[case.start[21]]
    case.reflectivity[hit] = 1.0
    case.irradiance[hit, 1, 4] = value
    case.irradiance[hit, 2, 5] = -100.0
    with np.errstate(over="ignore"):
        images, bad = composed(case)
    if value == 3e38:  # large, but a number: it stays
        assert bad == [(1, 5, 21, 1)]
        assert images[4, 21, 1] > 1e34
    else:
        expected = 1 if value == -1.0 else 2  # -1 drowns in the pixel's other light
        assert bad[0] == (expected, 5 if value == -1.0 else 4, 21, 0)
    assert images[5, 21, 2] == 0
    assert np.isfinite(images).all() and (images >= 0).all()
