"""Materials that shine: those of sources, and those that emit by themselves where surfaces follow the file."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.errors import JobError
from framearray_cli.render.identity import scene_fingerprint
from framearray_cli.render.prepare import Prepared
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.scene import Scene, build_scene

WALLS = tiny.box((-2, 0, -2), (2, 2.5, 2))
LAMP = tiny.quad((-0.6, 2.2, -0.3), (0.6, 2.2, -0.3), (0.6, 2.2, 0.3), (-0.6, 2.2, 0.3))  # its front down
SCREEN = tiny.quad((-0.8, 0.5, -1.9), (0.8, 0.5, -1.9), (0.8, 1.5, -1.9), (-0.8, 1.5, -1.9))
MIRROR = tiny.quad((-1.9, 0.2, -1.5), (-1.9, 0.2, 1.5), (-1.9, 2.0, 1.5), (-1.9, 2.0, -1.5))
MATERIALS = (
    Material(name="Walls", reflectivity=(0.5, 0.5, 0.5)),
    Material(name="Lamp", reflectivity=(0.0, 0.0, 0.0), emission=(3.0, 2.0, 1.0)),
    Material(name="Screen", reflectivity=(0.2, 0.2, 0.2), emission=(1.0, 1.0, 1.0), emission_texture=0),
    Material(name="Mirror", reflectivity=(0.0, 0.0, 0.0), specular=(0.9, 0.8, 0.7)),
    Material(name="Unused", emission=(1.0, 1.0, 1.0)),
)
UVS = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)


def room(lamp: Any = LAMP) -> Scene:
    texels = np.kron(tiny.checks(2, seed=3), np.ones((16, 16, 1), np.uint8))
    parts = (
        Part(material=0, corners=WALLS),
        Part(material=1, corners=lamp),
        Part(material=2, corners=SCREEN, uvs=UVS),
        Part(material=3, corners=MIRROR),
    )
    return build_scene(Meshes(parts=parts, materials=MATERIALS, textures=(texels,), dropped={}, notes=()), {})


def mesh(material: str, *keys: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"type": "mesh", "material": material, "keys": list(keys), **more}


def inputs(*sources: dict[str, Any], of: Scene | None = None, frames: int = 1, **more: Any) -> Prepared:
    return tiny.prepared(tiny.job(light={"frames": frames, "sources": list(sources)}, **more), of or room())


@pytest.mark.parametrize(
    ("sources", "text"),
    [
        ([mesh("Lmap"), mesh("Lamp", group="g", axis="b")],
         'light.sources[0].material: expected a material of the scene, got "Lmap"; it has Lamp, Walls, '),
        ([mesh("Unused")],
         'light.sources[0].material: expected a material that some triangle of the scene has, got "Unused"'),
        ([mesh("Walls", {"frame": 0, "intensity": 3})],
         'light.sources[0].material: expected a material that emits light, got "Walls", whose emission in the scene'),
        ([mesh("Lamp"), mesh("Lamp")],
         "light.sources[1].material: expected a material that no other source has, got the one of light.sources[0]"),
    ],
)  # fmt: skip
def test_materials_that_cannot_shine(sources: list[dict[str, Any]], text: str) -> None:
    with pytest.raises(JobError) as caught:
        inputs(*sources)
    (problem,) = caught.value.problems
    assert problem.startswith(text)


def test_the_emission_of_the_scene_is_multiplied() -> None:
    found = inputs(mesh("Lamp", {"frame": 0, "intensity": 2.0, "color": [1, 1, 0]}))
    np.testing.assert_allclose(found.lights.sources[0].intensity, [[6, 4, 0]])
    assert found.light_arrays.channels == 1
    assert inputs(mesh("Screen")).light_arrays.channels == 3


EYE = {"keys": [{"frame": 0, "eye": [0.2, 1.1, 1.7], "target": [0.0, 1.3, -1.9]}], "resolution": [48, 36]}


def rendered(prepared: Prepared) -> Any:
    """(n_lights, height, width, 3) of the only frame."""
    return tiny.render_frames(prepared).images[0].astype(np.float64)


def test_eyes_see_the_emission_under_each_light_position() -> None:
    """Directly and by a mirror: where the lamp fills a pixel, its radiance, and that times the mirror's."""
    keys = [{"frame": 0, "intensity": 1.0}, {"frame": 1, "intensity": 0.0}, {"frame": 2, "intensity": [0, 5, 0]}]
    up = {"keys": [{"frame": 0, "eye": [0.2, 1.1, 1.7], "target": [0.0, 2.2, 0.0]}], "resolution": [48, 36]}
    images = rendered(inputs(mesh("Lamp", *keys), frames=3, camera=up))
    lamp = np.isclose(images[0], [3, 2, 1], rtol=1e-5).all(axis=-1)
    assert lamp.sum() > 20
    np.testing.assert_allclose(images[1][lamp], 0, atol=1e-6)
    np.testing.assert_allclose(images[2][lamp], np.tile([0, 10, 0], (lamp.sum(), 1)), rtol=1e-5)
    aside = {"keys": [{"frame": 0, "eye": [1.0, 1.1, 1.0], "target": [-1.9, 1.7, 0.4]}], "resolution": [96, 72]}
    mirrored = rendered(inputs(mesh("Lamp", *keys), frames=3, camera=aside, specular={"depth": 2}))
    seen = np.isclose(mirrored[0], [2.7, 1.6, 0.7], rtol=1e-5).all(axis=-1)
    assert seen.sum() > 5
    np.testing.assert_allclose(mirrored[2][seen], np.tile([0, 8, 0], (seen.sum(), 1)), rtol=1e-5)


