"""Standard errors from two halves of the hits: the arithmetic, what is written, and what does not change."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import WALK

from framearray_cli.array.images import read_image, read_layers
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.engine.images.standard_error import error_summary, fill_unknown, half_factors, standard_error
from framearray_cli.job.job import Job
from framearray_cli.render.render import render


def test_factors_make_a_difference_of_means_with_the_variance_of_the_mean() -> None:
    weights = np.array([[1.0, 3.0, 0.5], [1.0, 5.0, 2.0]])
    first, second = half_factors(weights)
    np.testing.assert_allclose(first * weights[0], -second * weights[1], rtol=1e-6)  # equal halves: no difference
    # one unit of variance per unit of weight: the sum of w f^2 is the variance of the mean, one over the total weight
    np.testing.assert_allclose(weights[0] * first**2 + weights[1] * second**2, 1 / weights.sum(axis=0), rtol=1e-6)
    assert (first > 0).all() and (second < 0).all()


def test_a_pixel_with_only_one_half_has_no_difference() -> None:
    assert (half_factors(np.array([[2.0, 0.0, 0.0], [0.0, 3.0, 0.0]])) == 0).all()


def test_the_error_is_the_root_of_the_mean_square_nearby() -> None:
    rng = np.random.default_rng(3)
    difference = rng.normal(size=(60, 80, 3)).astype(np.float32) * np.float32([1.0, 2.0, 0.0])
    error = standard_error(difference, np.full((60, 80), 7))
    np.testing.assert_allclose(np.sqrt((error**2).mean(axis=(0, 1))), [1, 2, 0], rtol=0.05)
    middle = difference[20:25, 30:35]
    np.testing.assert_allclose(error[22, 32], np.sqrt((middle**2).mean(axis=(0, 1))), rtol=1e-5)


def test_neighbours_share_the_variance_of_a_hit() -> None:
    """They share no variance per pixel: where every second one has more hits, each keeps its own."""
    hits = np.tile([4, 8], (9, 9))
    difference = np.repeat(1 / np.sqrt(hits)[..., None], 3, axis=-1).astype(np.float32)
    np.testing.assert_allclose(standard_error(difference, hits), difference, rtol=1e-6)


def test_unknown_pixels_take_the_nearest_difference_for_their_hits() -> None:
    differences = np.zeros((2, 1, 3, 3), np.float32)
    differences[:, 0, 0] = [[1, 2, 3], [-1, 0, 4]]
    hits = np.array([[9, 1, 4]])
    fill_unknown(differences, np.array([[True, False, False]]), hits)
    np.testing.assert_allclose(differences[:, 0, 1], 3 * differences[:, 0, 0])
    np.testing.assert_allclose(differences[:, 0, 2], 1.5 * differences[:, 0, 0])
    untouched = differences.copy()
    fill_unknown(differences, np.zeros((1, 3), bool), hits)
    assert np.array_equal(differences, untouched)


def test_the_summary_of_an_array() -> None:
    found = error_summary({(0, 0): (1.0, 2.0), (0, 1): (9.0, 4.0), (1, 0): (2.0, 0.0)})
    assert found == {"rms": 2.0, "relative": 1.0, "largest": 3.0, "camera": 0, "light": 1}
    assert error_summary({(0, 0): (0.0, 0.0)})["relative"] == 0.0


def test_the_summary_is_the_same_in_whatever_order_images_were_written() -> None:
    rng = np.random.default_rng(4)
    errors = {(c, l): (rng.random() ** 9, rng.random() ** 9) for c in range(20) for l in range(20)}
    wanted = error_summary(errors)
    for _ in range(20):
        order = rng.permutation(len(errors))
        shuffled = [list(errors.items())[k] for k in order]
        assert error_summary(dict(shuffled)) == wanted


def windowed(job: Job, j: int, eyes: Any = None) -> Any:
    """Compose frame j of a job from all hits of its window, or from those of some eyes."""
    with tiny.planned(tiny.prepared(job)) as (setup, ambient):
        return tiny.composed(setup, ambient, j, eyes=eyes)


def test_the_difference_is_that_of_the_two_halves_of_the_window() -> None:
    """Against images composed of the hits of one half only; each half weighs by its number of hits."""
    job = tiny.job(
        camera=WALK, reuse={"n_r": 2, "weights": "average"}, samples={"hits": 1, "halves": True}, specular={"depth": 0}
    )
    whole, even, odd = (windowed(job, 3, eyes) for eyes in (None, (2, 4), (1, 3, 5)))
    n, m = (half.hits.reshape(whole.images.shape[1:3])[..., None].astype(float) for half in (even, odd))
    assert (whole.hits == even.hits + odd.hits).all()
    both = ((n > 0) & (m > 0))[..., 0]
    expected = (even.images.astype(float) - odd.images) * np.sqrt(n * m) / (n + m)
    assert both.mean() > 0.8 and abs(expected[:, both]).max() > 0.01
    np.testing.assert_allclose(whole.differences[:, both], expected[:, both], rtol=1e-4, atol=2e-6)


def test_images_stay_as_they_are_where_frames_are_the_halves() -> None:
    kinds: dict[str, Any] = {"camera": WALK, "reuse": {"n_r": 1}, "specular": {"depth": 0}}
    plain = tiny.render_frames(tiny.prepared(tiny.job(**kinds)))
    halved = tiny.render_frames(tiny.prepared(tiny.job(**kinds, samples={"halves": True})))
    assert np.array_equal(plain.images, halved.images)
    assert plain.composed[0].differences is None and halved.composed[0].differences is not None


@pytest.mark.parametrize(("still", "depth"), [(True, 0), (True, 4), (False, 4)])
def test_halves_of_samples_differ_wherever_there_is_light(still: bool, depth: int) -> None:
    """Without reuse, or with mirrors, samples and not frames are the halves."""
    camera = {} if still else WALK
    job = tiny.job(camera=camera, samples={"hits": 2, "halves": True}, specular={"depth": depth, "hits": 6})
    frame = tiny.render_frames(tiny.prepared(job)).composed[0]
    assert frame.differences is not None
    lit = frame.images.max(axis=(0, 3)) > 0
    assert (abs(frame.differences).max(axis=(0, 3)) > 0)[lit].mean() > 0.95
    assert abs(frame.differences.mean()) < 0.2 * abs(frame.differences).mean()


def test_blocks_of_lights_and_threads_give_the_same_differences() -> None:
    job = tiny.job(camera=WALK, reuse={"n_r": 1}, samples={"halves": True})
    inputs = tiny.prepared(job)
    one, three = tiny.render_frames(inputs, 1), tiny.render_frames(inputs, 3)
    for a, b in zip(one.composed, three.composed, strict=True):
        assert a.differences is not None and np.array_equal(a.differences, b.differences)


@pytest.mark.parametrize("half", ["auto", "never"])
def test_images_hold_error_and_difference(tmp_path: Path, half: str) -> None:
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb")
    job = tiny.job(
        scene={"file": str(scene)}, samples={"halves": True}, output={"directory": str(tmp_path / "out"), "half": half}
    )
    summary = render(job)
    manifest = read_manifest(tmp_path / "out")
    layers = read_layers(tmp_path / "out" / manifest.images.format(camera=0, light=1))
    image = read_image(tmp_path / "out" / manifest.images.format(camera=0, light=1))
    difference = np.stack([layers[f"difference.{letter}"] for letter in "RGB"], axis=-1)
    error = np.stack([layers[f"error.{letter}"] for letter in "RGB"], axis=-1)
    assert np.array_equal(image, np.stack([layers[letter] for letter in "RGB"], axis=-1))
    again = standard_error(difference, np.full(difference.shape[:2], 2))
    np.testing.assert_allclose(error, again, rtol=2e-3 if half == "auto" else 1e-5, atol=1e-5)
    assert manifest.summary["standard_error"] == summary.standard_error
    assert 0 < summary.standard_error["rms"] <= summary.standard_error["largest"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"output": {"format": "png"}}, 'expected output.format = "exr"'),
        ({"samples": {"hits": 1}}, "expected at least two hits"),
    ],
)
def test_halves_refuse_what_they_cannot_do(changes: dict[str, Any], message: str) -> None:
    changes = {**changes, "samples": {"halves": True, **changes.get("samples", {})}}
    with pytest.raises(ValueError, match=message):
        tiny.job(**changes)
