"""Materials of MaterialX in USD: documents that a stage references, and shaders within it."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.materialx import document, material
from support.scenes import png
from support.usdfiles import bind, coordinates, mesh, new_stage, preview, pxr, save

from framearray_cli.scene.scene import Scene, load_scene

NAMES = ("Standard", "Open", "Gltf", "Preview", "Picture", "Glass")
DOCUMENT = document(
    material(
        "Standard", "standard_surface", base=0.5, base_color="0.4, 0.6, 0.8", specular_roughness=0.35, metalness=0.25,
        emission=2.0, emission_color="1, 0.5, 0.25", coat=1.0,
    ),
    material("Open", "open_pbr_surface", base_color="0.3, 0.2, 0.1"),
    material("Gltf", "gltf_pbr", base_color="0.3, 0.2, 0.1", metallic=0.0, roughness=0.7),
    material("Preview", "UsdPreviewSurface", diffuseColor="0.7, 0.6, 0.5", roughness=0.6),
    material("Picture", "standard_surface", base=0.5, base_color="N"),
    material("Glass", "standard_surface", transmission=0.9, transmission_color="1, 0.5, 0.5"),
)  # fmt: skip


@pytest.fixture
def stage(tmp_path: Path) -> Any:
    """A square for each material of the document."""
    pytest.importorskip("MaterialX", reason="needs MaterialX: pip install MaterialX")
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "a.png").write_bytes(png(np.full((4, 4, 3), 188, np.uint8)))
    (tmp_path / "look.mtlx").write_text(DOCUMENT)
    made = new_stage(tmp_path / "a.usda")
    made.OverridePrim("/World/MaterialX").GetReferences().AddReference("look.mtlx", "/MaterialX")
    for k, name in enumerate(NAMES):
        shape = mesh(made, f"/World/{name}", [(3 * k, 0, 0), (3 * k + 1, 0, 0), (3 * k + 1, 1, 0), (3 * k, 1, 0)])
        coordinates(shape, [(0, 0), (1, 0), (1, 1), (0, 1)], "vertex")
        target = pxr().UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).GetDirectBindingRel()
        target.SetTargets([f"/World/MaterialX/Materials/{name}"])
    return made


def test_documents(stage: Any) -> None:
    scene = load_scene(save(stage), as_file=True, shining=["Standard"])
    row = {name: k for k, name in enumerate(scene.material_names)}
    expected = {
        "Standard": ((0.2, 0.3, 0.4), 0.35, 0.25),
        "Open": ((0.3, 0.2, 0.1), 0.3, 0.0),
        "Gltf": ((0.3, 0.2, 0.1), 0.7, 0.0),
        "Preview": ((0.7, 0.6, 0.5), 0.6, 0.0),
        "Picture": ((0.5, 0.5, 0.5), 0.2, 0.0),
    }
    for name, (colour, roughness, metallic) in expected.items():
        k = row[name]
        np.testing.assert_allclose(scene.reflectivity[k], colour, rtol=1e-6, err_msg=name)
        np.testing.assert_allclose((scene.roughness[k], scene.metallic[k]), (roughness, metallic), rtol=1e-6)
    np.testing.assert_allclose(scene.emission[row["Standard"]], (2.0, 1.0, 0.5))
    assert scene.report.notes.count("clear coats that are faint or on metal have no highlights: Standard") == 1
    assert scene.reflectivity_texture[row["Picture"]] >= 0
    uvs = scene.uvs[scene.material == row["Picture"]]
    np.testing.assert_allclose(uvs.reshape(-1, 2).max(axis=0), (2, 4))
    np.testing.assert_allclose(scene.pane_optics[0, :3], (0.9, 0.45, 0.45), rtol=1e-6)


def test_images_in_tiles(stage: Any, tmp_path: Path) -> None:
    """Two, next to the document."""
    for number, grey in ((1001, 50), (1002, 100)):
        (tmp_path / "images" / f"a.{number}.png").write_bytes(png(np.full((1, 1, 3), grey, np.uint8)))
    (tmp_path / "look.mtlx").write_text(DOCUMENT.replace("a.png", "a.&lt;UDIM&gt;.png"))
    scene = load_scene(save(stage), as_file=True)
    row = scene.material_names.index("Picture")
    first, *size = scene.textures[scene.reflectivity_texture[row]]
    assert size == [2, 1] and scene.texels[first : first + 2, 0].tolist() == [50, 100]
    np.testing.assert_allclose(scene.uvs[scene.material == row].reshape(-1, 2).max(axis=0), (1, 4))


def test_shaders_of_a_flattened_stage(tmp_path: Path) -> None:
    """They are the surface of MaterialX alone."""
    stage = new_stage(tmp_path / "a.usda")
    material = preview(stage, "Flat", diffuseColor=(0.1, 0.2, 0.3))
    shade = pxr().UsdShade
    shader = shade.Shader(stage.GetPrimAtPath("/World/Looks/Flat/Surface"))
    shader.GetIdAttr().Set("ND_UsdPreviewSurface_surfaceshader")
    material.GetPrim().RemoveProperty("outputs:surface")
    material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.ConnectableAPI(), "surface")
    bind(mesh(stage, "/World/M").GetPrim(), material)
    scene = load_scene(save(stage), as_file=True)
    np.testing.assert_allclose(scene.reflectivity[0], (0.1, 0.2, 0.3), rtol=1e-6)


def loaded(stage: Any, capfd: pytest.CaptureFixture) -> Scene:
    file = save(stage)
    capfd.readouterr()  # the stage of the test warns, too
    scene = load_scene(file, as_file=True)
    assert len(scene.corners) == 2 * len(NAMES)
    assert capfd.readouterr() == ("", "")
    return scene


def test_a_broken_document_is_left_out(stage: Any, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    (tmp_path / "look.mtlx").write_text(DOCUMENT[:900])
    assert any(
        note.startswith("layers that are broken are left out: look.mtlx (")
        for note in loaded(stage, capfd).report.notes
    )


def test_without_its_program_a_note_says_how_to_get_it(
    stage: Any, monkeypatch: Any, capfd: pytest.CaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    notes = loaded(stage, capfd).report.notes
    assert any(
        note.startswith("materials of MaterialX need ") and "[usd]" in note and "look.mtlx" in note for note in notes
    )
