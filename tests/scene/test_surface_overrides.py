"""Thin glass as scene files describe it, and what a job may say of surfaces that follow the file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import QUAD_UVS, Glb, png, write_obj

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.glass import transmission_along
from framearray_cli.engine.inputs.panes import pane_arrays
from framearray_cli.job.job import KEYS_BY_FILE, MaterialTable
from framearray_cli.scene.files import read_meshes
from framearray_cli.scene.files.materials import override_materials
from framearray_cli.scene.files.model import SCREENED, Material, Notes, PaneGlass
from framearray_cli.scene.panes import COLOUR, NORMAL, SHEET, F, G, in_closed_mesh
from framearray_cli.scene.scene import Scene, load_scene

CLEAR = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
BOX = tiny.box((0, 0, 0), (1, 2, 0.1))


def scene_with(tmp_path: Path, pbr: dict[str, Any], corners: Any = BOX, **more: Any) -> Scene:
    glb = Glb()
    glb.node(glb.mesh(glb.material("Wall", {})))
    positions = np.asarray(corners, np.float32).reshape(-1, 3)
    faces = np.arange(len(positions), dtype=np.uint16)
    glb.node(glb.mesh(glb.material("Pane", pbr, **more), positions=positions, faces=faces))
    return load_scene(glb.save(tmp_path / "a.glb"), as_file=True)


def test_a_closed_box_has_two_faces_and_an_open_one_sheets(tmp_path: Path) -> None:
    pbr = {"baseColorFactor": [0.81, 0.64, 0.25, 1.0]}
    closed = scene_with(tmp_path, pbr, extensions=CLEAR).pane_optics
    np.testing.assert_allclose(closed[:, COLOUR : COLOUR + 3], np.tile([0.9, 0.8, 0.5], (12, 1)), rtol=1e-6)
    assert (closed[:, SHEET] == 0).all()
    scene = scene_with(tmp_path, pbr, BOX[:-2], extensions=CLEAR)
    np.testing.assert_allclose(
        scene.pane_optics[:, COLOUR : COLOUR + 3], np.tile([0.81, 0.64, 0.25], (10, 1)), rtol=1e-6
    )
    np.testing.assert_allclose(scene.pane_optics[:, F], 0.04, rtol=1e-6)
    np.testing.assert_allclose(scene.pane_optics[:, G], 0.96, rtol=1e-6)
    assert (scene.pane_optics[:, SHEET] == 1).all()
    assert scene.has_glass and len(scene.corners) == 2
    assert "glass: 10 triangles of sheets" in scene.report.notes
    assert scene.report.dropped == {}


def test_meshes_close_one_by_one() -> None:
    """An open mesh beside a closed one, and one that shares a corner with it."""
    sheet = tiny.quad((3, 0, 0), (4, 0, 0), (4, 1, 0), (3, 1, 0))
    closed = in_closed_mesh(np.concatenate([BOX, sheet, BOX[:-1] + 7]).astype(np.float32))
    assert closed.tolist() == [True] * 12 + [False] * 13
    flap = np.array([[[0, 0, 0], [-1, 0, 0], [-1, 1, 0]]])
    assert not in_closed_mesh(np.concatenate([BOX, flap]).astype(np.float32)).any()


def test_normals_are_units(tmp_path: Path) -> None:
    optics = scene_with(tmp_path, {}, extensions=CLEAR).pane_optics
    np.testing.assert_allclose(np.linalg.norm(optics[:, NORMAL : NORMAL + 3], axis=1), 1.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("extensions", "colour", "f"),
    [
        ({"KHR_materials_ior": {"ior": 2.0}}, (0.8, 0.8, 0.8), 1 / 9),
        ({"KHR_materials_ior": {"ior": 0.0}}, (0.8, 0.8, 0.8), 0.0),
        (
            {
                "KHR_materials_volume": {
                    "thicknessFactor": 0.5,
                    "attenuationDistance": 0.25,
                    "attenuationColor": [1, 0.5, 0],
                }
            },
            (0.8, 0.2, 0.0),
            0.04,
        ),
        ({"KHR_materials_volume": {"thicknessFactor": 0.5}}, (0.8, 0.8, 0.8), 0.04),
    ],
)
def test_index_and_volume(tmp_path: Path, extensions: dict[str, Any], colour: Any, f: float) -> None:
    pbr = {"baseColorFactor": [0.8, 0.8, 0.8, 1.0]}
    optics = scene_with(tmp_path, pbr, BOX[:2], extensions={**CLEAR, **extensions}).pane_optics
    np.testing.assert_allclose(optics[0, COLOUR : COLOUR + 3], colour, atol=1e-6)
    assert optics[0, F] == pytest.approx(f)


def test_glass_is_read_texel_by_texel(tmp_path: Path) -> None:
    """Left lets light through, right does not; the upper half is as thick as it gets; a texture colours all."""
    glb, nearest = Glb(), {"magFilter": 9728}
    passes = {"index": glb.texture(png([[[255, 0, 0], [0, 0, 0]]] * 2), **nearest)}
    depth = {"index": glb.texture(png([[[0, 255, 0]] * 2, [[0, 0, 0]] * 2]), **nearest)}
    colour = {"index": glb.texture(png([[[188, 255, 0]] * 2] * 2), **nearest)}
    volume = {"thicknessFactor": 1.0, "thicknessTexture": depth, "attenuationDistance": 0.5}
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 1.0, "transmissionTexture": passes},
        "KHR_materials_volume": volume | {"attenuationColor": [0.5, 0.25, 1.0]},
    }
    pane = glb.material("Pane", {"baseColorTexture": colour}, extensions=extensions)
    glb.node(glb.mesh(pane, TEXCOORD_0=glb.accessor(QUAD_UVS)))
    scene = load_scene(glb.save(tmp_path / "a.glb"), as_file=True)
    assert len(scene.corners) == len(scene.pane_corners) == 2
    first, width, height = scene.textures[scene.alpha_texture[scene.material[0]]]
    opacity = scene.texels[first : first + width * height, 3].reshape(height, width)
    assert scene.alpha_cutoff[scene.material[0]] == SCREENED and opacity.tolist() == [[0, 255], [0, 255]]
    points = np.array([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25]])
    start = np.column_stack([points, np.ones(3)]) - scene.centre
    with EmbreeScene(scene) as embree:
        panes = pane_arrays(scene, embree.panes)
        found, _ = transmission_along(start, np.tile([0.0, 0.0, -1.0], (3, 1)), np.full(3, np.inf), panes)
    red = ((188 / 255 + 0.055) / 1.055) ** 2.4 * 0.96 / 1.04
    thick, thin = (red / 4, 0.96 / 1.04 / 16, 0.0), (red, 0.96 / 1.04, 0.0)
    np.testing.assert_allclose(found, (thick, thick, thin), atol=0.004)  # codes of 8 bits


def test_a_nearly_clear_blend_covers_and_reflects_nothing(tmp_path: Path) -> None:
    optics = scene_with(tmp_path, {"baseColorFactor": [0.1, 0.5, 1.0, 0.2]}, alphaMode="BLEND").pane_optics
    np.testing.assert_allclose(optics[:, COLOUR : COLOUR + 3], 0.8, rtol=1e-6)
    assert (optics[:, F] == 0).all() and (optics[:, G] == 0).all()


@pytest.mark.parametrize(
    ("lines", "colour", "ior"),
    [
        ("d 0.1", (0.9, 0.9, 0.9), 1.0),
        ("d 0.2\nTf 0.5 1 0.25\nNi 1.4", (0.4, 0.8, 0.2), 1.4),
        ("Tr 0.9\nillum 4", (0.9, 0.9, 0.9), 1.5),
    ],
)
def test_mtl(tmp_path: Path, lines: str, colour: Any, ior: float) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl G\nf 1 2 3\n"
    file = write_obj(tmp_path, text, f"newmtl G\nKd 1 1 1\n{lines}\n")
    glass = read_meshes(file, as_file=True).materials[0].glass
    assert glass is not None
    assert (glass.colour, glass.ior) == (pytest.approx(colour), pytest.approx(ior))
    assert glass.covers == (ior == 1.0)
    assert read_meshes(file).materials[0].left_out == "transmissive"


RED = (0.8, 0.4, 0.2)
# half of the texels have roughness 51 / 255 in green, the others 102 / 255; metal 255 / 255 and 0 in blue
TEXELS = np.array([[[0, 51, 255, 255], [0, 102, 0, 255]]], np.uint8)
GREY = np.full((1, 1, 4), (188, 188, 188, 255), np.uint8)  # 0.5 linear
GLOSSY = Material(name="M", reflectivity=RED, roughness=0.6, metallic=0.25, gloss_texture=0, texture=1)
MIRROR = Material(name="M", reflectivity=(0.2, 0.1, 0.05), specular=(0.6, 0.3, 0.15), texture=1, specular_texture=1)
DIFFUSE = Material(name="M", reflectivity=RED)


def changed(material: Material, **values: Any) -> tuple[Material, str]:
    notes = Notes()
    (found,) = override_materials([material], {"M": MaterialTable(**values)}, (TEXELS, GREY), notes)
    return found, "\n".join(notes.lines())


def test_both_values_replace_the_texture() -> None:
    found, notes = changed(GLOSSY, roughness=0.3, metallic=0.75)
    assert (found.roughness, found.metallic, found.gloss_texture) == (0.3, 0.75, -1)
    assert (found.reflectivity, found.texture, notes) == (RED, 1, "")


def test_one_value_leaves_the_mean_of_the_other() -> None:
    found, notes = changed(GLOSSY, roughness=0.3)
    assert (found.roughness, found.metallic) == (0.3, pytest.approx(0.25 * 0.5))
    assert "count by their mean" in notes
    found, _ = changed(GLOSSY, metallic=1.0)
    assert (found.roughness, found.metallic) == (pytest.approx(0.6 * 0.3), 1.0)


def test_a_smooth_metal_becomes_a_mirror_and_back() -> None:
    found, _ = changed(replace(GLOSSY, gloss_texture=-1), roughness=0.1, metallic=0.5)
    assert found.reflectivity == found.specular == pytest.approx(tuple(0.5 * c for c in RED))
    assert (found.roughness, found.texture, found.specular_texture) == (0.0, 1, 1)
    found, _ = changed(MIRROR, roughness=0.4)
    assert found.reflectivity == pytest.approx(RED) and found.specular == (0.0, 0.0, 0.0)
    assert (found.roughness, found.metallic) == (0.4, pytest.approx(0.75))
    assert (found.texture, found.specular_texture) == (1, -1)


def test_a_dielectric_is_never_smoother_than_a_highlight_allows() -> None:
    found, _ = changed(DIFFUSE, roughness=0.0)
    assert (found.roughness, found.metallic, found.specular) == (0.1, 0.0, (0.0, 0.0, 0.0))
    found, _ = changed(DIFFUSE, metallic=1.0)
    assert (found.roughness, found.metallic) == (1.0, 1.0)


def test_reflectivity_is_the_base_colour_of_gloss() -> None:
    found, _ = changed(GLOSSY, reflectivity=0.5, roughness=0.2)
    assert (found.reflectivity, found.texture, found.roughness) == ((0.5,) * 3, -1, 0.2)
    assert changed(GLOSSY, reflectivity=0.5)[0].roughness == 0, (
        "without roughness or metal beside it the surface is diffuse"
    )


def test_transmission_makes_glass_of_the_materials_colour() -> None:
    found, _ = changed(GLOSSY, transmission=0.9, ior=1.8)
    assert found.glass is not None and found.glass.ior == 1.8
    assert found.glass.texture == GLOSSY.texture and found.glass.colour == pytest.approx(tuple(0.9 * c for c in RED))
    found, notes = changed(GLOSSY, transmission=0.6)
    assert (found.glass, found.alpha_cutoff, found.alpha) == (None, SCREENED, pytest.approx(0.4))
    assert "by chance" in notes


@pytest.mark.parametrize("more", [{}, {"reflectivity": 0.6}])
def test_another_transmission_or_colour_leaves_the_rest_of_glass_as_it_is(more: dict[str, float]) -> None:
    pane = replace(DIFFUSE, glass=PaneGlass(colour=(1.0, 1.0, 1.0), ior=1.7, solid=True))
    glass = changed(pane, transmission=0.9, **more)[0].glass
    assert glass is not None and (glass.ior, glass.solid) == (1.7, True)


def test_no_transmission_makes_glass_and_screens_solid() -> None:
    pane = replace(DIFFUSE, glass=PaneGlass(colour=(1.0, 1.0, 1.0)))
    assert changed(pane, transmission=0)[0] == DIFFUSE
    assert changed(replace(DIFFUSE, alpha=0.5, alpha_cutoff=SCREENED), transmission=0)[0] == DIFFUSE
    holes = replace(DIFFUSE, alpha_texture=0, alpha_cutoff=0.5)
    assert changed(holes, transmission=0)[0] == holes


def test_ior_needs_glass() -> None:
    pane = replace(DIFFUSE, glass=PaneGlass(colour=(1.0, 1.0, 1.0)))
    found, notes = changed(pane, ior=1.3)
    assert found.glass is not None and found.glass.ior == 1.3 and notes == ""
    assert "ior changes nothing" in changed(DIFFUSE, ior=1.3)[1]


def test_emission_replaces_factor_and_texture() -> None:
    found, _ = changed(replace(DIFFUSE, emission=(1.0, 1.0, 1.0), emission_texture=1), emission=[4, 2, 0])
    assert (found.emission, found.emission_texture) == ((4.0, 2.0, 0.0), -1)


@pytest.mark.parametrize("key", KEYS_BY_FILE)
def test_diffuse_surfaces_refuse_the_keys(key: str) -> None:
    value = 1.2 if key == "ior" else 0.5
    with pytest.raises(ValueError, match=r'expected none with scene\.surfaces = "diffuse"'):
        tiny.job(scene={"materials": {"Wall": {key: value}}})
    tiny.job(scene={"surfaces": "file", "materials": {"Wall": {key: value}}})


@pytest.mark.parametrize("key", ["roughness", "metallic", "transmission"])
def test_a_mirror_is_not_glossy(key: str) -> None:
    with pytest.raises(ValueError, match="expected none next to `specular`"):
        MaterialTable.model_validate({"specular": 0.5, key: 0.5})
