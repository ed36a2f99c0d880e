"""`assemble`, `sheet` and `export` on the command line: options, messages and exit codes."""

import json
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.boxarrays import plain_manifest, write_array
from support.movies import decoded, grouped, path_file, plain
from support.program import names, run, write_job
from support.tiny import WALK


@pytest.fixture
def array(tmp_path: Path) -> Path:
    return write_array(plain_manifest(tmp_path / "out")).directory


def test_a_sheet_is_drawn(array, tmp_path, capsys):
    result = run(capsys, "sheet", array, "-o", tmp_path / "s.png", "--columns", 2, "--rows", 2)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{tmp_path / 's.png'}: 2 camera positions x 2 light positions, ")
    assert run(capsys, "sheet", array, "-o", tmp_path / "t.jpg", "-q").out == ""


@pytest.mark.parametrize(
    ("command", "options", "code", "message"),
    [
        ("sheet", ["-o", "s.png", "--width", "60"], 2, "--width: 60 pixels are too few for 4 columns"),
        ("sheet", ["-o", "s.png", "--at", "lamps=1"], 2, "--at: expected AXIS=PLACES with one of the axes light"),
        ("sheet", ["-o", ""], 2, "expected a name, got none"),
        ("report", ["-o", ""], 2, "expected a name, got none"),
        ("view", ["--host", ""], 2, "expected an address, got"),
        ("sheet", ["-o", "-.avif"], 4, "\n-.avif: expected a .png, .jpg, .exr or .tif\n"),
        ("export", ["-f", "colmap", "-o", "x", "--light", "7"], 2, "--light: expected one of 3 light positions"),
        ("export", ["-f", "colmap", "-o", "x", "--light", "noon"], 2, "nothing was written"),
        ("export", ["-f", "colmap", "-o", "x", "--cameras", ""], 2, "--cameras: expected places such as"),
        ("export", ["-f", "colmap", "-o", "x", "--image-format", "exr", "--exposure", "1"], 2, "only PNG and JPEG"),
        ("export", ["-f", "colmap", "-o", "out"], 4, "holds other files, and no sparse/0/images.txt"),
        *(
            ("view", ["--export", "page", option], 2, f"{option.partition('=')[0]}: expected no --export next to it")
            for option in ("--port=80", "--host=127.0.0.1", "--browser", "--no-browser")
        ),
    ],
)
def test_what_cannot_be_made(array, tmp_path, capsys, monkeypatch, command, options, code, message):
    monkeypatch.chdir(tmp_path)
    before = names(array)
    result = run(capsys, command, array, *options)
    assert (result.code, message in f"\n{result.err}") == (code, True), result.err
    assert (names(tmp_path), names(array)) == ({"out"}, before)


@pytest.mark.parametrize(
    ("kind", "lights"),
    [("nerfstudio", "1 light position,"), ("colmap", "1 light position,"), ("rti", "3 light positions")],
)
def test_an_array_is_exported(array, tmp_path, capsys, kind, lights):
    result = run(capsys, "export", array, "--format", kind, "-o", tmp_path / "x")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{tmp_path / 'x'}: 4 camera positions x {lights}")
    assert ("points" in result.out) == (kind != "rti")
    again = run(capsys, "export", array, "-f", kind, "-o", tmp_path / "x")
    assert again.code == 4 and "an earlier export is there" in again.err
    forced = run(capsys, "export", array, "-f", kind, "-o", tmp_path / "x", "--force", "-q")
    assert (forced.code, forced.out) == (0, "")
    assert names(tmp_path) == {"out", "x"}


def test_notes_are_printed(tmp_path, capsys):
    bare = write_array(plain_manifest(tmp_path / "out", layers=False)).directory
    result = run(capsys, "export", bare, "-f", "colmap", "-o", tmp_path / "x")
    assert result.code == 0
    assert result.err.splitlines()[-1].startswith("note: no points and no depth: the array was rendered without layers")


def misses(mesh: trimesh.Trimesh, points: np.ndarray, size: np.ndarray) -> float:
    """Return the share of points that are farther from the mesh than their own bound."""
    _, distance, _ = trimesh.proximity.closest_point_naive(mesh, points)
    return float(np.mean(distance > size))


def test_points_of_a_rendered_room_lie_on_its_surfaces(tmp_path, capsys):
    """Depth is a mean over hits anywhere in a pixel, so a point is off by less than the width of the pixel there.

    The pixel of an eye at distance d covers d / f / cos(alpha), alpha the angle to its axis; the bound takes the
    nearest of all eyes without the cosine, which makes it stricter.
    """
    job = write_job(tmp_path, camera={**WALK, "resolution": [96, 72]})
    assert run(capsys, "render", job, "-q").code == 0
    assert run(capsys, "export", tmp_path / "out", "-f", "nerfstudio", "-o", tmp_path / "x", "--points", 400).code == 0
    table = json.loads((tmp_path / "x/transforms.json").read_text())
    eyes = np.array([frame["transform_matrix"] for frame in table["frames"]])[:, :3, 3]
    points = np.array(trimesh.load(tmp_path / "x/points.ply").vertices)
    assert len(points) > 200
    mesh = trimesh.load(tmp_path / "tiny.glb").to_geometry()
    size = np.linalg.norm(points[:, None] - eyes, axis=-1).min(-1) / table["fl_x"]
    assert misses(mesh, points, size) <= 0.01  # edges whose depth bends little
    for wrong in ([-1, 1, 1], [1, -1, 1], [1, 1, -1], [1.1, 1.1, 1.1]):  # mirrored, or a tenth too far
        assert misses(mesh, (points - eyes[0]) * wrong + eyes[0], size) > 0.2


