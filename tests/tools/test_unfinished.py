"""Commands on an array that a stopped render has left unfinished, and what composed EXR files say of their values."""

import shutil
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.boxarrays import grouped_manifest, plain_manifest, write_array, write_groups
from support.making import export_array, make_sheet, warned_sheet
from support.sheets import blocks

from framearray_cli.array.images import SCENE_LIGHT, ImageFormat, read_codes, read_image
from framearray_cli.array.integrity import list_present
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.pictures import AS_RENDERED, Pictures
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import read_texts
from framearray_cli.tools.movie.look import Look
from framearray_cli.tools.movie.movie import write_frame
from framearray_cli.tools.movie.timeline import Shot


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return write_array(plain_manifest(tmp_path / "out"))


def test_files_that_exist_are_listed_without_a_look_at_each(array: Manifest) -> None:
    assert list_present(array).incomplete() == []
    (array.directory / "box.layers.c0002.exr").unlink()
    image_path(array, 0, 2).unlink()
    present = list_present(array)
    assert present.incomplete() == [0, 2]
    assert present.has([image_path(array, 0, 1)]) and not present.has([image_path(array, 0, l) for l in range(3)])


def test_cameras_that_lack_images_are_left_out(array: Manifest, tmp_path: Path) -> None:
    (array.directory / "box.layers.c0002.exr").unlink()
    image_path(array, 0, 2).unlink()
    lacks = "images: {}; `framearray render JOB` goes on with the rest"
    for kind, light, left_out, warning in (
        ("nerfstudio", "1", {2}, f"left out: 1 of 4 camera positions lacks {lacks.format(2)}"),
        ("colmap", "all", {0, 2}, f"left out: 2 of 4 camera positions lack {lacks.format('0,2')}"),
        ("rti", "0,1", set(), None),
        ("rti", "all", {0}, f"left out: 1 of 4 camera positions lacks {lacks.format(0)}"),
    ):
        result = export_array(array.directory, tmp_path / "x", kind, light=light, force=True)
        assert result.warnings == (() if warning is None else (warning,))
        assert result.result.cameras == 4 - len(left_out)
        names = {file.name[:5] for file in (result.target / "images").glob("*.png")}
        assert names == {f"c{c:04d}" for c in {0, 1, 2, 3} - left_out}
        shutil.rmtree(result.target)
    with pytest.raises(OutputError, match=rf"1 of 1 camera position lacks {lacks.format(0)}"):
        export_array(array.directory, tmp_path / "y", "rti", cameras="0")
    assert not list(tmp_path.glob("y*"))


def test_a_sheet_shows_what_is_there(array: Manifest, tmp_path: Path) -> None:
    image_path(array, 1, 2).unlink()
    for l in range(3):
        image_path(array, 3, l).unlink()
    _, warnings = warned_sheet(array.directory, tmp_path / "s.png")
    assert warnings == (
        "4 of 12 images of the sheet are missing, of cameras 1,3; `framearray render JOB` goes on with the rest",
    )
    shown = blocks(read_codes(tmp_path / "s.png"), array.resolution)
    for l, row in enumerate(shown):
        for c, tile in enumerate(row):
            if c == 3 or (c, l) == (1, 2):
                np.testing.assert_array_equal(tile, shown[0][3], "all blanks are alike")
                assert len(np.unique(tile)) == 2 and tile.max() < 100, "dark stripes"
            else:
                np.testing.assert_array_equal(tile, read_codes(image_path(array, c, l)))
    make_sheet(array.directory, tmp_path / "s.exr")
    assert not read_image(tmp_path / "s.exr")[:, 180:].any()
    assert read_image(tmp_path / "s.exr")[:, :180].reshape(3, 40, 3, 60, 3).any(axis=(1, 3, 4)).sum() == 8


def test_a_sheet_of_nothing_is_refused(array: Manifest, tmp_path: Path) -> None:
    for c in range(4):
        for l in range(3):
            image_path(array, c, l).unlink()
    with pytest.raises(OutputError, match=r"out: 12 of 12 images of the sheet are missing, of cameras 0-3; `framearr"):
        make_sheet(array.directory, tmp_path / "s.png")
    assert not (tmp_path / "s.png").exists()


NAME = "colorInteropID"


def colour_id(file: Path) -> str | None:
    return read_texts(file, NAME).get(NAME)


@pytest.fixture
def grouped(tmp_path: Path) -> Manifest:
    return write_groups(grouped_manifest(tmp_path / "grouped"))


def test_sheets(grouped: Manifest, tmp_path: Path) -> None:
    make_sheet(grouped.directory, tmp_path / "sheet.exr")
    assert colour_id(tmp_path / "sheet.exr") == SCENE_LIGHT
    make_sheet(grouped.directory, tmp_path / "sheet.tif")
    assert SCENE_LIGHT.encode() not in (tmp_path / "sheet.tif").read_bytes(), "no attribute of TIFF"


def test_frames_of_a_sequence(grouped: Manifest, tmp_path: Path) -> None:
    for layered in (False, True):
        file = tmp_path / "frame.exr"
        shot = Shot(1, (1.0, 0.0))
        write_frame(Pictures(grouped), shot, AS_RENDERED, file, Fraction(24), Look(), layered=layered)
        assert colour_id(file) == SCENE_LIGHT


def test_exports(grouped: Manifest, tmp_path: Path) -> None:
    export_array(grouped.directory, tmp_path / "x", "nerfstudio", image_format=ImageFormat())
    files = sorted((tmp_path / "x").rglob("*.exr"))
    assert files and {colour_id(file) for file in files} == {SCENE_LIGHT}


def test_files_that_are_linked_stay_as_the_array_has_them(tmp_path: Path) -> None:
    plain = write_array(plain_manifest(tmp_path / "plain", extension="exr"))
    export_array(plain.directory, tmp_path / "x", "nerfstudio", image_format=ImageFormat())
    file = sorted((tmp_path / "x").rglob("*.exr"))[0]
    assert file.read_bytes() == image_path(plain, 0, 1).read_bytes() and colour_id(file) is None
