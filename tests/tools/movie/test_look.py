"""The look of movies, and warnings of movies that would be useless."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import ROOT
from support.making import assemble_movie
from support.movies import barred, decoded, grouped, path_file, plain
from support.program import run

from framearray_cli.array.images import read_codes
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.views import find_view
from framearray_cli.tools.drawing import burn
from framearray_cli.tools.movie.look import Look, screen_codes, shot_label
from framearray_cli.tools.movie.timeline import Shot

GREYS = np.repeat(np.float32([0, 0.02, 0.18, 0.5, 1, 2, 4, 10, 100, 1000])[None, :, None], 3, axis=2)


def image(seed: int = 0) -> Any:
    return np.random.default_rng(seed).random((12, 16, 3), np.float32) * 1.5


def test_srgb_is_what_png_files_hold() -> None:
    np.testing.assert_array_equal(screen_codes(image(), Look(), ""), srgb8_from_linear(image()))
    assert screen_codes(GREYS, Look(), "", 16).dtype == np.uint16
    fine = screen_codes(image(), Look(), "", 16) / 257
    assert np.abs(fine - screen_codes(image(), Look(), "").astype(float)).max() < 0.55


@pytest.mark.parametrize("bits", [8, 16])
def test_exposure_doubles_radiance(bits: Any) -> None:
    np.testing.assert_array_equal(
        screen_codes(image(), Look(exposure=-1.0), "", bits), screen_codes(image() / 2, Look(), "", bits)
    )


def test_a_movie_shows_the_view(tmp_path: Path) -> None:
    plain(tmp_path / "out", 1, 1, picture=lambda c, l: np.full((16, 16, 3), 1.0, np.float32))
    path = path_file(tmp_path, "[[segments]]\nframes = 1\n")
    for name, low, high in (("aces", 175, 185), ("srgb", 253, 255)):
        assemble_movie(tmp_path / "out", path, tmp_path / f"{name}.mp4", look=Look(view=find_view(name)))
        assert low <= decoded(tmp_path / f"{name}.mp4").frames[0].mean() <= high


# labels


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_label_is_readable_and_only_in_its_corner(kind: Any) -> None:
    most = np.iinfo(kind).max
    grey = np.full((240, 320, 3), most // 2, kind)
    codes = burn(grey, "c 12  l 3")
    changed = np.argwhere((codes != grey).any(axis=2))
    assert changed[:, 0].min() > 240 * 0.85 and changed[:, 1].max() < 320 * 0.4
    corner = codes[-21:, :95]
    assert corner.max() > 0.95 * most and corner.min() < 0.2 * most  # white letters on a dark ground
    assert 0.03 < (corner[..., 0] > 0.6 * most).mean() < 0.5
    assert (grey == most // 2).all()


def test_labels_differ_and_fit_into_the_smallest_picture() -> None:
    grey = np.full((48, 96, 3), 100, np.uint8)
    texts = [f"c {c}  l {l}" for c in (0, 1, 12) for l in (0, 1, 3.25)]
    assert len({burn(grey, text).tobytes() for text in texts}) == len(texts)
    assert burn(np.zeros((4, 5, 3), np.uint8), "c 0  l 0").shape == (4, 5, 3)


def test_labels_say_the_place(tmp_path: Path) -> None:
    array, lamp = plain(tmp_path / "a", 2, 4), grouped(tmp_path / "b")
    assert shot_label(array, Shot(12, (3,))) == "c 12  l 3"
    assert shot_label(array, Shot(12, (3.256,))) == "c 12  l 3.26"
    assert shot_label(lamp, Shot(1, (3.0, 0.5))) == "c 1  light 3  lamp 0.5"


def test_every_frame_has_its_own_label(tmp_path: Path) -> None:
    picture = np.full((96, 192, 3), 0.2, np.float32)
    array = plain(tmp_path / "out", 3, 2, picture=lambda c, l: picture)
    path = path_file(tmp_path, "[[segments]]\nframes = 3\ncamera = [0, 2]\nlight = 1\n")
    assemble_movie(array.directory, path, tmp_path / "f.#.png", look=Look(label=True))
    assemble_movie(array.directory, path, tmp_path / "m.mov", look=Look(label=True))
    frames = decoded(tmp_path / "m.mov").frames
    for c in range(3):
        truth = [burn(srgb8_from_linear(picture), f"c {k}  l 1") for k in range(3)]
        np.testing.assert_array_equal(read_codes(tmp_path / f"f.{c}.png"), truth[c])
        apart = [np.abs(frames[c].astype(float) - label).mean() for label in truth]
        assert int(np.argmin(apart)) == c


SEGMENT = "[[segments]]\nseconds = 1\nlight = [0, -1]\n"
OFF = "\n".join(f"[groups.{name}]\nintensity = 0" for name in ("sun", "lamp", "background"))
RUINED = {
    "an intensity of 800": (
        "\n".join(f"[groups.{name}]\nintensity = 800" for name in ("sun", "lamp", "background")),
        "all frames are white: their pixels are clipped; --exposure -",
    ),
    "all groups off": (OFF, "all frames are black; check what the path does to the light"),
    "an intensity of 1e-5": (OFF.replace("= 0", "= 1e-5"), "all frames are black; --exposure 1"),
}


def warnings_of(array: Path, path: Path, target: Path, look: Look) -> list[str]:
    found: list[str] = []
    assemble_movie(array, path, target, look=look, warned=found.extend)
    return found


def test_a_view_of_clipped_images_is_warned_of(tmp_path):
    array = plain(tmp_path / "out", 2, 1, extension="png")
    path = path_file(tmp_path, "[[segments]]\nframes = 2\ncamera = [0, 1]\n")
    found = warnings_of(array.directory, path, tmp_path / "x.gif", Look(view=find_view("aces")))
    assert any("its images are PNG, clipped at 1 already, and --view aces" in text for text in found), found
    assert not [text for text in warnings_of(array.directory, path, tmp_path / "x.gif", Look()) if "--view" in text]


@pytest.mark.parametrize("name", RUINED)
def test_a_ruined_path_is_warned_of(name, tmp_path):
    text, *words = RUINED[name]
    grouped(tmp_path / "array")
    path = path_file(tmp_path, f"{SEGMENT}{text}\n")
    found = warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look())
    assert any(all(word in text for word in words) for text in found), found


@pytest.mark.parametrize(
    ("level", "exposure", "words"),
    [(40.0, 0, "all frames are white"), (0.2, 9, "white"), (1e-4, 0, "black"), (0.2, -12, "black")],
)
def test_pictures_that_a_screen_cannot_show(level, exposure, words, tmp_path):
    plain(tmp_path / "array", picture=lambda c, l: level * (barred(c, l) + 0.2))
    path = path_file(tmp_path, SEGMENT)
    found = warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look(exposure=exposure))
    assert len(found) == 1
    assert words in found[0]
    assert warnings_of(tmp_path / "array", path, tmp_path / "frame.####.exr", Look()) == []  # keeps all radiances


def test_good_movies_have_none(tmp_path):
    grouped(tmp_path / "array")
    keys = "{ time = 0, value = 0 }, { time = 0.5, value = 2 }, { time = '100%', value = 0 }"
    lit = f"{SEGMENT}[groups.sun]\nintensity = [{keys}]\n[groups.lamp]\ncolor = [1, 0.7, 0.4]\n"
    for text in (SEGMENT, lit):
        assert warnings_of(tmp_path / "array", path_file(tmp_path, text), tmp_path / "x.gif", Look()) == []


@pytest.mark.parametrize("name", ["easing", "first"])
def test_paths_of_the_project_have_none(name, tmp_path):
    plain(tmp_path / "array")
    assert warnings_of(tmp_path / "array", ROOT / "jobs" / f"{name}-movie.toml", tmp_path / "x.gif", Look()) == []


def test_a_white_object_before_a_black_background_is_meant(tmp_path):
    def thing(c: int, l: int) -> np.ndarray:
        image = np.zeros((48, 64, 3), np.float32)
        image[20:23, 30:32] = 0.5
        return image

    plain(tmp_path / "array", picture=thing)
    path = path_file(tmp_path, SEGMENT)
    assert warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look()) == []


def test_the_command_line(tmp_path, capsys):
    grouped(tmp_path / "array")
    path = path_file(tmp_path, f"{SEGMENT}{OFF}\n")
    arguments = ("assemble", tmp_path / "array", path, "-o", tmp_path / "x.gif")
    result = run(capsys, *arguments, "--strict")
    assert (result.code, result.out) == (2, "")
    assert result.err.splitlines() == [
        f"{path}: all frames are black; check what the path does to the light, and the pictures of the array",
        "1 problem; nothing was written.",
    ]
    assert not (tmp_path / "x.gif").exists()
    result = run(capsys, *arguments)
    assert result.code == 0
    assert result.err.startswith("warning: all frames are black; ")
    assert "warning" not in result.out
