"""Very many hits in one pixel."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.base.arrays import with_room
from framearray_cli.engine.frames.records import HitsByPixel
from framearray_cli.engine.hits.row import INDIRECT, LIT, REFLECTIVITY, WEIGHT
from framearray_cli.engine.images.accumulate import accumulate
from framearray_cli.engine.images.band import empty_band
from framearray_cli.engine.images.sourcelists import HitSource, SourceList
from framearray_cli.engine.kernels.simd import LANES


def mean_of_many(n: int) -> tuple[Any, Any]:
    """Direct and indirect light of a pixel with n hits of uneven brightness: as the program sums it, and in float64."""
    rng = np.random.default_rng(8)
    row, irradiance = with_room((n, LANES), np.float32, fill=0), with_room((n, 1, 3), np.float32)
    irradiance[:] = rng.exponential(size=(n, 1, 3))
    row[:, WEIGHT], row[:, LIT] = 1, 1
    row[:, REFLECTIVITY : REFLECTIVITY + 3] = rng.random((n, 3))
    row[:, INDIRECT : INDIRECT + 3] = rng.random((n, 3))
    by_pixel = HitsByPixel(start=np.array([0, n], np.int32), order=np.arange(n, dtype=np.int32))
    band = empty_band(1, 3)
    parts = SourceList([HitSource(by_pixel, {"row": row, "irradiance": irradiance})])
    accumulate(band, 0, 1, parts.addresses, 1, 3, True)
    light = row[:, REFLECTIVITY : REFLECTIVITY + 3, None].astype(np.float64) / np.pi * irradiance
    exact = [light.mean(axis=0).ravel(), row[:, INDIRECT : INDIRECT + 3].mean(axis=0, dtype=np.float64)]
    found = [band.direct[0, :, :3].ravel(), band.sums[0, INDIRECT : INDIRECT + 3]]
    return np.concatenate(found).astype(np.float64), np.concatenate(exact)


@pytest.mark.parametrize("n", [1, 64, 65, 10_000, 1_000_000])
def test_a_million_hits_in_one_pixel(n: int) -> None:
    """Sums in float32 lose one rounding per hit; even over a million of them that stays below a ten-thousandth."""
    found, exact = mean_of_many(n)
    assert np.abs(found / exact - 1).max() < 1e-4
