"""The frame loop: one function finds hits, and the same job has the same bytes for any number of threads."""

import ast
import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import WALK

import framearray_cli
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames, window_of
from framearray_cli.job.job import Job
from framearray_cli.render.render import render

PACKAGE = Path(framearray_cli.__file__).parent


def callers(name: str) -> list[str]:
    """Functions of the package that name another one, as "module.function"."""
    found = []
    for file in sorted(PACKAGE.rglob("*.py")):
        for function in ast.walk(ast.parse(file.read_text())):
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                names = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
                names |= {node.attr for node in ast.walk(function) if isinstance(node, ast.Attribute)}
                if name in names:
                    found.append(f"{file.stem}.{getattr(function, 'name', 'lambda')}")
    return found


def test_one_function_of_the_package_finds_hits() -> None:
    assert callers("find_frame") == ["loop.ready_frames"]


def test_the_loop_is_short_enough_to_be_quoted() -> None:
    tree = ast.parse((PACKAGE / "engine" / "loop.py").read_text())
    loop = next(node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "ready_frames")
    assert loop.end_lineno is not None and loop.end_lineno - loop.lineno < 24


@pytest.mark.parametrize("mirrors", [False, True])
def test_holes_are_traced_once_however_often_a_frame_is_composed(mirrors: bool) -> None:
    """Few hits, so that there are holes; each frame is composed once, and then three times."""
    camera = WALK | {"resolution": [16, 12]}
    job = tiny.job(camera=camera, samples={"hits": 0.125}, reuse={"n_r": 1}, specular={"hits": 1})
    inputs = tiny.prepared(job, tiny.room(mirrors=mirrors))
    rays, images = [], []
    with tiny.planned(inputs) as (setup, ambient):
        for times in (1, 3):
            with TracePool(setup, 1) as pool:
                window, found = Window(setup, ambient, pool), []
                for j in ready_frames(window, setup, range(setup.n_frames), pool):
                    for _ in range(times):
                        image = np.empty((setup.lights.n_lights, 12, 16, 3), np.float32)
                        composed = window.compose(j, image)
                        assert composed.hits.min() >= 1
                    found.append(image)
                images.append(found)
            rays.append(dict(pool.rays()))
        natives = sum(part.n for eye in setup.eyes_for(range(setup.n_frames)) for part in setup.passes(eye))
    assert rays[0] == rays[1]
    assert rays[0]["native"] > natives, "there were holes"
    np.testing.assert_array_equal(*images)


def test_some_frames_are_those_of_the_whole_path() -> None:
    """Wanted frames with gaps between them: only the frames around them are found."""
    inputs = tiny.prepared(tiny.job(camera=WALK, reuse={"n_r": 1}))
    with tiny.planned(inputs) as (setup, ambient), TracePool(setup, 1) as pool:
        whole = [frame.images for frame in tiny.frames_of(setup, ambient, pool)]
        window, wanted = Window(setup, ambient, pool), [0, 4]
        frames = ready_frames(window, setup, wanted, pool)
        some = [window.compose(j, np.empty_like(whole[0])) for j in frames]
        assert [frame.c for frame in some] == wanted
        for frame in some:
            np.testing.assert_array_equal(frame.images, whole[frame.c])


def test_other_ambient_light_takes_no_other_hits() -> None:
    inputs = tiny.prepared(tiny.job(camera=WALK, reuse={"n_r": 1}))
    with tiny.planned(inputs) as (setup, ambient), TracePool(setup, 1) as pool:
        window = window_of(2, setup, ambient, pool)
        rays = dict(pool.rays())
        shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
        dark, lit = (
            window.with_ambient(replace(ambient, intensity=np.full_like(ambient.intensity, level)))
            .compose(2, np.empty(shape, np.float32))
            .images
            for level in (0, 1)
        )
        own = window.compose(2, np.empty(shape, np.float32)).images
        assert dict(pool.rays()) == rays
    intensity = ambient.intensity[:, None, None, :]
    np.testing.assert_allclose(dark + intensity * (lit - dark), own, rtol=1e-4, atol=1e-5)


SKY = {"background": [0.3, 0.4, 0.5]}
LAMP = tiny.TABLE["light"]["sources"][0]
# More than one batch of hits per frame and more than one band of pixels, so that threads share work.
CAMERA = tiny.walk(4, resolution=[60, 45])


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
    table = {"scene": SKY, "light": {"sources": [LAMP, tiny.SUN]}, "ambient": {"paths": paths}}
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
    ("weights", "more"),
    [
        ("balance", {}),
        ("average", {"obscurance": {"outside": "background"}}),
        ("area", {}),
        ("area", {"indirect": tiny.CELLS}),
    ],
)
def test_same_bytes_for_1_2_and_5_threads(scene: Path, tmp_path: Path, weights: str, more: dict[str, Any]) -> None:
    changes = {"reuse": {"n_r": 1, "weights": weights}, "light": {"sources": [LAMP, tiny.SUN]}, **more}
    one = written(scene, tmp_path / "1", 1, **changes)
    assert len(one) == 4 * 3 + 4, "images and layers"
    assert len(set(one.values())) == len(one), "all different pictures"
    for threads in (2, 5):
        assert written(scene, tmp_path / str(threads), threads, **changes) == one


def test_another_seed_gives_other_bytes(scene: Path, tmp_path: Path) -> None:
    """The comparison can fail."""
    one, other = (written(scene, tmp_path / str(seed), 2, seed=seed, reuse={"n_r": 0}) for seed in (1, 2))
    assert one.keys() == other.keys()
    assert not set(one.values()) & set(other.values())


def test_the_hits_of_a_frame_do_not_depend_on_the_length_of_the_path() -> None:
    """Without reuse a frame of a path is the frame of a job that has only the path's first frames."""
    keys = [{"frame": c, "eye": [0.2 + 0.1 * c, 1.3, 1.7], "target": [-0.1, 0.9, -1.0]} for c in range(4)]
    ambient = {"intensity": [1.0, 1.0, 1.0], "paths": None}  # else it is averaged over the path's own eyes
    results = []
    for n in (4, 2):
        job = tiny.job(camera={"frames": n, "keys": keys[:n]}, scene=SKY, reuse={"n_r": 0}, ambient=ambient)
        with tiny.planned(tiny.prepared(job)) as (setup, estimate):
            average = np.float32([0.5, 0.5, 0.5])  # the walks that measure it start at the path's own eyes, too
            setup = replace(
                setup, indirect=setup.indirect.with_settings(setup.indirect.settings._replace(average=average))
            )
            with TracePool(setup, 1) as pool:
                results.append([frame.images for frame in tiny.frames_of(setup, estimate, pool)])
    for long, short in zip(results[0][:2], results[1], strict=True):
        np.testing.assert_array_equal(long, short)
