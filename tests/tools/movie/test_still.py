"""Stills: one picture of one place; and moments as places of light."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.making import assemble_movie
from support.movies import DARK, plain
from support.program import names, run

from framearray_cli.array.images import read_codes, read_image, resized
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.tools.axes import given_places
from framearray_cli.tools.drawing import burn
from framearray_cli.tools.movie.look import Look, shot_text
from framearray_cli.tools.movie.pathfile import Sweep
from framearray_cli.tools.movie.timeline import Shot

DAYS = "2026-03-20 08:00 to 09:30; 2026-06-21 08:00 to 09:30"


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return plain(tmp_path / "out")


@pytest.fixture
def sunny(tmp_path: Path) -> Manifest:
    """An array of two days with four positions each, half an hour apart."""
    times = [
        f"2026-{day}T0{clock}:00+01:00" for day in ("03-20", "06-21") for clock in ("8:00", "8:30", "9:00", "9:30")
    ]
    sun = {"type": "directional", "direction": [0.0, -1.0, 0.0], "irradiance": [3.0] * 3}
    lights = tuple(replace(DARK, sources=({**sun, "time": time},)) for time in times)
    manifest = replace(plain(tmp_path / "sunny", 2, len(times)), name="study", lights=lights)
    write_manifest(manifest.directory, manifest)
    return manifest


def still(array: Manifest, target: Path, look: Look | None = None, **places: Any) -> Any:
    return assemble_movie(array.directory, Sweep(still=True, **places), target, look=look or Look())


def test_an_unchanged_still_is_a_copy_that_may_be_edited(array: Manifest, tmp_path: Path) -> None:
    made = still(array, tmp_path / "a.exr", cameras="2", light="last")
    own = image_path(array, 2, array.n_lights - 1)
    assert (made.path, made.frames, made.size) == (str(tmp_path / "a.exr"), 1, array.resolution)
    assert (tmp_path / "a.exr").read_bytes() == own.read_bytes()
    assert (tmp_path / "a.exr").stat().st_ino != own.stat().st_ino
    assert names(tmp_path) == {"out", "a.exr"}


@pytest.mark.parametrize("name", ["a.exr", "a.tif", "a.png", "a.jpg"])
def test_a_still_has_the_size_that_is_given(array: Manifest, tmp_path: Path, name: str) -> None:
    width, height = array.resolution
    made = still(array, tmp_path / name, Look(size=(3 * width, 3 * height), label=name[-3:] in ("png", "jpg")))
    read = read_image if name[-3:] in ("exr", "tif") else read_codes
    assert made.size == (3 * width, 3 * height)
    assert read(tmp_path / name).shape == (3 * height, 3 * width, 3)


def test_resizing_keeps_constants_and_means_and_makes_no_rings() -> None:
    lamp = np.zeros((16, 24, 3), np.float32)
    lamp[8, 12] = 1000.0
    for size in ((48, 32), (12, 8)):
        found = resized(lamp, size)
        assert found.shape == (size[1], size[0], 3) and found.min() >= 0
        assert found.mean() == pytest.approx(lamp.mean(), rel=0.01)
        np.testing.assert_allclose(resized(np.full((16, 24), 0.5, np.float32), size), 0.5, rtol=1e-5)


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["-o", "a.png", "--camera", "0-2"], 2, "--camera: expected one place, as a still is one picture, got 3"),
        (["-o", "a.png", "--light", "all"], 2, "--light: expected one place"),
        (["-o", "a.png", "--size", "100"], 2, '--size: expected WxH such as 1920x1080, at most 16384 each, got "100"'),
        (["-o", "a.png", "--size", "20000x10"], 2, "--size: expected WxH"),
        (["-o", "a.png", "--size", "300x50"], 2, "--size: expected the shape of the images"),
        (["-o", "a.mp4"], 4, "a.mp4: expected .exr, .png, .tif, .jpg"),
        (["-o", "a.exr", "--exposure", "1"], 4, "exposure changes only movies, PNG and JPEG"),
        (["-o", "a.#.png"], 4, 'a.#.png: expected a name without "#"'),
        (["-o", "a.exr", "--layers", "--size", "10x10"], 2, "identifiers and depths cannot be resized"),
        (["-o", "out/a.png"], 4, "holds the frame array itself"),
        (
            ["-o", "a.png", "--text", "{lamp}"],
            2,
            "--text: expected text with the fields {name}, {camera}, {light}, got",
        ),
        (["-o", "a.png", "--light", "2026-06-21T12:00"], 2, "this axis has no sun with date and time"),
    ],
)
def test_no_still(
    array: Manifest,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(capsys, "still", "out", *options)
    assert (result.code, message in result.err) == (code, True), result.err
    assert names(tmp_path) == {"out"}


def test_an_earlier_still_is_replaced_only_by_force(
    array: Manifest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "a.png"
    assert run(capsys, "still", array.directory, "-o", target, "--text", "one").code == 0
    before = target.read_bytes()
    assert run(capsys, "still", array.directory, "-o", target).code == 4
    assert target.read_bytes() == before
    assert run(capsys, "still", array.directory, "-o", target, "--force", "-q").code == 0
    assert target.read_bytes() != before


def test_a_movie_of_one_frame_points_to_stills(
    array: Manifest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = run(capsys, "assemble", array.directory, "walk", "--cameras", "1", "-o", tmp_path / "a.gif")
    assert (result.code, "note: " in result.err, "framearray still" in result.err) == (0, True, True)


@pytest.mark.parametrize(
    ("text", "places", "notes"),
    [
        ("2026-06-21T08:30", "5", 0),
        ("2026-06-21T08:40", "5", 1),
        ("2026-03-20T10:20", "3", 1),
        ("2026-03-20T08:00-2026-03-20T09:00", "0-2", 0),
        ("0,2026-06-21T09:30", "0,7", 0),
    ],
)
def test_moments_are_the_nearest_positions(sunny: Manifest, text: str, places: str, notes: int) -> None:
    said: list[str] = []
    assert given_places(sunny, text, (), said.append) == {"light": ("--light", places)}
    assert given_places(sunny, None, [f"light={text}"]) == {"light": ("--at light", places)}
    assert len(said) == notes


@pytest.mark.parametrize("text", ["2026-06-21T12:00", "2026-06-22T08:00", "2026-13-41T08:00", "2025-06-21T08:00"])
def test_a_moment_that_is_not_there(sunny: Manifest, text: str) -> None:
    with pytest.raises(JobError) as caught:
        given_places(sunny, text, ())
    assert str(caught.value) == f'--light: expected a moment within {DAYS}, got "{text}"'


def test_the_note_has_the_true_time(sunny: Manifest, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, "still", sunny.directory, "--light", "2026-06-21T08:40", "-o", tmp_path / "a.png")
    note = "note: --light: the light position nearest to 2026-06-21T08:40 is 5, of 2026-06-21 08:30\n"
    assert (result.code, result.err) == (0, note)


def test_texts_have_fields_of_the_place(sunny: Manifest) -> None:
    shot = Shot(1, (5,))
    assert shot_text(sunny, shot, "") == "c 1  l 5  2026-06-21 08:30"
    assert shot_text(sunny, shot, "{name} {camera:03d} {light} {date} {time}") == "study 001 5 2026-06-21 08:30"
    assert shot_text(sunny, shot, "{date:%d.%m.%Y}, {time:%Hh}, {{}}") == "21.06.2026, 08h, {}"
    for wrong in ("{azimuth}", "{camera.real}", "{camera!r}", "{camera", "{camera:q}", "{}"):
        with pytest.raises(JobError, match="--text: expected text with the fields "):
            shot_text(sunny, shot, wrong)


def test_a_still_lies_outside_of_the_array(array: Manifest) -> None:
    with pytest.raises(OutputError, match="holds the frame array itself"):
        still(array, array.directory / "a.exr")


def test_long_text_is_smaller_and_whole() -> None:
    ground = np.full((180, 320, 3), 200, np.uint8)
    found = burn(ground, "x" * 50)
    drawn = np.nonzero((found != ground).any(axis=(0, 2)))[0]
    assert 250 < drawn.max() < 319
    assert found.max() > 200 and burn(ground, "short").max() > 200
