"""Images with alpha: premultiplied in EXR and TIFF, unassociated in PNG; read back, also by other libraries."""

from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from framearray_cli.array.images.alpha import read_alpha, require_alpha
from framearray_cli.array.images.images import ImageFormat, read_image, write_image
from framearray_cli.base.colour import linear_from_srgb8
from framearray_cli.base.errors import OutputError

RNG = np.random.default_rng(3)
ALPHA = np.array([[0.0, 0.25, 0.5], [0.75, 1.0, 1.0]], np.float32)
COLOUR = RNG.uniform(0.2, 0.9, (2, 3, 3)).astype(np.float32)
IMAGE = COLOUR * ALPHA[..., None]  # premultiplied


def written(path: Path, **options: Any) -> Path:
    write_image(path, IMAGE, ImageFormat(format=path.suffix[1:], **options), alpha=ALPHA)
    return path


@pytest.mark.parametrize(("name", "tolerance"), [("a.exr", 2.0**-11), ("a.tif", 0.0), ("a.png", 0.006)])
def test_what_was_written_is_read_back_premultiplied(tmp_path: Path, name: str, tolerance: float) -> None:
    path = written(tmp_path / name)
    np.testing.assert_allclose(read_image(path), IMAGE, atol=tolerance)
    np.testing.assert_allclose(read_alpha(path), ALPHA, atol=tolerance)


def test_halves_and_compression_too(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    write_image(path, IMAGE.astype(np.float16), ImageFormat(compression="zip"), alpha=ALPHA)
    np.testing.assert_array_equal(read_alpha(path), ALPHA)


def test_a_png_is_not_premultiplied(tmp_path: Path) -> None:
    codes = np.asarray(PIL.Image.open(written(tmp_path / "a.png")))
    assert codes.shape == (2, 3, 4)
    np.testing.assert_array_equal(codes[..., 3], np.rint(255 * ALPHA))
    np.testing.assert_allclose(linear_from_srgb8(codes[ALPHA > 0, :3]), COLOUR[ALPHA > 0], atol=0.005)
    assert not codes[0, 0].any()


def test_light_before_nothing_stays_in_a_png(tmp_path: Path) -> None:
    """A lamp before the sky covers nothing, and codes cannot hold its light without alpha."""
    image = np.full((1, 1, 3), 0.4, np.float32) * np.array([1, 0.5, 0.25], np.float32)
    write_image(tmp_path / "a.png", image, ImageFormat(format="png"), alpha=np.zeros((1, 1), np.float32))
    np.testing.assert_allclose(read_image(tmp_path / "a.png"), image, atol=0.005)


def test_an_image_without_alpha_has_none(tmp_path: Path) -> None:
    for name in ("a.exr", "a.png", "a.tif", "a.jpg"):
        path = tmp_path / name
        write_image(path, IMAGE, ImageFormat(format=path.suffix[1:]))
        assert read_alpha(path) is None
    with pytest.raises(OutputError, match=r"a\.exr: expected an alpha channel, found none; render again with "):
        require_alpha(tmp_path / "a.exr")
