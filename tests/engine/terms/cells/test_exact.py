"""Indirect light by paths from every hit: that of independent pictures, whatever is computed together."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.pathtraced import path_traced

from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.terms.ambient import estimate
from framearray_cli.engine.terms.cells import exact

EXACT = {"method": "cells", "exact": True}
SKY = {"scene": {"background": [0.3, 0.4, 0.5]}}
LAMP = tiny.TABLE["light"]["sources"][0]
PANEL = {"frame": 0, "position": [-0.5, 1.9, 0], "target": [0, 0, 0], "power": 30.0, "width": 0.5, "height": 0.2}
JOBS: dict[str, dict[str, Any]] = {
    "one colour of light": SKY,
    "three": {"light": {"sources": [LAMP, tiny.RED]}},
    "a panel": {"light": {"sources": [LAMP, {"type": "rect", "keys": [PANEL]}]}},
}


def mean_of(image: Any) -> Any:
    """Over pixels and channels, by light position."""
    return image.mean(axis=(-3, -2, -1))


@pytest.mark.parametrize("name", [*list(JOBS)[:2], pytest.param("a panel", marks=pytest.mark.slow)])
def test_images_are_those_of_paths(name: str) -> None:
    inputs = [
        tiny.prepared(tiny.job(**JOBS[name], indirect=EXACT, samples={"hits": 16, "obscurance": 8}, seed=seed))
        for seed in range(4)
    ]
    images = np.array([mean_of(tiny.render_frames(one, threads=2).images[0]) for one in inputs], np.float64)
    paths = path_traced(inputs[0], 0, 1024).mean(axis=(1, 2))  # (samples, n_lights)
    error = np.hypot(paths.std(axis=0, ddof=1) / len(paths) ** 0.5, images.std(axis=0, ddof=1) / len(images) ** 0.5)
    right = paths.mean(axis=0)
    assert (error < 0.02 * right).all()
    assert (abs(images.mean(axis=0) - right) < 4 * error).all()


def test_what_is_computed_together_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads, blocks of light positions, and hits per batch of paths."""
    job = tiny.job(**SKY, indirect=EXACT, samples={"hits": 2, "obscurance": 3})
    found = []
    for threads, batch in ((1, estimate.BATCH), (2, estimate.BATCH), (1, 64)):
        monkeypatch.setattr(exact, "BATCH", batch)
        with tiny.planned(tiny.prepared(job)) as (setup, ambient), TracePool(setup, threads) as pool:
            found.append(tiny.frames_of(setup, ambient, pool)[0].images)
            block = setup.for_block(range(1, 3))
            with TracePool(block, threads) as few:
                part = tiny.frames_of(block, ambient.for_lights(range(1, 3)), few)[0].images
            np.testing.assert_array_equal(part, found[-1][1:])
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
