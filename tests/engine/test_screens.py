"""Surfaces that cover a part of what is behind them: an awning over a floor in the sun, seen from above."""

import math
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import SCREENED

ALPHA, FLOOR, AWNING, IRRADIANCE = 0.4, 0.8, 0.5, 3.0
SUN = (0.3, -1.0, 0.2)
LARGE, WIDE = 40.0, 8.0


def inputs_for(n_r: int, weights: str) -> Any:
    def square(half: float, y: float) -> Any:
        return tiny.quad((-half, y, half), (half, y, half), (half, y, -half), (-half, y, -half))

    awning = Material(name="Awning", reflectivity=(AWNING,) * 3, alpha=ALPHA, alpha_cutoff=SCREENED)
    floor = Material(name="Floor", reflectivity=(FLOOR,) * 3)
    scene = tiny.scene_with((floor, square(LARGE, 0.0)), (awning, square(WIDE, 2.0)))
    keys = [
        {"frame": 0, "eye": [0.0, 6.0, 3.0], "target": [0.0, 0.0, 0.0]},
        {"frame": 4, "eye": [0.5, 6.2, 2.6], "target": [0.1, 0.0, -0.1]},
    ]
    sun = {"frame": 0, "direction": list(SUN), "irradiance": [IRRADIANCE] * 3}
    job = tiny.job(
        camera={"resolution": [40, 30], "fov": 40.0, "frames": 5, "keys": keys},
        light={"frames": 1, "sources": [{"type": "directional", "keys": [sun]}]},
        samples={"hits": 24, "obscurance": 1},
        reuse={"n_r": n_r, "weights": weights},
        ambient=tiny.DARK,
    )
    return tiny.prepared(job, scene)


@pytest.mark.parametrize(("n_r", "weights"), [(0, "balance"), (2, "balance"), (2, "area")])
def test_an_awning_covers_the_share_alpha_of_the_light_and_of_the_view(n_r: int, weights: str) -> None:
    """Within four standard errors; the eye sees awning, floor in the sun and floor in the shadow by their shares."""
    cosine = -SUN[1] / math.sqrt(sum(x * x for x in SUN))
    seen = (ALPHA * AWNING + (1 - ALPHA) * (1 - ALPHA) * FLOOR) * IRRADIANCE * cosine / math.pi
    images = tiny.render_frames(inputs_for(n_r, weights), threads=2).images
    for j in (0, 2):
        pixels = images[j, 0][..., 0].astype(np.float64).ravel()
        error = pixels.std() / math.sqrt(pixels.size)
        assert error < 0.01 * seen
        assert abs(pixels.mean() - seen) < 4 * error
