"""Same job, same bytes: for any number of threads, in every run."""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import WALK

from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.job.job import Job
from framearray_cli.render.render import render

SKY = {"background": [0.3, 0.4, 0.5]}
LAMP = tiny.TABLE["light"]["sources"][0]
# More than one batch of hits per frame and more than one band of pixels, so that threads share work.
CAMERA = {**WALK, "frames": 4, "resolution": [60, 45], "keys": [WALK["keys"][0], {**WALK["keys"][1], "frame": 3}]}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny room as a file, with texture, corner colours, normals and mirrors."""
    return tiny.save_glb(tiny.room_meshes(), tmp_path_factory.mktemp("scene") / "room.glb")


def job(scene: Path, out: Path, threads: int, **changes: Any) -> Job:
    return tiny.job(
        **{
            "scene": {**SKY, "file": str(scene)},
            "camera": CAMERA,
            "output": {"directory": str(out), "format": "exr"},
            "render": {"threads": threads},
            **changes,
        }
    )


def digests(folder: Path) -> dict[str, str]:
    """Hash of every image and layer file; manifest and records hold times."""
    files = sorted(file for file in folder.rglob("*") if file.is_file() and file.suffix == ".exr")
    return {str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def written(scene: Path, folder: Path, threads: int, **changes: Any) -> dict[str, str]:
    render(job(scene, folder, threads, **changes))
    return digests(folder)


@pytest.mark.parametrize("paths", [None, 100, 10_000])
def test_walks_from_the_eyes_are_the_same_for_any_number_of_threads(paths: int | None) -> None:
    """Batches beyond the last one needed are dropped, and their rays not counted."""
    table = {"scene": SKY, "light": {"sources": [LAMP, tiny.SUN]}, "ambient": {"method": "eye", "paths": paths}}
    found = []
    for threads in (1, 2, 5):
        with tiny.planned(tiny.prepared(tiny.job(**table, render={"threads": threads}))) as (_, ambient):
            found.append(ambient)
    one, *others = found
    assert paths in (None, one.paths)
    for other in others:
        assert (other.paths, other.rays, other.notes) == (one.paths, one.rays, one.notes)
        for name in ("intensity", "standard_error", "reflectivity"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))


@pytest.mark.parametrize(
    ("weights", "indirect"), [("balance", {}), ("average", {}), ("area", {}), ("area", tiny.CELLS)]
)
def test_same_bytes_for_1_2_and_5_threads(scene: Path, tmp_path: Path, weights: str, indirect: dict[str, Any]) -> None:
    changes = {
        "reuse": {"n_r": 1, "weights": weights}, "light": {"sources": [LAMP, tiny.SUN]}, "indirect": indirect
    }  # fmt: skip
    one = written(scene, tmp_path / "1", 1, **changes)
    assert len(one) == 4 * 3 + 4, "images and layers"
    assert len(set(one.values())) == len(one), "all different pictures"
    for threads in (2, 5):
        assert written(scene, tmp_path / str(threads), threads, **changes) == one


def test_same_bytes_again(scene: Path, tmp_path: Path) -> None:
    changes = {"reuse": {"n_r": 1}, "obscurance": {"outside": "background"}}
    one = written(scene, tmp_path / "1", 2, **changes)
    assert written(scene, tmp_path / "2", 2, **changes) == one


def test_another_seed_gives_other_bytes(scene: Path, tmp_path: Path) -> None:
    """The comparison can fail."""
    one, other = (written(scene, tmp_path / str(seed), 2, seed=seed, reuse={"n_r": 0}) for seed in (1, 2))
    assert one.keys() == other.keys()
    assert not set(one.values()) & set(other.values())


def test_the_hits_of_a_frame_do_not_depend_on_the_length_of_the_path() -> None:
    """Without reuse a frame of a path is the frame of a job that has only the path's first frames."""
    keys = [{"frame": c, "eye": [0.2 + 0.1 * c, 1.3, 1.7], "target": [-0.1, 0.9, -1.0]} for c in range(4)]
    ambient = {"intensity": [1.0, 1.0, 1.0]}  # else it is averaged over the path's own eyes
    results = []
    for n in (4, 2):
        camera = {"frames": n, "resolution": [24, 18], "keys": keys[:n]}
        table = tiny.table(camera=camera, scene=SKY, reuse={"n_r": 0})
        table["ambient"] = ambient
        inputs = tiny.prepared(Job.model_validate(table))
        with tiny.planned(inputs) as (setup, estimate):
            average = np.float32([0.5, 0.5, 0.5])  # the walks that measure it start at the path's own eyes, too
            setup = replace(
                setup, indirect=setup.indirect.with_settings(setup.indirect.settings._replace(average=average))
            )
            with TracePool(setup, 1) as pool:
                results.append([frame.images for frame in tiny.frames_of(setup, estimate, pool)])
    for long, short in zip(results[0][:2], results[1], strict=True):
        np.testing.assert_array_equal(long, short)
