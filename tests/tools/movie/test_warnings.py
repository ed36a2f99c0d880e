"""Ruined path files, and arrays whose movies would be black or white, are warned of; those of the project are not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from support import ROOT, movies
from support.program import run

from framearray_cli.base.errors import JobError
from framearray_cli.tools.display import find_view
from framearray_cli.tools.movie.assemble import assemble_movie
from framearray_cli.tools.movie.look import Look

SEGMENT = "[[segments]]\nseconds = 1\nlight = [0, -1]\n"
OFF = "\n".join(f"[groups.{name}]\nintensity = 0" for name in ("sun", "lamp", "background"))
RUINED = {
    "a colour of 255": ("[groups.lamp]\ncolor = [255, 214, 170]", "groups.lamp.color: a colour of 255", "divide"),
    "a colour of 255 at a key": (
        "[ambient]\ncolor = [{ time = 0, value = 1 }, { time = 1, value = 255 }]",
        "ambient.color: a",
    ),
    "a key at 100 s of a movie of 1 s": (
        "[groups.sun]\nintensity = [{ time = 0, value = 1 }, { time = 100, value = 0 }]",
        "groups.sun.intensity[1].time: 100 s is after the end of the movie, 1 s",
    ),
    "milliseconds": (
        "[groups.sun]\ncolor = [{ time = 0, value = 1 }, { time = 500, value = 0.5 }]",
        "groups.sun.color[1].time: 500 s is after the end",
    ),
    "an ambient key too late": (
        "[ambient]\nintensity = [{ time = 2, value = 1 }]",
        "ambient.intensity[0].time: 2 s is after the end",
    ),
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
    array = movies.plain(tmp_path / "out", 2, 1, extension="png")
    path = tmp_path / "path.toml"
    path.write_text("[[segments]]\nframes = 2\ncamera = [0, 1]\n")
    found = warnings_of(array.directory, path, tmp_path / "x.gif", Look(view=find_view("aces")))
    assert any("its images are PNG, clipped at 1 already, and --view aces" in text for text in found), found
    assert not [text for text in warnings_of(array.directory, path, tmp_path / "x.gif", Look()) if "--view" in text]


@pytest.mark.parametrize("name", RUINED)
def test_a_ruined_path_is_warned_of(name, tmp_path):
    text, *words = RUINED[name]
    movies.grouped(tmp_path / "array")
    path = tmp_path / "path.toml"
    path.write_text(f"{SEGMENT}{text}\n")
    found = warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look())
    assert any(all(word in text for word in words) for text in found), found


@pytest.mark.parametrize(
    ("level", "exposure", "words"),
    [(40.0, 0, "all frames are white"), (0.2, 9, "white"), (1e-4, 0, "black"), (0.2, -12, "black")],
)
def test_pictures_that_a_screen_cannot_show(level, exposure, words, tmp_path):
    movies.plain(tmp_path / "array", picture=lambda c, l: level * (movies.barred(c, l) + 0.2))
    path = tmp_path / "path.toml"
    path.write_text(SEGMENT)
    found = warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look(exposure=exposure))
    assert len(found) == 1
    assert words in found[0]
    assert warnings_of(tmp_path / "array", path, tmp_path / "frame.####.exr", Look()) == []  # keeps all radiances


def test_good_movies_have_none(tmp_path):
    movies.grouped(tmp_path / "array")
    sun = (
        "[groups.sun]\nintensity = [{ time = 0, value = 0 }, { time = 0.5, value = 2 }, { time = '100%', value = 0 }]\n"
    )
    for name, text in (("first", SEGMENT), ("second", f"{SEGMENT}{sun}[groups.lamp]\ncolor = [1, 0.7, 0.4]\n")):
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        assert warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look()) == []


@pytest.mark.parametrize("name", ["easing", "first"])
def test_paths_of_the_project_have_none(name, tmp_path):
    movies.plain(tmp_path / "array")
    assert warnings_of(tmp_path / "array", ROOT / "jobs" / f"{name}-movie.toml", tmp_path / "x.gif", Look()) == []


def test_a_white_object_before_a_black_background_is_meant(tmp_path):
    def thing(c: int, l: int) -> np.ndarray:
        image = np.zeros((48, 64, 3), np.float32)
        image[20:23, 30:32] = 0.5
        return image

    movies.plain(tmp_path / "array", picture=thing)
    path = tmp_path / "path.toml"
    path.write_text(SEGMENT)
    assert warnings_of(tmp_path / "array", path, tmp_path / "x.gif", Look()) == []


def test_warned_may_refuse(tmp_path):
    movies.grouped(tmp_path / "array")
    path = tmp_path / "path.toml"
    path.write_text(f"{SEGMENT}{OFF}\n")

    def refuse(warnings: Sequence[str]) -> None:
        raise JobError(path, warnings)

    with pytest.raises(JobError):
        assemble_movie(tmp_path / "array", path, tmp_path / "x.gif", warned=refuse)
    assert not (tmp_path / "x.gif").exists()


def test_the_command_line(tmp_path, capsys):
    movies.grouped(tmp_path / "array")
    path = tmp_path / "path.toml"
    path.write_text(f"{SEGMENT}{OFF}\n")
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
