"""The encoder of DWA: files that OpenEXR decodes to nearly the same picture, with the same alpha."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from framearray_cli.array.exr import Attributes
from framearray_cli.array.images import ImageFormat, read_image, read_layers
from framearray_cli.engine.images.dwa import LINES
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.render.rows import write_stored

RNG = np.random.default_rng(7)
ATTRIBUTES: Attributes = {"framesPerSecond": Fraction(24), "framearray:camera": 3, "worldToCamera": np.eye(4)}
FORMAT = ImageFormat(compression="dwaa")


def write(path: Path, image: np.ndarray, compression: Any = "dwaa", attributes: Attributes = ATTRIBUTES) -> bytes:
    """Write a file with the encoder, and return its bytes."""
    write_stored(path, image, ImageFormat(compression=compression), attributes, {}, None)
    return path.read_bytes()


def picture(height: int, width: int, noise: float = 0.1) -> np.ndarray:
    """A smooth picture with noise: a colour that rises over six stops."""
    y, x = np.mgrid[:height, :width] / max(height, width)
    smooth = np.stack([np.exp2(6 * x - 3), 0.5 + 0.4 * np.sin(9 * y), 0.2 + x * y], axis=-1)
    return (smooth * np.exp(noise * RNG.normal(size=smooth.shape))).astype(np.float16)


def error(found: np.ndarray, image: np.ndarray) -> float:
    """Root mean square of the difference over the mean."""
    exact = image.astype(np.float64)
    return float(np.sqrt(np.mean((found - exact) ** 2)) / exact.mean())


@pytest.mark.parametrize("compression", sorted(LINES))
@pytest.mark.parametrize(
    ("height", "width"),
    [(1, 1), (3, 7), (8, 8), (33, 17), (64, 8 * LANES), (31, 8 * LANES + 1), (257, 40), (300, 400)],
)
def test_the_error_is_small_at_every_size(height: int, width: int, compression: str, tmp_path: Path) -> None:
    image = picture(height, width)
    write(tmp_path / "a.exr", image, compression)
    found = read_image(tmp_path / "a.exr")
    assert found.shape == image.shape
    assert error(found, image) < 0.01
    assert abs(found.mean() / image.astype(np.float64).mean() - 1) < 1e-3


def test_openexr_reads_pixels_and_header(tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR", reason="OpenEXR is not installed (extra dev)")
    image = picture(40, 200)
    write(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        header, pixels = file.header(), file.channels()["RGB"].pixels
        assert header["compression"] == OpenEXR.DWAA_COMPRESSION and header["framearray:camera"] == 3
    assert pixels.dtype == np.float16 and error(pixels.astype(np.float64), image) < 0.01


@pytest.mark.parametrize("value", [0.0, 1.0, 0.18, 6e-8, 65504.0])
def test_a_picture_of_one_value_keeps_it(value: float, tmp_path: Path) -> None:
    image = np.full((40, 50, 3), value, np.float16)
    write(tmp_path / "a.exr", image, attributes={})
    found = read_image(tmp_path / "a.exr")
    np.testing.assert_allclose(found, image.astype(np.float32), rtol=5e-3, atol=1e-5)


def test_a_light_among_darkness_stays_finite(tmp_path: Path) -> None:
    image = np.zeros((32, 32, 3), np.float16)
    image[9, 9] = 65504.0
    write(tmp_path / "a.exr", image, attributes={})
    found = read_image(tmp_path / "a.exr")
    assert np.isfinite(found).all()
    assert found[9, 9].min() > 0.98 * 65504 and np.abs(np.delete(found.reshape(-1, 3), 9 * 32 + 9, 0)).max() < 1e-3


def test_pure_noise_takes_no_more_space_than_no_compression(tmp_path: Path) -> None:
    image = RNG.integers(0, 0x7C00, (64, 64, 3), dtype=np.uint16).view(np.float16)
    assert len(write(tmp_path / "a.exr", image, attributes={})) < image.nbytes + 1000


def test_equal_pictures_have_equal_bytes(tmp_path: Path) -> None:
    image = picture(100, 100)
    known = write(tmp_path / "a.exr", image)
    assert write(tmp_path / "b.exr", image.copy()) == known
    strided = np.concatenate([image, image], axis=-1)[..., :3]
    assert write(tmp_path / "c.exr", strided) == known


def test_it_beats_openexrs_own_encoder(tmp_path: Path) -> None:
    """Less error in less space."""
    image = picture(300, 400)
    write_stored(tmp_path / "own.exr", image, FORMAT, ATTRIBUTES, {}, None)
    theirs: Attributes = {"ImageDescription": "an attribute that is left to OpenImageIO"}
    write_stored(tmp_path / "theirs.exr", image, FORMAT, theirs, {}, None)
    own, other = tmp_path / "own.exr", tmp_path / "theirs.exr"
    assert error(read_image(own), image) < error(read_image(other), image)
    assert own.stat().st_size < 1.05 * other.stat().st_size


def test_floats_layers_and_alpha_lose_nothing(tmp_path: Path) -> None:
    floats = picture(20, 30).astype(np.float32)
    floats[3, 4] = 1e5
    write_stored(tmp_path / "a.exr", floats, FORMAT, ATTRIBUTES, {}, None)
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), floats)
    image, layer = picture(20, 30), picture(20, 30).astype(np.float32)
    write_stored(tmp_path / "b.exr", image, FORMAT, ATTRIBUTES, {"error": layer}, None)
    np.testing.assert_array_equal(read_image(tmp_path / "b.exr"), image.astype(np.float32))
    found = read_layers(tmp_path / "b.exr")
    np.testing.assert_array_equal(np.stack([found[f"error.{c}"] for c in "RGB"], axis=-1), layer)
    alpha = RNG.random((20, 30)).astype(np.float32)
    write_stored(tmp_path / "c.exr", image, FORMAT, ATTRIBUTES, {}, alpha)
    np.testing.assert_array_equal(read_image(tmp_path / "c.exr"), image.astype(np.float32))
    np.testing.assert_array_equal(read_layers(tmp_path / "c.exr")["A"], alpha.astype(np.float16))
