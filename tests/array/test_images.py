"""Image files: read, written, checked, alpha, levels, and damage."""

import struct
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import PIL.Image
import pytest
from support.scenes import made_png
from support.smalldisk import largest_file

from framearray_cli.array.exr import frame_attributes
from framearray_cli.array.images import (
    CODE_0,
    COUNTED,
    HALF_MAX,
    ImageFormat,
    mean_shares,
    open_picture,
    pixel_shares,
    read_alpha,
    read_image,
    read_layers,
    write_image,
    write_layers,
)
from framearray_cli.base.colour import linear_from_srgb, linear_from_srgb8, srgb8_from_linear, srgb_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import whole_file, write_bytes
from framearray_cli.base.lens import Lens
from framearray_cli.base.openimage import read_pixels, read_texts

FORMATS = ("exr", "png", "tif", "jpg")


def noisy(height: int = 12, width: int = 17, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1.5, (height, width, 3)).astype(np.float32)


def smooth(height: int = 24, width: int = 40) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x / width, y / height, (x + y) / (width + height)], axis=-1).astype(np.float32)


# colour


def test_srgb_formula_at_known_points() -> None:
    linear = np.array([-1.0, 0.0, 0.0031308, 0.18, 0.5, 1.0, 7.0])
    expected = np.array([0.0, 0.0, 0.040449936, 0.461356, 0.735357, 1.0, 1.0])
    np.testing.assert_allclose(srgb_from_linear(linear), expected, atol=1e-6)


def test_srgb_decode_is_the_inverse_and_keeps_the_dtype() -> None:
    x = np.linspace(0, 1, 10001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(x)), x, atol=1e-7)  # the two branches meet to 1e-8
    assert srgb_from_linear(np.float32([0.2])).dtype == linear_from_srgb(np.float32([0.2])).dtype == np.float32


def test_8_bit_code_is_within_a_rounding_of_the_exact_value() -> None:
    x = np.concatenate([np.linspace(0, 1, 200001), np.geomspace(1e-9, 1, 100001)]).astype(np.float32)
    error = np.abs(srgb8_from_linear(x) - 255 * srgb_from_linear(x.astype(np.float64)))
    assert error.max() <= 0.5 + 168 * 2**-12  # 168: codes per unit of light at 0.5, where a half is 2^-12 off at most


def test_8_bit_codes_survive_a_round_trip_and_clip() -> None:
    codes = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(srgb8_from_linear(linear_from_srgb8(codes)), codes)
    np.testing.assert_array_equal(srgb8_from_linear(np.float32([-5, -0.0, 1, 2, 1e6])), [0, 0, 255, 255, 255])


# files that appear whole or not at all


