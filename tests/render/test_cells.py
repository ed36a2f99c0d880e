"""Renders with light from cells: parts give the bytes of the whole, and other cells are refused."""

from pathlib import Path
from typing import Any

import pytest
from support import tiny
from support.tiny import WALK

from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import read_records, record_files, seal, unseal
from framearray_cli.base.errors import OutputError
from framearray_cli.job.job import Job
from framearray_cli.render.render import render


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny.save_glb(tiny.room_meshes(), tmp_path_factory.mktemp("scene") / "room.glb")


def job(scene: Path, out: Path, threads: int) -> Job:
    tables: dict[str, Any] = {
        "scene": {"file": str(scene), "background": [0.3, 0.4, 0.5]},
        "camera": WALK,
        "output": {"directory": str(out)},
        "reuse": {"n_r": 1},
        "render": {"threads": threads},
        "indirect": {"method": "cells", "samples": 4096},
    }
    return tiny.job(**tables)


def images(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("*.exr")}


def test_parts_and_threads_give_the_bytes_of_the_whole(scene: Path, tmp_path: Path) -> None:
    summary = render(job(scene, tmp_path / "whole", 1))
    for part in ((0, 1, 5), (2, 3, 4)):
        render(job(scene, tmp_path / "parts", 3), cameras=part)
    assert images(tmp_path / "whole") == images(tmp_path / "parts") != {}
    note = next(note for note in summary.notes if note.startswith("indirect light differs from paths by"))
    manifest = read_manifest(tmp_path / "whole")
    assert note in manifest.summary["notes"]  # type: ignore[operator]
    runs = read_records(tmp_path / "parts", manifest.fingerprint).runs
    assert len(runs) == 2 and len({run.cells for run in runs}) == 1 and runs[0].cells.startswith("sha256:")


def test_other_cells_than_those_of_the_images_there_are_refused(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path, 2), cameras=(0, 1))
    (file,) = record_files(tmp_path)
    lines = [unseal(line) for line in file.read_bytes().splitlines()]
    head = next(line for line in lines if line and "cells" in line)
    head["cells"] = "sha256:" + 64 * "0"
    file.write_bytes(b"".join(seal(line) + b"\n" for line in lines if line))
    before = images(tmp_path)
    with pytest.raises(OutputError, match="expected the cells of the images that are there, got others"):
        render(job(scene, tmp_path, 2))
    assert images(tmp_path) == before
