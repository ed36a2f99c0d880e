"""Image-based lights of glTF files: where their pictures are, what they hold, and files that break the format."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.imagelights import add_light, coefficients, rgbd
from support.scenes import Glb, png
from support.staged import QUARTER

from framearray_cli.base.colour import LUMINANCE
from framearray_cli.scene.files import Stage, StageEnvironment, read_stage
from framearray_cli.scene.paths.panorama import texel_powers

N = 8
# What the saved picture of each face shows in its first row's left and right corner and in its last row's, as
# directions of glTF: the faces +x, -x, +y, -y, +z, -z of a left-handed cube, upside down, with x to the left.
CORNERS = np.array(
    [
        [[-1, -1, 1], [-1, -1, -1], [-1, 1, 1], [-1, 1, -1]],
        [[1, -1, -1], [1, -1, 1], [1, 1, -1], [1, 1, 1]],
        [[1, 1, 1], [-1, 1, 1], [1, 1, -1], [-1, 1, -1]],
        [[1, -1, -1], [-1, -1, -1], [1, -1, 1], [-1, -1, 1]],
        [[1, -1, 1], [-1, -1, 1], [1, 1, 1], [-1, 1, 1]],
        [[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, 1, -1]],
    ]
)
MIDDLES = CORNERS.mean(axis=1)


def scene() -> Glb:
    glb = Glb()
    glb.node(glb.mesh())
    return glb


def stage_of(folder: Path, pictures: Any, **keys: Any) -> Stage:
    glb = scene()
    add_light(glb, pictures, **keys)
    return read_stage(glb.save(folder / "scene.glb"))


def light_of(folder: Path, pictures: Any, **keys: Any) -> StageEnvironment:
    found = stage_of(folder, pictures, **keys).environment
    assert found is not None
    return found


def at(pixels: Any, way: Any) -> Any:
    """The pixel of a panorama in a direction of a scene with y up: -z in its middle, +x to the right of it."""
    height, width, _ = pixels.shape
    x, y, z = np.asarray(way, np.float64) / np.linalg.norm(way)
    column = (np.arctan2(x, -z) / (2 * np.pi) + 0.5) * width
    return pixels[min(int(np.arccos(y) / np.pi * height), height - 1), int(column) % width]


def quarters() -> Any:
    """(6, N, N, 3) faces whose quarters all have different radiance, and these, (6, 4, 3)."""
    colours = np.random.default_rng(3).uniform(0.05, 1, (6, 4, 3)).astype(np.float32)
    return np.kron(colours.reshape(6, 2, 2, 3), np.ones((1, N // 2, N // 2, 1), np.float32)), colours


def test_every_corner_of_every_face_is_where_it_belongs(tmp_path: Path) -> None:
    faces, colours = quarters()
    pixels = light_of(tmp_path, [rgbd(face) for face in faces]).pixels
    assert pixels.shape == (2 * N, 4 * N, 3)
    for corners, middle, colour in zip(CORNERS, MIDDLES, colours, strict=True):
        for corner, expected in zip(corners, colour, strict=True):
            np.testing.assert_allclose(at(pixels, 0.6 * corner + 0.4 * middle), expected, atol=0.01)


@pytest.mark.parametrize(
    ("axis", "ways"),
    [
        # where the faces +x, +y and +z come to be after a quarter turn of the left-handed cube about its axis
        ([1, 0, 0], {0: [-1, 0, 0], 2: [0, 0, 1], 4: [0, -1, 0]}),
        ([0, 1, 0], {0: [0, 0, -1], 2: [0, 1, 0], 4: [-1, 0, 0]}),
        ([0, 0, 1], {0: [0, 1, 0], 2: [1, 0, 0], 4: [0, 0, 1]}),
    ],
)
def test_the_rotation_turns_the_cube(tmp_path: Path, axis: Any, ways: Any) -> None:
    colours = np.random.default_rng(4).uniform(0.05, 1, (6, 3)).astype(np.float32)
    pictures = [rgbd(np.broadcast_to(colour, (N, N, 3))) for colour in colours]
    turned = light_of(tmp_path, pictures, rotation=[*(3 * QUARTER * np.array(axis)), 3 * QUARTER])  # of any length
    for face, way in ways.items():
        np.testing.assert_allclose(at(turned.pixels, way), colours[face], atol=0.01)


def test_pictures_hold_radiance_beyond_1_where_they_have_alpha(tmp_path: Path) -> None:
    """RGBD of values up to 200, an opaque PNG, and a JPEG; to the precision of 8 bits."""
    bright = np.full((N, N, 3), (200.0, 50.0, 0.5), np.float32)
    codes = np.full((N, N, 3), 188, np.uint8)  # sRGB of 0.503
    jpeg = _jpeg(codes)
    found = light_of(tmp_path, [rgbd(bright), png(codes), jpeg, jpeg, jpeg, jpeg], intensity=3.0)
    assert found.intensity == 3.0
    np.testing.assert_allclose(at(found.pixels, MIDDLES[0]), (200, 50, 0.5), rtol=0.02, atol=0.3)
    for face in (1, 2, 5):
        np.testing.assert_allclose(at(found.pixels, MIDDLES[face]), 0.503, atol=0.01)


def test_a_panorama_keeps_the_light_of_the_cube(tmp_path: Path) -> None:
    """The mean over all directions, of noise and of one bright texel in a corner, where texels are smallest."""
    noise = np.random.default_rng(5).uniform(0, 1, (6, 32, 32, 3)).astype(np.float32)
    noise[3, 0, 0] = 50.0
    centres = (np.arange(32) + 0.5) / 16 - 1
    weights = (1 + centres[:, None] ** 2 + centres[None, :] ** 2) ** -1.5  # solid angles, but for a factor
    expected = (weights[None] * (noise @ LUMINANCE)).sum() / (6 * weights.sum())
    pixels = light_of(tmp_path, [rgbd(face) for face in noise]).pixels
    assert texel_powers(pixels).sum() / (4 * np.pi) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"specularImages": []}, "specularImages[0]: expected six pictures of the faces of a cube, got 0"),
        (
            {"specularImages": [[0, 1, 2, 3, 4]]},
            "specularImages[0]: expected six pictures of the faces of a cube, got 5",
        ),
        ({"specularImages": [7]}, "lights[0].specularImages[0]: expected a list, got 7"),
        ({"specularImages": None}, "lights[0].specularImages: is missing"),
        (
            {"specularImages": [[0, 1, 2, 3, 4, 9]]},
            "specularImages[0][5]: expected the number of one of 9 images, from 0",
        ),
        ({"specularImages": [[0, 1, -1, 3, 4, 5]]}, "specularImages[0][2]: expected the number of one of 9 images"),
        ({"specularImages": [[0, 1, 2, 3, 4, 6]]}, "expected a square of 8 x 8, as all faces have one size, got 4 x 4"),
        ({"specularImages": [[7, 1, 2, 3, 4, 5]]}, "gone.png: no such file next to the scene"),
        ({"specularImages": [[0, 1, 2, 8, 4, 5]]}, "specularImages[0][3]: not an image that can be read"),
        ({"rotation": [0, 0, 0, 0]}, "expected a rotation x, y, z, w that is not all 0"),
        ({"rotation": [0, 1]}, "lights[0].rotation: expected 4 numbers, got [0, 1]"),
        ({"intensity": -1}, "lights[0].intensity: expected a number of at least 0, got -1"),
        ({"intensity": 0}, "is black and is left out"),
        ({"intensity": "bright"}, 'lights[0].intensity: expected a number of at least 0, got "bright"'),
    ],
)
def test_a_broken_light_is_left_out_with_one_note(tmp_path: Path, keys: Any, why: str) -> None:
    glb = scene()
    faces = [rgbd(np.ones((N, N, 3))) for _ in range(6)]
    add_light(glb, [*faces, rgbd(np.ones((4, 4, 3)))], irradianceCoefficients=coefficients(1.0), **keys)
    if "specularImages" not in keys:
        glb.tree["extensions"]["EXT_lights_image_based"]["lights"][0]["specularImages"] = [[0, 1, 2, 3, 4, 5]]
    glb.add("images", {"uri": "gone.png"})
    glb.add("images", {"bufferView": glb.view(b"no picture"), "mimeType": "image/png"})
    stage = read_stage(glb.save(tmp_path / "scene.glb"))
    assert stage.environment is None
    (note,) = stage.notes
    assert note.startswith("image-based light") and why in note


@pytest.mark.parametrize("light", [1, -1, "0", True, None])
def test_a_scene_without_a_light_of_that_number(tmp_path: Path, light: Any) -> None:
    glb = scene()
    add_light(glb, [rgbd(np.ones((N, N, 3)))] * 6)
    glb.tree["scenes"][0]["extensions"] = {"EXT_lights_image_based": {} if light is None else {"light": light}}
    stage = read_stage(glb.save(tmp_path / "scene.glb"))
    assert stage.environment is None
    assert len(stage.notes) == 1 and "image-based light: " in stage.notes[0]


def test_coefficients_that_disagree_with_the_pictures_are_noted(tmp_path: Path) -> None:
    pictures = [rgbd(np.full((N, N, 3), 2.0))] * 6
    assert stage_of(tmp_path, pictures, irradianceCoefficients=coefficients(2.1)).notes == ()
    (note,) = stage_of(tmp_path, pictures, irradianceCoefficients=coefficients(6.0)).notes
    assert "its irradiance coefficients stand for a mean radiance of 6, its pictures for 2" in note
    (note,) = stage_of(tmp_path, pictures, irradianceCoefficients=[[1.0, 2.0]]).notes
    assert "expected irradiance coefficients of 9 x 3 numbers; the pictures count" in note


def _jpeg(codes: Any) -> bytes:
    import io

    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(codes).save(data, format="JPEG", quality=95)
    return data.getvalue()
