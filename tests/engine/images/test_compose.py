"""Sums of hits, and how they become images."""

import gc
from typing import Any
from weakref import ref

import numpy as np
import pytest
from support.hits import lit_packets
from support.kept import KEPT, irradiance_of, keep, short, unpacked

from framearray_cli.base.arrays import with_room
from framearray_cli.engine.frames.kept_light import LightStore
from framearray_cli.engine.frames.records import ArrayPool, HitRecords, HitsByPixel, StoredLight
from framearray_cli.engine.hits.outer import sort_by_pixel
from framearray_cli.engine.hits.row import (
    BY_SAMPLE,
    HALF,
    INDIRECT,
    LIGHT_INDEPENDENT,
    LIT,
    LIT_BITS,
    OBSCURANCE,
    REFLECTIVITY,
    WEIGHT,
)
from framearray_cli.engine.images.accumulate import accumulate
from framearray_cli.engine.images.band import HITS_AT_ONCE, Band, Finish, as_stored, empty_band, finish
from framearray_cli.engine.images.compose import compose_differences, weigh_halves
from framearray_cli.engine.images.gloss import NO_GLOSS
from framearray_cli.engine.images.sourcelists import HitSource, SourceList
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.cells.gather import LIGHT

N_PIXELS, N_LIGHTS, NOTHING = 40, 7, np.empty(0, np.float32)


class Case:
    """Random hits, and what numpy makes of them in float64."""

    def __init__(
        self, channels: int, n: int = 600, constant: bool = True, weighed: bool = True, seed: int = 1,
        n_lights: int = N_LIGHTS,
    ) -> None:  # fmt: skip
        rng = np.random.default_rng(seed)
        self.pixel = rng.integers(-1, N_PIXELS, n).astype(np.int32)
        self.start, self.order = np.empty(N_PIXELS + 1, np.int32), np.empty(n, np.int32)
        sort_by_pixel(self.pixel, 0, N_PIXELS, self.start, self.order)

        def values(*shape: int) -> Any:
            return rng.random(shape).astype(np.float32)

        self.weight = values(n) if weighed else NOTHING
        self.reflectivity = values(n, 3) * (rng.random((n, 1)) < 0.8)  # some hits are black
        self.obscurance = values(n, 3)
        self.constant = values(n, 3) if constant else np.empty((0, 3), np.float32)
        self.irradiance = with_room((n, channels, n_lights), np.float32)
        self.irradiance[:] = values(n, channels, n_lights)
        self.stores = list[LightStore]()  # keep the light that sources point to
        self.half = rng.integers(0, 2, n)

    def row(self) -> Any:
        row = with_room((len(self.pixel), LANES), np.float32, fill=0)
        row[:, WEIGHT] = 1
        row[:, INDIRECT : INDIRECT + 3] = self.reflectivity * self.obscurance
        row[:, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] = self.constant if len(self.constant) else 0
        row[:, OBSCURANCE : OBSCURANCE + 3] = self.obscurance
        row[:, REFLECTIVITY : REFLECTIVITY + 3] = self.reflectivity
        row[:, LIT] = lit_packets(self.irradiance)
        row[:, HALF] = self.half
        return row

    def add(self, band: Band, first: int, n: int, scale: Any = NOTHING, mean: bool = True) -> None:
        parts = SourceList([self.source(np.float32(scale))])
        accumulate(band, first, n, parts.addresses, *self.irradiance.shape[1:], mean)

    def source(self, scale: Any = NOTHING, odd_scale: Any = NOTHING, **columns: Any) -> HitSource:
        columns = {"row": self.row(), "light": self.light(), "weight": self.weight} | columns
        return HitSource(HitsByPixel(start=self.start, order=self.order), columns, scale, odd_scale)

    def light(self) -> Any:
        """The addresses of the irradiance as it is kept."""
        address, store = keep(self.row(), self.irradiance)
        self.stores.append(store)
        return address

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
        irradiance = np.broadcast_to(self.irradiance, (len(self.pixel), 3, self.irradiance.shape[2]))
        return self.reflectivity[:, :, None].astype(np.float64) / np.pi * irradiance

    def picture(self, colour: Any, ambient: Any) -> Any:
        """(n_lights, n_pixels, 3) weighed means."""
        total = self.sums(np.ones(len(self.pixel)))
        indirect = self.sums(self.reflectivity.astype(np.float64) * self.obscurance)
        light_independent = self.sums(self.constant.astype(np.float64)) if len(self.constant) else 0
        direct = self.sums(self.direct())  # (n_pixels, 3, n_lights)
        value = (
            colour * direct
            + ambient * indirect[:, :, None]
            + np.reshape(light_independent, (-1, 3, 1) if len(self.constant) else ())
        )
        return (value / total[:, None, None]).transpose(2, 0, 1)


