"""Light that environments send by other surfaces: as much as a background of the same radiance sends."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.scene.files import Material

SEEDS = range(4)
RADIANCE = (1.0, 1.0, 2.0)


def corner() -> Any:
    """A floor between two walls under an open sky, with a box in it; all of it reflects four fifths."""
    walls = [
        tiny.quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)),
        tiny.quad((-2, 0, -2), (2, 0, -2), (2, 2, -2), (-2, 2, -2)),
        tiny.quad((-2, 0, 2), (-2, 0, -2), (-2, 2, -2), (-2, 2, 2)),
        tiny.box((0.2, 0, -1.0), (1.0, 1.0, -0.2), 0.4),
    ]
    return tiny.scene_of(np.concatenate(walls), Material(name="Grey", reflectivity=(0.8, 0.8, 0.8)))


def means(source: dict[str, Any], background: Any, **changes: Any) -> Any:
    """Means of pictures without noise in common, (n_seeds, 3)."""
    keys = [{"frame": 0, "eye": [1.2, 1.6, 2.6], "target": [-0.2, 0.5, -0.8]}]
    found = []
    for seed in SEEDS:
        job = tiny.job(
            seed=seed, camera={"keys": keys, "resolution": [32, 24]}, light={"frames": 1, "sources": [source]},
            scene={"background": background}, samples={"hits": 64, "obscurance": 5}, **changes,
        )  # fmt: skip
        found.append(tiny.render_frames(tiny.prepared(job, corner())).images[0, 0].mean(axis=(0, 1)))
    return np.array(found, np.float64)


@pytest.mark.slow
@pytest.mark.parametrize(
    "tables",
    [
        {"indirect": {"method": "cells", "samples": 2**16}},
        {"obscurance": {"range": 1.5, "outside": "background"}, "ambient": {"paths": 2**16}},
    ],
)
def test_an_environment_of_one_colour_lights_as_the_background(tables: dict[str, Any], tmp_path: Path) -> None:
    """By other samples: a ray from each hit to the sky, in place of gather rays that leave the scene.

    Cells and obscurances differ a little from paths, each in its own way; so a half per cent is left to them.
    """
    write_image(tmp_path / "sky.exr", np.full((4, 8, 3), RADIANCE, np.float32), ImageFormat(half="never"))
    sky = {"type": "environment", "file": str(tmp_path / "sky.exr"), "keys": [{"frame": 0}]}
    dark = {"type": "point", "keys": [{"frame": 0, "position": [0, 9, 0], "intensity": 0.0}]}
    by_sky, by_background = means(sky, [0.0, 0.0, 0.0], **tables), means(dark, list(RADIANCE), **tables)
    error = np.hypot(*(each.std(axis=0, ddof=1) / np.sqrt(len(SEEDS)) for each in (by_sky, by_background)))
    difference = np.abs(by_sky.mean(axis=0) - by_background.mean(axis=0))
    assert (difference < 3.5 * error + 0.005 * by_background.mean(axis=0)).all()
    assert (error < 0.01 * by_background.mean(axis=0)).all()
