"""Repair of texels that are no radiance."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.base.errors import OutputError
from framearray_cli.base.radiance import mend_radiance


def image(**texels: Any) -> Any:
    """An image of 4 x 8 texels of radiance 2, but for some of places such as `r1c3`."""
    pixels = np.full((4, 8, 3), 2.0, np.float32)
    for place, value in texels.items():
        pixels[int(place[1]), int(place[3])] = value
    return pixels


def test_radiance_stays_as_it_is() -> None:
    pixels = image(r0c0=(0.0, -0.0, 1e20))
    found, note = mend_radiance(pixels, panorama=True)
    assert found is pixels and note == ""


def test_negative_and_huge_channels_are_clamped() -> None:
    found, note = mend_radiance(image(r1c3=(-1, 3, 2), r0c0=(2, 1e30, 2)), panorama=False)
    np.testing.assert_allclose(found, image(r1c3=(0, 3, 2), r0c0=(2, 1e20, 2)))
    kinds = "negative in 1 texel (taken as 0), above 1e+20 in 1 texel (taken as 1e+20)"
    assert note == f"radiance is {kinds}: 6.2% of the texels, 100% of the light"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("panorama", "expected"), [(True, (5 * 2 + 3 * 10) / 8), (False, 2.0)])
def test_texels_that_are_not_finite_are_the_mean_of_their_neighbours(
    value: float, panorama: bool, expected: float
) -> None:
    """In a panorama the last column is next to the first one."""
    pixels = image(r2c0=(1.0, value, 1.0))
    pixels[:, 7] = 10.0
    found, note = mend_radiance(pixels, panorama=panorama)
    np.testing.assert_allclose(found[2, 0], expected)
    assert "not finite in 1 texel (taken as the mean of the neighbours): 3.1% of the texels" in note


def test_large_holes_are_filled_from_the_outside_in() -> None:
    pixels = np.full((80, 160, 3), 1.0, np.float32)
    pixels[10:60] = np.nan
    pixels[60:] = 3.0
    found, _ = mend_radiance(pixels, panorama=True)
    assert found[10].tolist() == [[1.0] * 3] * 160 and found[59].tolist() == [[3.0] * 3] * 160
    assert 1.0 < found[35, 80, 0] < 3.0


def test_the_share_of_light_counts_solid_angles() -> None:
    """Negative texels at the pole of a panorama stand for less light than at its horizon."""
    at_pole, at_horizon = image(r0c0=(-2, -2, -2)), image(r2c0=(-2, -2, -2))
    notes = [mend_radiance(pixels, panorama=True)[1] for pixels in (at_pole, at_horizon)]
    assert [note.rpartition("texels, ")[2] for note in notes] == ["1.9% of the light", "4.6% of the light"]


def test_an_image_without_finite_texels_is_refused() -> None:
    with pytest.raises(OutputError, match="expected radiance, got no finite texel"):
        mend_radiance(np.full((2, 4, 3), np.nan, np.float32), panorama=True)
