"""`sheet` and `export`, as typed: what they say, and how they end."""

from pathlib import Path

import pytest
from boxarrays import plain_manifest, write_array
from program import names, run


@pytest.fixture
def array(tmp_path: Path) -> Path:
    return write_array(plain_manifest(tmp_path / "out")).directory


def test_a_sheet_is_drawn(array, tmp_path, capsys):
    result = run(capsys, "sheet", array, "-o", tmp_path / "s.png", "--columns", 2, "--rows", 2)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{tmp_path / 's.png'}: 2 cameras, 2 light positions, ")
    assert run(capsys, "sheet", array, "-o", tmp_path / "t.jpg", "-q").out == ""


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["-o", "s.gif"], 4, "s.gif: expected a .png, .jpg, .exr or .tif"),
        (["-o", "s.png", "--width", "60"], 2, "--width: 60 pixels are too few for 4 columns; try fewer --columns"),
        (["-o", "s.png", "--at", "lamps=1"], 2, "--at: expected AXIS=PLACES with one of the axes light (0 to 2)"),
        (["-o", ""], 2, "expected a name, got none"),
        (["-o", "s.png", "--columns", "0"], 2, "--columns"),
    ],
)
def test_a_sheet_that_cannot_be_drawn(array, tmp_path, capsys, monkeypatch, options, code, message):
    monkeypatch.chdir(tmp_path)
    result = run(capsys, "sheet", array, *options)
    assert (result.code, message in result.err) == (code, True), result.err
    assert names(tmp_path) == {"out"}


@pytest.mark.parametrize(
    ("kind", "folder", "said"),
    [
        ("nerfstudio", "x", "4 cameras, 1 light position, "),
        ("colmap", "x", "4 cameras, 1 light position, "),
        ("cinema", "x.cdb", "4 cameras, 3 light positions"),
    ],
)
def test_an_array_is_exported(array, tmp_path, capsys, kind, folder, said):
    result = run(capsys, "export", array, "--format", kind, "-o", tmp_path / "x")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{tmp_path / folder}: {said}")
    assert ("points" in result.out) == (kind != "cinema")
    again = run(capsys, "export", array, "-f", kind, "-o", tmp_path / "x")
    assert again.code == 4
    assert "an earlier export is there; choose another folder, or give --force to replace it" in again.err
    forced = run(capsys, "export", array, "-f", kind, "-o", tmp_path / "x", "--force", "-q")
    assert (forced.code, forced.out) == (0, "")
    assert names(tmp_path) == {"out", folder}


def test_notes_are_printed(tmp_path, capsys):
    bare = write_array(plain_manifest(tmp_path / "out", layers=False)).directory
    result = run(capsys, "export", bare, "-f", "colmap", "-o", tmp_path / "x")
    assert result.code == 0
    assert result.out.splitlines()[1].startswith("no points and no depth: the array was rendered without layers")


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["-f", "usd", "-o", "x"], 2, "usd"),
        (["-f", "colmap", "-o", "x", "--light", "7"], 2, "--light: expected 0 to 2, or -3 to -1, got 7"),
        (["-f", "colmap", "-o", "x", "--light", "noon"], 2, "nothing was written"),
        (["-f", "colmap", "-o", "x", "--image-format", "exr", "--exposure", "1"], 2, "changes PNG and JPEG alone"),
        (["-f", "colmap", "-o", "out"], 4, "holds other files, and no sparse/0/images.txt of an earlier export"),
    ],
)
def test_an_export_that_cannot_be_made(array, tmp_path, capsys, monkeypatch, options, code, message):
    monkeypatch.chdir(tmp_path)
    before = names(array)
    result = run(capsys, "export", array, *options)
    assert (result.code, message in result.err) == (code, True), result.err
    assert (names(tmp_path), names(array)) == ({"out"}, before)
