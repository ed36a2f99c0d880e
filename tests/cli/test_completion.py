"""Completion of the command line: through the protocol of the shells' scripts, and function by function."""

import json
import shlex
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support import handmade
from support.program import run, start, write_job

from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.errors import JobError
from framearray_cli.cli import completions
from framearray_cli.cli.completions import WORDS
from framearray_cli.cli.options import sum_options

SHELLS = ("bash", "zsh", "fish")


def answer(shell: str, line: str, folder: Path) -> str:
    """Return what the program tells the script of a shell at the end of a line."""
    words = [*shlex.split(line), *([""] if line.endswith(" ") else [])]
    variables = {"_FRAMEARRAY_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line}
    variables |= {"COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)}
    variables |= {"_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in variables.items():
            patch.setenv(name, value)
        out, err = start(cwd=folder).communicate(timeout=60)
    assert err == ""
    return out


def offered(shell: str, line: str, folder: Path) -> list[str]:
    """Return what a shell would offer at the end of a line."""
    out = answer(shell, line, folder)
    if shell == "zsh":  # _arguments '*: :(("--threads":"Threads" ...))'
        return [one.strip('"').split('":"')[0] for one in out[out.find("((") + 2 : out.rfind("))")].split("\n")]
    return [one.split("\t")[0] for one in out.splitlines() if one]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a job, two arrays and a scene with cameras."""
    place = tmp_path_factory.mktemp("completion")
    write_job(place, camera={"frames": 24})
    handmade.plain(place / "out" / "small", n_c=3, n_l=2)
    handmade.grouped(place / "out" / "lamps")
    (place / "notes.txt").write_text("")
    tree = {"nodes": [{"camera": 0, "name": "Shot"}, {"camera": 0}, {}], "cameras": [{"name": "Lens"}]}
    text = json.dumps(tree).encode()
    (place / "house.glb").write_bytes(struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0) + text)
    return place


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_gets_commands_and_options(shell, folder):
    assert offered(shell, "framearray re", folder) == ["render", "report"]
    assert offered(shell, "framearray render --res", folder) == ["--restart"]


def test_descriptions_are_whole(folder):
    """As the list of commands has them: typer would cut the first line of the help."""
    assert "render\tRender a job into a frame array." in answer("fish", "framearray re", folder)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "framearray export out/small --format ",
            ["nerfstudio", "colmap", "cinema", "rti", "blender", "olat", "webdataset", "huggingface"],
        ),
        ("framearray export out/small --image-format t", ["tif"]),
        ("framearray schema ", ["job", "path", "manifest", "results"]),
        ("framearray check ", ["job.toml"]),
        ("framearray check j", ["job.toml"]),
        ("framearray init ", ["house.glb", "tiny.glb"]),
        ("framearray init house.glb --camera ", ["Shot", "Lens"]),
        ("framearray verify o", ["out/lamps", "out/small"]),
        ("framearray verify out/s", ["out/small"]),
        ("framearray render job.toml --cameras ", ["all", "first", "last", "50%", "0-23"]),
        ("framearray export out/small -f colmap --cameras 0", ["0-2"]),
        ("framearray sheet out/lamps --side ", ["light", "lamps"]),
        ("framearray sheet out/lamps --at la", ["lamps="]),
        ("framearray sheet out/lamps --at lamps=l", ["lamps=last"]),
        ("framearray check job.toml --set camera.fo", ["camera.fov="]),
        ("framearray sheet nothing --side ", []),
        ("framearray init notes.txt --camera ", []),
    ],
)
def test_words_fit_the_place(line, words, folder):
    assert offered("bash", line, folder) == words


def test_broken_files_offer_nothing(tmp_path):
    (tmp_path / "job.toml").write_bytes(b"camera = [\xff")
    (tmp_path / "a.glb").write_bytes(b"glTF\x00")
    (tmp_path / "b.gltf").write_text('{"nodes": 3}')
    assert offered("bash", "framearray sheet job.toml --side ", tmp_path) == []
    for scene in ("a.glb", "b.gltf"):
        assert offered("bash", f"framearray init {scene} --camera ", tmp_path) == []


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_of_a_shell_asks_the_program(shell, capsys, monkeypatch):
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "")
    monkeypatch.setenv("_FRAMEARRAY_COMPLETE", f"source_{shell}")
    result = run(capsys)
    assert result.code == 0
    assert f"_FRAMEARRAY_COMPLETE=complete_{shell}" in result.out


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path, camera={"frames": 24})
    handmade.plain(tmp_path / "out" / "small", n_c=3, n_l=2)
    handmade.grouped(tmp_path / "out" / "lamps")
    (tmp_path / "broken.toml").write_text("[camera\n")
    (tmp_path / "odd.toml").write_text('axes = 3\n[camera]\nframes = "many"\n[light]\nsources = 5\n')
    tree = {"nodes": [{"camera": 0, "name": "Shot"}, {"camera": 0}, {}], "cameras": [{"name": "Lens"}]}
    (tmp_path / "house.gltf").write_text(json.dumps(tree))
    (tmp_path / "list.gltf").write_text("[1, 2]")
    (tmp_path / ".hidden.glb").write_text("")
    return tmp_path


def typed(*words: str) -> Any:
    """A context that has these words before the one to complete."""
    return SimpleNamespace(meta={WORDS: words})


def test_files_of_the_right_kind(place: Path) -> None:
    assert completions.complete_scene("") == ["house.gltf", "list.gltf", "tiny.glb"]
    assert completions.complete_job("b") == ["broken.toml"]
    assert completions.complete_job("nowhere/") == []
    assert completions.complete_array("o") == ["out/lamps", "out/small"]
    assert completions.complete_array("out/s") == ["out/small"]


@pytest.mark.parametrize(
    ("word", "whole"), [("job.toml", ["0-23"]), ("out/small", ["0-2"]), ("broken.toml", []), ("odd.toml", [])]
)
def test_places_have_the_range_of_all_where_it_is_known(word: str, whole: list[str], place: Path) -> None:
    assert completions.complete_places(typed("--quiet", word), "0") == whole
    assert completions.complete_places(typed(word), "l") == ["last"] == completions.complete_light_places("l")


@pytest.mark.parametrize(
    ("word", "axes"),
    [("out/small", ["light"]), ("job.toml", ["light"]), ("odd.toml", ["light"]), ("broken.toml", []), ("none", [])],
)
def test_axes_of_a_job_or_an_array(word: str, axes: list[str], place: Path) -> None:
    assert completions.complete_axis(typed(word), "") == axes
    assert completions.complete_axis_places(typed(word), "") == [f"{axis}=" for axis in axes]
    assert completions.complete_axis_places(typed(word), "light=f") == ["light=first"]


def test_axes_of_groups(place: Path) -> None:
    found = completions.complete_axis(typed("out/lamps"), "")
    assert len(found) > 1 and "light" in found


def test_groups_of_an_array(place: Path) -> None:
    names = [group.name for group in read_manifest(place / "out" / "lamps").groups]
    assert completions.complete_group(typed("out/lamps"), "") == names and len(names) > 1
    (place / "groups.toml").write_text('groups = [3, {axis = "light"}]\n')
    for word in ("out/small", "groups.toml", "odd.toml", "none"):
        assert completions.complete_group(typed(word), "") == []


def test_cameras_of_a_scene(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert completions.complete_camera(typed("house.gltf"), "") == ["Shot", "Lens"]
    assert completions.complete_camera(typed("house.gltf"), "L") == ["Lens"]
    assert completions.complete_camera(typed("list.gltf", "none.glb", "job.toml"), "") == []
    monkeypatch.setattr(completions, "LARGEST_FILE", 10)
    assert completions.complete_camera(typed("house.gltf"), "") == []


def test_keys_of_a_job() -> None:
    assert completions.complete_key("samples.h") == ["samples.hits=", "samples.halves="]
    assert completions.complete_key("light.sources") == ["light.sources="]


@pytest.mark.parametrize(
    ("text", "moves", "turn"),
    [("30", False, (30.0, 30.0)), ("0-360", True, (0.0, 360.0)), (" -5.5 ", True, (-5.5, -5.5))],
)
def test_a_rotation(text: str, moves: bool, turn: tuple[float, float]) -> None:
    assert sum_options(Path("sky.exr"), text, None, None, moves=moves).rotate == turn


@pytest.mark.parametrize(
    ("text", "moves", "message"),
    [
        ("0-360", False, "expected degrees such as 30, got"),
        ("east", True, "or 0-360, got"),
        ("999999", False, "at most"),
    ],
)
def test_a_rotation_that_is_none(text: str, moves: bool, message: str) -> None:
    with pytest.raises(JobError, match=message):
        sum_options(Path("sky.exr"), text, None, None, moves=moves)


def test_a_rotation_needs_a_map() -> None:
    with pytest.raises(JobError, match="expected --environment next to it"):
        sum_options(None, "30", None, None)