def test_a_list_of_sources_keeps_its_arrays() -> None:
    """Nothing else holds them; without the list their memory would be freed and used again."""
    case = Case(1)
    dropped = []

    def listed() -> SourceList:
        row, light = case.row(), case.light()
        dropped.extend([ref(row), ref(light)])
        return SourceList([case.source(np.ones(N_PIXELS, np.float32), row=row, light=light)])

    kept = listed()
    gc.collect()
    assert all(array() is not None for array in dropped)
    del kept
    gc.collect()
    assert all(array() is None for array in dropped)


@pytest.mark.parametrize("column", ["start", "order", "weight", "scale", "odd_scale", "row", "light", "subpixel"])
def test_a_list_of_sources_refuses_what_kernels_would_misread(column: str) -> None:
    case = Case(1)
    ones = np.ones(N_PIXELS, np.float32)
    arrays = {"start": case.start, "order": case.order, "weight": case.weight, "scale": ones, "odd_scale": ones}
    arrays |= {"row": case.row(), "light": case.light(), "subpixel": np.zeros(len(case.pixel), np.uint8)}

    def listed(**changed: Any) -> SourceList:
        a = arrays | changed
        of_pixel = HitsByPixel(start=a.pop("start"), order=a.pop("order"))
        scale, odd_scale = a.pop("scale"), a.pop("odd_scale")
        return SourceList([HitSource(of_pixel, a, scale, odd_scale)])

    assert (listed().addresses != 0).sum() == len(arrays)
    layer = listed(hours=np.ones((len(case.pixel), 2), np.float32))
    assert layer.addresses[0, layer.columns["hours"]] != 0 and layer.columns["row"] == listed().columns["row"]
    with pytest.raises(ValueError, match="contiguous"):
        listed(**{column: np.repeat(arrays[column], 2, axis=0)[::2]})
    with pytest.raises(ValueError, match="expected an array of"):
        listed(**{column: arrays[column].astype(np.float64)})


def lights() -> tuple[Any, Any]:
    """Colour and ambient radiance, (3, n_lights)."""
    rng = np.random.default_rng(9)
    found = [with_room((3, N_LIGHTS), np.float32) for _ in range(2)]
    for values in found:
        values[:] = rng.random((3, N_LIGHTS))
    return found[0], found[1]


def composed(
    case: Case, bands: Any = ((0, N_PIXELS),), dtype: Any = np.float32, brightness: float = 1.0
) -> tuple[Any, list[tuple[int, int, int, int]]]:
    colour, ambient = lights()
    for values in (colour, ambient):
        values *= np.float32(brightness)
    images, bad = np.full((N_LIGHTS, N_PIXELS, 3), np.nan, dtype), []
    band = empty_band(N_PIXELS, N_LIGHTS)
    for first, n in bands:
        case.add(band, first, n)
        bad.append(finish(band, first, n, Finish(colour, ambient, 0, np.float32(0)), as_stored(images)))
    return images, bad


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("weighed", [False, True])
def test_differences_are_sums_with_a_factor_for_each_half(channels: int, weighed: bool) -> None:
    case = Case(channels, weighed=weighed)
    rng = np.random.default_rng(6)
    even, odd = rng.normal(size=(2, N_PIXELS)).astype(np.float32)
    images = np.full((N_LIGHTS, N_PIXELS, 3), np.nan, np.float32)
    colour, ambient = lights()
    listed = SourceList([case.source(even, odd)])
    how = Finish(colour, ambient, 0, np.float32(-np.inf))
    compose_differences(empty_band(16, N_LIGHTS), 0, N_PIXELS, listed.addresses, channels, how, images, NO_GLOSS)
    factor = np.where(case.half == 1, odd[case.pixel], even[case.pixel]).astype(np.float64)
    value = (
        colour * case.sums(case.direct() * factor[:, None, None])
        + ambient * case.sums(case.reflectivity.astype(np.float64) * case.obscurance * factor[:, None])[:, :, None]
        + case.sums(case.constant.astype(np.float64) * factor[:, None])[:, :, None]
    )
    # terms of both signs: their roundings are proportional to the largest of them
    np.testing.assert_allclose(images, value.transpose(2, 0, 1), rtol=0, atol=5e-6 * abs(value).max())
    assert (value > 0).any() and (value < 0).any()


