"""Emission in scene files: read of the materials that shine, noted of others."""

from pathlib import Path
from typing import Any

import numpy as np
from support.scenes import QUAD, QUAD_UVS, Glb, png

from framearray_cli.scene.files.read import read_meshes
from framearray_cli.scene.scene import load_scene

TEXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
STRENGTH = {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}


def lamp(folder: Path, *, base: Any = None, **emission: Any) -> Path:
    """A quad with an emissive material "Lamp"."""
    glb = Glb()
    for texels in (TEXELS, 255 - TEXELS):
        glb.texture(png(texels))
    pbr = {} if base is None else {"baseColorTexture": base}
    material = glb.material("Lamp", pbr, emissiveFactor=[1.0, 0.5, 0.0], **emission)
    glb.node(glb.mesh(material, positions=QUAD, TEXCOORD_0=glb.accessor(QUAD_UVS)))
    return glb.save(folder / "lamp.glb")


def test_factor_and_strength_are_multiplied(tmp_path: Path) -> None:
    file = lamp(tmp_path, extensions=STRENGTH)
    scene = load_scene(file, shining=["Lamp"])
    np.testing.assert_allclose(scene.emission, [[4.0, 2.0, 0.0]])
    assert not scene.report.notes and scene.emission_texture[0] == -1
    other = load_scene(file, shining=["Lemp"])
    assert not other.emission.any()
    assert other.report.notes == ("emission is left out: Lamp",)


def test_the_texture_is_read_only_if_the_material_shines(tmp_path: Path) -> None:
    file = lamp(tmp_path, emissiveTexture={"index": 0})
    scene = load_scene(file, shining=["Lamp"])
    assert len(scene.uvs) and scene.emission_texture[0] == 0 and scene.reflectivity_texture[0] == -1
    np.testing.assert_array_equal(scene.texels[:, :3], TEXELS.reshape(-1, 3))
    assert read_meshes(file).textures == ()


def test_a_texture_shares_the_coordinates_of_the_colour_or_counts_by_its_mean(tmp_path: Path) -> None:
    scene = load_scene(lamp(tmp_path, base={"index": 1}, emissiveTexture={"index": 0}), shining=["Lamp"])
    assert (scene.reflectivity_texture[0], scene.emission_texture[0]) == (0, 1)
    turned = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}}
    scene = load_scene(lamp(tmp_path, base={"index": 1}, emissiveTexture=turned), shining=["Lamp"])
    assert scene.emission_texture[0] == -1
    mean = ((0.5 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(scene.emission[0], [mean, 0.5 * mean, 0], rtol=1e-5)
    assert "count by their mean: Lamp" in scene.report.notes[0]


def test_emission_of_an_mtl_file(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl Lamp\nKd 0.5 0.5 0.5\nKe 3 2 -1\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl Lamp\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    np.testing.assert_allclose(load_scene(tmp_path / "a.obj", shining=["Lamp"]).emission, [[3, 2, 0]])
    assert "emission is left out: Lamp" in load_scene(tmp_path / "a.obj").report.notes
