"""Many short vectors, coordinate by coordinate: numpy takes up to ten times as long along an axis of two or three."""

from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Flags, Keys


def largest(vectors: NDArray[Any]) -> NDArray[Any]:
    """The largest absolute coordinate of (..., k) vectors, (...); NaN if one is."""
    return np.asarray(reduce(np.maximum, _coordinates(np.abs(vectors))))


def lengths(vectors: NDArray[Any]) -> NDArray[Any]:
    """Euclidean lengths of (..., k) vectors, (...)."""
    return np.asarray(np.sqrt(reduce(np.add, _coordinates(vectors * vectors))))


def cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Cross products of (..., 3) vectors."""
    (ax, ay, az), (bx, by, bz) = _coordinates(a), _coordinates(b)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def are_finite(vectors: NDArray[Any]) -> Flags:
    """True if all coordinates of (..., k) vectors are finite, (...)."""
    finite = np.isfinite(vectors)
    if finite.all():
        return np.ones(vectors.shape[:-1], np.bool_)
    return np.asarray(finite.all(axis=-1))


def rows_of(array: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
    """Return `array[rows]`, which is the array itself where rows are all of its rows in their order."""
    if len(rows) == len(array) and bool((rows[1:] > rows[:-1]).all()):
        return array
    return np.asarray(array[rows])


def hash_rows(rows: NDArray[np.floating]) -> Keys:
    """(...) hash of each row of numbers (..., k); 0.0 and -0.0 are the same number."""
    bits = np.ascontiguousarray(rows + 0.0).view(f"u{rows.itemsize}")
    found = np.zeros(rows.shape[:-1], np.uint64)
    with np.errstate(over="ignore"):
        for k in range(bits.shape[-1]):
            found = mix(found + bits[..., k])
    return found


def mix(keys: Keys) -> Keys:
    """Spread 64-bit keys over all their bits (the finaliser of splitmix64)."""
    with np.errstate(over="ignore"):
        keys = (keys + np.uint64(0x9E3779B97F4A7C15)).astype(np.uint64)
        keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return np.asarray(keys ^ (keys >> np.uint64(31)))


def _coordinates(vectors: NDArray[Any]) -> list[NDArray[Any]]:
    return [vectors[..., k] for k in range(vectors.shape[-1])]