@pytest.mark.parametrize("weighed", [False, True])
def test_halves_are_weighed_by_part_and_by_sample(weighed: bool) -> None:
    cases = [Case(1, weighed=weighed, seed=seed) for seed in (1, 2, 3)]
    weights = np.full((2, N_PIXELS), np.nan)
    listed = SourceList([case.source() for case in cases])
    weigh_halves(listed.addresses, np.array([1, BY_SAMPLE, 0], np.int32), 0, N_PIXELS, weights)
    second = cases[1]
    for half, whole in ((0, cases[2]), (1, cases[0])):
        expected = whole.sums(np.ones(len(whole.pixel))) + second.sums((second.half == half).astype(float))
        np.testing.assert_allclose(weights[half], expected, rtol=1e-6)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("constant", [False, True])
@pytest.mark.parametrize("weighed", [False, True])
def test_images_are_weighed_means(channels: int, constant: bool, weighed: bool) -> None:
    case = Case(channels, constant=constant, weighed=weighed)
    images, bad = composed(case)
    # some tens of terms of one sign, each a few roundings
    np.testing.assert_allclose(images, case.picture(*lights()), rtol=5e-6)
    assert bad == [(0, -1, -1, 0)]


def test_means_of_a_band() -> None:
    case, band = Case(1), empty_band(N_PIXELS, N_LIGHTS)
    case.add(band, 15, 20)
    pixels = slice(15, 35)
    np.testing.assert_array_equal(band.hits[:20], np.bincount(case.pixel[case.pixel >= 0], minlength=N_PIXELS)[pixels])
    total = case.sums(np.ones(len(case.pixel)))[pixels]
    expected = {
        INDIRECT: case.sums(case.reflectivity.astype(np.float64) * case.obscurance),
        LIGHT_INDEPENDENT: case.sums(case.constant),
        OBSCURANCE: case.sums(case.obscurance),
        REFLECTIVITY: case.sums(case.reflectivity),
    }
    for first, values in expected.items():
        means = values[pixels] / total[:, None]
        np.testing.assert_allclose(band.sums[:20, first : first + 3], means, rtol=2e-6)
    direct = case.sums(case.direct())[pixels] / total[:, None, None]
    np.testing.assert_allclose(band.direct[:20, :, :N_LIGHTS], direct, rtol=2e-6)


@pytest.mark.parametrize("scale", [1e-18, 1e-6, 1.0, 1e6, 1e17])
def test_indirect_light_that_is_kept_is_off_by_little_and_not_in_the_mean(scale: float) -> None:
    case, light = Case(1, n=20_000), StoredLight(1, 1, N_LIGHTS)
    indirect = np.ones((20_000, LIGHT + N_LIGHTS), np.float32)
    exact = scale * np.random.default_rng(5).uniform(0.3, 3, (20_000, N_LIGHTS)).astype(np.float32)
    exact[:3] = [[0.0], [1e-30], [1e30]]  # the last two are beyond what is kept
    indirect[:, LIGHT:] = exact
    store, kept = LightStore(ArrayPool(), light), HitRecords({"row": case.row(), "light": np.empty(20_000, np.int64)})
    store.keep(HitRecords({"row": case.row(), "irradiance": case.irradiance, "indirect": indirect}), kept)
    found = unpacked(kept, light)
    error = found["indirect"][3:, LIGHT:] / exact[3:] - 1
    assert abs(error).max() <= KEPT and abs(error.mean()) < 4 * error.std() / error.size**0.5
    np.testing.assert_array_equal(found["indirect"][:, LIGHT:], short(exact))
    np.testing.assert_array_equal(found.irradiance, case.irradiance)


