"""Wide lobes read from cells, against the same lobes followed to hits that are lit like any other."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import ball, box, quad

from framearray_cli.engine.features.indirect import CellLight
from framearray_cli.job.job import Job
from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene

SEEDS = 8


def room(roughness: float, metallic: float, coat: float = 0.0) -> Scene:
    """A glossy floor and a glossy ball in a coloured room."""
    corners, normals = ball((0.3, 0.5, 0.0), 0.5, 12)
    shine = {"roughness": roughness, "metallic": metallic, "coat": coat, "coat_roughness": 0.15}
    floor = quad((-2, 0.01, 2), (2, 0.01, 2), (2, 0.01, -2), (-2, 0.01, -2))
    return tiny.scene_with(
        (Material(name="Walls", reflectivity=(0.7, 0.5, 0.3)), box((-2, 0, -2), (2, 2.5, 2))),
        (Material(name="Floor", reflectivity=(0.8, 0.8, 0.8), **shine), floor),
        (Material(name="Ball", reflectivity=(0.3, 0.5, 0.8), **shine), {"corners": corners, "normals": normals}),
    )


def job() -> Job:
    eye = {"frame": 0, "eye": [-1.5, 1.6, 1.7], "target": [0.2, 0.4, 0.0]}
    lamp = {"type": "point", "keys": [{"frame": 0, "position": [0.8, 2.2, 0.8], "intensity": [3.0, 2.5, 2.0]}]}
    return tiny.job(
        camera={"frames": 1, "resolution": [32, 24], "fov": 60.0, "keys": [eye]},
        light={"frames": 1, "sources": [lamp]},
        samples={"hits": 4, "obscurance": 4},
        reuse={"n_r": 0},
        indirect=tiny.CELLS,
    )


def pictures(scene: Scene, seeds: range, threads: int = 1) -> Any:
    """(seeds, height, width, 3) of the only image."""
    with tiny.planned(tiny.prepared(job(), scene), compare=False) as (setup, ambient):
        frames = [tiny.composed(replace(setup, seed=seed), ambient, 0, threads=threads) for seed in seeds]
    return np.array([frame.images[0] for frame in frames], float)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("roughness", "metallic", "coat"), [(0.25, 1.0, 0.0), (0.4, 1.0, 0.0), (0.3, 0.0, 0.0), (0.3, 1.0, 1.0)]
)
def test_cells_hold_what_lobes_find(
    monkeypatch: pytest.MonkeyPatch, roughness: float, metallic: float, coat: float
) -> None:
    """Means of the picture agree within 2 % of it: cells are means themselves. The noise of pixels is lower."""
    scene = room(roughness, metallic, coat)
    read = pictures(scene, range(SEEDS))
    monkeypatch.setattr(CellLight, "reads_lobes", False)
    followed = pictures(scene, range(100, 100 + SEEDS))
    a, b = read.mean(axis=(1, 2)), followed.mean(axis=(1, 2))  # (seeds, 3)
    error = np.hypot(a.std(axis=0, ddof=1), b.std(axis=0, ddof=1)) / np.sqrt(SEEDS)
    assert (error < 0.02 * b.mean(axis=0)).all()
    assert (np.abs(a.mean(axis=0) - b.mean(axis=0)) < 3 * error + 0.02 * b.mean(axis=0)).all()
    if metallic:
        assert read.var(axis=0, ddof=1).mean() < 0.7 * followed.var(axis=0, ddof=1).mean()


@pytest.mark.slow
def test_they_are_the_same_for_any_number_of_threads() -> None:
    scene = room(0.3, 1.0)
    np.testing.assert_array_equal(pictures(scene, range(1)), pictures(scene, range(1), threads=3))
