"""Camera reuse: which pixels of other eyes see a hit, with which density, and with which weight."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.hits import native
from support.oracle import Oracle
from support.tiny import WALK

from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.hits.hits import SURFACE
from framearray_cli.engine.hits.outer import balance_weights, outer_hits, sort_by_pixel
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.cameras import OUTSIDE

SKY = {"background": [0.3, 0.4, 0.5]}


def outer(setup: Any, c: int, hits: Any, eyes: range, room: int = 4096) -> tuple[Any, Any, int]:
    """Pixel and density of hits of eye c in each of some eyes, (n_eyes, n), and the number of rays."""
    n = len(hits.kind)
    room_for_hits = -(-n // 16) * 16
    pixel, density = np.empty((len(eyes), room_for_hits), np.int32), np.empty((len(eyes), room_for_hits), np.float64)
    tests = room_for_tests(room, setup.lights.n_lights)
    rays = outer_hits(setup.cams, c, eyes.start, hits, n, setup.world.tracer, tests, pixel, density, True)
    return pixel[:, :n], density[:, :n], rays


@pytest.fixture(scope="module")
def walk() -> Any:
    return tiny.prepared(tiny.job(camera=WALK, reuse={"n_r": 2}, scene=SKY))


def test_outer_hits_are_those_of_brute_force(walk: Any) -> None:
    with tiny.planned(walk) as (setup, ambient):
        hits = native(setup, 2, 2)
        pixel, density, rays = outer(setup, 2, hits, range(0, 6))
    twin = Oracle(walk, ambient)
    theirs = twin.native(2)
    here = {key: i for i, key in enumerate(hits.key.tolist())}
    order = [here[key] for key in theirs.key]
    for k in range(6):
        expected, p = twin.seen(k, 2, theirs)
        same = pixel[k][order] == expected
        assert (~same).sum() <= 1  # a hit at the very border of a pixel or of a shadow
        seen = same & (expected >= 0)
        assert 0.3 < seen.mean() <= 1
        np.testing.assert_allclose(density[k][order][seen], p[seen], rtol=1e-4)
        assert (density[k][pixel[k] == OUTSIDE] == 0).all()
    assert 0 < rays <= 5 * len(hits.kind)


def test_the_eye_that_found_a_hit_sees_it_in_its_own_pixel(walk: Any) -> None:
    with tiny.planned(walk) as (setup, _):
        hits = native(setup, 3, 2)
        pixel, density, rays = outer(setup, 3, hits, range(3, 4))
    np.testing.assert_array_equal(pixel[0], hits.pixel)
    assert (density > 0).all() and rays == 0


@pytest.mark.parametrize("room", [16, 160])
def test_any_room_for_rays_gives_the_same(walk: Any, room: int) -> None:
    with tiny.planned(walk) as (setup, _):
        hits = native(setup, 2, 2)
        expected, result = outer(setup, 2, hits, range(0, 6)), outer(setup, 2, hits, range(0, 6), room)
    for one, other in zip(expected, result, strict=True):
        np.testing.assert_array_equal(one, other)


def around_a_box(*looks: tuple[Any, Any], per_pixel: int) -> tuple[Any, Any, Any]:
    """Hits of the first of two eyes before a box, given by eye and target; their pixels and densities in both."""
    keys = [{"frame": c, "eye": eye, "target": target} for c, (eye, target) in enumerate(looks)]
    job = tiny.job(camera={"frames": 2, "keys": keys, "fov": 60.0}, reuse={"n_r": 1})
    with tiny.planned(tiny.prepared(job, tiny.scene_of(tiny.box((-1, -1, -1), (1, 1, 1))))) as (setup, _):
        hits = native(setup, 0, per_pixel)
        return hits, *outer(setup, 0, hits, range(0, 2))[:2]


def test_a_hit_behind_a_box_is_not_seen() -> None:
    """Two eyes on the two sides of a box see nothing of each other's side, and both see the sky above it."""
    looks = ([-4, 0, 0], [-3, 0.2, 0]), ([4, 0, 0], [3, 0.2, 0])
    hits, pixel, density = around_a_box(*looks, per_pixel=2)
    on_box = hits.kind == SURFACE
    assert on_box.any() and (~on_box).any()
    assert (pixel[1] == OUTSIDE).all() and not density[1].any()  # the other eye looks the other way: no sky in common