def test_light_of_hits_that_no_frame_shows_is_not_kept() -> None:
    case, shown = Case(1, n=64), np.arange(64) % 3 == 0
    store, kept = LightStore(ArrayPool(), StoredLight(1, 1, N_LIGHTS)), case.row()
    records = HitRecords({"row": kept, "light": np.full(64, -1)})
    store.keep(HitRecords({"row": kept, "irradiance": case.irradiance}), records, shown)
    assert not records["light"][~shown].any() and records["light"][shown].all()
    some = HitRecords({"row": kept[shown], "light": records["light"][shown]})
    np.testing.assert_array_equal(irradiance_of(some, StoredLight(1, 1, N_LIGHTS)), case.irradiance[shown])


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("n_lights", [1, 15, 16, 17, 40, LANES * LIT_BITS, LANES * LIT_BITS + 1, 900])
def test_light_that_is_zero_is_left_out(channels: int, n_lights: int) -> None:
    """Most packets of light positions are dark, some hits and some pixels see no light at all."""
    case, band = Case(channels, n=300, n_lights=n_lights), empty_band(N_PIXELS, n_lights)
    rng, n_packets = np.random.default_rng(4), -(-n_lights // LANES)
    dark = np.repeat(rng.random((300, 1, n_packets)) < 0.7, LANES, axis=2)[:, :, :n_lights]
    case.irradiance[np.broadcast_to(dark, case.irradiance.shape)] = 0
    case.irradiance[case.pixel == 7] = 0
    band.direct[:] = np.nan  # what a band held before does not count
    case.add(band, 0, N_PIXELS)
    direct = case.sums(case.direct()) / case.sums(np.ones(300))[:, None, None]
    np.testing.assert_allclose(band.direct[:, :, :n_lights], direct, rtol=2e-6)
    assert not direct[7].any() and direct.any()


@pytest.mark.parametrize("bands", [[(0, 1), (1, 39)], [(0, 16), (16, 16), (32, 8)], [(35, 5), (0, 35)]])
def test_bands_of_any_size_give_the_same(bands: Any) -> None:
    np.testing.assert_array_equal(composed(Case(1), bands)[0], composed(Case(1))[0])


@pytest.mark.parametrize("channels", [1, 3])
def test_a_pixel_may_have_more_hits_than_are_summed_at_once(channels: int) -> None:
    case = Case(channels, n=40 * 3 * HITS_AT_ONCE, weighed=False)
    np.testing.assert_allclose(composed(case)[0], case.picture(*lights()), rtol=2e-5)


@pytest.mark.parametrize("bands", [[(0, 40)], [(0, 1), (1, 39)], [(0, 3), (3, 37)]])
def test_halves_are_rounded_to_the_nearest(bands: Any) -> None:
    images, bad = composed(Case(1), bands, np.float16)
    np.testing.assert_array_equal(images, composed(Case(1))[0].astype(np.float16))
    assert sum(entry[3] for entry in bad) == 0


def test_values_beyond_the_largest_half_are_cut_and_counted() -> None:
    exact = composed(Case(1), brightness=1e6)[0]
    images, bad = composed(Case(1), dtype=np.float16, brightness=1e6)
    np.testing.assert_array_equal(images, np.minimum(exact, 65504).astype(np.float16))
    assert bad[0][3] == (exact > 65504).sum() > 0 and bad[0][0] == 0


def test_a_scale_per_pixel_multiplies_all_its_hits() -> None:
    """Reflected hits are added so, after the mean over all hits."""
    case, other = Case(3), Case(3, n=100, seed=2, weighed=False)
    scale = np.random.default_rng(3).random(N_PIXELS).astype(np.float32)
    colour, ambient = lights()
    band, images = empty_band(N_PIXELS, N_LIGHTS), np.empty((N_LIGHTS, N_PIXELS, 3), np.float32)
    case.add(band, 0, N_PIXELS)
    other.add(band, 0, N_PIXELS, scale, mean=False)
    finish(band, 0, N_PIXELS, Finish(colour, ambient, 0, np.float32(0)), images)
    more = colour * other.sums(other.direct(), scale)
    more = more + ambient * other.sums(other.reflectivity.astype(np.float64) * other.obscurance, scale)[:, :, None]
    more = more + other.sums(other.constant, scale)[:, :, None]
    np.testing.assert_allclose(images, case.picture(colour, ambient) + more.transpose(2, 0, 1), rtol=5e-6)


def test_a_pixel_without_hits_is_black() -> None:
    case = Case(1)
    case.pixel[case.pixel == 11] = -1
    sort_by_pixel(case.pixel, 0, N_PIXELS, case.start, case.order)
    images, bad = composed(case)
    assert not images[:, 11].any() and images[:, 12].all() and bad[0][0] == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 3e38])
def test_an_invalid_value_is_counted_located_and_black(value: float) -> None:
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
        expected = 1 if value == -1.0 else 2  # -1 is outweighed by the other light of the pixel
        assert bad[0] == (expected, 5 if value == -1.0 else 4, 21, 0)
    assert images[5, 21, 2] == 0
    assert np.isfinite(images).all() and (images >= 0).all()
