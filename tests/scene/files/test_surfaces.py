"""Emission, gloss and object names of surfaces, by the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import QUAD_UVS, Glb, png, quad_of, write_obj

from framearray_cli.base.arrays import Float64, Int32
from framearray_cli.base.colour import linear_from_srgb
from framearray_cli.job.job import MaterialTable
from framearray_cli.scene.files import Meshes, read_meshes
from framearray_cli.scene.files.layers import from_specular, joined, sheen_albedo
from framearray_cli.scene.files.model import UV_SET
from framearray_cli.scene.merge import merge
from framearray_cli.scene.scene import Scene, load_scene

TEXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
STRENGTH = {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}


def lamp(folder: Path, *, base: Any = None, **emission: Any) -> Path:
    """A quad with an emissive material "Lamp"."""
    glb = Glb()
    for texels in (TEXELS, 255 - TEXELS):
        glb.texture(png(texels))
    pbr = {} if base is None else {"baseColorTexture": base}
    material = glb.material("Lamp", pbr, emissiveFactor=[1.0, 0.5, 0.0], **emission)
    glb.node(glb.mesh(material, TEXCOORD_0=glb.accessor(QUAD_UVS)))
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


def test_emission_has_texture_coordinates_of_its_own_where_the_file_says_so(tmp_path: Path) -> None:
    scene = load_scene(lamp(tmp_path, base={"index": 1}, emissiveTexture={"index": 0}), shining=["Lamp"])
    assert (scene.reflectivity_texture[0], scene.emission_texture[0]) == (0, 1)
    assert scene.uvs.shape == (2, 3, 2) and not len(scene.samplers)
    turned = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}}
    scene = load_scene(lamp(tmp_path, base={"index": 1}, emissiveTexture=turned), shining=["Lamp"])
    assert scene.samplers[scene.emission_texture[0]] == 1 << UV_SET
    assert scene.uvs.shape == (4, 3, 2) and not scene.report.notes
    np.testing.assert_allclose(scene.uvs[2:] * [1, -1] + [0, 1], 2 * (scene.uvs[:2] * [1, -1] + [0, 1]), atol=1e-6)


@pytest.mark.parametrize("transform", [{"rotation": 4 * np.pi}, {"offset": [0, 0]}, {"scale": [1, 1], "texCoord": 0}])
def test_transforms_that_say_the_same_are_one(tmp_path: Path, transform: dict[str, Any]) -> None:
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    scene = load_scene(lamp(tmp_path, base={"index": 1}, emissiveTexture=info), shining=["Lamp"])
    assert scene.uvs.shape == (2, 3, 2) and not len(scene.samplers)


def test_a_mesh_without_the_second_set_shows_only_textures_of_the_first(tmp_path: Path) -> None:
    info = {"index": 0, "texCoord": 1}
    scene = load_scene(lamp(tmp_path, base={"index": 1}, emissiveTexture=info), shining=["Lamp"])
    used = scene.material[0]
    assert (scene.reflectivity_texture[used], scene.emission_texture[used]) == (0, -1)
    assert np.isfinite(scene.uvs).all()
    assert scene.report.notes == ("meshes without texture coordinates show no texture: Lamp",)


def test_emission_of_an_mtl_file(tmp_path: Path) -> None:
    text = "usemtl Lamp\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    file = write_obj(tmp_path, text, "newmtl Lamp\nKd 0.5 0.5 0.5\nKe 3 2 -1\n")
    np.testing.assert_allclose(load_scene(file, shining=["Lamp"]).emission, [[3, 2, 0]])
    assert "emission is left out: Lamp" in load_scene(file).report.notes


# roughness in green, metal in blue
RAW = np.array([[[0, 51, 255], [0, 102, 0]]], np.uint8)


def load(glb: Glb, folder: Path, **more: Any) -> Scene:
    return load_scene(glb.save(folder / "a.glb"), as_file=True, **more)


def test_a_dielectric_is_glossy_only_as_the_file_says(tmp_path: Path):
    scene = load(quad_of("Paint", {"baseColorFactor": [0.5, 0.4, 0.3, 1.0], "roughnessFactor": 0.6}), tmp_path)
    assert (scene.roughness[0], scene.metallic[0], scene.gloss_texture[0]) == (pytest.approx(0.6), 0.0, -1)
    assert scene.is_glossy
    plain = load_scene(tmp_path / "a.glb")
    assert plain.roughness.shape == plain.metallic.shape == plain.gloss_texture.shape == (0,)
    assert not plain.is_glossy
    np.testing.assert_array_equal(plain.reflectivity, scene.reflectivity)


@pytest.mark.parametrize(("roughness", "mirror"), [(0.05, True), (0.1, True), (0.11, False), (1.0, False)])
def test_smooth_metals_stay_mirrors(tmp_path: Path, roughness: float, mirror: bool):
    scene = load(quad_of("Paint", {"metallicFactor": 1.0, "roughnessFactor": roughness}), tmp_path)
    assert scene.has_mirrors == mirror
    assert scene.is_glossy != mirror
    assert scene.report.notes == ()


def test_the_smoothest_dielectric_has_a_lobe(tmp_path: Path):
    assert load(quad_of("Paint", {"roughnessFactor": 0.0}), tmp_path).roughness[0] == pytest.approx(0.1)


def test_textures_multiply_factors(tmp_path: Path):
    pbr = {"metallicFactor": 0.5, "roughnessFactor": 1.0, "metallicRoughnessTexture": png(RAW)}
    scene = load(quad_of("Paint", pbr), tmp_path)
    assert (scene.roughness[0], scene.metallic[0], scene.gloss_texture[0]) == (1.0, 0.5, 0)
    assert len(scene.uvs) == 2
    np.testing.assert_array_equal(scene.texels[:, 1:3], RAW[0, :, 1:3])


def test_a_texture_has_places_of_its_own(tmp_path: Path):
    glb = Glb()
    base = {"index": glb.texture(png(np.full((2, 2, 3), 200)))}
    other = {"index": glb.texture(png(RAW)), "texCoord": 1}
    pbr = {"baseColorTexture": base, "metallicRoughnessTexture": other, "metallicFactor": 1.0}
    uvs = {"TEXCOORD_0": glb.accessor(QUAD_UVS), "TEXCOORD_1": glb.accessor(QUAD_UVS / 2)}
    glb.node(glb.mesh(glb.material("Paint", pbr), **uvs))
    scene = load(glb, tmp_path)
    assert scene.samplers[scene.gloss_texture[0]] == 1 << UV_SET
    assert (scene.roughness[0], scene.metallic[0]) == (1, 1)
    assert scene.report.notes == ()
    np.testing.assert_allclose(1 - scene.uvs[2:, :, 1], (1 - scene.uvs[:2, :, 1]) / 2)


def test_meshes_without_texture_coordinates_keep_the_factors(tmp_path: Path):
    glb = Glb()
    pbr = {"metallicRoughnessTexture": {"index": glb.texture(png(RAW))}, "roughnessFactor": 0.7, "metallicFactor": 0.2}
    glb.node(glb.mesh(glb.material("Paint", pbr)))
    scene = load(glb, tmp_path)
    used = scene.material[0]
    assert (scene.gloss_texture[used], scene.roughness[used]) == (-1, pytest.approx(0.7))


def test_specular_and_glossiness_become_metal_and_roughness(tmp_path: Path):
    gloss = {"diffuseFactor": [0.0, 0.0, 0.0, 1.0], "specularFactor": [0.9, 0.6, 0.3], "glossinessFactor": 0.6}
    scene = load(quad_of("Gold", extensions={"KHR_materials_pbrSpecularGlossiness": gloss}), tmp_path)
    assert scene.metallic[0] == pytest.approx(1.0)
    assert scene.roughness[0] == pytest.approx(0.4)
    np.testing.assert_allclose(scene.reflectivity[0], [0.9, 0.6, 0.3], atol=1e-6)


@pytest.mark.parametrize("apart", [False, True])
def test_specular_and_glossiness_images_become_metal_and_roughness(tmp_path: Path, apart: bool):
    """A texel of gold and one of paint; by their mean where both images lie at different places."""
    glb = Glb()
    shine = np.array([[[231, 200, 100, 204], [56, 56, 56, 51]]], np.uint8)  # 56: sRGB of 0.04
    transform = {"extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}}
    gloss = {
        "diffuseTexture": {"index": glb.texture(png(np.array([[[0, 0, 0], [188, 188, 188]]], np.uint8)))},
        "specularGlossinessTexture": {"index": glb.texture(png(shine))} | (transform if apart else {}),
    }
    more = {"extensions": {"KHR_materials_pbrSpecularGlossiness": gloss}}
    glb.node(glb.mesh(glb.material("Gold", {}, **more), TEXCOORD_0=glb.accessor(QUAD_UVS)))
    scene = load(glb, tmp_path)
    assert bool(scene.report.notes) == apart
    if apart:
        assert scene.gloss_texture[0] == -1
        return
    base, numbers = (
        scene.texels[scene.textures[texture][0] :][:2]
        for texture in (scene.reflectivity_texture[0], scene.gloss_texture[0])
    )
    np.testing.assert_allclose(numbers[:, 1:3], [[51, 255], [204, 0]], atol=1)
    np.testing.assert_allclose(base[:, :3], [[231, 200, 100], [188, 188, 188]], atol=2)
    assert scene.reflectivity[0].tolist() == [1, 1, 1]
    assert (scene.roughness[0], scene.metallic[0]) == (1, 1)


def test_colours_survive_the_way_to_metal_and_back():
    """Base colour and metal say F0 and the diffuse colour; these become the same base colour and metal again."""
    for metallic in (0.0, 0.3, 1.0):
        base = np.full(3, 0.6)
        f0, diffuse = 0.04 * (1 - metallic) + base * metallic, base * (1 - metallic)
        # the old model takes the strongest specular channel from the diffuse part
        found, metal = from_specular(diffuse * (1 - 0.04) / (1 - f0.max()), f0)
        assert metal == pytest.approx(metallic, abs=1e-9)
        np.testing.assert_allclose(found, base, atol=1e-9)


def layered(folder: Path, *, base: float = 0.5, roughness: float = 0.8, **layers: dict[str, Any]) -> tuple[Scene, str]:
    """A grey surface that is no metal with `KHR_materials_` extensions, and the notes on it."""
    pbr = {"baseColorFactor": [base] * 3 + [1.0], "metallicFactor": 0.0, "roughnessFactor": roughness}
    scene = load(
        quad_of("Paint", pbr, extensions={f"KHR_materials_{key}": value for key, value in layers.items()}), folder
    )
    return scene, "; ".join(scene.report.notes)


def of_even_light(scene: Scene) -> float:
    """Share of even light that a grey surface reflects, by glTF 2.0, appendix B."""
    base, metal = float(scene.reflectivity[0, 0]), 0.0
    if not scene.is_glossy:
        return base
    metal = float(scene.metallic[0])
    plain, tinted = (f0 + (1 - f0) / 21 for f0 in (0.04, base))
    return (1 - metal) * (plain + (1 - plain) * base) + metal * tinted


@pytest.mark.parametrize("base", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("ior", [1.2, 1.45, 1.8, 2.4])
def test_an_index_of_refraction_is_seen_in_even_light(tmp_path: Path, ior: float, base: float) -> None:
    f0 = ((ior - 1) / (ior + 1)) ** 2
    lobe = f0 + (1 - f0) / 21
    scene, notes = layered(tmp_path, base=base, ior={"ior": ior})
    assert of_even_light(scene) == pytest.approx(lobe + (1 - lobe) * base, abs=0.02)
    assert not notes and scene.is_glossy


@pytest.mark.parametrize("weight", [0.0, 0.3, 0.7, 1.0])
def test_a_weight_of_reflection_is_seen_in_even_light(tmp_path: Path, weight: float) -> None:
    lobe = weight * (0.04 + 0.96 / 21)
    scene, notes = layered(tmp_path, specular={"specularFactor": weight})
    assert of_even_light(scene) == pytest.approx(lobe + (1 - lobe) * 0.5, rel=1e-5)
    assert not notes and scene.is_glossy == (weight >= 0.5)


def test_a_coloured_reflection_becomes_a_little_metal(tmp_path: Path) -> None:
    scene, notes = layered(tmp_path, base=0.0, ior={"ior": 2.5}, specular={"specularColorFactor": [1.0, 0.5, 0.2]})
    metal, base = float(scene.metallic[0]), scene.reflectivity[0].astype(float)
    f0 = 0.04 * (1 - metal) + metal * base
    assert 0 < metal <= 1 and f0[0] > f0[1] > f0[2] and not notes
    np.testing.assert_allclose(f0, (1.5 / 3.5) ** 2 * np.array([1.0, 0.5, 0.2]), atol=0.03)


@pytest.mark.parametrize("metal", [0.0, 1.0])
def test_a_clear_coat_leaves_the_surface_under_it(tmp_path: Path, metal: float) -> None:
    coat = {"KHR_materials_clearcoat": {"clearcoatFactor": 0.2, "clearcoatRoughnessFactor": 0.3}}
    pbr = {"roughnessFactor": 0.5, "metallicFactor": metal, "baseColorFactor": [0.5, 0.4, 0.3, 1.0]}
    scene = load(quad_of("Paint", pbr, extensions=coat), tmp_path)
    assert (scene.coat[0], scene.coat_roughness[0]) == (pytest.approx(0.2), pytest.approx(0.3))
    assert (scene.roughness[0], scene.metallic[0], scene.report.notes) == (0.5, metal, ())
    np.testing.assert_allclose(scene.reflectivity[0], [0.5, 0.4, 0.3], rtol=1e-6)


def test_what_a_clear_coat_cannot_have_is_noted(tmp_path: Path) -> None:
    coat = {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatNormalTexture": {"index": 0}}}
    scene = load(quad_of("Gold", {"roughnessFactor": 0.0, "metallicFactor": 1.0}, extensions=coat), tmp_path)
    assert scene.has_mirrors and not scene.is_glossy
    of_coat = "clear coats have the normal map of the surface under them, and none of their own: Gold"
    assert set(scene.report.notes) == {
        of_coat, "clear coats of mirrors are left out: Gold",
    }  # fmt: skip


def test_a_faint_reflection_under_a_clear_coat_is_rough(tmp_path: Path) -> None:
    scene, _ = layered(tmp_path, clearcoat={"clearcoatFactor": 1.0}, specular={"specularFactor": 0.0})
    assert (scene.roughness[0], scene.coat[0]) == (1.0, 1.0)
    assert of_even_light(scene) == pytest.approx(0.5, rel=1e-5)


# Texels of every slot of layers, RGBA; factors multiply them.
LAYERS = {
    "clearcoat": {"clearcoatFactor": 0.8, "clearcoatTexture": 0, "clearcoatRoughnessTexture": 0},
    "specular": {"specularTexture": 1, "specularColorTexture": 0},
    "sheen": {"sheenColorTexture": 0, "sheenRoughnessTexture": 1},
}
CODES = np.array(
    [[[[255, 51, 90, 255], [128, 204, 0, 51]], [[0, 0, 255, 102], [26, 255, 128, 255]]],
     [[[9, 77, 0, 30], [99, 128, 255, 255]], [[0, 200, 128, 160], [26, 10, 0, 90]]]], np.uint8,
)  # fmt: skip
ROUGHNESS_FACTORS = {"clearcoatRoughnessFactor": 1.0, "sheenColorFactor": [0.7, 0.8, 0.9], "sheenRoughnessFactor": 0.9}
PBR = {"baseColorFactor": [0.9, 0.8, 0.7, 1.0], "roughnessFactor": 0.9, "metallicFactor": 0.5}


def with_layers(folder: Path, names: list[str], codes: Any, *, moved: bool = False, lobe: Any = None) -> Scene:
    """A surface with textures of some layers, of its colour and, if given, of its lobe."""
    glb = Glb()
    for texels in (*codes, codes[0][::-1], codes[1][::-1] if lobe is None else lobe):
        glb.texture(png(texels))
    more = {"extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}} if moved else {}
    extensions = {}
    for name in names:
        values = {key: {"index": value, **more} if "Texture" in key else value for key, value in LAYERS[name].items()}
        extensions[f"KHR_materials_{name}"] = values | {
            key: value for key, value in ROUGHNESS_FACTORS.items() if key.startswith(name)
        }
    pbr = PBR | {"baseColorTexture": {"index": 2}}
    if lobe is not None:
        pbr["metallicRoughnessTexture"] = {"index": 3}
    material = glb.material("Paint", pbr, extensions=extensions)
    glb.node(glb.mesh(material, TEXCOORD_0=glb.accessor(QUAD_UVS)))
    return load(glb, folder)


def texels_of(scene: Scene, table: str) -> Float64:
    """(2, 2, 4) texels of the texture of a table, from 0 to 1."""
    first, width, height = scene.textures[getattr(scene, table)[scene.material[0]]]
    texels = scene.texels[first : first + width * height].reshape(height, width, 4) / 255.0
    return np.broadcast_to(texels, (2, 2, 4))


@pytest.mark.parametrize("lobe", [None, 255 - CODES[1]])
@pytest.mark.parametrize("names", [["clearcoat"], ["specular"], ["sheen"], ["specular", "sheen", "clearcoat"]])
def test_textures_of_layers_count_texel_by_texel(tmp_path: Path, names: list[str], lobe: Any) -> None:
    """Every texel becomes what a material of these constants becomes."""
    scene = with_layers(tmp_path, names, CODES, lobe=lobe)
    used, (a, b) = scene.material[0], CODES / 255.0
    base = linear_from_srgb(CODES[0][::-1, :, :3] / 255.0) * PBR["baseColorFactor"][:3]
    rough, metal = (np.ones((2, 2)) if lobe is None else lobe[..., k] / 255.0 for k in (1, 2))
    reflects, cloth = "specular" in names, np.float64("sheen" in names)
    base, rough, metal, _ = joined(
        base, 0.9 * rough, 0.5 * metal, linear_from_srgb(a[..., :3]) if reflects else np.ones((2, 2, 3)),
        b[..., 3] if reflects else np.ones((2, 2)), cloth * linear_from_srgb(a[..., :3]) * [0.7, 0.8, 0.9],
        0.9 * b[..., 3], f0=0.04,
    )  # fmt: skip
    found, numbers = texels_of(scene, "reflectivity_texture"), texels_of(scene, "gloss_texture")
    np.testing.assert_allclose(linear_from_srgb(found[..., :3]) * scene.reflectivity[used], base, atol=0.005)
    np.testing.assert_allclose(numbers[..., 1] * scene.roughness[used], rough, atol=0.003)
    np.testing.assert_allclose(numbers[..., 2] * scene.metallic[used], metal, atol=0.003)
    coat = "clearcoat" in names
    np.testing.assert_allclose(numbers[..., 0] * scene.coat[used], coat * 0.8 * a[..., 0], atol=0.003)
    if coat:
        np.testing.assert_allclose(numbers[..., 3] * scene.coat_roughness[used], a[..., 1], atol=0.003)
    np.testing.assert_array_equal(found[..., 3], a[::-1, :, 3])
    assert scene.report.textures == 2 and not scene.report.notes


@pytest.mark.parametrize("name", ["clearcoat", "specular", "sheen"])
def test_constant_textures_of_layers_are_their_means(tmp_path: Path, name: str) -> None:
    """Elsewhere than the colour's, the colour gets the mean; elsewhere than the lobe's, the lobe does, too."""
    codes = np.broadcast_to(CODES[:, :1, 1:], CODES.shape)
    one = with_layers(tmp_path, [name], codes)
    base = linear_from_srgb(texels_of(one, "reflectivity_texture")[..., :3]) * one.reflectivity[one.material[0]]
    for lobe in (None, np.full((2, 2, 4), 255, np.uint8)):
        moved = with_layers(tmp_path, [name], codes, moved=True, lobe=lobe)
        means = "textures of layers with texture coordinates of their own count by their mean: Paint"
        assert moved.report.notes == (() if lobe is None else (means,))
        if lobe is None:
            a, b = (texels_of(scene, "gloss_texture") for scene in (one, moved))
            np.testing.assert_allclose(a, b, atol=0.003)
        factor = moved.reflectivity[moved.material[0]]
        np.testing.assert_allclose(
            linear_from_srgb(texels_of(moved, "reflectivity_texture")[..., :3]) * factor, base, atol=0.005
        )


@pytest.mark.parametrize("image", [{"mimeType": "image/ktx2", "bufferView": 0}, {"uri": "a.ktx2"}])
def test_a_compressed_texture_names_the_tool_that_converts_it(tmp_path: Path, image: Any) -> None:
    glb = quad_of("Paint", {"baseColorTexture": {"index": 0}}, TEXCOORD_0=QUAD_UVS)
    glb.add("textures", {"extensions": {"KHR_texture_basisu": {"source": glb.add("images", image)}}})
    assert "gltf-transform ktxdecompress" in "; ".join(load(glb, tmp_path).report.notes)


@pytest.mark.parametrize("ior", [1.5, 2.0])
def test_the_rim_of_cloth_is_seen_in_even_light(tmp_path: Path, ior: float) -> None:
    cloth = {"sheenColorFactor": [0.5] * 3, "sheenRoughnessFactor": 0.6}
    scene, notes = layered(tmp_path, sheen=cloth, ior={"ior": ior})
    f0 = ((ior - 1) / (ior + 1)) ** 2
    lobe, rim = f0 + (1 - f0) / 21, 0.5 * sheen_albedo(0.6)
    assert of_even_light(scene) == pytest.approx(rim + (1 - rim) * (lobe + (1 - lobe) * 0.5), rel=1e-5)
    assert not notes


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
def test_the_rim_of_cloth_agrees_with_random_directions(roughness: float) -> None:
    """Pairs of directions with the density of the cosine; their mean of pi times the lobe is the share."""
    random = np.random.default_rng(7)
    into, out = (_by_cosine(random, 200_000) for _ in range(2))
    half = (into + out) / np.linalg.norm(into + out, axis=1, keepdims=True)
    sharpness = 1 / max(roughness, 0.07) ** 2
    distribution = (2 + sharpness) * np.sqrt(1 - half[:, 2] ** 2) ** sharpness / (2 * np.pi)
    found = np.pi * distribution / (4 * (into[:, 2] + out[:, 2] - into[:, 2] * out[:, 2]))
    assert abs(found.mean() - sheen_albedo(roughness)) < 4 * found.std() / np.sqrt(len(found)) + 2e-3


def _by_cosine(random: np.random.Generator, count: int) -> Float64:
    """(count, 3) directions around z, with the density of the cosine."""
    square, turn = random.random(count), 2 * np.pi * random.random(count)
    return np.stack([np.sqrt(square) * np.cos(turn), np.sqrt(square) * np.sin(turn), np.sqrt(1 - square)], axis=1)


def test_a_reflectivity_of_the_job_is_diffuse(tmp_path: Path):
    glb = quad_of("Paint", {"roughnessFactor": 0.3})
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
    file = write_obj(tmp_path, vertices + faces, MTL)
    scene = load_scene(file, as_file=True)
    found = {name: k for k, name in enumerate(scene.material_names)}
    rough = {name: float(scene.roughness[found[name]]) for name in names}
    assert rough == pytest.approx({"Pbr": 0.3, "Phong": 0.4, "Matte": 0.0, "Chrome": 0.0})
    assert scene.metallic[found["Pbr"]] == pytest.approx(0.8)
    np.testing.assert_allclose(scene.specular[found["Chrome"]], 0.8)
    assert not load_scene(file).is_glossy


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 2 0\nvt 2 3\nvt 0 3\n"
FACE = "f 1/1 2/2 3/3\n"


def named(meshes: Meshes) -> dict[str, int]:
    """Number of triangles of each object."""
    merged = merge(meshes.parts)
    objects: Int32 = merged.object
    return dict(zip(merged.objects, np.bincount(objects, minlength=len(merged.objects)).tolist(), strict=True))


def test_nodes_of_gltf_have_their_name_or_that_of_their_mesh(tmp_path: Path) -> None:
    glb = Glb()
    mesh = glb.mesh()
    glb.node(mesh, name="Table")
    glb.node(mesh, name="Table", translation=[0, 2, 0])
    glb.node(mesh, translation=[0, 4, 0])
    glb.node(glb.mesh(), name="")
    glb.tree["meshes"][1]["name"] = "Chair"
    assert named(read_meshes(glb.save(tmp_path / "a.glb"))) == {"Table": 4, "node 2": 2, "Chair": 2}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{SQUARE}o Box\n{FACE}g side\n{FACE}o Lid\n{FACE}", {"Box": 2, "Lid": 1}),
        (f"{SQUARE}{FACE}g left arm\n{FACE}g right\n{FACE}", {"default": 1, "left arm": 1, "right": 1}),
        (f"{SQUARE}{FACE}", {"default": 1}),
        (f"{SQUARE}o Box\nusemtl A\n{FACE}o Lid\n{FACE}usemtl B\n{FACE}{FACE}", {"Box": 1, "Lid": 3}),
    ],
)
def test_objects_of_obj_are_by_o_or_else_by_g(tmp_path: Path, text: str, expected: dict[str, int]) -> None:
    assert named(read_meshes(write_obj(tmp_path, text))) == expected


def test_instances_of_usd_have_the_paths_of_their_prims(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="usd-core is not installed (extra usd)")
    from support.usdfiles import coordinates, instancer, mesh, new_stage, save

    stage = new_stage(tmp_path / "a.usda")
    stage.CreateClassPrim("/Proto")
    coordinates(mesh(stage, "/Proto/M"), [(0, 0), (1, 0), (1, 1), (0, 1)], "vertex")
    for k in range(2):
        prim = stage.DefinePrim(f"/World/I{k}", "Xform")
        prim.GetReferences().AddInternalReference("/Proto")
        prim.SetInstanceable(True)
    instancer(stage, "/World/Many", "/World/Many/P/Card", [(0.0, 0.0, 5.0), (0.0, 0.0, 6.0)])
    mesh(stage, "/World/Many/P/Card")
    file = save(stage)
    assert named(read_meshes(file)) == {"/World/I0/M": 2, "/World/I1/M": 2, "/World/Many/P/Card": 4}
    assert not len(load_scene(file).uvs)
    uvs = load_scene(file, all_uvs=True).uvs
    assert uvs[:4].max() == 1 and not uvs[4:].any(), "a mesh without has 0"


def test_texture_coordinates_are_read_without_a_texture_where_they_are_asked_for(tmp_path: Path) -> None:
    corners = np.array([[[0, 0], [2, 0], [2, 3]]], np.float32)
    glb = Glb()
    uvs = np.array([[0, 1], [2, 1], [2, -2], [0, -2]], np.float32)  # v downwards
    glb.node(glb.mesh(faces=np.array([0, 1, 2], np.uint16), TEXCOORD_0=glb.accessor(uvs)))
    for file in (write_obj(tmp_path, f"{SQUARE}{FACE}"), glb.save(tmp_path / "a.glb")):
        assert not len(load_scene(file).uvs)
        np.testing.assert_allclose(load_scene(file, all_uvs=True).uvs, corners)
