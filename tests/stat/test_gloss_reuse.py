"""Reuse of glossy hits keeps the mean: balls under a moving camera and a moving light, with `balance` and without."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import ball, quad
from support.ztests import differing

from framearray_cli.engine.images.window import Window
from framearray_cli.job.job import Job
from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene

pytestmark = pytest.mark.slow  # 80 windows for a mean, with kernels of their own

ALPHAS = (0.05, 0.1, 0.25, 0.5)
N_R, MIDDLE, SEEDS = 2, 2, 40


def balls() -> Scene:
    """Metal balls of four lobes in a row, and dielectric ones behind them, on a glossy floor."""
    floor = Material(name="Floor", reflectivity=(0.5, 0.5, 0.5), roughness=0.5)
    surfaces: list[Any] = [(floor, quad((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)))]
    for metal, colour in ((1.0, (0.9, 0.5, 0.2)), (0.0, (0.1, 0.3, 0.7))):
        for k, alpha in enumerate(ALPHAS):
            corners, normals = ball((k - 1.5, 0.4, metal), 0.4, 12)
            shine = {"reflectivity": colour, "roughness": alpha**0.5, "metallic": metal}
            surfaces.append((Material(name=f"{alpha} {metal}", **shine), {"corners": corners, "normals": normals}))
    return tiny.scene_with(*surfaces)


def job_of(n_r: int, hits: int, weights: str) -> Job:
    return tiny.job(
        camera={"frames": 5, "resolution": [32, 12], "fov": 22.0, "keys": [
            {"frame": 0, "eye": [-1.2, 1.5, 5.0], "target": [0, 0.3, 0.5]},
            {"frame": 4, "eye": [1.2, 1.7, 5.0], "target": [0, 0.3, 0.5]}]},
        light={"frames": 3, "sources": [{"type": "point", "keys": [
            {"frame": 0, "position": [-2, 3, 3], "intensity": [20, 20, 20], "radius": 0.4},
            {"frame": 2, "position": [1, 3, 3], "intensity": [20, 20, 20], "radius": 0.4}]}]},
        scene={"background": [0.3, 0.4, 0.5]}, obscurance={"range": 1.0, "outside": "background"},
        samples={"hits": hits, "obscurance": 2},
        reuse={"n_r": n_r, "weights": weights},
    )  # fmt: skip


def middle_frames(job: Job, seeds: range) -> Any:
    """The middle frame under all lights for each seed, (seeds, values)."""
    frames = tiny.frames_of_seeds(tiny.prepared(job, balls()), MIDDLE, seeds)
    return np.array([frame.images.ravel() for frame in frames], float)


@pytest.fixture(scope="module")
def unshared() -> Any:
    return middle_frames(job_of(0, 20, "balance"), range(1000, 1000 + SEEDS))


def test_balance_keeps_the_mean_of_gloss(unshared: Any):
    shared = middle_frames(job_of(N_R, 4, "balance"), range(SEEDS))
    assert differing(shared, unshared).max() < 1
    # the mean over all pixels and lights as well, within three standard errors
    means, others = shared.mean(axis=1), unshared.mean(axis=1)
    error = np.hypot(means.std(ddof=1), others.std(ddof=1)) / np.sqrt(SEEDS)
    assert abs(means.mean() - others.mean()) < 3 * error


def test_average_shows_what_other_eyes_saw(unshared: Any):
    """The bias of the literature [Havran03], of narrow lobes most."""
    shared = middle_frames(job_of(N_R, 4, "average"), range(SEEDS))
    assert differing(shared, unshared).max() > 1.5


def test_gloss_towards_another_eye_is_off(unshared: Any, monkeypatch: pytest.MonkeyPatch):
    """The comparison can fail: it finds highlights where another eye sees them."""
    view = Window._view
    monkeypatch.setattr(Window, "_view", lambda self, j: view(self, 0))
    shared = middle_frames(job_of(N_R, 4, "balance"), range(SEEDS))
    assert differing(shared, unshared).max() > 1.5