def test_whole_file_replaces_only_on_success(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "a.txt"
    write_bytes(target, b"old")
    for failure in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(failure), whole_file(target) as part:
            part.write_bytes(b"half of the ne")
            raise failure
        assert target.read_bytes() == b"old"
        assert list(target.parent.iterdir()) == [target]
    write_bytes(target, b"new")
    assert target.read_bytes() == b"new"


def test_whole_file_names_the_target_and_the_reason(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OutputError, match="file: a file of that name is in the way"):
        write_bytes(tmp_path / "file" / "a.txt", b"x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="folder: cannot be written: Is a directory"):
        write_bytes(tmp_path / "folder", b"x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


# one image


@pytest.mark.parametrize(
    ("image_format", "largest", "kept"),
    [
        (ImageFormat(), 1.5, np.float16),
        (ImageFormat(half="never"), 1.5, np.float32),
        (ImageFormat(format="tif"), 1.5e5, np.float32),
        *((ImageFormat(compression=name), 1.5, np.float16) for name in ("none", "rle", "zips", "zip", "piz")),
    ],
)
def test_halves_and_floats_are_kept_exactly(
    tmp_path: Path, image_format: ImageFormat, largest: float, kept: Any
) -> None:
    image, path = noisy() * np.float32(largest / 1.5), tmp_path / f"a.{image_format.format}"
    write_image(path, image, image_format)
    if path.suffix == ".exr":
        assert oiio.ImageInput.open(str(path)).spec()["compression"] == image_format.compression
    np.testing.assert_array_equal(read_image(path), image.astype(kept).astype(np.float32))


@pytest.mark.parametrize("sign", [1, -1])
def test_exr_is_float_where_a_half_would_be_infinite(tmp_path: Path, sign: int) -> None:
    image = noisy()
    image[3, 4, 1] = sign * HALF_MAX
    write_image(tmp_path / "fits.exr", image, ImageFormat())
    image[3, 4, 1] = sign * 70000
    write_image(tmp_path / "beyond.exr", image, ImageFormat())
    kinds = [str(oiio.ImageInput.open(str(tmp_path / f"{name}.exr")).spec().format) for name in ("fits", "beyond")]
    assert kinds == ["half", "float"]
    assert read_image(tmp_path / "fits.exr")[3, 4, 1] == sign * HALF_MAX
    np.testing.assert_array_equal(read_image(tmp_path / "beyond.exr"), image)


def test_exr_clamps_to_half_where_asked(tmp_path: Path) -> None:
    image = noisy()
    image[3, 4] = [65505, 1e30, -70000]
    write_image(tmp_path / "a.exr", image, ImageFormat(half="always"))
    assert str(oiio.ImageInput.open(str(tmp_path / "a.exr")).spec().format) == "half"
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr")[3, 4], [HALF_MAX, HALF_MAX, -HALF_MAX])


def test_png_holds_srgb_codes(tmp_path: Path) -> None:
    image = noisy()
    write_image(tmp_path / "a.png", image, ImageFormat(format="png"), {"framearray:camera": 3})
    with PIL.Image.open(tmp_path / "a.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), srgb8_from_linear(image))
        assert picture.info["srgb"] == 0
        assert picture.info["framearray:camera"] == "3"
    np.testing.assert_array_equal(srgb8_from_linear(read_image(tmp_path / "a.png")), srgb8_from_linear(image))


def test_jpg_is_close(tmp_path: Path) -> None:
    image = smooth()
    write_image(tmp_path / "a.jpg", image, ImageFormat(format="jpg", quality=95))
    codes = srgb8_from_linear(read_image(tmp_path / "a.jpg")).astype(int)
    assert np.abs(codes - srgb8_from_linear(image)).mean() < 1.5


def test_exposure_brightens_only_the_screen_formats(tmp_path: Path) -> None:
    image = smooth() / 8
    write_image(tmp_path / "a.png", image, ImageFormat(format="png", exposure=1.0))
    np.testing.assert_array_equal(srgb8_from_linear(read_image(tmp_path / "a.png")), srgb8_from_linear(2 * image))
    write_image(tmp_path / "a.exr", image, ImageFormat(exposure=1.0, half="never"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), image)


@pytest.mark.parametrize("name", FORMATS)
def test_equal_images_are_equal_files(tmp_path: Path, name: str) -> None:
    attributes = frame_attributes(world_from_camera=np.eye(4), lens=Lens(fov=60), resolution=(17, 12), fps=24, c=1, l=2)
    for file in ("a", "b"):
        write_image(tmp_path / file, noisy(), ImageFormat(format=name), attributes)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert b"2000:01:01" in (tmp_path / "a").read_bytes() or name in ("png", "jpg")


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_values_are_refused(tmp_path: Path, name: str, bad: float) -> None:
    image = noisy()
    image[0, 0, 0] = image[5, 5, 1] = bad
    with pytest.raises(ValueError, match="2 values"):
        write_image(tmp_path / "a", image, ImageFormat(format=name))
    assert list(tmp_path.iterdir()) == []


def test_a_strided_image_is_written_right(tmp_path: Path) -> None:
    image = noisy(24, 34)[::2, ::-2]
    for name in ("exr", "tif", "png"):
        write_image(tmp_path / f"a.{name}", image, ImageFormat(format=name, half="never"))
        back = read_image(tmp_path / f"a.{name}")
        np.testing.assert_array_equal(srgb8_from_linear(back), srgb8_from_linear(image))


def test_threads_write_different_images(tmp_path: Path) -> None:
    images = [noisy(seed=k) for k in range(12)]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda k: write_image(tmp_path / f"{k}.exr", images[k], ImageFormat(half="never")), range(12)))
    for k, image in enumerate(images):
        np.testing.assert_array_equal(read_image(tmp_path / f"{k}.exr"), image)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize(("size", "limit"), [(200, 4096), (40, 300), (40, 0)])
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path: Path, name: str, size: int, limit: int) -> None:
    write_image(tmp_path / "warm", noisy(), ImageFormat(format=name))
    with largest_file(limit), pytest.raises(OutputError, match=r"image: cannot be written") as caught:
        write_image(tmp_path / "image", noisy(size, size), ImageFormat(format=name))
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["warm"]


@pytest.mark.parametrize("name", ["exr", "tif"])
@pytest.mark.parametrize("missing", [100, 1000, 5000])
def test_a_last_buffer_that_is_lost_is_an_error(tmp_path: Path, name: str, missing: int) -> None:
    """The disk fills up just before the end of the file."""
    image = noisy(64, 64)
    write_image(tmp_path / "whole", image, ImageFormat(format=name))
    size = (tmp_path / "whole").stat().st_size
    with largest_file(size - missing), pytest.raises(OutputError, match="cannot be written"):
        write_image(tmp_path / "image", image, ImageFormat(format=name))


# layers


def test_layers_round_trip(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    names = ["obscurance.R", "obscurance.G", "obscurance.B", "normal.X", "depth.Z", "samples", "indirect.R"]
    layers = {name: rng.uniform(0, 1, (5, 6)).astype(np.float32) for name in names}
    layers["samples"][:] = 100001  # not a half
    layers["indirect.R"][2, 2] = 1e6  # beyond a half
    write_layers(tmp_path / "a.exr", layers, {"framearray:camera": 7})
    back = read_layers(tmp_path / "a.exr")
    assert set(back) == set(names)
    for name in ("depth.Z", "samples", "indirect.R"):
        np.testing.assert_array_equal(back[name], layers[name])
    for name in ("obscurance.R", "obscurance.B", "normal.X"):
        np.testing.assert_array_equal(back[name], layers[name].astype(np.float16).astype(np.float32))


def test_layers_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"depth\.Z"):
        write_layers(tmp_path / "a.exr", {"depth.Z": np.full((2, 3), np.inf, np.float32)})


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
        with pytest.raises(OutputError, match=rf"{name}: expected an alpha channel, found none; render again with "):
            read_alpha(path)


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


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("kept", [0.0, 0.02, 0.5, 0.95])
def test_a_file_cut_short_is_an_error(tmp_path: Path, name: str, kept: float) -> None:
    path = tmp_path / f"a.{name}"
    write_image(path, noisy(60, 80), ImageFormat(format=name))
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    with pytest.raises(OutputError, match=rf"a\.{name}: "):
        read_image(path)


@pytest.mark.parametrize("name", FORMATS)
def test_missing_and_foreign_files_are_errors(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=r"(?i)no such file"):
        read_image(tmp_path / f"a.{name}")
    (tmp_path / f"b.{name}").write_text("not a picture at all, not at all")
    with pytest.raises(OutputError, match="not an image"):
        read_image(tmp_path / f"b.{name}")
    (tmp_path / f"c.{name}").mkdir()
    with pytest.raises(OutputError, match=rf"c\.{name}: "):
        read_image(tmp_path / f"c.{name}")


@pytest.mark.parametrize("name", FORMATS)
def test_images_of_another_kind_are_errors(tmp_path: Path, name: str) -> None:
    other = "png" if name in ("exr", "tif") else "exr"
    write_image(tmp_path / f"a.{name}", noisy(4, 4), ImageFormat(format=other))
    with pytest.raises(OutputError, match=rf"a\.{name}: not an image, or damaged: it does not begin like"):
        read_image(tmp_path / f"a.{name}")


def test_sizes_beyond_any_job_take_no_memory(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(made_png(60_000, 60_000, bytes(99)))
    write_image(tmp_path / "a.exr", noisy(4, 4), ImageFormat())
    data, wide = (tmp_path / "a.exr").read_bytes(), struct.pack("<iiii", 0, 0, 59_999, 59_999)
    assert data.count(struct.pack("<iiii", 0, 0, 3, 3)) == 2  # data and display window
    (tmp_path / "a.exr").write_bytes(data.replace(struct.pack("<iiii", 0, 0, 3, 3), wide))
    for name in ("a.png", "a.exr"):
        with pytest.raises(OutputError, match=rf"{name}: .*damaged"):
            read_image(tmp_path / name)


@pytest.mark.filterwarnings("error")
def test_large_pngs_of_a_job_are_not_refused_as_bombs(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    PIL.Image.new("1", (16384, 16384)).save(path)  # Pillow's own `open` raises from 179 million pixels on
    with open_picture(path) as picture:
        assert picture.size == (16384, 16384)


def test_an_exr_without_rgb_is_an_error(tmp_path: Path) -> None:
    write_layers(tmp_path / "a.exr", {"depth.Z": np.ones((3, 4), np.float32)})
    with pytest.raises(OutputError, match=r"expected channels R, G, B, found depth\.Z"):
        read_image(tmp_path / "a.exr")


def test_names_in_a_header_that_are_not_utf_8_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    write_layers(path, {"depth.Z": np.ones((3, 4), np.float32)}, attributes={"framearray:eye": "words"})
    good = path.read_bytes()
    for old, new, read in (
        (b"depth.Z", b"dep\xb2h.Z", read_pixels),
        (b"framearray:eye", b"framearray:e\xb2e", lambda file: read_texts(file, "framearray")),
        (b"words", b"wor\xb2s", lambda file: read_texts(file, "framearray")),
    ):
        assert good.count(old) == 1
        path.write_bytes(good.replace(old, new))
        with pytest.raises(OutputError, match=r"a\.exr: damaged: its header has names that are not UTF-8"):
            read(path)
