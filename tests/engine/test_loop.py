"""The frame loop: one function finds hits, and what it traces does not depend on how often a frame is composed."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import tiny
from support.tiny import WALK

import framearray_cli
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames, window_of

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
        natives = sum(part.n for c in range(setup.n_frames) for part in setup.passes(c))
    assert rays[0] == rays[1]
    assert rays[0]["native"] > natives, "there were holes"
    np.testing.assert_array_equal(*images)


def test_some_frames_are_those_of_the_whole_path() -> None:
    """Wanted frames with gaps between them: only the frames around them are found."""
    inputs = tiny.prepared(tiny.job(camera=WALK, reuse={"n_r": 1}))
    with tiny.planned(inputs) as (setup, ambient), TracePool(setup, 1) as pool:
        whole = [frame.images for frame in tiny.frames_of(setup, ambient, pool)]
        window, wanted = Window(setup, ambient, pool), [0, 4]
        shape = whole[0].shape
        some = [window.compose(j, np.empty(shape, np.float32)) for j in ready_frames(window, setup, wanted, pool)]
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
