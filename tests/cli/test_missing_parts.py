"""A missing library, encoder or typeface: a message before any work."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import PIL.Image
import PIL.ImageFont
import pytest
from support.program import PACKAGE_PARENT, names, run, write_job

from framearray_cli.array.images import exr as exrtiff
from framearray_cli.tools.movie import label, video

# Runs the command line with some libraries hidden.
HIDING = """
import sys
import importlib.util as util
hidden = sys.argv[1].split(",")
class Hide:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in hidden:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
found = util.find_spec
util.find_spec = lambda name, package=None: None if name in hidden else found(name, package)
sys.meta_path.insert(0, Hide())
from framearray_cli.cli.main import main
main(sys.argv[2:])
"""


@pytest.fixture
def array(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert run(capsys, "render", "-q", write_job(tmp_path, output={"format": "exr"})).code == 0
    return tmp_path / "out"


def hiding(library: str, *arguments: str | Path) -> tuple[int, str]:
    """Run a command without a library; return exit code and errors."""
    environment = os.environ | {"PYTHONPATH": str(PACKAGE_PARENT)}
    command = [sys.executable, "-c", HIDING, library, *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    return done.returncode, done.stderr


@pytest.mark.slow
def test_libraries_that_are_not_installed(array, tmp_path):
    """Every extra where a command needs it, and the library that images need."""
    sun = {"type": "sun", "date": "2026-06-21", "start": "06:00", "stop": "20:00", "irradiance": 3.0}
    place = {"latitude": 52.52, "longitude": 13.405, "timezone": "Europe/Berlin"}
    sunny = write_job(tmp_path, "sun.toml", light={"frames": 2, "sources": [sun | place | {"almanac": "pvlib"}]})
    smooth = write_job(tmp_path, "smooth.toml", denoise={"obscurance": True}, output={"directory": "other"})
    plain = write_job(tmp_path, "plain.toml", output={"directory": "other"})
    cases = [
        ("av", ["assemble", array, "--walk", "-o", tmp_path / "a.mp4"], "[movie]"),
        ("pvlib", ["render", sunny], "[sun]"),
        ("pyoidn", ["render", smooth], "[denoise]"),
        ("matplotlib,jinja2", ["report", plain], "[report]"),
        ("flip_evaluator", ["report", plain], "[report]"),
        ("OpenImageIO", ["render", "-q", plain], "pip install OpenImageIO"),
        ("OpenImageIO", ["verify", array], ""),
    ]
    before = names(tmp_path)
    for library, command, advice in cases:
        code, errors = hiding(library, *command)
        assert code == (2 if advice else 0), (library, errors)
        assert advice in errors and errors.count("\n") == bool(advice), (library, errors)
    assert names(tmp_path) - {"other"} == before
    assert not list((tmp_path / "other").glob("tiny.*"))


@pytest.mark.parametrize(("suffix", "change"), [(".mp4", {"codec": "none"}), (".mov", {"format": "none"})])
def test_an_encoder_that_is_missing(suffix, change, array, tmp_path, monkeypatch, capsys):
    pytest.importorskip("av")
    (array / "tiny.c0000.l000.exr").unlink()  # not even searched
    monkeypatch.setitem(video.VIDEOS, suffix, replace(video.VIDEOS[suffix], **change))
    result = run(capsys, "assemble", array, "--light", "-o", tmp_path / f"a{suffix}")
    assert result.code == 2
    assert result.err.startswith(f"{suffix}: PyAV is built without {video.VIDEOS[suffix].codec} here; ")
    assert (
        result.err.endswith(f"{'.mkv' if suffix == '.mov' else '.mkv, .webm, .mov'} can be made here\n")
        or suffix == ".mov"
    )
    assert not list(tmp_path.glob("*a.*"))


def test_a_typeface_that_is_missing(array, tmp_path, monkeypatch, capsys):
    def without(_: object) -> None:
        raise ImportError("The _imagingft C module is not installed")

    monkeypatch.setattr(PIL.ImageFont, "load_default", without)
    label.typeface.cache_clear()
    label._letters.cache_clear()
    for command in (
        ["sheet", array, "-o", tmp_path / "a.png"],
        ["assemble", array, "--light", "--label", "-o", tmp_path / "a.mp4"],
        ["assemble", array, "--light", "--label", "-o", tmp_path / "a.##.png"],
    ):
        result = run(capsys, *command)
        assert result.code == 2
        assert result.err.startswith("labels need Pillow with FreeType (")
    assert not list(tmp_path.glob("*a*.png"))
    assert run(capsys, "sheet", array, "-o", tmp_path / "a.exr").code == 0, "it has no labels"
    label.typeface.cache_clear()


def test_formats_that_a_library_was_built_without(array, tmp_path, monkeypatch, capsys):
    monkeypatch.delattr(PIL.Image.core, "jpeg_encoder")
    monkeypatch.setitem(sys.modules, "PIL._webp", None)
    job = write_job(tmp_path, "jpg.toml", output={"format": "jpg", "directory": "other"})
    for command, start in (
        (["render", "-q", job], "Pillow is built without JPG here; "),
        (["sheet", array, "-o", tmp_path / "a.jpg"], "Pillow is built without JPG here; "),
        (["assemble", array, "--light", "-o", tmp_path / "a.##.jpg"], "Pillow is built without JPG here; "),
        (["assemble", array, "--light", "-o", tmp_path / "a.webp"], "Pillow is built without WebP here; "),
        (
            ["export", array, "-f", "cinema", "--image-format", "jpg", "-o", tmp_path / "a"],
            "Pillow is built without JPG",
        ),
        (["view", array, "--export", tmp_path / "a"], "Pillow is built without JPG here; "),
    ):
        result = run(capsys, *command)
        assert (result.code, result.err.count("\n")) == (2, 1), result
        assert result.err.startswith(start)
    assert not list((tmp_path / "other").glob("tiny.*"))


def test_an_image_library_without_a_format(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(exrtiff.OIIO_NAMES, "exr", "none")
    result = run(capsys, "render", "-q", write_job(tmp_path, output={"format": "png"}))
    assert result.code == 2, "layers are EXR"
    assert result.err.startswith("OpenImageIO is built without EXR here; ")
    assert not list((tmp_path / "out").glob("tiny.*"))
    assert run(capsys, "render", "-q", write_job(tmp_path, output={"format": "png", "layers": False})).code == 0
