"""Materials that emit, and are those of no source, where surfaces follow the file: they are seen, and light nothing."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.job.job import Job
from framearray_cli.render.identity import scene_fingerprint
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.scene import Scene, build_scene

GLOW = (3.0, 2.0, 1.0)
TINT = (0.9, 0.5, 0.25)
WALL = tiny.quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))  # its front towards +z
MIRROR = tiny.quad((3, -3, 4), (-3, -3, 4), (-3, 3, 4), (3, 3, 4))
FLOOR = tiny.quad((-3, -3, 4), (3, -3, 4), (3, -3, 0), (-3, -3, 0))
TEXELS = np.full((1, 64, 4), 255, np.uint8)
TEXELS[0, :32, :3] = 0


def scene_of(*, front: Any = WALL, texture: int = -1, one_sided: bool = True, roughness: float = 0.0) -> Scene:
    material = Material(
        name="Wall", reflectivity=(0.4, 0.4, 0.4), emission=GLOW, emission_texture=texture, one_sided=one_sided,
        roughness=roughness,
    )  # fmt: skip
    materials = (material, Material(name="Mirror", reflectivity=(0.0,) * 3, specular=TINT), Material(name="Floor"))
    uvs = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)
    parts = (
        Part(material=0, corners=front, uvs=uvs),
        Part(material=1, corners=MIRROR),
        Part(material=2, corners=FLOOR),
    )
    return build_scene(Meshes(parts=parts, materials=materials, textures=(TEXELS,), dropped={}, notes=()), {})


def inputs(scene: Scene, target: Any, surfaces: str = "file") -> Any:
    table = tiny.table(
        scene={"surfaces": surfaces},
        camera={
            "resolution": [12, 9],
            "fov": 30.0,
            "frames": 1,
            "keys": [{"frame": 0, "eye": [0.0, 0.0, 3.0], "target": list(target)}],
        },
        light={
            "frames": 2,
            "sources": [{"type": "point", "keys": [{"frame": 0, "position": [50.0, 0.0, -9.0], "intensity": 1e-6}]}],
        },
        samples={"hits": 4, "obscurance": 1},
        reuse={"n_r": 0},
    )
    return tiny.prepared(Job.model_validate({**table, "ambient": {"intensity": [0.0, 0.0, 0.0]}}), scene)


def seen(*args: Any, **more: Any) -> Any:
    """(2, height, width, 3) of both light positions."""
    return tiny.render_frames(inputs(*args, **more)).images[0]


def test_a_wall_is_seen_as_bright_as_it_is_under_every_light() -> None:
    images = seen(scene_of(), (0, 0, 0))
    np.testing.assert_allclose(images, np.broadcast_to(GLOW, images.shape), rtol=1e-5)


def test_a_mirror_shows_it() -> None:
    images = seen(scene_of(), (0, 0, 4))
    np.testing.assert_allclose(images, np.broadcast_to(np.multiply(GLOW, TINT), images.shape), rtol=1e-5)


def test_its_texture_counts() -> None:
    images = seen(scene_of(texture=0), (0, 0, 0))
    assert images[:, :, :5].max() < 1e-6
    np.testing.assert_allclose(images[:, :, 7:], np.broadcast_to(GLOW, images[:, :, 7:].shape), rtol=1e-5)


@pytest.mark.parametrize("one_sided", [True, False])
def test_its_back_is_dark_if_the_file_says_so(one_sided: bool) -> None:
    back = np.ascontiguousarray(WALL[:, ::-1])
    assert (seen(scene_of(front=back, one_sided=one_sided), (0, 0, 0)).max() < 1e-6) == one_sided


def test_it_does_not_gloss() -> None:
    images = seen(scene_of(roughness=0.3), (0, 0, 0))
    np.testing.assert_allclose(images, np.broadcast_to(GLOW, images.shape), rtol=1e-5)


def test_it_lights_nothing() -> None:
    assert seen(scene_of(), (0, -3, 2)).min() < 1e-6


def test_diffuse_surfaces_stay_dark() -> None:
    assert seen(scene_of(), (0, 0, 0), surfaces="diffuse").max() < 1e-6


def test_another_emission_is_another_scene() -> None:
    scene = scene_of()
    brighter = replace(scene, emission=2 * scene.emission)
    assert scene_fingerprint(inputs(scene, (0, 0, 0))) != scene_fingerprint(inputs(brighter, (0, 0, 0)))
