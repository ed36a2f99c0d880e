"""A missing library, encoder or typeface: a message before any work."""

import json
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import PIL.Image
import PIL.ImageFont
import pytest
from packaging.requirements import Requirement
from support import ROOT
from support.program import names, run, write_job

from framearray_cli.base import platform
from framearray_cli.base.errors import MissingExtraError
from framearray_cli.engine.embree import library as embree_library
from framearray_cli.tools import drawing as label
from framearray_cli.tools.movie import video

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


# Runs several commands without some libraries, and writes the exit code and the errors of each as a line of JSON.
SEVERAL = """
import contextlib, io, json
for arguments in json.loads(sys.argv[2]):
    errors = io.StringIO()
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
            main(arguments)
        code = 0
    except SystemExit as end:
        code = end.code or 0
    print(json.dumps([code, errors.getvalue()]))
"""


@pytest.fixture
def array(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert run(capsys, "render", "-q", write_job(tmp_path, output={"format": "exr"})).code == 0
    return tmp_path / "out"


def hiding(library: str, *arguments: str | Path, script: str = HIDING) -> subprocess.CompletedProcess[str]:
    """Run a command without a library."""
    command = platform.python_command(script, [library, *map(str, arguments)])
    return subprocess.run(command, env=platform.python_environment(), capture_output=True, text=True, timeout=300)


def test_without_embree_all_works_that_traces_no_rays(array, tmp_path):
    """As on Linux on ARM, for which embreex has no wheels; and with one message where rays are needed."""
    job, scene = tmp_path / "job.toml", tmp_path / "tiny.glb"
    works = [
        ["--help"], ["render", "--help"], ["--version"], ["schema"], ["verify", array],
        ["sheet", array, "-o", tmp_path / "sheet.png"], ["view", array, "--export", tmp_path / "page"],
        ["assemble", array, "light", "-o", tmp_path / "a.webp"],
        ["export", array, "-f", "nerfstudio", "-o", tmp_path / "nerf"],
    ]  # fmt: skip
    fails = [["render", job], ["check", job], ["init", scene, "-o", tmp_path / "new.toml"], ["report", job]]
    commands = json.dumps([[str(one) for one in command] for command in [*works, *fails, ["doctor"]]])
    done = hiding("embreex", commands, script=HIDING.replace("main(sys.argv[2:])", SEVERAL))
    assert done.returncode == 0, done
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert [code for code, _ in results] == [0] * len(works) + [2] * len(fails) + [5], results
    for _, errors in results[len(works) : -1]:
        assert errors.startswith("rendering needs embreex") and errors.count("\n") == 1
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.parametrize("name", ["gone.glb", "scene.xcf"])
def test_a_scene_that_cannot_be_is_found_before_libraries_are_loaded(tmp_path: Path, name: str) -> None:
    """They need two thirds of a second of processor time."""
    job = write_job(tmp_path, scene={"file": name})
    (tmp_path / "scene.xcf").touch()
    done = hiding("numpy,numba,embreex", "render", job)
    assert done.returncode == 3 and ("no such scene" in done.stderr or "of a known format" in done.stderr), done


@pytest.mark.parametrize(
    ("system", "machine", "libc", "wheels"),
    [
        ("linux", "x86_64", "glibc", True),
        ("linux", "x86_64", "", False),
        ("linux", "aarch64", "glibc", False),
        ("darwin", "arm64", "", True),
        ("win32", "AMD64", "", True),
        ("win32", "ARM64", "", False),
    ],
)
def test_systems_that_embreex_has_wheels_for(system, machine, libc, wheels, monkeypatch):
    """pyproject.toml says the same, except of the C library, of which markers know nothing."""
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(platform.platform, "machine", lambda: machine)
    monkeypatch.setattr(platform.platform, "libc_ver", lambda: (libc, ""))
    assert platform.has_wheels_of_embree() is wheels
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (need,) = (Requirement(line) for line in project["dependencies"] if line.startswith("embreex"))
    names = {"sys_platform": system, "platform_machine": machine}
    assert need.marker.evaluate(names) is wheels or (system, machine) == ("linux", "x86_64")
    monkeypatch.setattr(embree_library, "find_spec", lambda name: None)
    if not wheels:
        with pytest.raises(MissingExtraError, match=f"none for this system, .* on {machine}; render on one of those"):
            embree_library.require_embree()


@pytest.mark.slow
def test_libraries_that_are_not_installed(array, tmp_path):
    """Every extra where a command needs it, and the library that images need."""
    plain = write_job(tmp_path, "plain.toml", output={"directory": "other"})
    cases = [
        ("av", ["assemble", array, "walk", "-o", tmp_path / "a.mp4"], "[movie]"),
        ("av", ["view", array, "--export", tmp_path / "page", "--most", "300MB"], "[movie]"),
        ("matplotlib,jinja2", ["report", plain], "[report]"),
        ("OpenImageIO", ["render", "-q", plain], "pip install OpenImageIO"),
        ("OpenImageIO", ["verify", array], ""),
    ]
    before = names(tmp_path)
    for library, command, advice in cases:
        done = hiding(library, *command)
        assert done.returncode == (2 if advice else 0), done
        assert advice in done.stderr and done.stderr.count("\n") == bool(advice), done
    assert names(tmp_path) - {"other"} == before
    assert not list((tmp_path / "other").glob("tiny.*"))


@pytest.mark.slow
def test_an_export_without_pyav_has_single_pictures_and_says_so(array, tmp_path):
    done = hiding("av", "view", array, "--export", tmp_path / "page")
    assert done.returncode == 0, done
    assert "note: every picture is a JPEG; with PyAV " in done.stderr and "[movie]" in done.stderr
    assert "clips" not in (tmp_path / "page" / "data.js").read_text(encoding="utf-8")
    assert list((array / ".view").rglob("c0000.l000.jpg")) and not list(tmp_path.rglob("*.clip"))


@pytest.mark.parametrize(("suffix", "change"), [(".mp4", {"codec": "none"}), (".mov", {"format": "none"})])
def test_an_encoder_that_is_missing(suffix, change, array, tmp_path, monkeypatch, capsys):
    pytest.importorskip("av")
    (array / "tiny.c0000.l000.exr").unlink()  # not even searched
    monkeypatch.setitem(video.VIDEOS, suffix, replace(video.VIDEOS[suffix], **change))
    result = run(capsys, "assemble", array, "light", "-o", tmp_path / f"a{suffix}")
    assert result.code == 2
    assert result.err.startswith(f"{suffix}: PyAV is built without {video.VIDEOS[suffix].codec} here; ")
    assert suffix == ".mov" or result.err.endswith(".mkv, .webm, .mov can be made here\n")
    assert not list(tmp_path.glob("*a.*"))


def test_a_typeface_that_is_missing(array, tmp_path, monkeypatch, capsys):
    def without(_: object) -> None:
        raise ImportError("The _imagingft C module is not installed")

    monkeypatch.setattr(PIL.ImageFont, "load_default", without)
    label.typeface.cache_clear()
    label._letters.cache_clear()
    for command in (
        ["sheet", array, "-o", tmp_path / "a.png"],
        ["assemble", array, "light", "--label", "-o", tmp_path / "a.mp4"],
        ["assemble", array, "light", "--label", "-o", tmp_path / "a.##.png"],
    ):
        result = run(capsys, *command)
        assert result.code == 2
        assert result.err.startswith("labels need Pillow with FreeType (")
    assert not list(tmp_path.glob("*a*.png"))
    assert run(capsys, "sheet", array, "-o", tmp_path / "a.exr").code == 0, "it has no labels"
    label.typeface.cache_clear()


def test_an_animation_that_pillow_was_built_without(array, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "PIL._webp", None)
    result = run(capsys, "assemble", array, "light", "-o", tmp_path / "a.webp")
    assert (result.code, result.err.count("\n")) == (2, 1), result
    assert result.err.startswith("Pillow is built without WebP here; ")