def test_escaped_rays_are_reused_as_directions() -> None:
    """Against an open sky every hit of one eye is used by its neighbour, box and sky, or is hidden by the box."""
    hits, pixel, density = around_a_box(([0, 0, 6], [0, 0, 0]), ([0.5, 0, 6], [0.5, 0, 0]), per_pixel=4)
    gone = hits.kind != SURFACE
    # both eyes look the same way, so that a direction falls into the same pixel of both
    seen = gone & (pixel[1] != OUTSIDE)
    np.testing.assert_array_equal(pixel[1][seen], hits.pixel[seen])
    np.testing.assert_allclose(density[1][seen], density[0][seen], rtol=1e-5)
    hidden = gone & (pixel[1] == OUTSIDE)
    assert 0 < hidden.sum() < 0.2 * gone.sum()  # directions that meet the box from the other eye
    column = hits.pixel[hidden] % 24
    assert column.max() < 12, "they lie to the left of the box's middle, from where the box has come"


@pytest.mark.parametrize("n_r", [1, 2, 7])
def test_balance_weights_are_the_formula(walk: Any, n_r: int) -> None:
    rng = np.random.default_rng(1)
    n_c, n = 6, 500
    density = rng.random((n_c, n)) * 10
    pixel = rng.integers(0, 99, (n_c, n), dtype=np.int32)
    hidden = rng.random((n_c, n)) < 0.3
    density[hidden], pixel[hidden] = 0, OUTSIDE
    counts = rng.integers(0, 5, (n_c, n_c)).astype(np.float64)
    counts[np.diag_indices(n_c)] += 1
    weight = np.full((n_c, n), np.nan, np.float32)
    balance_weights(counts, n_r, 0, 0, n, pixel, density, weight)
    for j in range(n_c):
        window = slice(max(j - n_r, 0), j + n_r + 1)
        total = (counts[j, window, None] * density[window]).sum(axis=0)
        expected = np.divide(density[j], total, out=np.zeros(n), where=density[j] > 0)
        np.testing.assert_allclose(weight[j], expected, rtol=1e-6)
        # the rule behind it: over the eyes that may find the hit, n_k p_k times the hit's weight sum to p_j
        seen = density[j] > 0
        np.testing.assert_allclose(total[seen] * weight[j][seen], density[j][seen], rtol=1e-6)


@pytest.mark.parametrize("c", [0, 2, 5])
def test_weights_of_a_frame_sum_to_one_per_pixel_in_the_mean(walk: Any, c: int) -> None:
    """The bare sum of weights over a pixel's hits has mean 1: densities, hit counts and visibility agree.

    A wrong density, a forgotten escaped ray or hits at the path's ends counted wrongly would all shift it.
    """
    with tiny.planned(walk) as (setup, _), TracePool(setup, 1) as pool:
        total = np.zeros(setup.n_pixels)
        for eye in setup.eyes_of(c):
            frame = find_frame(setup, eye, pool)
            place, weight = frame.places[c], frame.seen_in(c)["weight"]
            used = place.order[: place.start[-1]]
            np.add.at(total, np.repeat(np.arange(setup.n_pixels), np.diff(place.start)), weight[used])
    z = (total.mean() - 1) / (total.std() / np.sqrt(len(total)))
    assert abs(z) < 4
    assert total.std() < 1


@pytest.mark.parametrize("n", [0, 1, 1000, 5000])
def test_sort_by_pixel_is_a_stable_sort(n: int) -> None:
    n_pixels = 97
    pixel = np.random.default_rng(n).integers(-1, n_pixels, n).astype(np.int32)
    assert OUTSIDE == -1
    start, order = np.empty(n_pixels + 1, np.int32), np.full(n, -7, np.int32)
    for first, last in pairwise([0, 0, 40, 41, n_pixels]):  # in any ranges
        sort_by_pixel(pixel, first, last, start, order)
    expected = np.argsort(pixel, kind="stable")[(pixel == OUTSIDE).sum() :]
    np.testing.assert_array_equal(order[: start[-1]], expected)
    counts = np.bincount(pixel[pixel >= 0], minlength=n_pixels)
    np.testing.assert_array_equal(start, np.concatenate([[0], np.cumsum(counts)]))


def test_without_reuse_no_visibility_ray_is_traced() -> None:
    rendered = tiny.render_frames(tiny.prepared(tiny.job(camera=WALK, reuse={"n_r": 0})))
    assert "visibility" not in rendered.rays
    assert all((frame.layers["samples"] == 2).all() for frame in rendered.composed)
