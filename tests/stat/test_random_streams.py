"""Scrambles of pixels, frames, samples and dimensions are independent; and what would not be, is found."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest
from support.streams import Words, all_chances, dependent, pairs, program

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@pytest.fixture(scope="module")
def found() -> dict[str, float]:
    return all_chances(program)


@pytest.mark.parametrize("pair", pairs())
def test_words_at_two_places_are_independent(pair: str, found: dict[str, float]) -> None:
    """Corrected for all tests of all pairs, not only for those of one pair."""
    assert not [name for name in dependent(found) if name.startswith(pair)]


def test_words_at_three_places_are_independent(found: dict[str, float]) -> None:
    assert not [name for name in dependent(found) if name.startswith("triples")]


def test_the_chances_themselves_are_as_chance_has_them(found: dict[str, float]) -> None:
    """Of honest tests, p is uniform: neither do too many fail by a little, nor is everything too even."""
    assert len(found) == 12 * len(pairs()) + 4
    # tests of one pair share numbers, so that their chances are not all independent: one test of each pair
    for kind in ("cells, x and x", "correlation, x and y", "shift, y and y"):
        chances = [p for name, p in found.items() if name.endswith(kind)]
        assert kstest(chances, "uniform").pvalue > 1e-3


def mixed(z: Any) -> Any:
    """SplitMix64's finaliser."""
    z = np.asarray(z, np.uint64)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def number(*values: int) -> Any:
    return [np.asarray([value], np.uint64) for value in values]


def twin(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """The program's words, written again."""
    seed_, c_, sample_, dimension_ = number(seed, c, sample, dimension)
    place = pixel.astype(np.uint64) * np.uint64(1 << 16) + sample_ + c_ * np.uint64(1 << 44)
    return mixed(mixed(place ^ mixed(seed_ + GOLDEN)) + dimension_ * GOLDEN)


def unmixed(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """A Weyl sequence over places, without a finaliser."""
    seed_, c_, sample_, dimension_ = number(seed, c, sample, dimension)
    return (pixel.astype(np.uint64) + sample_ * np.uint64(97) + c_ * np.uint64(389) + seed_ + dimension_) * GOLDEN


def summed(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """A hash of each part, added up."""
    parts = number(seed, c + 1000, sample + 2000, dimension + 3000)
    return mixed(pixel) + mixed(parts[0]) + mixed(parts[1]) + mixed(parts[2]) + mixed(parts[3])


def overlapping(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """Pixel and sample added before the hash: a pixel's next sample is the next pixel's first."""
    seed_, c_, sample_, dimension_ = number(seed, c, sample, dimension)
    place = pixel.astype(np.uint64) + sample_ + c_ * np.uint64(1 << 44)
    return mixed(mixed(place ^ mixed(seed_ + GOLDEN)) + dimension_ * GOLDEN)


def same_each_frame(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """The frame forgotten: noise that stands still on the screen."""
    return twin(seed, 0, pixel, sample, dimension)


def one_dimension(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """One word for all dimensions, its halves swapped in every other."""
    bits, half = twin(seed, c, pixel, sample, 0), np.uint64(32)
    return (bits << half) | (bits >> half) if dimension % 2 else bits


def tiled(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """A tile of 16 pixels, repeated."""
    return twin(seed, c, pixel % 16, sample, dimension)


def leaning(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """Independent but for one pixel in twenty, which takes its neighbour's word."""
    bits = twin(seed, c, pixel, sample, dimension)
    return np.where(mixed(pixel) % np.uint64(20) == 0, twin(seed, c, pixel + 1, sample, dimension), bits)


BAD = {
    unmixed: "next pixel", summed: "next frame", overlapping: "next pixel, sample before",
    same_each_frame: "next frame", one_dimension: "dimensions", tiled: "pixel 16 further", leaning: "next pixel",
}  # fmt: skip


def test_the_twin_is_the_program() -> None:
    pixel = np.arange(1000)
    np.testing.assert_array_equal(twin(3, 4, pixel, 5, 2), program(3, 4, pixel, 5, 2))


@pytest.mark.parametrize("words", BAD, ids=[words.__name__ for words in BAD])
def test_bad_scrambles_are_found(words: Words) -> None:
    """The tests above can fail, and name the pair at fault."""
    with np.errstate(over="ignore"):
        failing = dependent(all_chances(words))
    assert any(name.startswith(BAD[words]) for name in failing)
