"""`sheet --wrap`: the light positions of one camera position, line by line."""

from pathlib import Path

import numpy as np
import pytest
from support.movies import plain
from support.sheets import blocks

from framearray_cli.array.images import read_codes, read_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.base.errors import JobError
from framearray_cli.tools.drawing import SHEET_GREY
from framearray_cli.tools.sheet import make_sheet


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    noise = np.random.default_rng(3).random((3, 20, 48, 64, 3), np.float32)
    return plain(tmp_path / "out", 3, 20, "png", lambda c, l: 0.3 + 0.7 * noise[c, l])


def test_every_light_position_in_its_line(array: Manifest, tmp_path: Path) -> None:
    made = make_sheet(array.directory, tmp_path / "a.png", wrap=True, columns=5, rows=4)
    assert (made.cameras, made.lights) == ((1,), tuple(range(20)))
    shown = blocks(read_codes(tmp_path / "a.png"), array.resolution)
    assert [len(row) for row in shown] == [5] * 4
    for l in range(20):
        np.testing.assert_array_equal(shown[l // 5][l % 5], read_codes(image_path(array, 1, l)))


def test_what_is_left_of_the_last_line_is_blank(array: Manifest, tmp_path: Path) -> None:
    make_sheet(array.directory, tmp_path / "a.png", wrap=True, cameras="2", light="0-5,19,7", columns=6)
    shown = blocks(read_codes(tmp_path / "a.png"), array.resolution)
    for k, l in enumerate((0, 1, 2, 3, 4, 5, 19, 7)):
        np.testing.assert_array_equal(shown[k // 6][k % 6], read_codes(image_path(array, 2, l)))
    assert (np.array(shown[1][2:]) == SHEET_GREY).all()
    made = make_sheet(array.directory, tmp_path / "a.tif", wrap=True, cameras="2", light="0-4", columns=3)
    assert made.size == (3 * 64, 2 * 48)
    image = read_image(tmp_path / "a.tif")
    assert not image[48:, 128:].any() and image[48:, :128].all()


def test_as_many_as_fit_are_chosen_evenly(array: Manifest, tmp_path: Path) -> None:
    made = make_sheet(array.directory, tmp_path / "a.png", wrap=True, columns=2, rows=2)
    assert made.lights == (0, 6, 13, 19)
    assert make_sheet(array.directory, tmp_path / "b.png", wrap=True, light="3").lights == (3,)


def test_several_camera_positions_are_refused(array: Manifest, tmp_path: Path) -> None:
    with pytest.raises(JobError, match=r"--wrap: expected one camera position, got 2; give one with --cameras"):
        make_sheet(array.directory, tmp_path / "a.png", wrap=True, cameras="0-1")
