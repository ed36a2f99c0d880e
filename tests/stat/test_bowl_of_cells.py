"""A bowl under an even sky: light from cells in a part of a sphere, where the sum of all bounces is known.

Each point of a sphere gives every other point the same irradiance. So a sphere of which the share f is open has the
same light at each point: E = pi f L + R (1 - f) E.
"""

from typing import Any

import numpy as np
import pytest
from scipy.stats import t
from support import tiny
from support.ztests import CHANCE, estimate

SEEDS = 16
OPEN, REFLECTIVITY, SKY = 0.9, 0.8, np.array([1.0, 1.0, 2.0])
STEPS = 48  # along a meridian of the bowl
DARK = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 9.0, 0.0], "intensity": 0.0}]}
ABOVE = {"frame": 0, "eye": [0.0, 0.0, 0.0], "target": [0.0, -1.0, 0.0], "up": [0.0, 0.0, 1.0]}
# Triangles of the bowl have about this share less light from each other.
FLAT = 5e-4


def bowl() -> Any:
    """The lowest part of a sphere of radius 1: corners, (triangles, 3, 3)."""
    down = np.linspace(0, np.arccos(2 * OPEN - 1), STEPS + 1)[:, None]
    around = np.linspace(0, 2 * np.pi, 4 * STEPS + 1)[None]
    at = np.stack(
        np.broadcast_arrays(np.sin(down) * np.cos(around), -np.cos(down), np.sin(down) * np.sin(around)), axis=-1
    )
    return np.concatenate(
        [
            tiny.quad(at[j, i], at[j + 1, i], at[j + 1, i + 1], at[j, i + 1])[0 if j else 1 :]
            for j in range(STEPS)
            for i in range(4 * STEPS)
        ]
    )


def light_over_sky(seed: int) -> float:
    """The mean radiance of the bowl over that of the sky."""
    job = tiny.job(
        seed=seed,
        scene={"background": SKY.tolist()},
        camera={"resolution": [16, 16], "fov": 40.0, "frames": 1, "keys": [ABOVE]},
        light={"frames": 1, "sources": [DARK]},
        samples={"hits": 16},
        obscurance={"range": 0.001, "outside": "average"},
        indirect={"method": "cells", "samples": 2**15},
    )
    scene = tiny.scene_of(bowl(), tiny.Material(name="Grey", reflectivity=(REFLECTIVITY,) * 3))
    return float((tiny.render_frames(tiny.prepared(job, scene), threads=2).images / SKY).mean())


@pytest.mark.slow
def test_a_bowl_has_the_light_of_an_open_sphere() -> None:
    got = estimate(np.array([light_over_sky(seed) for seed in range(SEEDS)]))
    right = REFLECTIVITY * OPEN / (1 - REFLECTIVITY * (1 - OPEN))
    most = float(t.ppf(1 - CHANCE / 2, SEEDS - 1))
    assert abs(got.mean - right) < most * got.error + FLAT * right
    assert abs(got.mean - right) < 0.01 * right
    assert got.error < 0.002 * right  # so that only the light of the sky, 8 % less, would fail
