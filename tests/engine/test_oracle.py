"""The engine against its slow twin: every pixel, with and without reuse.

Tolerance. A pixel is a weighed mean of hits, each the end of a chain of about a hundred float32 operations (ray, hit,
texture, cosine, falloff, sums); the twin computes in float64. The two may differ by 128 roundings of 2^-24 of the
pixel's value or, where dark and bright terms meet, of the image's mean.

A ray that passes an edge within rounding may fall on different sides in the two; that changes a pixel by a whole hit.
With about 1e4 rays per image and 1e-6 of the room's size, 0.1 pixels per image do so. More than 2 are an error. Every
pixel that differs by more than rounding counts.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.oracle import Oracle
from support.tiny import RED, SUN, WALK

ROUNDING = 128 * 2.0**-24
FLIPS = 2
# With weights by area a hit at the border of a part of its pixel may lie on either side. A position is known to a few
# 1e-7 of the image's size, some 1e-5 pixels; 16 borders per pixel and axis, 1e4 hits, each in 2.25 pixels.
PARTS_FLIPS = 8

SKY = {"background": [0.3, 0.4, 0.5]}
LAMP = tiny.TABLE["light"]["sources"][0]


def differing(image: Any, twin: Any) -> int:
    """Number of pixels that differ by more than rounding."""
    error = abs(image - twin) / (twin + twin.mean())
    return int((error > ROUNDING).any(axis=-1).sum())


def compare(inputs: Any, frames: Any = None, lights: Any = None, flips: int = FLIPS) -> tuple[Any, Oracle]:
    """Render, and compare images of some frames and lights with the twin's; returns the render and the twin."""
    rendered = tiny.render_frames(inputs, threads=2)
    twin = Oracle(inputs, rendered.ambient)
    for c in range(len(rendered.composed)) if frames is None else frames:
        for l in range(inputs.n_lights) if lights is None else lights:
            image, expected = rendered.images[c, l], twin.image(c, l)
            assert np.isfinite(expected).all() and expected.mean() > 0.01
            assert differing(image, expected) <= flips, f"camera {c}, light {l}"
        moved = abs(rendered.composed[c].layers["samples"].reshape(-1) - twin.count)
        assert (moved > 0).sum() <= 2 * FLIPS, "hits that fell into another pixel"
    return rendered, twin


NO_REUSE: dict[str, dict[str, Any]] = {
    "black outside": {},
    "sky seen": {"scene": SKY},
    "sky gathered": {"scene": SKY, "obscurance": {"outside": "background"}},
    "three colours of light": {"light": {"sources": [LAMP, SUN, RED]}},
    "only the sun": {"light": {"frames": 1, "sources": [SUN]}},
    "one ray, one hit": {"samples": {"hits": 1, "obscurance": 1}},
    "mirrors to depth 1": {"specular": {"depth": 1}},
    "mirrors to depth 9": {"specular": {"depth": 9}},
    "mirrors black": {"specular": {"depth": 0}},
    "more hits on mirrors": {"specular": {"hits": 7}, "scene": SKY},
    "fixed ambient light": {"ambient": {"intensity": [0.5, 0.7, 0.2], "paths": None}},
    "a hit in every other pixel": {"samples": {"hits": 0.5}, "scene": SKY},
    "a hit in every eighth pixel, two on mirrors": {"samples": {"hits": 0.125}, "specular": {"hits": 2}},
    "another seed": {"seed": 2**32 - 1},
    "linear": {"obscurance": {"falloff": "linear"}},
    "cbrt": {"obscurance": {"falloff": "cbrt"}},
    "exponential": {"obscurance": {"falloff": "exponential", "tau": 2.0}},
    "constant": {"obscurance": {"falloff": "constant"}},
    "a short range": {"obscurance": {"range": 0.2}},
    "a range beyond the room": {"obscurance": {"range": 50.0}},
    "a view of a degree": {"camera": {"fov": 1.0}},
    "a view of 170 degrees": {"camera": {"fov": 170.0}, "scene": SKY},
}


@pytest.mark.parametrize("name", NO_REUSE)
def test_without_reuse_every_pixel_is_that_of_the_twin(name: str) -> None:
    compare(tiny.prepared(tiny.job(**NO_REUSE[name])))


@pytest.mark.parametrize("options", [{"mirrors": False}, {"textured": False}, {"mirrors": False, "textured": False}])
def test_scenes_without_a_feature_too(options: dict[str, bool]) -> None:
    compare(tiny.prepared(tiny.job(scene=SKY), tiny.room(**options)))


