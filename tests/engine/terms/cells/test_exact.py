"""Indirect light by paths, and the error of cells against it."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.light_errors import blocks_of, paths_of, rendered
from support.lit_rooms import LIT_ROOMS, LitRoom
from support.pathtraced import path_traced

from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.terms.ambient import intensity
from framearray_cli.engine.terms.ambient.intensity import Accuracy
from framearray_cli.engine.terms.cells import exact
from framearray_cli.engine.terms.cells.exact import compare_with_paths
from framearray_cli.render.plan import _eye_walks, plan_work
from framearray_cli.render.prepare import open_embree

EXACT = {"method": "cells", "exact": True}
SKY = {"scene": {"background": [0.3, 0.4, 0.5]}}
LAMP = tiny.TABLE["light"]["sources"][0]
PANEL = {"frame": 0, "position": [-0.5, 1.9, 0], "target": [0, 0, 0], "power": 30.0, "width": 0.5, "height": 0.2}
JOBS: dict[str, dict[str, Any]] = {
    "one colour of light": SKY,
    "three": {"light": {"sources": [LAMP, tiny.RED]}},
    "a panel": {"light": {"sources": [LAMP, {"type": "rect", "keys": [PANEL]}]}},
}


@pytest.mark.parametrize(
    "name", ["three", *(pytest.param(name, marks=pytest.mark.slow) for name in JOBS if name != "three")]
)
def test_images_are_those_of_paths(name: str) -> None:
    inputs = [
        tiny.prepared(tiny.job(**JOBS[name], indirect=EXACT, samples={"hits": 16, "obscurance": 8}, seed=seed))
        for seed in range(4)
    ]
    images = np.array([tiny.render_frames(one, threads=2).images[0].mean(axis=(1, 2, 3)) for one in inputs], float)
    paths = path_traced(inputs[0], 0, 1024).mean(axis=(1, 2))  # (samples, n_lights)
    error = np.hypot(paths.std(axis=0, ddof=1) / len(paths) ** 0.5, images.std(axis=0, ddof=1) / len(images) ** 0.5)
    right = paths.mean(axis=0)
    assert (error < 0.02 * right).all()
    assert (abs(images.mean(axis=0) - right) < 4 * error).all()


def test_what_is_computed_together_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads, blocks of light positions, and hits per batch of paths."""
    job = tiny.job(**SKY, indirect=EXACT, samples={"hits": 2, "obscurance": 3})
    found = []
    for threads, batch in ((1, intensity.BATCH), (2, intensity.BATCH), (1, 64)):
        monkeypatch.setattr(exact, "BATCH", batch)
        with tiny.planned(tiny.prepared(job)) as (setup, ambient), TracePool(setup, threads) as pool:
            found.append(tiny.frames_of(setup, ambient, pool)[0].images)
            block = setup.for_block(range(1, 3))
            with TracePool(block, threads) as few:
                part = tiny.frames_of(block, ambient.at(range(1, 3)), few)[0].images
            np.testing.assert_array_equal(part, found[-1][1:])
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


CELLS = {"method": "cells", "samples": 2**18, "filter": 0, "cell": 2.0}  # as wide as the rooms, to be wrong there
N, N_L = 2048, 8


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_known_errors_come_out(noise: float) -> None:
    rng = np.random.default_rng(3)
    light = rng.exponential(2.0, (N, 1, N_L))
    wrong = light * (1.05 + rng.normal(0, 0.2, (N, 1, N_L)))
    found = []
    for _ in range(40):
        paths, read = (right + rng.normal(0, noise, (N, 2, N_L)) for right in (light, wrong))
        accuracy = exact._accuracy(paths, read)
        assert isinstance(accuracy, Accuracy)
        found.append(accuracy)
    bias = wrong.mean() / light.mean() - 1
    error = float(((wrong - light) ** 2).mean()) ** 0.5 / light.mean()
    for name, right in (("bias", bias), ("error", error)):
        values = np.array([getattr(one, name) for one in found])
        of_noise = values.std(ddof=1)
        assert abs(values.mean() - right) < 4 * of_noise / len(found) ** 0.5 + 1e-9
        # printed errors hold the spread of points, too, which these repetitions share
        assert 0.9 * of_noise < np.median([getattr(one, f"{name}_error") for one in found]) < 0.05


def test_no_light_has_no_error() -> None:
    assert exact._accuracy(np.zeros((64, 2, 3)), np.zeros((64, 2, 3))) == exact.NO_LIGHT


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a sunlit floor under a table", "black and white surfaces"])
def test_the_error_is_that_of_images(name: str) -> None:
    """Of rooms that wide cells get wrong, with enough hits to make their noise negligible."""
    room, many = LIT_ROOMS[name], {"hits": 32, "obscurance": 16}
    image, direct = rendered(room, indirect=CELLS, samples=many), rendered(room, ambient=tiny.DARK, samples=many)
    groups = paths_of(room, 512)
    means = groups.mean(axis=(1, 2, 3, 4))
    level, noise = means.mean(), means.std(ddof=1) / len(means) ** 0.5
    bias = float((image - direct).mean()) / level - 1
    residuals = [blocks_of(image - direct - groups[k::2].mean(axis=0)) for k in range(2)]
    error = float((residuals[0] * residuals[1]).mean()) ** 0.5 / level
    found = accuracy_of(room)
    assert error > 0.04
    assert found.bias_error < 0.02
    assert abs(found.bias - bias) < 3 * np.hypot(found.bias_error, noise / level)
    # points differ a little more than means over blocks of pixels do
    assert error - 3 * found.error_error < found.error < 1.2 * error + 3 * found.error_error


def accuracy_of(room: LitRoom) -> Accuracy:
    inputs = tiny.prepared(room.job(indirect=CELLS), room.scene())
    with open_embree(inputs) as embree:
        setup, _ = plan_work(inputs, embree)
        assert setup.indirect.cells is not None
        found = compare_with_paths(
            setup.indirect.cells, _eye_walks(inputs, embree), setup.indirect.settings, setup.depth, 1 << 20, 2
        )
    assert isinstance(found, Accuracy)
    return found
