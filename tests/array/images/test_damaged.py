"""Image files that are truncated, foreign or of another kind."""

import struct
import zlib
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from framearray_cli.array.images.check import check_image
from framearray_cli.array.images.images import ImageFormat, read_image, write_image, write_layers
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import read_pixels, read_texts

FORMATS = ("exr", "png", "tif", "jpg")


def noisy(height: int = 12, width: int = 17, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1.5, (height, width, 3)).astype(np.float32)


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


@pytest.mark.parametrize("name", ["exr", "tif", "png", "jpg"])
def test_images_of_another_kind_are_errors(tmp_path: Path, name: str) -> None:
    other = "png" if name in ("exr", "tif") else "exr"
    write_image(tmp_path / f"a.{name}", noisy(4, 4), ImageFormat(format=other))
    for read in (read_image, lambda path: check_image(path, (4, 4))):
        with pytest.raises(OutputError, match=rf"a\.{name}: not an image, or damaged: it does not begin like"):
            read(tmp_path / f"a.{name}")


def test_sizes_beyond_any_job_take_no_memory(tmp_path: Path) -> None:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 2, 0, 0, 0)
    end = chunk(b"IDAT", zlib.compress(bytes(99))) + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + end)
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
    check_image(path, (16384, 16384))


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
