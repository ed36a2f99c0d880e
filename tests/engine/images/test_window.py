"""The window: the hits it holds, when a frame is composed, and what a composed frame holds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import walk

from framearray_cli.engine.frames.frame import FrameHits
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames, window_of

SKY = {"background": [0.3, 0.4, 0.5]}


class Watched(Window):
    """A window that notes the eyes that were added, and the most that it held at a time."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.found: list[int] = []
        self.most = 0

    def add(self, frame: FrameHits) -> None:
        super().add(frame)
        self.found.append(frame.eye)
        self.most = max(self.most, len(self._frames))


@pytest.mark.parametrize(("n_c", "n_r"), [(1, 3), (2, 0), (7, 0), (7, 1), (7, 2), (4, 3), (3, 9), (12, 2)])
def test_no_more_than_the_window_is_held_and_every_frame_comes_once(n_c: int, n_r: int) -> None:
    camera = walk(n_c) if n_c > 1 else {}
    job = tiny.job(
        camera={**camera, "resolution": [4, 3]}, reuse={"n_r": n_r}, ambient={"paths": 8}, light={"frames": 3}
    )
    composed: list[int] = []
    with tiny.planned(tiny.prepared(job)) as (setup, ambient), TracePool(setup, 1) as pool:
        window = Watched(setup, ambient, pool)
        images = np.empty((3, 3, 4, 3), np.float32)
        for j in ready_frames(window, setup, range(n_c), pool):
            c = window.found[-1]
            assert j == len(composed), "in order"
            assert j + setup.n_r == c, "as soon as its last neighbour was found"
            composed.append(window.compose(j, images).c)
        beyond = setup.n_r
    assert composed == list(range(n_c)) and window.found == list(range(-beyond, n_c + beyond))
    assert window.most == 2 * beyond + 1
    assert not window._frames and not window._holes


def test_memory_of_dropped_frames_is_not_seen_again() -> None:
    """A frame is the same whether its arrays are new or were used by an earlier eye."""
    inputs = tiny.prepared(tiny.job(camera=walk(8), reuse={"n_r": 1}, scene=SKY))
    rendered = tiny.render_frames(inputs).images
    with tiny.planned(inputs) as (setup, ambient):
        for j in (3, 7):
            np.testing.assert_array_equal(tiny.composed(setup, ambient, j).images, rendered[j])


def test_memory_that_others_need_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays of dropped frames go back to the system where memory is scarce; images stay the same."""
    inputs = tiny.prepared(tiny.job(camera=walk(4), reuse={"n_r": 1}))
    with tiny.planned(inputs) as (setup, ambient):
        found = []
        for scarce in (False, True):
            monkeypatch.setattr("framearray_cli.engine.images.window.is_scarce", lambda held, scarce=scarce: scarce)
            with TracePool(setup, 1) as pool:
                window = Window(setup, ambient, pool)
                shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
                frames = ready_frames(window, setup, range(4), pool)
                found.append([window.compose(j, np.empty(shape, np.float32)).images for j in frames])
                assert bool(pool.arrays._free) != scarce
        np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("kernel", ["compose_pixels", "compose_differences"])
def test_a_task_that_fails_gives_its_sums_to_the_next(kernel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each thread has one band: a lost one would end all later frames."""
    inputs = tiny.prepared(tiny.job(camera=walk(3), reuse={"n_r": 1}, samples={"halves": True}))

    def fail(*_arguments: object) -> None:
        raise MemoryError

    with tiny.planned(inputs) as (setup, ambient), TracePool(setup, 2) as pool:
        window = window_of(1, setup, ambient, pool)
        shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
        before = window.compose(1, np.empty(shape, np.float32)).images
        for _ in range(3):
            with monkeypatch.context() as broken, pytest.raises(MemoryError):
                broken.setattr(f"framearray_cli.engine.images.window.{kernel}", fail)
                window.compose(1, np.empty(shape, np.float32))
        np.testing.assert_array_equal(window.compose(1, np.empty(shape, np.float32)).images, before)


