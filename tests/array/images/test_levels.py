"""Shares of clipped and black pixels, as the format shows them."""

import numpy as np
import pytest

from framearray_cli.array.images.images import ImageFormat, read_image, write_image
from framearray_cli.array.images.levels import CODE_0, COUNTED, mean_shares, pixel_shares

PNG, EXR = ImageFormat(format="png"), ImageFormat(format="exr")


def columns(*values: float, height: int = 8, dtype: type = np.float32) -> np.ndarray:
    """One column of pixels for each value, in one channel."""
    image = np.zeros((height, len(values), 3), dtype)
    image[..., 1] = values
    return image


@pytest.mark.parametrize(
    ("image_format", "expected"),
    [
        (PNG, (0.4, 0.4)),
        (EXR, (0.4, 0.2)),
        (ImageFormat(format="png", exposure=1.0), (0.6, 0.2)),
        (ImageFormat(format="exr", exposure=1.0), (0.4, 0.2)),
        (ImageFormat(format="jpg", exposure=-2.0), (0.2, 0.4)),
    ],
)
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_shares_of_known_pixels(image_format, expected, dtype):
    image = columns(0.0, CODE_0 * 0.75, 0.6, 3.0, 9.0, dtype=dtype)
    assert pixel_shares(image, image_format) == pytest.approx(expected)


def test_what_no_scene_covers_is_not_black():
    image, alpha = columns(0.0, 0.0, 0.5, 2.0), np.array([[0.0, 0.2, 1.0, 0.0]] * 8, np.float32)
    assert pixel_shares(image, EXR) == (0.25, 0.5)
    assert pixel_shares(image, EXR, alpha) == (0.25, 0.25)


def test_large_images_are_counted_in_part():
    image = np.zeros((600, 800, 3), np.float32)
    image[:300] = 2.0
    assert pixel_shares(image, PNG) == pytest.approx((0.5, 0.5), abs=1 / np.sqrt(COUNTED))


def test_black_is_what_is_written_as_code_0(tmp_path):
    for value, black in ((0.99 * CODE_0, 1.0), (1.01 * CODE_0, 0.0)):
        image = np.full((4, 4, 3), value, np.float32)
        write_image(tmp_path / "x.png", image, PNG)
        assert pixel_shares(image, PNG) == (0.0, black)
        assert (read_image(tmp_path / "x.png") == 0).all() == bool(black)


def test_means():
    assert mean_shares([]) is None
    assert mean_shares([(0.2, 0.0), (0.4, 1.0)]) == pytest.approx((0.3, 0.5))