def test_a_scene_without_normals_or_colours() -> None:
    scene = tiny.scene_of(np.concatenate([tiny.box((-2, 0, -2), (2, 2.5, 2)), tiny.box((-1, 0, -1), (0, 1, 0), 0.3)]))
    assert not len(scene.normals) and not len(scene.colours) and not len(scene.uvs)
    compare(tiny.prepared(tiny.job(), scene))


@pytest.mark.parametrize("reuse", [{"n_r": 0}, {"n_r": 2, "weights": "balance"}])
def test_normal_maps_turn_what_all_terms_see(reuse: dict[str, Any]) -> None:
    inputs = tiny.prepared(tiny.job(camera=WALK, reuse=reuse, scene=SKY), tiny.bumpy_room())
    rendered, _ = compare(inputs, frames=[3], lights=[0, 2])
    flat = tiny.render_frames(tiny.prepared(tiny.job(camera=WALK, reuse=reuse, scene=SKY)))
    assert differing(rendered.images[3, 0], flat.images[3, 0]) > 100


def test_the_twin_sees_mirrors_in_mirrors() -> None:
    """Otherwise the depths above would all test the same picture. Both sides are the twin's, so no pixel flips."""
    jobs = [tiny.job(specular={"depth": depth}) for depth in range(4)]
    images = [compare(tiny.prepared(job), lights=[0])[1].image(0, 0) for job in jobs]
    for one, deeper in pairwise(images):
        assert differing(deeper, one) >= 2


REUSE: dict[str, dict[str, Any]] = {
    "inside a long path": {"camera": WALK, "reuse": {"n_r": 2}},
    "longer than the path": {"camera": tiny.walk(3), "reuse": {"n_r": 7}, "samples": {"hits": 1}},
    "one neighbour": {"camera": WALK, "reuse": {"n_r": 1}, "samples": {"hits": 3}},
    "two frames": {"camera": tiny.walk(2), "reuse": {"n_r": 3}},
    "a hit in every third pixel": {"camera": WALK, "reuse": {"n_r": 2}, "samples": {"hits": 1 / 3}},
    "a hit in every eighth pixel": {"camera": WALK, "reuse": {"n_r": 1}, "samples": {"hits": 0.125}},
    "sky gathered": {
        "camera": WALK,
        "reuse": {"n_r": 2},
        "obscurance": {"outside": "background"},
        "light": {"sources": [LAMP, SUN]},
    },
    "a camera that rests on its way": {
        "camera": {
            "frames": 5,
            "keys": [
                WALK["keys"][0],
                {"frame": 2, "eye": [0.4, 1.4, 1.5], "target": [0, 0.9, -1]},
                {"frame": 3, "eye": [0.4, 1.4, 1.5], "target": [0, 0.9, -1]},
                {"frame": 4, "eye": [0.5, 1.4, 1.2], "target": [0, 0.8, -1]},
            ],
        },
        "reuse": {"n_r": 2},
    },
    "past things that are then behind": {
        "camera": {
            "frames": 5,
            "fov": 120.0,
            "keys": [
                {"frame": 0, "eye": [0.1, 1.2, 1.8], "target": [0.1, 1.1, -3.0]},
                {"frame": 4, "eye": [0.1, 1.2, -1.0], "target": [0.1, 1.1, -3.0]},
            ],
        },
        "reuse": {"n_r": 2},
    },
    "turning round, a third of a turn per frame": {
        "camera": {
            "frames": 4,
            "keys": [
                {"frame": 0, "eye": [0.2, 1.3, 1.2], "target": [0.2, 1.2, -1.0]},
                {"frame": 1, "eye": [0.2, 1.3, 1.1], "target": [2.2, 1.2, 2.2]},
                {"frame": 2, "eye": [0.2, 1.3, 1.0], "target": [-2.2, 1.2, 2.2]},
                {"frame": 3, "eye": [0.2, 1.3, 0.9], "target": [0.2, 1.2, -1.0]},
            ],
        },
        "reuse": {"n_r": 2},
    },
}