@pytest.mark.parametrize("weights", ["average", "balance", "area"])
def test_twice_the_light_is_twice_the_picture(weights: str) -> None:
    """Direct and indirect light together, to the last bit: a factor of two changes no digit."""
    lamp = tiny.TABLE["light"]["sources"][0]
    twice = {**lamp, "keys": [{**key, "intensity": [2 * i for i in key["intensity"]]} for key in lamp["keys"]]}
    images = []
    for source in (lamp, twice):
        job = tiny.job(camera=walk(3), reuse={"n_r": 1, "weights": weights}, light={"sources": [source]})
        images.append(tiny.render_frames(tiny.prepared(job)).images)
    assert images[0].mean() > 0.1
    np.testing.assert_array_equal(images[1], 2 * images[0])


def test_layers_are_what_the_pictures_are_made_of() -> None:
    """Lights of no strength and a fixed I_A: the picture is I_A times the indirect layer."""
    dark = {"type": "point", "keys": [{"frame": 0, "position": [0, 1, 0], "intensity": 0.0}]}
    ambient = {"intensity": [2.0, 3.0, 4.0], "paths": None}
    job = tiny.job(camera=walk(3), reuse={"n_r": 1}, light={"frames": 1, "sources": [dark]}, ambient=ambient)
    rendered = tiny.render_frames(tiny.prepared(job, tiny.room(mirrors=False)))
    for frame in rendered.composed:
        layers = frame.layers
        np.testing.assert_allclose(frame.images[0], layers["indirect"] * [2, 3, 4], rtol=1e-6)
        for layer in (layers["obscurance"], layers["reflectivity"]):
            assert (layer >= 0).all() and (layer <= 1 + 1e-6).all()
        assert (layers["indirect"] <= np.minimum(layers["reflectivity"], layers["obscurance"]) + 1e-6).all()
        np.testing.assert_array_equal(layers["samples"].reshape(-1), frame.hits)


def test_normal_and_depth_are_those_of_the_frames_own_hits() -> None:
    """Before a wall at a known distance, and before nothing."""
    wall = tiny.quad((-9, -9, 0), (0, -9, 0), (0, 9, 0), (-9, 9, 0))  # the left half of the view
    keys = [
        {"frame": 0, "eye": [0, 0, 2], "target": [0, 0, 0]},
        {"frame": 1, "eye": [0, 0, 3], "target": [0, 0, 0]},
    ]
    job = tiny.job(camera={"frames": 2, "keys": keys, "fov": 60.0}, reuse={"n_r": 1})
    rendered = tiny.render_frames(tiny.prepared(job, tiny.scene_of(wall)))
    for frame, distance in zip(rendered.composed, (2, 3), strict=True):
        layers = frame.layers
        np.testing.assert_allclose(layers["depth"][:, :12], distance, rtol=1e-5)
        np.testing.assert_allclose(layers["normal"][:, :12], np.tile([0, 0, 1], (18, 12, 1)), atol=1e-6)
        assert not layers["depth"][:, 12:].any() and not layers["normal"][:, 12:].any()


def test_no_layers_if_the_job_wants_none() -> None:
    inputs = tiny.prepared(tiny.job(output={"layers": False}))
    rendered, full = tiny.render_frames(inputs), tiny.render_frames(tiny.prepared(tiny.job()))
    assert rendered.composed[0].layers == {}
    np.testing.assert_array_equal(rendered.images, full.images)


def test_a_value_that_is_not_finite_is_counted_located_and_black() -> None:
    """Light 1 of 3 is far too strong for float32: only its picture changes, and the first place is noted."""
    inputs = tiny.prepared(tiny.job(scene=SKY))
    strength = inputs.light_arrays.strength.copy()
    strength[..., 1] = 3e38
    broken = replace(inputs, light_arrays=inputs.light_arrays._replace(strength=strength))
    good = tiny.render_frames(inputs).composed[0]
    with np.errstate(over="ignore", invalid="ignore"):
        bad = tiny.render_frames(broken).composed[0]
    assert (good.bad, good.first_bad) == (0, None)
    assert bad.first_bad is not None and bad.first_bad[0] == 1
    assert bad.bad > 0 and np.isfinite(bad.images).all()
    for l in (0, 2):
        assert (bad.images[l] > 0).all()
    first = bad.images[1].reshape(-1, 3)[bad.first_bad[1]]
    assert (first == 0).any()
