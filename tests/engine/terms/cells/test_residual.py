"""The printed error of light from cells: known errors come out, and those of images of a room that cells get wrong."""

import numpy as np
import pytest
from support import tiny
from support.light_errors import DARK, blocks_of, paths_of, rendered
from support.lit_rooms import LIT_ROOMS, LitRoom

from framearray_cli.engine.terms.accuracy import Accuracy
from framearray_cli.engine.terms.cells import residual
from framearray_cli.engine.terms.cells.residual import compare_with_paths
from framearray_cli.render.plan import _eye_walks, plan_work
from framearray_cli.render.prepare import open_embree

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
        accuracy = residual._accuracy(paths, read)
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
    assert residual._accuracy(np.zeros((64, 2, 3)), np.zeros((64, 2, 3))) == residual.NO_LIGHT


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a sunlit floor under a table", "black and white surfaces"])
def test_the_error_is_that_of_images(name: str) -> None:
    """Of rooms that wide cells get wrong, with enough hits to make their noise negligible."""
    room, many = LIT_ROOMS[name], {"hits": 32, "obscurance": 16}
    image, direct = rendered(room, indirect=CELLS, samples=many), rendered(room, ambient=DARK, samples=many)
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
            setup.indirect.cells, _eye_walks(inputs, embree), setup.indirect.settings, setup.depth, 2
        )
    assert isinstance(found, Accuracy)
    return found
