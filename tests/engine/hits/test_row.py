"""The rows of hits that composing reads, against numpy."""

from typing import Any

import numpy as np
import pytest
from support.hits import lit_packets, points

from framearray_cli.base.arrays import with_room
from framearray_cli.engine.hits.hits import ESCAPED, SURFACE
from framearray_cli.engine.hits.row import (
    CLEAR,
    HALF,
    INDIRECT,
    LIGHT_INDEPENDENT,
    LIT,
    LIT_BITS,
    OBSCURANCE,
    REFLECTIVITY,
    WEIGHT,
    write_rows,
)
from framearray_cli.engine.kernels.simd import LANES

N = 37
NOTHING = np.empty((0, 3), np.float32)


def written(n_lights: int = 20, channels: int = 1, skylight: bool = False, throughput: bool = False) -> Any:
    """Rows of N hits, and what they were written from."""
    rng = np.random.default_rng(n_lights)
    hits = points(N, (0, 0, 0), (0, 1, 0))
    hits.kind[:] = np.where(rng.random(N) < 0.3, ESCAPED, SURFACE)
    hits.half[:] = rng.integers(0, 2, N)
    hits.reflectivity[:] = rng.random((N, 3)) * (hits.kind == SURFACE)[:, None]

    def values() -> Any:
        return rng.random((N, 3)).astype(np.float32)

    irradiance = with_room((N, channels, n_lights), np.float32, fill=5)  # what lies behind it does not count
    irradiance[:] = rng.random(irradiance.shape) * (rng.random(irradiance.shape) < 1 / (n_lights + 1))
    given = {
        "background": np.float32([1, 2, 3]),
        "obscurance": values() * (hits.kind == SURFACE)[:, None],
        "skylight": values() if skylight else NOTHING,
        "throughput": values() if throughput else NOTHING,
        "irradiance": irradiance,
    }
    row = np.full((N, LANES), np.nan, np.float32)
    write_rows(hits, N, *given.values(), row)
    return row, hits, given


@pytest.mark.parametrize("throughput", [False, True])
@pytest.mark.parametrize("skylight", [False, True])
def test_rows_are_those_of_numpy(skylight: bool, throughput: bool) -> None:
    row, hits, given = written(skylight=skylight, throughput=throughput)
    tint = given["throughput"] if throughput else 1.0
    reflectivity = tint * hits.reflectivity
    light_independent = np.where((hits.kind == ESCAPED)[:, None], tint * given["background"], 0.0)
    if skylight:
        light_independent = light_independent + reflectivity * given["skylight"]
    expected = {
        INDIRECT: reflectivity * given["obscurance"],
        LIGHT_INDEPENDENT: light_independent,
        OBSCURANCE: given["obscurance"],
        REFLECTIVITY: reflectivity,
    }
    assert (row[:, WEIGHT] == 1).all() and LANES == CLEAR + 1
    assert np.array_equal(row[:, CLEAR], hits.kind == ESCAPED)
    assert np.array_equal(row[:, HALF], hits.half) and 0 < hits.half.sum() < N
    for first, values in expected.items():
        np.testing.assert_allclose(row[:, first : first + 3], values, rtol=3e-7)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("n_lights", [1, 15, 16, 17, 48, LANES * LIT_BITS, LANES * LIT_BITS + 1, 1700])
def test_bits_mark_the_packets_that_have_light(channels: int, n_lights: int) -> None:
    row, _, given = written(n_lights, channels)
    np.testing.assert_array_equal(row[:, LIT], lit_packets(given["irradiance"]))
    assert 0 < np.count_nonzero(row[:, LIT]) < N


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 1e-45])
def test_any_value_but_zero_is_light(value: float) -> None:
    """Invalid values must reach composing, which counts them."""
    hits = points(1, (0, 0, 0), (0, 1, 0))
    irradiance = with_room((1, 1, 33), np.float32, fill=0)
    irradiance[0, 0, 32] = value
    row, nothing = np.empty((1, LANES), np.float32), np.zeros((1, 3), np.float32)
    write_rows(hits, 1, nothing[0], nothing, NOTHING, NOTHING, irradiance, row)
    assert row[0, LIT] == 0b100