@pytest.mark.parametrize("weights", ["average", "balance", "area"])
@pytest.mark.parametrize("name", REUSE)
def test_with_reuse_every_pixel_is_that_of_brute_force(name: str, weights: str) -> None:
    changes = REUSE[name]
    reuse = {**changes["reuse"], "weights": weights}
    inputs = tiny.prepared(tiny.job(**{"scene": SKY, **changes, "reuse": reuse}))
    n_c = inputs.n_cameras
    flips = PARTS_FLIPS if weights == "area" else FLIPS
    compare(inputs, frames=sorted({0, n_c // 2, n_c - 1}), lights=[1], flips=flips)


@pytest.mark.parametrize("weights", ["average", "balance", "area"])
def test_a_camera_that_stands_still_is_rendered_once(weights: str) -> None:
    inputs = tiny.prepared(tiny.job(camera={"frames": 4}, reuse={"n_r": 2, "weights": weights}, scene=SKY))
    rendered, _ = compare(inputs, flips=PARTS_FLIPS if weights == "area" else FLIPS)
    assert len(rendered.composed) == 1
    assert (rendered.composed[0].layers["samples"] == 2 * 5).all()
    assert "visibility" not in rendered.rays


@pytest.mark.parametrize("weights", ["average", "balance"])
def test_every_hit_of_a_long_window_is_used(weights: str) -> None:
    """In a closed room, seen from a point that hardly moves, nearly all frames show nearly every hit."""
    walk = {"frames": 5, "keys": [WALK["keys"][0], {"frame": 4, "eye": [0.2, 1.3, 1.699], "target": [-0.1, 0.9, -1.0]}]}
    reuse = {"n_r": 1, "weights": weights}
    inputs = tiny.prepared(tiny.job(camera=walk, reuse=reuse), tiny.scene_of(tiny.box((-2, 0, -2), (2, 2.5, 2))))
    rendered, _ = compare(inputs, frames=[2], lights=[0])
    assert rendered.composed[2].hits.mean() == pytest.approx(3 * 2, rel=0.01)


@pytest.mark.parametrize("change", ["light", "reflectivity", "seed", "texture"])
def test_a_small_fault_would_be_seen(change: str) -> None:
    """The comparison can fail: each of these faults changes more pixels than may flip."""
    inputs = tiny.prepared(tiny.job())
    rendered = tiny.render_frames(inputs)
    twin = Oracle(inputs, rendered.ambient)
    assert differing(rendered.images[0, 0], twin.image(0, 0)) <= FLIPS
    scene = inputs.scene
    if change == "light":
        inputs.lights.sources[0].vector[0, 0] += 1e-4
    elif change == "reflectivity":
        scene.reflectivity[0] *= np.float32(1.0001)
    elif change == "texture":
        scene.texels[: len(scene.texels) // 2, 0] += 1
    else:
        twin.job = tiny.job(seed=6)
    assert differing(rendered.images[0, 0], twin.image(0, 0)) > 10 * FLIPS


def test_far_from_the_origin_the_picture_is_the_same() -> None:
    """A model at 5e6 renders like the one at 0: positions are centred in float64."""
    near = tiny.render_frames(tiny.prepared(tiny.job(scene=SKY)))
    at = np.array([5.0e6, -3.0e6, 1.0e6])

    def shift(keys: Any, *names: str) -> list[dict[str, Any]]:
        return [{**key, **{name: list(np.array(key[name]) + at) for name in names}} for key in keys]

    camera = {"keys": shift(tiny.TABLE["camera"]["keys"], "eye", "target")}
    light = {"sources": [{**LAMP, "keys": shift(LAMP["keys"], "position")}]}
    far = tiny.render_frames(tiny.prepared(tiny.job(scene=SKY, camera=camera, light=light), tiny.room(at=at)))
    # float64 keeps 1e-9 at 5e6, far below float32's last digit at 2
    assert sum(differing(a, b) for a, b in zip(far.images[0], near.images[0], strict=True)) <= 3 * FLIPS


@pytest.mark.parametrize("size", [1e-4, 1e4])
def test_the_picture_does_not_depend_on_the_unit_of_length(size: float) -> None:
    """Room, path, lamps and range scaled together; intensity by the square."""

    def scaled(keys: Any) -> list[dict[str, Any]]:
        factor = {"eye": size, "target": size, "position": size, "intensity": size**2}
        return [
            {name: [x * factor[name] for x in value] if name in factor else value for name, value in key.items()}
            for key in keys
        ]

    changes = {
        "camera": {"keys": scaled(tiny.TABLE["camera"]["keys"])},
        "light": {"sources": [{**LAMP, "keys": scaled(LAMP["keys"])}]},
        "obscurance": {"range": 1.5 * size},
    }
    one = tiny.render_frames(tiny.prepared(tiny.job())).images[0]
    other = tiny.render_frames(tiny.prepared(tiny.job(**changes), tiny.room(size=size))).images[0]
    assert sum(differing(a, b) for a, b in zip(other, one, strict=True)) <= 3 * FLIPS
