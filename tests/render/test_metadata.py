"""Values of a job that change no pixel never force a new render: the manifest takes them over."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from support import tiny
from support.handed import contents

from framearray_cli.array.folder import ArrayFolder
from framearray_cli.array.images import read_image
from framearray_cli.array.integrity import verify
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import record_files
from framearray_cli.base.errors import OutputError
from framearray_cli.job.job import Job
from framearray_cli.render.events import Event, Noted
from framearray_cli.render.render import render

N = 4
OTHER = 23.976


def job(scene: Path, out: Path, kind: str = "exr", changes: Any = None, **output: Any) -> Job:
    tables = {"camera": tiny.walk(N), "reuse": {"n_r": 1}, **(changes or {})}
    return tiny.job_of_file(scene, out, output={"format": kind, **output}, **tables)


def is_whole(folder: Path) -> bool:
    found = verify(folder, 1, lambda done, total: None)
    return not found.wrong and not found.unknown


def noted(events: list[Event], word: str) -> list[str]:
    """Return the notes with a word."""
    return [event.text for event in events if isinstance(event, Noted) and word in event.text]


def test_another_rate_changes_the_manifest_and_images_to_come(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path, "png"), cameras=(1,))
    before = contents(tmp_path)
    assert render(job(scene, tmp_path, "png", fps=OTHER)).written == 3 * (N - 1)
    assert contents(tmp_path).items() >= before.items() and is_whole(tmp_path)
    assert read_manifest(tmp_path).fps == read_manifest(tmp_path).job["output"]["fps"] == OTHER
    for c, rate in ((1, "24"), (2, "24000/1001")):
        with Image.open(tmp_path / f"tiny.c{c:04d}.l000.png") as image:
            assert image.info["framesPerSecond"] == rate


@pytest.mark.parametrize(
    ("kind", "old", "new"),
    [
        ("exr", {"exposure": 0.0}, {"exposure": 1.5, "quality": 80}),
        ("png", {"compression": "none"}, {"compression": "zip", "half": "never", "quality": 50}),
        ("tif", {"half": "auto"}, {"half": "always", "exposure": -1.0}),
        ("jpg", {"half": "auto"}, {"half": "always", "compression": "piz"}),
    ],
)
def test_what_a_format_ignores_only_changes_the_manifest(
    scene: Path, tmp_path: Path, kind: str, old: Any, new: Any
) -> None:
    one = {"layers": False, **old}
    render(job(scene, tmp_path, kind, **one), cameras=(0,))
    before = contents(tmp_path)
    assert render(job(scene, tmp_path, kind, **{**one, **new}), cameras=(0,)).written == 0
    assert contents(tmp_path) == before
    assert read_manifest(tmp_path).job["output"].items() >= new.items()


def test_other_ignored_values_are_taken_over_too(scene: Path, tmp_path: Path) -> None:
    changes = {"obscurance": {"range": 1.2, "tau": 2.0}}
    render(job(scene, tmp_path, changes={"obscurance": {"range": 1.2}}), cameras=(0,))
    assert render(job(scene, tmp_path, changes=changes), cameras=(0,)).written == 0
    assert read_manifest(tmp_path).job["obscurance"]["tau"] == 2.0


@pytest.mark.parametrize(
    ("kind", "output"),
    [("png", {"exposure": 1.0}), ("jpg", {"quality": 90}), ("exr", {"half": "never"}), ("exr", {"compression": "b44"})],
)
def test_what_a_format_depends_on_is_another_array(scene: Path, tmp_path: Path, kind: str, output: Any) -> None:
    render(job(scene, tmp_path, kind), cameras=(0,))
    with pytest.raises(OutputError, match=f"another frame array.*output.{next(iter(output))}"):
        render(job(scene, tmp_path, kind, **output), cameras=(0,))


@pytest.mark.parametrize(("old", "new"), [("none", "zip"), ("zip", "rle"), ("piz", "none")])
def test_images_to_come_have_another_lossless_compression(scene: Path, tmp_path: Path, old: str, new: str) -> None:
    """Pixels are those of either, and files that are there stay."""
    out, events = tmp_path / "out", list[Event]()
    render(job(scene, out, compression=old), cameras=(0,))
    before = contents(out)
    assert render(job(scene, out, compression=new), events.append).written == 3 * (N - 1)
    assert f"output.compression is {new} now" in noted(events, "keep")[0] and is_whole(out)
    render(job(scene, tmp_path / "new", compression=new))
    assert contents(out) == contents(tmp_path / "new") | before
    for name in before:
        if "layers" not in name:
            np.testing.assert_array_equal(read_image(out / name), read_image(tmp_path / "new" / name))
    again: list[Event] = []
    assert render(job(scene, out, compression=new), again.append).written == 0
    assert not noted(again, "output.compression")


def test_lossy_compression_is_another_array_either_way(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path, compression="dwaa"), cameras=(0,))
    for other in ("zip", "dwab"):
        with pytest.raises(OutputError, match=f'output.compression: "dwaa" there, "{other}" now'):
            render(job(scene, tmp_path, compression=other), cameras=(0,))


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"specular": {"depth": 2}}, "specular.depth"),
        ({"specular": {"hits": 40}}, "specular.hits"),
        ({"scene": {"up": "z"}}, "scene.up"),
    ],
)
def test_other_keys_make_another_array(scene: Path, tmp_path: Path, changes: Any, key: str) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    with pytest.raises(OutputError, match=f"another frame array.*{key}"):
        render(job(scene, tmp_path, changes=changes), cameras=(0,))


def test_another_run_in_the_folder_comes_first(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    before, folder = contents(tmp_path), ArrayFolder(tmp_path)
    with (
        folder.reserve((2,), "2"),
        pytest.raises(OutputError, match="another run is rendering cameras 2 into this folder"),
    ):
        render(job(scene, tmp_path, fps=OTHER), cameras=(1,))
    assert contents(tmp_path) == before and len(record_files(tmp_path)) == 1