def test_a_texture_is_seen() -> None:
    """Beside reflected light: the difference of two strengths is the texture, and what it lights elsewhere."""
    images = rendered(inputs(mesh("Screen", {"frame": 0, "intensity": 1.0}), camera=EYE, samples={"hits": 64}))
    plain = rendered(inputs(mesh("Screen", {"frame": 0, "radiance": 1.0}), camera=EYE, samples={"hits": 64}))
    texels = tiny.checks(2, seed=3)[..., :3] / 255
    linear = np.where(texels <= 0.04045, texels / 12.92, ((texels + 0.055) / 1.055) ** 2.4)
    # centres of the quarters of the screen, 16 pixels above and below, by the plain one
    bright = (plain[0] >= 1.0).all(axis=-1)
    rows, columns = np.flatnonzero(bright.any(axis=1)), np.flatnonzero(bright.any(axis=0))
    for j in range(2):
        for i in range(2):
            y, x = rows[(1 + 2 * j) * len(rows) // 4], columns[(1 + 2 * i) * len(columns) // 4]
            # what it reflects is at most 0.2 of what the walls send back
            assert (images[0, y, x] >= linear[j, i] * 0.999).all()
            assert (images[0, y, x] <= linear[j, i] + 0.15).all()


LOOK = {"keys": [{"frame": 0, "eye": [0.2, 1.1, 1.7], "target": [0.2, 0.4, -1.0]}], "resolution": [48, 36]}
RECT = {"frame": 0, "position": [0, 2.2, 0], "direction": [0, -1, 0], "radiance": [3, 2, 1]}
RECT |= {"width": 1.2, "height": 0.6, "up": [0, 0, 1]}


def pair(**more: Any) -> tuple[Any, Any]:
    """A room under the shining quad, and under a rectangle at its place; the dark quad still hides what it did."""
    shining = inputs(mesh("Lamp", {"frame": 0, "intensity": 1.0}, two_sided=False), camera=LOOK, **more)
    rectangle = inputs({"type": "rect", "keys": [RECT]}, camera=LOOK, **more)
    return rendered(shining)[0], rendered(rectangle)[0]


def test_a_quad_lights_as_a_rectangle_does() -> None:
    """Direct light: means of pictures agree within 3 standard errors of the difference, which are below 1 %."""
    found, expected = pair(samples={"hits": 32}, ambient=tiny.DARK)
    difference = (found - expected).reshape(-1, 3)
    error = difference.std(axis=0) / np.sqrt(len(difference))
    assert expected.mean() > 0.01
    assert (np.abs(difference.mean(axis=0)) <= 3 * error).all()
    assert (error <= 0.01 * expected.mean(axis=(0, 1))).all()


@pytest.mark.slow
def test_cells_bring_its_light_on_as_that_of_a_rectangle() -> None:
    """Neighbours share errors of cells, so the error comes from pictures of several seeds: Student's t, 1 in 1,000."""
    pairs = np.array([pair(seed=k, indirect=tiny.CELLS) for k in range(8)]).mean(axis=(2, 3))  # (8, 2, 3)
    difference, expected = pairs[:, 0] - pairs[:, 1], pairs[:, 1].mean(axis=0)
    error = difference.std(axis=0, ddof=1) / np.sqrt(8)
    assert (np.abs(difference.mean(axis=0)) <= 5.4 * error).all()
    assert (error <= 0.01 * expected).all()
    direct = pair(ambient=tiny.DARK)[0].mean(axis=(0, 1))
    assert (expected > 1.2 * direct).all()


def test_other_jobs_hold_nothing_of_it() -> None:
    lamp = {"type": "point", "keys": [{"frame": 0, "position": [0, 1, 0], "intensity": 1.0}]}
    with tiny.planned(inputs(lamp)) as (setup, _):
        assert "emission" not in setup.empty_records(5)


GLOW = (3.0, 2.0, 1.0)
TINT = (0.9, 0.5, 0.25)
WALL = tiny.quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))  # its front towards +z
METAL_MIRROR = tiny.quad((3, -3, 4), (-3, -3, 4), (-3, 3, 4), (3, 3, 4))
FLOOR = tiny.quad((-3, -3, 4), (3, -3, 4), (3, -3, 0), (-3, -3, 0))
TEXELS = np.full((1, 64, 4), 255, np.uint8)
TEXELS[0, :32, :3] = 0


