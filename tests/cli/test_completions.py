"""What completion offers, function by function; what cannot be read offers nothing."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support import handmade
from support.program import write_job

from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.errors import JobError
from framearray_cli.cli import completions
from framearray_cli.cli.completions import WORDS
from framearray_cli.cli.options import sum_options


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
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


def test_files_of_the_right_kind(folder: Path) -> None:
    assert completions.complete_scene("") == ["house.gltf", "list.gltf", "tiny.glb"]
    assert completions.complete_job("b") == ["broken.toml"]
    assert completions.complete_job("nowhere/") == []
    assert completions.complete_array("o") == ["out/lamps", "out/small"]
    assert completions.complete_array("out/s") == ["out/small"]


@pytest.mark.parametrize(
    ("word", "whole"), [("job.toml", ["0-23"]), ("out/small", ["0-2"]), ("broken.toml", []), ("odd.toml", [])]
)
def test_places_have_the_range_of_all_where_it_is_known(word: str, whole: list[str], folder: Path) -> None:
    assert completions.complete_places(typed("--quiet", word), "0") == whole
    assert completions.complete_places(typed(word), "l") == ["last"] == completions.complete_light_places("l")


@pytest.mark.parametrize(
    ("word", "axes"),
    [("out/small", ["light"]), ("job.toml", ["light"]), ("odd.toml", ["light"]), ("broken.toml", []), ("none", [])],
)
def test_axes_of_a_job_or_an_array(word: str, axes: list[str], folder: Path) -> None:
    assert completions.complete_axis(typed(word), "") == axes
    assert completions.complete_axis_places(typed(word), "") == [f"{axis}=" for axis in axes]
    assert completions.complete_axis_places(typed(word), "light=f") == ["light=first"]


def test_axes_of_groups(folder: Path) -> None:
    found = completions.complete_axis(typed("out/lamps"), "")
    assert len(found) > 1 and "light" in found


def test_groups_of_an_array(folder: Path) -> None:
    names = [group.name for group in read_manifest(folder / "out" / "lamps").groups]
    assert completions.complete_group(typed("out/lamps"), "") == names and len(names) > 1
    (folder / "groups.toml").write_text('groups = [3, {axis = "light"}]\n')
    for word in ("out/small", "groups.toml", "odd.toml", "none"):
        assert completions.complete_group(typed(word), "") == []


def test_cameras_of_a_scene(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
