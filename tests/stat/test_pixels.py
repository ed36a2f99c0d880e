"""Pictures compared pixel by pixel: means and variances over independent runs, corrected for the number of values.

Every comparison is made once more with 2 % more light, or a fault of its own, and must then fail.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import closed_forms as forms
from support import tiny
from support.stages import FURNACE, make_job, point, repeats, result_of
from support.ztests import differing, off

from framearray_cli.engine.frames.pool import TracePool

BRIGHTER = 1.02
AMBIENT = {"intensity": [0.4, 0.3, 0.2], "paths": None}  # given: it is not what is compared


def runs(inputs: Any, seeds: range) -> Any:
    """(n_seeds, n_c, n_l, h, w, 3): pictures of a job for independent seeds."""
    with tiny.planned(inputs) as (setup, ambient):
        found = []
        for seed in seeds:
            with TracePool(replace(setup, seed=seed), 1) as pool:
                composed = tiny.frames_of(replace(setup, seed=seed), ambient, pool)
                assert all(frame.bad == 0 for frame in composed)
                found.append(np.stack([frame.images for frame in composed]).astype(np.float64))
    return np.array(found)


def flat(images: Any) -> Any:
    return images.reshape(len(images), -1)


@pytest.mark.parametrize(("hits", "frames"), [pytest.param(2, (0, 3), marks=pytest.mark.slow), (0.5, (3,))])
def test_a_wide_window_shows_the_same_scene(hits: float, frames: tuple[int, ...]) -> None:
    """Two hits, or one in every other pixel, shared by up to eleven frames, against sixteen and no sharing.

    A pixel is a ratio of sums, whose mean is off by a share of 1 / hits. With half a hit that shows at the ends of the
    path, where a window has fewer frames: in frame 0 one pixel of 432 is 5 % too bright.
    """
    some: dict[str, Any] = {"camera": tiny.WALK, "specular": {"hits": 8}, "ambient": AMBIENT}
    shared = runs(tiny.prepared(tiny.job(samples={"hits": hits}, reuse={"n_r": 5}, **some)), range(40))
    unshared = runs(tiny.prepared(tiny.job(samples={"hits": 16}, reuse={"n_r": 0}, **some)), range(100, 140))
    for c in frames:
        assert differing(flat(shared[:, c]), flat(unshared[:, c])).max() < 1
        assert differing(flat(BRIGHTER * shared[:, c]), flat(unshared[:, c])).max() > 1


def resting(first: int, last: int, **changes: Any) -> Any:
    """A job whose camera rests from one frame to another of six."""
    eyes = [([0.2, 1.3, 1.7], 0), ([0.3, 1.3, 1.5], first), ([0.3, 1.3, 1.5], last), ([0.4, 1.3, 1.4], 5)]
    keys = [{"frame": frame, "eye": eye, "target": [-0.1, 0.9, -1.0]} for eye, frame in eyes]
    job = tiny.job(camera={"frames": 6, "keys": keys}, ambient=AMBIENT, **changes)
    return tiny.prepared(job, tiny.room(mirrors=False))


@pytest.mark.parametrize(
    ("weights", "first", "last"), [("balance", 2, 3), pytest.param("average", 1, 4, marks=pytest.mark.slow)]
)
def test_two_equal_eyes_in_a_row_have_the_same_picture(weights: str, first: int, last: int) -> None:
    """A camera that rests: both pictures have the mean of a render without sharing.

    With `average` that is so where all eyes that share are equal; else see test_reuse_bias.py. The two pictures share
    hits, so that their difference is tested, not each for itself.
    """
    found = runs(resting(first, last, reuse={"n_r": 1, "weights": weights}), range(48))
    one, other, moved = (flat(found[:, c]) for c in (2, 3, 5))
    nothing = np.zeros(one.shape[1])
    assert off(one - other, nothing).max() < 1
    assert off(one - moved, nothing).max() > 1
    assert off(BRIGHTER * one - other, nothing).max() > 1
    unshared = flat(runs(resting(first, last, samples={"hits": 6}, reuse={"n_r": 0}), range(100, 148))[:, 2])
    for shared in (one, other):
        assert differing(shared, unshared).max() < 1
    assert differing(BRIGHTER * one, unshared).max() > 1


def test_every_pixel_of_a_sphere_with_a_lamp_off_its_middle(tmp_path: Path) -> None:
    """Direct light by formula at each place of a pixel, indirect light by the chords of the sphere: R (E / pi + I_A W).

    Triangles lie below the sphere by up to rho^2 / 2, which changes irradiance by 3 rho^2 / 2 (see test_furnace.py).
    """
    reflectivity, ambient, lamp, n = 0.7, 0.5, np.array([0.3, 0.2, -0.3]), 48
    eye, target, size, fov = np.array([0.1, 0.0, 0.2]), np.array([0.3, -0.5, -0.81]), (16, 12), 60.0
    sampled = make_job(
        FURNACE, tmp_path, materials={"Wall": reflectivity}, lights=[point(lamp, 2.0)],
        camera={"resolution": list(size)} | repeats(eye, target, n, fov), samples={"hits": 4, "obscurance": 4},
        obscurance={"range": 2.0, "falloff": "sqrt"}, ambient={"intensity": ambient},
    )  # fmt: skip
    found = result_of(sampled).images[:, 0, ..., 0].reshape(n, -1)
    fine = 8  # places along each edge of a pixel
    focal = 0.5 * size[1] / np.tan(np.radians(fov) / 2)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 1, 0]) / np.linalg.norm(np.cross(forward, [0, 1, 0]))
    x = ((np.arange(size[0] * fine) + 0.5) / fine - size[0] / 2) / focal
    y = (size[1] / 2 - (np.arange(size[1] * fine) + 0.5) / fine) / focal
    way = forward + x[None, :, None] * right + y[:, None, None] * np.cross(right, forward)
    way = (way / np.linalg.norm(way, axis=-1, keepdims=True)).reshape(-1, 3)
    along = way @ eye
    points = eye + (np.sqrt(along**2 - eye @ eye + 1) - along)[:, None] * way
    direct = forms.point_irradiance(points, -points, lamp, 2.0).reshape(size[1], fine, size[0], fine).mean(axis=(1, 3))
    indirect = ambient * forms.sphere_obscurance("sqrt", reflectivity, 1.0)
    expected = (reflectivity * (direct / np.pi + indirect)).ravel()
    flatness = 1.5 * 1.5 * 4 / (3 * 3**0.5) * 4 * np.pi / 81920
    assert off(found, expected, flatness).max() < 1
    assert off(BRIGHTER * found, expected, flatness).max() > 1
    assert off(found + 0.02 * reflectivity * indirect, expected, flatness).max() > 1  # 2 % more indirect light only
