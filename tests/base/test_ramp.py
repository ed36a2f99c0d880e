"""Colours of scales: even steps of lightness, within the gamut of screens."""

import numpy as np

from framearray_cli.base.colour import linear_from_srgb8
from framearray_cli.base.ramp import DARKEST, LIGHTEST, ramp

LMS_FROM_RGB = [  # OKLab, the inverse of the matrix that the ramp uses, as its author gives it
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
]
LIGHTNESS = [0.2104542553, 0.7936177850, -0.0040720468]


def test_lightness_rises_in_even_steps() -> None:
    values = np.linspace(0, 1, 256, dtype=np.float32)
    lightness = np.cbrt(linear_from_srgb8(ramp(values)) @ np.array(LMS_FROM_RGB).T) @ LIGHTNESS
    np.testing.assert_allclose(lightness, DARKEST + (LIGHTEST - DARKEST) * values, atol=0.006)  # a step of a code


def test_values_beyond_the_scale_have_the_colours_of_its_ends() -> None:
    assert (ramp(np.float32([[-1.0, 2.0]])) == ramp(np.float32([[0.0, 1.0]]))).all()
    assert ramp(np.zeros((2, 3), np.float32)).shape == (2, 3, 3)