def scene_of(*, front: Any = WALL, texture: int = -1, one_sided: bool = True, roughness: float = 0.0) -> Scene:
    material = Material(
        name="Wall", reflectivity=(0.4, 0.4, 0.4), emission=GLOW, emission_texture=texture, one_sided=one_sided,
        roughness=roughness,
    )  # fmt: skip
    materials = (material, Material(name="Mirror", reflectivity=(0.0,) * 3, specular=TINT), Material(name="Floor"))
    parts = (
        Part(material=0, corners=front, uvs=UVS),
        Part(material=1, corners=METAL_MIRROR),
        Part(material=2, corners=FLOOR),
    )
    return build_scene(Meshes(parts=parts, materials=materials, textures=(TEXELS,), dropped={}, notes=()), {})


def glowing(scene: Scene, target: Any, surfaces: str = "file") -> Prepared:
    """A view of a scene under a lamp that is as good as off."""
    lamp = {"type": "point", "keys": [{"frame": 0, "position": [50.0, 0.0, -9.0], "intensity": 1e-6}]}
    eye = {"frame": 0, "eye": [0.0, 0.0, 3.0], "target": list(target)}
    camera, samples = {"resolution": [12, 9], "fov": 30.0, "keys": [eye]}, {"hits": 4, "obscurance": 1}
    more = {"camera": camera, "samples": samples, "scene": {"surfaces": surfaces}, "ambient": tiny.DARK}
    return inputs(lamp, of=scene, frames=2, **more)


def seen(*args: Any, **more: Any) -> Any:
    """(2, height, width, 3) of both light positions."""
    return tiny.render_frames(glowing(*args, **more)).images[0]


@pytest.mark.parametrize(
    ("roughness", "target", "tint"), [(0.0, (0, 0, 0), 1.0), (0.0, (0, 0, 4), TINT), (0.3, (0, 0, 0), 1.0)]
)
def test_a_wall_is_seen_as_bright_as_it_is_under_every_light(roughness: float, target: Any, tint: Any) -> None:
    """Directly and in a mirror; it does not gloss."""
    images = seen(scene_of(roughness=roughness), target)
    np.testing.assert_allclose(images, np.broadcast_to(np.multiply(GLOW, tint), images.shape), rtol=1e-5)


def test_its_texture_counts() -> None:
    images = seen(scene_of(texture=0), (0, 0, 0))
    assert images[:, :, :5].max() < 1e-6
    np.testing.assert_allclose(images[:, :, 7:], np.broadcast_to(GLOW, images[:, :, 7:].shape), rtol=1e-5)


@pytest.mark.parametrize("one_sided", [True, False])
def test_its_back_is_dark_if_the_file_says_so(one_sided: bool) -> None:
    back = np.ascontiguousarray(WALL[:, ::-1])
    assert (seen(scene_of(front=back, one_sided=one_sided), (0, 0, 0)).max() < 1e-6) == one_sided


def test_it_lights_nothing() -> None:
    assert seen(scene_of(), (0, -3, 2)).min() < 1e-6


def test_diffuse_surfaces_stay_dark() -> None:
    assert seen(scene_of(), (0, 0, 0), surfaces="diffuse").max() < 1e-6


def test_another_emission_is_another_scene() -> None:
    scene = scene_of()
    brighter = replace(scene, emission=2 * scene.emission)
    assert scene_fingerprint(glowing(scene, (0, 0, 0))) != scene_fingerprint(glowing(brighter, (0, 0, 0)))
