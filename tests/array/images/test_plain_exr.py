"""EXR without compression is what OpenImageIO writes, to the last byte."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from framearray_cli.array.images import images, plain_exr
from framearray_cli.array.images.attributes import frame_attributes
from framearray_cli.array.images.images import ImageFormat, read_image, write_image
from framearray_cli.base.errors import OutputError
from framearray_cli.base.lens import Lens

RNG = np.random.default_rng(3)
ATTRIBUTES = frame_attributes(
    world_from_camera=np.linalg.qr(RNG.normal(size=(4, 4)))[0], lens=Lens(fov=47.5), resolution=(7, 5),
    fps=Fraction(30000, 1001), c=12, l=345, group="Lamp über dem Tisch",
)  # fmt: skip
OTHERS: dict[str, Any] = {
    "framearray:a long name of more than thirty-one bytes": "x" * 300,
    "framearray:empty": "",
    "framearray:negative": -7,
    "framearray:place": (1.5, -2.0, 1e-9),
}


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 7, 3), (16, 33, 3), (300, 1, 3)])
@pytest.mark.parametrize("half", ["always", "never"])
@pytest.mark.parametrize("attributes", [{}, ATTRIBUTES, ATTRIBUTES | OTHERS])
@pytest.mark.parametrize("more", [(), ("error", "difference")])
def test_the_bytes_are_those_of_openimageio(
    shape: Any, half: Any, attributes: Any, more: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = RNG.uniform(-10, 100, shape).astype(np.float32)
    layers = {name: RNG.normal(size=shape).astype(np.float32) for name in more}
    stored = ImageFormat(half=half)
    write_image(tmp_path / "plain.exr", image, stored, attributes, layers)
    with monkeypatch.context() as patched:
        patched.setattr(plain_exr, "can_encode", lambda attributes: False)
        write_image(tmp_path / "theirs.exr", image, stored, attributes, layers)
    assert (tmp_path / "plain.exr").read_bytes() == (tmp_path / "theirs.exr").read_bytes()


def test_halves_and_strided_pixels_are_read_back(tmp_path: Path) -> None:
    image = RNG.uniform(0, 100, (6, 3, 9)).astype(np.float16).transpose(0, 2, 1)
    write_image(tmp_path / "a.exr", image, ImageFormat(), ATTRIBUTES)
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), image.astype(np.float32))


def test_attributes_that_openimageio_renames_are_left_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain_exr, "encode_plain_exr", None)
    write_image(tmp_path / "a.exr", np.ones((2, 2, 3), np.float32), ImageFormat(), {"ImageDescription": "a table"})
    assert read_image(tmp_path / "a.exr").all()


def test_a_write_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, data: memoryview) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match=r"a\.exr: cannot be written: no space left on the disk|No space left"):
        write_image(tmp_path / "a.exr", np.ones((2, 2, 3), np.float32), ImageFormat(), {})
    assert not list(tmp_path.iterdir())
    assert images.ImageFormat().compression == "none"
