"""Gloss of scene files: what materials become with surfaces as the file says; without, they stay as they were."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import QUAD_UVS, Glb, png

from framearray_cli.job.job import MaterialTable
from framearray_cli.scene.files.materials import from_specular
from framearray_cli.scene.scene import Scene, load_scene

# roughness in green, metal in blue
RAW = np.array([[[0, 51, 255], [0, 102, 0]]], np.uint8)


def load(glb: Glb, folder: Path, **more: Any) -> Scene:
    return load_scene(glb.save(folder / "a.glb"), as_file=True, **more)


def painted(pbr: dict[str, Any], texture: Any = None, **info: Any) -> Glb:
    glb = Glb()
    if texture is not None:
        pbr = {**pbr, "metallicRoughnessTexture": {"index": glb.texture(png(texture)), **info}}
    uvs = {"TEXCOORD_0": glb.accessor(QUAD_UVS), "TEXCOORD_1": glb.accessor(QUAD_UVS)}
    glb.node(glb.mesh(glb.material("Paint", pbr), **uvs))
    return glb


def test_a_dielectric_is_glossy_only_as_the_file_says(tmp_path: Path):
    glb = painted({"baseColorFactor": [0.5, 0.4, 0.3, 1.0], "roughnessFactor": 0.6})
    scene = load(glb, tmp_path)
    assert (scene.roughness[0], scene.metallic[0], scene.gloss_texture[0]) == (pytest.approx(0.6), 0.0, -1)
    assert scene.is_glossy
    plain = load_scene(tmp_path / "a.glb")
    assert plain.roughness.shape == plain.metallic.shape == plain.gloss_texture.shape == (0,)
    assert not plain.is_glossy
    np.testing.assert_array_equal(plain.reflectivity, scene.reflectivity)


@pytest.mark.parametrize(("roughness", "mirror"), [(0.05, True), (0.1, True), (0.11, False), (1.0, False)])
def test_smooth_metals_stay_mirrors(tmp_path: Path, roughness: float, mirror: bool):
    scene = load(painted({"metallicFactor": 1.0, "roughnessFactor": roughness}), tmp_path)
    assert scene.has_mirrors == mirror
    assert scene.is_glossy != mirror
    assert scene.report.notes == ()


def test_the_smoothest_dielectric_has_a_lobe(tmp_path: Path):
    assert load(painted({"roughnessFactor": 0.0}), tmp_path).roughness[0] == pytest.approx(0.1)


def test_textures_multiply_factors(tmp_path: Path):
    scene = load(painted({"metallicFactor": 0.5, "roughnessFactor": 1.0}, RAW), tmp_path)
    assert (scene.roughness[0], scene.metallic[0], scene.gloss_texture[0]) == (1.0, 0.5, 0)
    assert len(scene.uvs) == 2
    np.testing.assert_array_equal(scene.texels[:, 1:3], RAW[0, :, 1:3])


def test_a_texture_with_places_of_its_own_counts_by_its_mean(tmp_path: Path):
    glb = Glb()
    base = {"index": glb.texture(png(np.full((2, 2, 3), 200)))}
    other = {"index": glb.texture(png(RAW)), "texCoord": 1}
    pbr = {"baseColorTexture": base, "metallicRoughnessTexture": other, "metallicFactor": 1.0}
    uvs = {"TEXCOORD_0": glb.accessor(QUAD_UVS), "TEXCOORD_1": glb.accessor(QUAD_UVS)}
    glb.node(glb.mesh(glb.material("Paint", pbr), **uvs))
    scene = load(glb, tmp_path)
    assert scene.gloss_texture[0] == -1
    assert scene.roughness[0] == pytest.approx(0.3)
    assert scene.metallic[0] == pytest.approx(0.5)
    assert any("count by their mean: Paint" in note for note in scene.report.notes)


def test_meshes_without_texture_coordinates_keep_the_factors(tmp_path: Path):
    glb = Glb()
    pbr = {"metallicRoughnessTexture": {"index": glb.texture(png(RAW))}, "roughnessFactor": 0.7, "metallicFactor": 0.2}
    glb.node(glb.mesh(glb.material("Paint", pbr)))
    scene = load(glb, tmp_path)
    used = scene.material[0]
    assert (scene.gloss_texture[used], scene.roughness[used]) == (-1, pytest.approx(0.7))


def test_specular_and_glossiness_become_metal_and_roughness(tmp_path: Path):
    gloss = {"diffuseFactor": [0.0, 0.0, 0.0, 1.0], "specularFactor": [0.9, 0.6, 0.3], "glossinessFactor": 0.6}
    glb = Glb()
    more = {"extensions": {"KHR_materials_pbrSpecularGlossiness": gloss}}
    glb.node(glb.mesh(glb.material("Gold", {}, **more)))
    scene = load(glb, tmp_path)
    assert scene.metallic[0] == pytest.approx(1.0)
    assert scene.roughness[0] == pytest.approx(0.4)
    np.testing.assert_allclose(scene.reflectivity[0], [0.9, 0.6, 0.3], atol=1e-6)


def test_colours_survive_the_way_to_metal_and_back():
    """Base colour and metal say F0 and the diffuse colour; these become the same base colour and metal again."""
    for metallic in (0.0, 0.3, 1.0):
        base = np.full(3, 0.6)
        f0, diffuse = 0.04 * (1 - metallic) + base * metallic, base * (1 - metallic)
        # the old model takes the strongest specular channel from the diffuse part
        found, metal = from_specular(diffuse * (1 - 0.04) / (1 - f0.max()), f0)
        assert metal == pytest.approx(metallic, abs=1e-9)
        np.testing.assert_allclose(found, base, atol=1e-9)


def test_a_reflectivity_of_the_job_is_diffuse(tmp_path: Path):
    glb = painted({"roughnessFactor": 0.3})
    scene = load(glb, tmp_path, overrides={"Paint": MaterialTable(reflectivity=(0.2, 0.2, 0.2))})
    assert not scene.is_glossy


MTL = """
newmtl Pbr
Kd 0.5 0.5 0.5
Pr 0.3
Pm 0.8
newmtl Phong
Kd 0.5 0.4 0.3
Ks 0.5 0.5 0.5
Ns 360
illum 2
newmtl Matte
Kd 0.5 0.5 0.5
Ks 0 0 0
newmtl Chrome
Kd 0.8 0.8 0.8
Pr 0.05
Pm 1
"""


def test_gloss_of_material_libraries(tmp_path: Path):
    names = ("Pbr", "Phong", "Matte", "Chrome")
    vertices = "".join(f"v 0 0 {k}\nv 1 0 {k}\nv 0 1 {k}\n" for k in range(4))
    faces = "".join(f"usemtl {name}\nf {3 * k + 1} {3 * k + 2} {3 * k + 3}\n" for k, name in enumerate(names))
    (tmp_path / "a.mtl").write_text(MTL)
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + vertices + faces)
    scene = load_scene(tmp_path / "a.obj", as_file=True)
    found = {name: k for k, name in enumerate(scene.material_names)}
    rough = {name: float(scene.roughness[found[name]]) for name in names}
    assert rough == pytest.approx({"Pbr": 0.3, "Phong": 0.4, "Matte": 0.0, "Chrome": 0.0})
    assert scene.metallic[found["Pbr"]] == pytest.approx(0.8)
    np.testing.assert_allclose(scene.specular[found["Chrome"]], 0.8)
    assert not load_scene(tmp_path / "a.obj").is_glossy
