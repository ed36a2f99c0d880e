"""Coordinate by coordinate gives what numpy gives along the last axis."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from framearray_cli.scene.vectors import are_finite, cross, largest, lengths, rows_of

RANDOM = np.random.default_rng(1)
ODD = np.array(
    [[0.0, -0.0, -3.0], [np.nan, 1.0, 2.0], [1.0, -np.inf, np.nan], [np.inf, 1e200, -1e200], [4.0, 0.0, -3.0]]
)


@pytest.mark.parametrize(
    "vectors", [RANDOM.normal(size=(50, 3)), RANDOM.normal(size=(9, 3, 2)).astype(np.float32), ODD]
)
def test_reductions_are_those_of_numpy(vectors: np.ndarray) -> None:
    with np.errstate(all="ignore"):
        assert_array_equal(largest(vectors), np.abs(vectors).max(axis=-1))
        assert_array_equal(are_finite(vectors), np.isfinite(vectors).all(axis=-1))
        np.testing.assert_allclose(lengths(vectors), np.linalg.norm(vectors, axis=-1), rtol=1e-6)
        assert largest(vectors).dtype == lengths(vectors).dtype == vectors.dtype


def test_cross_products_are_those_of_numpy() -> None:
    a, b = RANDOM.normal(size=(2, 40, 3))
    assert_array_equal(cross(a, b), np.cross(a, b))


@pytest.mark.parametrize("rows", [[0, 1, 2], [2, 1, 0], [0, 2], [0, 0, 1], []])
def test_rows_in_their_order_are_the_array_itself(rows: list[int]) -> None:
    array = np.arange(6.0).reshape(3, 2)
    found = rows_of(array, np.array(rows, np.int64))
    assert_array_equal(found, array[rows])
    assert (found is array) == (rows == [0, 1, 2])
