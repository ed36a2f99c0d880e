"""`framearray assemble` on the command line, with and without a path file: options and messages."""

import re
from fractions import Fraction
from pathlib import Path

import pytest
from support.movies import decoded, grouped, path_file, plain
from support.program import names, run

WAYS = "expected a path file, walk, light or diagonal, or --cameras and --light with places"


@pytest.fixture
def array(tmp_path: Path) -> Path:
    return plain(tmp_path / "out", 5, 4).directory


@pytest.mark.parametrize(
    ("options", "printed", "rate"),
    [
        (["walk"], "5 frames from 5 images, 24 frames per second", 24),
        (["light", "--cameras", "50%"], "4 frames from 4 images, 24 frames per second", 24),
        (["diagonal", "--fps", "12.5"], "5 frames from 5 images, 12.5 frames per second", Fraction(25, 2)),
        (["light", "--seconds", "1", "--blend", "--label"], "24 frames from 24 images, 24 frames per second", 24),
        (["walk", "--seconds", "0.5", "--light", "-1"], "12 frames from 5 images, 24 frames per second", 24),
        (["walk", "--view", "aces", "--exposure", "1"], "5 frames from 5 images, 24 frames per second", 24),
        (["--cameras", "all"], "5 frames from 5 images, 24 frames per second", 24),
        (["--light", "last-0x-2", "--cameras", "-1"], "2 frames from 2 images, 24 frames per second", 24),
        (["walk", "--cameras", "1-3", "--light", "50%"], "3 frames from 3 images, 24 frames per second", 24),
        (["diagonal", "--light", "0,2", "--seconds", "0.25"], "6 frames from 5 images, 24 frames per second", 24),
        (["--at", "light=0-2"], "3 frames from 3 images, 24 frames per second", 24),
    ],
)
def test_movements(array: Path, tmp_path: Path, capsys, options: list[str], printed: str, rate: Fraction) -> None:
    result = run(capsys, "assemble", array, *options, "-o", tmp_path / "m.mkv")
    assert (result.code, result.err) == (0, "")
    assert result.out.endswith(f"m.mkv: {printed}\n")
    movie = decoded(tmp_path / "m.mkv")
    assert (len(movie.frames), movie.rate) == (int(printed.split()[0]), rate)


def test_a_path_file_with_another_rate_and_blends(array: Path, tmp_path: Path, capsys) -> None:
    path = path_file(tmp_path, "fps = 30\n[[segments]]\nseconds = 1\nlight = [0, 3]\n")
    result = run(capsys, "assemble", array, path, "--fps", "12", "--blend", "-o", tmp_path / "m.webp", "-q")
    assert (result.code, result.out, result.err) == (0, "", "")
    assert decoded(tmp_path / "m.webp").length == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], f"{WAYS}; got none of them"),
        (["--seconds", "2"], f"{WAYS}; got none of them"),
        (["wlak"], "expected a path file, walk, light or diagonal; got wlak"),
        (["path.toml", "--seconds", "2"], "a path file gives the lengths of its segments"),
        (["path.toml", "--at", "light=2"], "--at: a path file says where camera and light are"),
        (["path.toml", "--light", "2"], "--light: a path file says where camera and light are"),
        (["walk", "--seconds", "0"], "--seconds: expected a number from 0.001 to 40000, got 0"),
        (["walk", "--fps", "0"], "--fps: expected a number from 0.01 to 1000, got 0"),
    ],
)
def test_wrong_usage(array: Path, tmp_path: Path, capsys, monkeypatch, options: list[str], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    path_file(tmp_path, "[[segments]]\nframes = 2\n")
    result = run(capsys, "assemble", "out", *options, "-o", "m.mp4")
    assert (result.code, result.out) == (2, "")
    assert "Usage: framearray assemble" in result.err
    assert message in re.sub(r"\s+", " ", result.err)
    assert names(tmp_path) == {"out", "path.toml"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["walk", "--light", "4"], "--light: expected one of 4 light positions (0 to 3, or -4 to -1), got 4\n"),
        (["walk", "--at", "4"], "--at: expected AXIS=PLACES with one of the axes light (0 to 3), got"),
        (["--cameras", "0-5"], "--cameras: expected one of 5 camera positions (0 to 4, or -5 to -1), got 5\n"),
        (["walk", "--light", "noon"], "--light: expected places such as 5, 0-47, "),
        (["--light", "3", "--cameras", "2"], "--cameras: expected several places, such as 0-last or all, as nothing"),
        (["--cameras", "all", "--at", "lamp=2"], "--at: expected AXIS=PLACES with one of the axes light (0 to 3), got"),
        (["--light", "0-2", "--at", "light=1"], "--light: expected either this or --at light=..., got both\n"),
        (["walk", "--view", "filmic"], "--view: expected srgb, aces or a view of ocio://default ("),
    ],
)
def test_places_and_views_that_do_not_exist(
    array: Path, tmp_path: Path, capsys, monkeypatch, options: list[str], message: str
) -> None:
    monkeypatch.delenv("OCIO", raising=False)
    result = run(capsys, "assemble", array, *options, "-o", tmp_path / "m.mp4")
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith(message)
    assert result.err.endswith("1 problem; nothing was written.\n")
    assert names(tmp_path) == {"out"}


def test_a_movement_through_an_array_with_groups(tmp_path: Path, capsys) -> None:
    array = grouped(tmp_path / "out").directory
    assert run(capsys, "assemble", array, "light", "-o", tmp_path / "m.mov").code == 0
    assert len(decoded(tmp_path / "m.mov").frames) == 4
    result = run(capsys, "assemble", array, "walk", "--at", "lamp=3", "-o", tmp_path / "n.mov")
    assert result.err.startswith("--at lamp: expected one of 3 positions of lamp (0 to 2, or -3 to -1), got 3\n")
