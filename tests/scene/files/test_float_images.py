"""Textures of linear floats: EXR and HDR."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import write_floats, write_obj

from framearray_cli.scene.files import read_meshes
from framearray_cli.scene.files.assets import AssetError, Limit
from framearray_cli.scene.files.model import Notes
from framearray_cli.scene.files.textures import EncodedImage, TextureTable

LINEAR = np.array([[[0.0, 0.5, 1.0], [0.25, 0.5, 0.75]], [[0.0, 0.5, 3.0], [-0.1, 0.5, 0.75]]], np.float32)
COLOURS = [[[0, 188, 255], [137, 188, 225]], [[0, 188, 255], [0, 188, 225]]]
NUMBERS = [[[0, 128, 255], [64, 128, 191]], [[0, 128, 255], [0, 128, 191]]]


def written(file: Path, pixels: Any = LINEAR) -> Path:
    """Floats (h, w, 3) in a file of its suffix."""
    least = -1 if file.suffix == ".exr" else 0  # HDR has no negative values
    return write_floats(file, np.maximum(pixels, least))


def table_of(file: Path) -> tuple[TextureTable, EncodedImage]:
    return TextureTable(Notes(), Limit()), EncodedImage(file.name, file.name, file.read_bytes)


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
@pytest.mark.parametrize("numbers, codes", [(False, COLOURS), (True, NUMBERS)])
def test_values_become_codes(tmp_path: Path, suffix: str, numbers: bool, codes: Any) -> None:
    table, image = table_of(written(tmp_path / f"a.{suffix}"))
    texels = table.textures[table.index(image, numbers=numbers)]
    close = 0 if suffix == "exr" else 1  # HDR has 8 bits next to a shared exponent
    assert np.abs(texels[..., :3].astype(int) - codes).max() <= close and (texels[..., 3] == 255).all()
    assert "a." + suffix + ": values above 1, in 0.25 of the image, count as 1" in table.notes.lines()
    assert table.index(image, numbers=not numbers) != table.index(image, numbers=numbers)


def test_vectors_with_signs_become_the_codes_of_the_same_normals(tmp_path: Path) -> None:
    slopes = np.random.default_rng(1).normal(0, 0.5, (8, 8, 2))
    upward = np.dstack([slopes, np.ones((8, 8))])
    normals = (upward / np.linalg.norm(upward, axis=2, keepdims=True)).astype(np.float32)
    normals[0, 0] = (0, 0, 1.0001)  # rounded, as by half floats
    normals[0, 1] = (np.nan, 1e30, 0)
    codes = np.clip(normals / 2 + 0.5, 0, 1)
    found = []
    for name, pixels in (("signed", normals), ("codes", codes)):
        table, image = table_of(written(tmp_path / f"{name}.exr", pixels))
        index, heights = table.relief(image)
        found.append(table.textures[index])
        assert not heights and index == table.index(image, numbers=True)
        (note,) = table.notes.lines()
        assert note.endswith("radiance is not finite in 1 texel (taken as the mean of the others)")
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0][1:, :, :3], np.rint(codes[1:] * 255))


@pytest.mark.parametrize("least", [0.0, -0.2])  # negative where a filter overshoots
def test_other_numbers_with_signs_stay(tmp_path: Path, least: float) -> None:
    rough = np.random.default_rng(2).uniform(least, 1, (8, 8, 1)).astype(np.float32).repeat(3, axis=2)
    table, image = table_of(written(tmp_path / "a.exr", rough))
    texels = table.textures[table.index(image, numbers=True)]
    assert np.array_equal(texels[..., :3], np.rint(rough.clip(0, 1) * 255))


def test_a_broken_one_is_left_out(tmp_path: Path) -> None:
    file = written(tmp_path / "a.exr")
    file.write_bytes(file.read_bytes()[:-40])
    table, image = table_of(file)
    assert table.index(image) == -1
    (note,) = table.notes.lines()
    assert note.startswith("texture left out, a.exr: damaged or cut short")


@pytest.mark.parametrize("x, y", [(1, 1), (-1, 0), (1, -1)], ids=["cropped", "overscan", "offset"])
@pytest.mark.parametrize("channels", [1, 3])
def test_the_display_window_of_one_channel_or_three(tmp_path: Path, channels: int, x: int, y: int) -> None:
    """4 x 3 pixels at (x, y) of a display window of 3 x 2: black outside; one channel is grey."""
    pixels = np.random.default_rng(4).uniform(0.1, 1.0, (3, 4, channels))
    window = {"full_x": 9, "full_y": 7, "full_width": 3, "full_height": 2}
    table, image = table_of(write_floats(tmp_path / "a.exr", pixels, x=9 + x, y=7 + y, **window))
    texels = table.textures[table.index(image, numbers=True)]
    expected = np.zeros((2, 3, 3))
    for row in range(max(y, 0), 2):
        for column in range(max(x, 0), 3):
            expected[row, column] = pixels[row - y, column - x]
    assert np.array_equal(texels[..., :3], np.rint(expected * 255)) and (texels[..., 3] == 255).all()


@pytest.mark.parametrize("numbers, codes", [(False, COLOURS), (True, NUMBERS)])
def test_in_tiles(tmp_path: Path, numbers: bool, codes: Any) -> None:
    data = written(tmp_path / "a.exr").read_bytes()

    def read(number: int) -> bytes:
        if number not in (1001, 1012):
            raise AssetError("no such file")
        return data

    table = TextureTable(Notes(), Limit())
    image = table.tiled("a", "a", read)
    texels = table.textures[table.index(image, numbers=numbers)]
    assert image.counts == (2, 2) and texels.shape == (4, 4, 4)
    assert texels[2:, :2, :3].tolist() == texels[:2, 2:, :3].tolist() == codes and not texels[:2, :2, :3].any()


def test_in_a_scene(tmp_path: Path) -> None:
    written(tmp_path / "a.exr")
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl M\nf 1/1 2/2 3/3\n"
    file = write_obj(tmp_path, text, "newmtl M\nmap_Kd a.exr\n")
    assert read_meshes(file).textures[0][..., :3].tolist() == COLOURS
