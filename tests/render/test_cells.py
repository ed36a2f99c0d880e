"""Renders with light from cells: parts give the bytes of the whole, and other cells are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.handed import contents
from support.tiny import SUN, WALK

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import file_name, image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.array.record import read_records, record_files, seal, unseal
from framearray_cli.base.errors import OutputError
from framearray_cli.engine.frames.setup import Scratch
from framearray_cli.job.job import Job
from framearray_cli.render.memory import _gathering_memory
from framearray_cli.render.render import render


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny.save_glb(tiny.room_meshes(), tmp_path_factory.mktemp("scene") / "room.glb")


def job(scene: Path, out: Path, threads: int, **more: Any) -> Job:
    tables: dict[str, Any] = {
        "scene": {"file": str(scene), "background": [0.3, 0.4, 0.5]},
        "camera": WALK,
        "output": {"directory": str(out)},
        "reuse": {"n_r": 1},
        "render": {"threads": threads},
        "indirect": {"method": "cells", "samples": 4096},
    }
    return tiny.job(**{**tables, **more})


def test_images_of_groups_hold_all_light_of_their_sources(scene: Path, tmp_path: Path) -> None:
    """Nothing is left for ambient light; the picture is the sum of groups and background, relit as they are."""
    lamps = [{**lamp, "group": name} for lamp, name in ((tiny.TABLE["light"]["sources"][0], "a"), (SUN, "b"))]
    render(job(scene, tmp_path, 2, light={"sources": lamps}, camera={"resolution": [8, 6]}))
    manifest = read_manifest(tmp_path)
    assert not manifest.uses_ambient
    assert not read_image(tmp_path / file_name(manifest.ambient_images, 0)).any()
    a, b = (read_image(image_path(manifest, 0, 1, group)) for group in manifest.groups)
    sky = read_image(tmp_path / file_name(manifest.background_images, 0))
    pictures = Pictures(manifest)
    np.testing.assert_allclose(pictures.picture(0, (1,)), a + b + sky, rtol=1e-6)
    relit = Relight(groups={"a": (0.0,) * 3, "b": (2.0,) * 3}, ambient=(7.0,) * 3)
    np.testing.assert_allclose(pictures.picture(0, (1,), relit), 2 * b + sky, rtol=1e-6)
    mixture = Mixture(((0, (0.5,) * 3), (1, (2.0,) * 3)))
    mixed = pictures.picture(0, (mixture,), Relight(groups={"b": (0.0,) * 3, "background": (0.0,) * 3}))
    first = read_image(image_path(manifest, 0, 0, manifest.groups[0]))
    np.testing.assert_allclose(mixed, 0.5 * first + 2 * a, rtol=1e-5)


def test_parts_and_threads_give_the_bytes_of_the_whole(scene: Path, tmp_path: Path) -> None:
    summary = render(job(scene, tmp_path / "whole", 1))
    for part in ((0, 1, 5), (2, 3, 4)):
        render(job(scene, tmp_path / "parts", 3), cameras=part)
    assert contents(tmp_path / "whole") == contents(tmp_path / "parts") != {}
    note = next(note for note in summary.notes if note.startswith("indirect light differs from paths by"))
    manifest = read_manifest(tmp_path / "whole")
    assert note in manifest.summary["notes"]  # type: ignore[operator]  # values of a summary are of any type
    runs = read_records(tmp_path / "parts", manifest.fingerprint).runs
    assert len(runs) == 2 and len({run.cells for run in runs}) == 1 and runs[0].cells.startswith("sha256:")


def test_other_cells_than_those_of_the_images_there_are_refused(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path, 2), cameras=(0, 1))
    (file,) = record_files(tmp_path)
    lines = [unseal(line) for line in file.read_bytes().splitlines()]
    head = next(line for line in lines if line and "cells" in line)
    head["cells"] = "sha256:" + 64 * "0"
    file.write_bytes(b"".join(seal(line) + b"\n" for line in lines if line))
    before = contents(tmp_path)
    with pytest.raises(OutputError, match="expected the cells of the images that are there, got others"):
        render(job(scene, tmp_path, 2))
    assert contents(tmp_path) == before


@pytest.mark.parametrize("exact", [False, True])
def test_the_memory_of_threads_grows_with_the_light_positions_as_their_arrays_do(exact: bool) -> None:
    keys = {"exact": True} if exact else {"samples": 1024}
    sizes, expected = [], []
    for frames in (16, 160):
        inputs = tiny.prepared(tiny.job(indirect={"method": "cells", **keys}, light={"frames": frames}))
        with tiny.planned(inputs) as (setup, _):
            scratch = Scratch(setup, 2048)
        room = scratch.indirect
        if exact:
            arrays = [room.paths.work.sums, room.paths.work.irradiance]
        else:
            arrays = [a for one in (*room.near, room.smooth) for a in one if isinstance(a, np.ndarray)]
        sizes.append(sum(array.nbytes for array in arrays))
        expected.append(_gathering_memory(inputs, frames))
    assert expected[1] - expected[0] == sizes[1] - sizes[0]
