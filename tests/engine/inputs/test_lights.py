"""Lights in the form that kernels read."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.engine.inputs.lights import DIRECTIONAL, POINT, light_arrays
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights_without_groups

WHITE = np.array([1.0, 1.0, 1.0])


def source(intensity: Any, kind: Any = "point", vector: Any = ((0, 0, 0), (1, 2, 3))) -> LightPath:
    return LightPath(kind=kind, vector=np.asarray(vector, np.float64), intensity=np.asarray(intensity, np.float64))


def arrays(*sources: LightPath, centre: Any = (0, 0, 0)) -> Any:
    return light_arrays(lights_without_groups(sources), np.asarray(centre, np.float64))


@pytest.mark.parametrize(
    ("channels", "intensities"),
    [
        (1, [[[2, 1, 0.5], [4, 2, 1]]]),  # one source: always one colour
        (1, [[[2, 1, 0.5], [0, 0, 3]]]),  # which may change with l
        (1, [[[2, 1, 0.5], [4, 2, 1]], [[4, 2, 1], [1, 0.5, 0.25]]]),  # two of the same colour
        (1, [[[2, 1, 0.5], [4, 2, 1]], [[0, 0, 0], [0, 0, 0]]]),  # one of them dark
        (1, [[[2, 1, 0.5], [0, 0, 0]], [[0, 0, 0], [1, 2, 1]]]),  # never two at a time
        (3, [[[2, 1, 0.5], [4, 2, 1]], [[4, 2, 1], [1, 1, 1]]]),
        (3, [[[1, 0, 0], [1, 0, 0]], [[0, 1, 0], [0, 1, 0]]]),
        (1, [[[0, 0, 0], [0, 0, 0]]]),
        (1, [[[1e20, 1e-10, 0], [1e-20, 0, 0]]]),
    ],
)
def test_strength_times_colour_is_the_intensity(channels: int, intensities: Any) -> None:
    result = arrays(*(source(intensity) for intensity in intensities))
    assert result.channels == channels and result.n_lights == 2
    product = result.strength.astype(np.float64) * result.colour.T.astype(np.float64)
    np.testing.assert_allclose(product.transpose(0, 2, 1), intensities, rtol=2e-6, atol=1e-37)
    np.testing.assert_array_equal(result.lit, np.any(intensities, axis=-1))


def test_positions_are_centred_and_directions_are_not() -> None:
    centre = np.array([5e6, 0, -5e6])
    lamp = source([WHITE, WHITE], vector=np.array([[0.001, 1, 2], [3, 4, 5]]) + centre)
    sun = source([WHITE, WHITE], "directional", [[0, -1, 0], [0.6, -0.8, 0]])
    result = arrays(lamp, sun, centre=centre)
    assert result.kind.tolist() == [POINT, DIRECTIONAL]
    np.testing.assert_allclose(result.vector[0].T, [[0.001, 1, 2], [3, 4, 5]], rtol=1e-6)
    np.testing.assert_allclose(result.vector[1].T, [[0, -1, 0], [0.6, -0.8, 0]], rtol=1e-7)
    for array in (result.vector, result.strength, result.colour):
        behind = np.lib.stride_tricks.as_strided(array.reshape(-1)[-1:], (17,), (4,))[1:]
        assert (behind == 1).all()  # numbers that are quick to compute with
        assert array.dtype == np.float32 and array.flags.c_contiguous
