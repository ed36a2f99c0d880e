"""Amounts in messages, and values as TOML text."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as some

from framearray_cli.base.forms import toml as tomltext
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
