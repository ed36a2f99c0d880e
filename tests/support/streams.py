"""Are scrambles independent? Tests of pairs of random streams: neighbours in pixels, frames, samples and dimensions.

A scramble is a 64-bit word; its halves shift the two coordinates of a lattice. Of many words at places a and of as many
at places b, that all stand in the same relation:

- cells: the unit square of a coordinate at a and one at b, in 16 x 16 cells; chi-squared;
- correlation: Pearson's r of the two, times sqrt(n), is normal;
- shift: the difference modulo 1 is uniform, in 64 cells; chi-squared. A generator that adds up parts fails here;
- triples: three places in a row, in 8 x 8 x 8 cells.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy.stats import chi2, norm

from framearray_cli.engine.inputs.random import CHOICE, HEMISPHERE, OTHER_HALF, PIXEL, PIXEL_SAMPLE, random_word, stream
from framearray_cli.engine.kernels.kernel import kernel
from support.ztests import CHANCE, sidak

WIDTH, N = 240, 43_200  # an image of 240 x 180
DIMENSIONS = {"pixel": PIXEL, "hemisphere": HEMISPHERE, "choice": CHOICE, "other half": OTHER_HALF}
# words(seed, c, pixel, sample, dimension): (n,) uint64 for (n,) pixels.
Words = Callable[[int, int, Any, int, int], Any]


@kernel
def _fill(seed: int, c: int, pixel: Any, sample: int, dimension: int, out: Any) -> None:
    for i in range(out.shape[0]):
        out[i] = random_word(stream(seed, c, pixel[i], sample), dimension)


def program(seed: int, c: int, pixel: Any, sample: int, dimension: int) -> Any:
    """The words of the program itself."""
    out = np.empty(len(pixel), np.uint64)
    _fill(seed, c, pixel, sample, dimension, out)
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The place of a set of words: an offset from pixels 0 to N - 1 of a frame, sample and dimension."""

    pixel: int = 0
    c: int = 5
    sample: int = 0
    dimension: int = HEMISPHERE
    seed: int = 7


def pairs() -> dict[str, tuple[Place, Place]]:
    """Pairs of places whose words must be independent, by name."""
    here, in_pixel = Place(), partial(Place, sample=PIXEL_SAMPLE, dimension=PIXEL)
    found = {
        "next pixel": (here, Place(pixel=1)),
        "pixel below": (here, Place(pixel=WIDTH)),
        "pixel below, to the left": (here, Place(pixel=WIDTH - 1)),
        "pixel 16 further": (here, Place(pixel=16)),
        "pixel 2^16 further": (here, Place(pixel=1 << 16)),
        "next frame": (here, Place(c=6)),
        "frame after next": (here, Place(c=7)),
        "frame 4 further": (here, Place(c=9)),
        "next sample": (here, Place(sample=1)),
        "sample 5 further": (here, Place(sample=5)),
        "next seed": (here, Place(seed=8)),
        "next pixel, sample before": (Place(sample=1), Place(pixel=1)),
        "next frame, pixel before": (Place(pixel=1), Place(c=6)),
        "next frame, sample before": (Place(sample=1), Place(c=6)),
        "next seed, pixel before": (Place(pixel=1), Place(seed=8)),
        "place in the pixel, and direction": (in_pixel(), here),
        "place in the pixel, next pixel": (in_pixel(), in_pixel(pixel=1)),
        "place in the pixel, next frame": (in_pixel(), in_pixel(c=6)),
    }
    for (a, first), (b, second) in combinations(DIMENSIONS.items(), 2):
        found[f"dimensions {a} and {b}"] = Place(dimension=first), Place(dimension=second)
    return found


def taken(words: Words, place: Place) -> Any:
    """(2, N) the coordinates at a place, in [0, 1)."""
    pixel = np.arange(N, dtype=np.int64) + place.pixel
    bits = words(place.seed, place.c, pixel, place.sample, place.dimension)
    return np.stack([bits & np.uint64(0xFFFFFFFF), bits >> np.uint64(32)]).astype(np.float64) / 2.0**32


def _chi2(cells: Any, n_cells: int) -> float:
    """Chance of counts as uneven as these, or more, or as even as these, or more."""
    counts = np.bincount(cells, minlength=n_cells)
    expected = counts.sum() / n_cells
    found = ((counts - expected) ** 2).sum() / expected
    return float(2 * min(chi2.sf(found, n_cells - 1), chi2.cdf(found, n_cells - 1)))


def chances(words: Words, a: Place, b: Place) -> dict[str, float]:
    """By test, the chance that independent words look as dependent as those at two places."""
    found = {}
    left, right = taken(words, a), taken(words, b)
    for i, j in product(range(2), range(2)):
        x, y, name = left[i], right[j], f"{'xy'[i]} and {'xy'[j]}"
        found[f"cells, {name}"] = _chi2((x * 16).astype(int) * 16 + (y * 16).astype(int), 256)
        z = ((x - 0.5) * (y - 0.5)).mean() * 12 * np.sqrt(N)
        found[f"correlation, {name}"] = float(2 * norm.sf(abs(z)))
        found[f"shift, {name}"] = _chi2(((y - x) % 1.0 * 64).astype(int) % 64, 64)
    return found


def triples(words: Words) -> dict[str, float]:
    """The same of three pixels in a row, and of three frames and samples."""
    found = {}
    moves = {
        "pixels": [Place(pixel=k) for k in range(3)],
        "frames": [Place(c=5 + k) for k in range(3)],
        "samples": [Place(sample=k) for k in range(3)],
        "dimensions": [Place(dimension=k) for k in range(3)],
    }
    for name, places in moves.items():
        cells = np.zeros(N, int)
        for place in places:
            cells = cells * 8 + (taken(words, place)[0] * 8).astype(int)
        found[f"triples of {name}"] = _chi2(cells, 512)
    return found


def all_chances(words: Words) -> dict[str, float]:
    """Every test of every pair."""
    found = {f"{pair}: {test}": p for pair, ab in pairs().items() for test, p in chances(words, *ab).items()}
    return found | triples(words)


def dependent(found: dict[str, float]) -> dict[str, float]:
    """The tests that fail by Holm's rule: all together fail by `CHANCE` where every word is independent."""
    failing: dict[str, float] = {}
    for rank, (name, p) in enumerate(sorted(found.items(), key=lambda item: item[1])):
        if p > sidak(len(found) - rank, CHANCE):
            break
        failing[name] = p
    return failing
