"""EXR files by OpenEXR's own library: a second opinion on headers, channels and values."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.boxarrays import EYES

from framearray_cli.array.images.attributes import frame_attributes
from framearray_cli.array.images.images import ImageFormat, write_image, write_layers
from framearray_cli.base.lens import Lens

OpenEXR = pytest.importorskip("OpenEXR", reason="OpenEXR is not installed (extra dev)")
ATTRIBUTES = frame_attributes(
    world_from_camera=EYES[1],
    lens=Lens(fov=60),
    resolution=(9, 7),
    fps=Fraction(24000, 1001),
    c=12,
    l=3,
    software="framearray 0",
)


@pytest.mark.parametrize("compression", ["none", "zip", "piz", "dwaa"])
@pytest.mark.parametrize("half", ["auto", "never"])
def test_images(tmp_path: Path, compression: str, half: str) -> None:
    image = np.random.default_rng(1).random((7, 9, 3), np.float32) * 4
    write_image(tmp_path / "a.exr", image, ImageFormat(compression=compression, half=half), ATTRIBUTES)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        header, pixels = file.header(), file.channels()["RGB"].pixels
        assert pixels.dtype == (np.float16 if half == "auto" else np.float32)
        wanted = image.astype(pixels.dtype)
        np.testing.assert_allclose(pixels, wanted, rtol=0.1 if compression == "dwaa" else 0)  # dwaa loses a little
        for name in ("worldToCamera", "worldToNDC"):
            rows = np.transpose(ATTRIBUTES[name])  # the file multiplies row vectors
            np.testing.assert_allclose(np.reshape(header[name], (4, 4)), rows, rtol=1e-5, atol=1e-6)
        assert header["framesPerSecond"] == Fraction(24000, 1001)
        assert (header["framearray:camera"], header["framearray:light"]) == (12, 3)
        assert header["framearray:fov"] == 60.0 and header["Software"] == "framearray 0"
        x, y, _, w = np.array([*(EYES[1] @ [0, 0, -2.0, 1])[:3], 1]) @ np.reshape(header["worldToNDC"], (4, 4))
        assert (x / w, y / w) == pytest.approx((0.5, 0.5), abs=1e-6), "a point on the axis is in the middle"


def test_layers(tmp_path: Path) -> None:
    values = np.random.default_rng(2).random((7, 9), np.float32)
    layers = {"normal.X": values, "normal.Y": -values, "depth.Z": values * 1e5, "samples": np.round(values * 9)}
    write_layers(tmp_path / "a.exr", layers, ATTRIBUTES)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(found) == set(layers)
    for name, pixels in found.items():
        assert pixels.dtype == (np.float32 if name in ("depth.Z", "samples") else np.float16)
        np.testing.assert_array_equal(pixels, layers[name].astype(pixels.dtype))