@pytest.mark.parametrize(
    "options",
    [
        ("assemble", "walk", "-o", "a.gif", "--view"),
        ("export", "-f", "colmap", "-o", "a", "--at"),
        ("export", "-f", "colmap", "-o", "a", "--cameras"),
        ("sheet", "-o", "a.png", "--side"),
        ("sheet", "-o", "a.png", "--at"),
    ],
)
def test_a_long_value_of_an_option_is_shortened(options, array, capsys):
    result = run(capsys, options[0], array, *options[1:], "1" * 5000)
    assert result.code == 2
    assert "111..." in result.err and len(result.err) < 1000


@pytest.mark.parametrize("key", ["groups.{}.intensity", "segments[0].axes.{}"])
def test_a_long_key_of_a_movie_path_is_shortened(key, array, tmp_path, capsys):
    name = "x" * 5000
    text = f"[[segments]]\nframes = 2\ncamera = [0, 1]\n{f'axes = {{ {name} = [0, 1] }}' if 'axes' in key else ''}\n"
    (tmp_path / "path.toml").write_text(text + (f"[groups.{name}]\nintensity = 2\n" if "groups" in key else ""))
    result = run(capsys, "assemble", array, tmp_path / "path.toml", "-o", tmp_path / "a.gif")
    assert result.code == 2
    assert "x" * 100 + "..." in result.err and len(result.err) < 1000


WAYS = "expected a path file, walk, light or diagonal, or --cameras and --light with places"


@pytest.fixture
def barred_array(tmp_path: Path) -> Path:
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
def test_movements(
    barred_array: Path, tmp_path: Path, capsys, options: list[str], printed: str, rate: Fraction
) -> None:
    result = run(capsys, "assemble", barred_array, *options, "-o", tmp_path / "m.mkv")
    assert (result.code, result.err) == (0, "")
    assert result.out.endswith(f"m.mkv: {printed}\n")
    movie = decoded(tmp_path / "m.mkv")
    assert (len(movie.frames), movie.rate) == (int(printed.split()[0]), rate)


def test_a_path_file_with_another_rate_and_blends(barred_array: Path, tmp_path: Path, capsys) -> None:
    path = path_file(tmp_path, "fps = 30\n[[segments]]\nseconds = 1\nlight = [0, 3]\n")
    result = run(capsys, "assemble", barred_array, path, "--fps", "12", "--blend", "-o", tmp_path / "m.webp", "-q")
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
        (["path.toml", "--light", ""], "--light: a path file says where camera and light are"),
        (["walk", "--seconds", "0"], "'--seconds': expected a number from 0.001 to 40000, got 0"),
        (["walk", "--fps", "0"], "'--fps': expected a number from 0.01 to 1000, got 0"),
    ],
)
def test_wrong_usage(barred_array: Path, tmp_path: Path, capsys, monkeypatch, options: list[str], message: str) -> None:
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
        (["--light", ""], "--light: expected places such as 5, 0-47, "),
        (["--light", "3", "--cameras", "2"], "--cameras: expected several places, such as 0-last or all, as nothing"),
        (["--cameras", "all", "--at", "lamp=2"], "--at: expected AXIS=PLACES with one of the axes light (0 to 3), got"),
        (["--light", "0-2", "--at", "light=1"], "--light: expected either this or --at light=..., got both\n"),
        (["walk", "--view", "filmic"], "--view: expected srgb, neutral, agx, aces or a view of ocio://default, as"),
    ],
)
def test_places_and_views_that_do_not_exist(
    barred_array: Path, tmp_path: Path, capsys, monkeypatch, options: list[str], message: str
) -> None:
    monkeypatch.delenv("OCIO", raising=False)
    result = run(capsys, "assemble", barred_array, *options, "-o", tmp_path / "m.mp4")
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith(message)
    assert result.err.endswith("1 problem; nothing was written.\n")
    assert names(tmp_path) == {"out"}


def test_a_movement_through_an_array_with_groups(tmp_path: Path, capsys) -> None:
    barred_array = grouped(tmp_path / "out").directory
    assert run(capsys, "assemble", barred_array, "light", "-o", tmp_path / "m.mov").code == 0
    assert len(decoded(tmp_path / "m.mov").frames) == 4
    result = run(capsys, "assemble", barred_array, "walk", "--at", "lamp=3", "-o", tmp_path / "n.mov")
    assert result.err.startswith("--at lamp: expected one of 3 positions of lamp (0 to 2, or -3 to -1), got 3\n")
