"""EXR files that are composed from an array say what their values are, whatever the array's own files say."""

from fractions import Fraction
from pathlib import Path

import pytest
from support.boxarrays import grouped_manifest, plain_manifest, write_array, write_groups
from support.making import export_array, make_sheet

from framearray_cli.array.images import SCENE_LIGHT, ImageFormat
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.pictures import AS_RENDERED, Pictures
from framearray_cli.base.openimage import read_texts
from framearray_cli.tools.movie.look import Look
from framearray_cli.tools.movie.movie import write_frame
from framearray_cli.tools.movie.timeline import Shot

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
