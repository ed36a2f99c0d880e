"""Units, colour temperatures, and radiance files."""

import math
import tomllib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from framearray_cli.base.colour import black_body
from framearray_cli.base.errors import OutputError
from framearray_cli.base.forms import toml as tomltext
from framearray_cli.base.openimage import mend_radiance
from framearray_cli.base.units import GIB, MIB, agree, amount, counted, digits, gibibytes, in_unit_of, size


@pytest.mark.parametrize(
    ("n_bytes", "texts"),
    [
        (1023, ("1023 bytes", "0.00 GiB", "0.0 MiB")),
        (100 * MIB, ("100.0 MiB", "0.10 GiB", "100.0 MiB")),
        (GIB // 2, ("512.0 MiB", "0.50 GiB", "0.5 GiB")),
        (GIB, ("1.0 GiB", "1.0 GiB", "1.0 GiB")),
        (2000 * GIB, ("2.0 TiB", "2000.0 GiB", "2,000.0 GiB")),
    ],
)
def test_bytes(n_bytes: int, texts: tuple[str, ...]) -> None:
    assert (size(n_bytes), gibibytes(n_bytes), amount(n_bytes)) == texts


@pytest.mark.parametrize(
    ("value", "n", "text"),
    [
        (47012.0, 4, "47010"),
        (2.6337e6, 3, "2630000"),
        (0.68, 4, "0.68"),
        (-0.0, 3, "0"),
        (1e-5, 2, "1e-05"),
        (1e20, 3, "1e+20"),
    ],
)
def test_large_numbers_have_no_exponent(value: float, n: int, text: str) -> None:
    assert digits(value, n) == text


def test_a_negative_amount_is_zero() -> None:
    assert amount(-5) == "0.0 MiB"


plain = some.recursive(
    some.booleans() | some.integers(-(2**63), 2**63 - 1) | some.floats(allow_nan=False) | some.text(),
    lambda inner: some.lists(inner, max_size=3) | some.dictionaries(some.from_regex(r"\A[a-z_]+\Z"), inner, max_size=3),
    max_leaves=6,
)


@given(plain)
def test_values_come_back(value: object) -> None:
    assert tomllib.loads(f"x = {tomltext.inline(value)}")["x"] == value


@given(some.text(some.characters(exclude_categories=())))
def test_any_text_can_be_quoted(text: str) -> None:
    """Also lone surrogates, which file names may hold; they become question marks."""
    found = tomllib.loads(f"x = {tomltext.quoted(text)}")["x"]
    assert found == text.encode("utf-8", "replace").decode()


@given(some.lists(some.floats(allow_nan=False)))
def test_numbers_come_back_as_floats(values: list[float]) -> None:
    found = tomllib.loads(f"x = {tomltext.inline_floats(values)}")["x"]
    assert found == values and all(isinstance(value, float) for value in found)


@pytest.mark.parametrize(
    ("value", "text"), [(True, "true"), ("auto", '"auto"'), (4.0, "4"), (1 / 3, "0.333333"), (12, "12")]
)
def test_settings_are_brief(value: bool | str | float, text: str) -> None:
    assert tomltext.brief(value) == text
    found = tomllib.loads(f"x = {text}")["x"]
    assert found == value or math.isclose(found, float(value), rel_tol=1e-5)


def test_counts_agree_with_their_nouns() -> None:
    assert [counted(n, "light position") for n in (0, 1, 2, 1200)] == [
        "0 light positions",
        "1 light position",
        "2 light positions",
        "1,200 light positions",
    ]
    assert [counted(n, "entry", "entries") for n in (1, 2)] == ["1 entry", "2 entries"]
    assert [agree(n, "is", "are") for n in (0, 1, 2)] == ["are", "is", "are"]


@pytest.mark.parametrize(
    ("typed", "needed", "expected"),
    [
        (500 * 10**6, 650_000_000, "650 MB"),
        (500 * MIB, 650 * MIB, "650 MiB"),
        (2 * 10**9, 3_456_000_000, "3.46 GB"),
        (3 * GIB // 2, 2 * GIB, "2.00 GiB"),
        (8 * GIB, 900 * GIB, "900 GiB"),
        (123_456_789, 200_000_001, "200,000,001 bytes"),
    ],
)
def test_memory_is_reported_in_the_unit_that_was_typed(typed: int, needed: int, expected: str) -> None:
    assert in_unit_of(needed, typed) == expected


XYZ_FROM_RGB = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))  # IEC 61966-2-1
# CIE illuminant A, and points of the locus as tables of CIE 1931 chromaticities have them.
PUBLISHED = [(2856, 0.44757, 0.40745), (4000, 0.3804, 0.3768), (6500, 0.3135, 0.3237), (10000, 0.2807, 0.2883)]
# Error of the Gaussian sums for the colour matching functions, and of sRGB's matrix in four digits.
ERROR = 0.004


@pytest.mark.parametrize(("kelvin", "x", "y"), PUBLISHED)
def test_the_chromaticity_is_that_of_the_locus(kelvin: float, x: float, y: float) -> None:
    rgb = black_body(kelvin)
    xyz = [sum(a * b for a, b in zip(row, rgb, strict=True)) for row in XYZ_FROM_RGB]
    assert xyz[0] / sum(xyz) == pytest.approx(x, abs=ERROR)
    assert xyz[1] / sum(xyz) == pytest.approx(y, abs=ERROR)


@pytest.mark.parametrize("kelvin", [1000.0, 1900.0, 3200.0, 6504.0, 40000.0])
def test_the_luminance_is_1(kelvin: float) -> None:
    red, green, blue = black_body(kelvin)
    assert 0.2126 * red + 0.7152 * green + 0.0722 * blue == pytest.approx(1, abs=1e-12)
    assert min(red, green, blue) >= 0


def test_warmer_light_has_more_blue() -> None:
    blues = [black_body(kelvin)[2] for kelvin in (2000, 3200, 5000, 6500, 10000)]
    assert blues == sorted(blues)
    assert blues[0] < 0.1 < 1 < blues[-1]


def image(**texels: Any) -> Any:
    """An image of 4 x 8 texels of radiance 2, but for some of places such as `r1c3`."""
    pixels = np.full((4, 8, 3), 2.0, np.float32)
    for place, value in texels.items():
        pixels[int(place[1]), int(place[3])] = value
    return pixels


def test_radiance_stays_as_it_is() -> None:
    pixels = image(r0c0=(0.0, -0.0, 1e16))
    found, note = mend_radiance(pixels)
    assert found is pixels and note == ""


def test_negative_and_huge_channels_are_clamped() -> None:
    found, note = mend_radiance(image(r1c3=(-1, 3, 2), r0c0=(2, 1e30, 2)))
    np.testing.assert_allclose(found, image(r1c3=(0, 3, 2), r0c0=(2, 1e16, 2)))
    kinds = "negative in 1 texel (taken as 0), above 1e+16 in 1 texel (taken as 1e+16)"
    assert note == f"radiance is {kinds}"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_texels_that_are_not_finite_are_the_mean_of_the_others(value: float) -> None:
    pixels = image(r2c0=(1.0, value, 1.0))
    pixels[:, 7] = 10.0
    found, note = mend_radiance(pixels)
    np.testing.assert_allclose(found[2, 0], (27 * 2 + 4 * 10) / 31, rtol=1e-6)
    assert note == "radiance is not finite in 1 texel (taken as the mean of the others)"


def test_an_image_without_finite_texels_is_refused() -> None:
    with pytest.raises(OutputError, match="expected radiance, got no finite texel"):
        mend_radiance(np.full((2, 4, 3), np.nan, np.float32))
