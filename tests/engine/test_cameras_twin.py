"""Cameras other than plain perspectives against the slow twin: every pixel, with and without reuse."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.oracle import Oracle
from support.tiny import WALK

from .test_oracle import FLIPS, PARTS_FLIPS, compare

pytestmark = pytest.mark.slow  # they compile kernels that no other test needs

CAMERAS: dict[str, dict[str, Any]] = {
    "shifted": {"fov": 75.0, "shift": [0.1, -0.2], "pixel_aspect": 1.3},
    "orthographic": {"type": "orthographic", "height": 2.2},
    "panorama": {"type": "panorama", "resolution": [36, 18]},
}
SKY = {"background": [0.3, 0.4, 0.5]}


def inputs_of(name: str, path: Any = WALK, zoom: Any = None, **changes: Any) -> Any:
    table = tiny.table(scene=SKY, **changes)
    table["camera"] = {"resolution": [24, 18], **path, **CAMERAS[name]}
    if zoom:
        key = next(iter(zoom))
        table["camera"].pop(key)
        keys = [{**row, key: value} for row, value in zip(path["keys"], zoom[key], strict=True)]
        table["camera"]["keys"] = keys
    return tiny.prepared(tiny.Job.model_validate(table))


@pytest.mark.parametrize("name", CAMERAS)
def test_without_reuse_every_pixel_is_that_of_the_twin(name: str) -> None:
    compare(inputs_of(name, {"frames": 1, "keys": WALK["keys"][:1]}), lights=[0, 2])


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("weights", ["balance", "area"])
def test_with_reuse_every_pixel_is_that_of_the_twin(name: str, weights: str) -> None:
    inputs = inputs_of(name, reuse={"n_r": 2, "weights": weights})
    flips = PARTS_FLIPS if weights == "area" else FLIPS
    rendered, _ = compare(inputs, frames=[0, 3], lights=[0, 2], flips=flips)
    assert rendered.rays["visibility"] > 0


@pytest.mark.parametrize(
    ("name", "zoom"), [("shifted", {"fov": [75.0, 40.0]}), ("orthographic", {"height": [2.2, 1.1]})]
)
def test_a_zoom_too(name: str, zoom: Any) -> None:
    compare(inputs_of(name, zoom=zoom, reuse={"n_r": 2, "weights": "balance"}), frames=[2], lights=[1])


def test_parallel_cameras_share_the_sky() -> None:
    """An orthographic camera that slides past a box: every eye sees the sky of its neighbours."""
    scene = tiny.scene_of(tiny.box((-1, -1, -1), (1, 1, 1)))
    keys = [
        {"frame": 0, "eye": [0.3, 0.2, 5], "target": [0.1, 0, 0]},
        {"frame": 3, "eye": [0.9, 0.4, 5], "target": [0.7, 0.2, 0]},
    ]
    table = tiny.table(scene=SKY, reuse={"n_r": 2, "weights": "balance"})
    table["camera"] = {"resolution": [24, 18], "frames": 4, "keys": keys, "type": "orthographic", "height": 4.0}
    inputs = tiny.prepared(tiny.Job.model_validate(table), scene)
    rendered, twin = compare(inputs, frames=[1], lights=[0])
    samples = rendered.composed[1].layers["samples"]
    assert samples[0, 0] < samples.max() and samples[:, 0].max() > 4, "hits of the sky come from neighbours, too"
    assert isinstance(twin, Oracle)


@pytest.mark.parametrize("name", CAMERAS)
def test_reuse_changes_no_mean(name: str) -> None:
    """Pictures with the hits of neighbours and pictures of twice as many own hits differ by noise only."""
    means = []
    for seed in range(12):
        with_reuse = inputs_of(name, reuse={"n_r": 2, "weights": "balance"}, seed=seed)
        alone = inputs_of(name, reuse={"n_r": 0}, samples={"hits": 4}, seed=100 + seed)
        one, other = (tiny.render_frames(inputs).images[3, 1].mean(axis=(0, 1)) for inputs in (with_reuse, alone))
        means.append(one - other)
    z = np.mean(means, axis=0) / (np.std(means, axis=0, ddof=1) / np.sqrt(len(means)))
    assert (abs(z) < 4.5).all()  # t of 11 degrees of freedom, 9 comparisons: 0.7 % by chance
