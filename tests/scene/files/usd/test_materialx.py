"""Materials of MaterialX in USD: documents that a stage references, and shaders within it."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.materialx import document, material
from support.scenes import png
from support.usdfiles import bind, coordinates, mesh, new_stage, preview, pxr, save

from framearray_cli.base.colour import linear_from_srgb, srgb_from_linear
from framearray_cli.scene.files import read_meshes
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
    return squares(tmp_path, DOCUMENT, NAMES)


def squares(folder: Path, text: str, names: Sequence[str]) -> Any:
    """A square for each of these materials of a document."""
    (folder / "look.mtlx").write_text(text)
    made = new_stage(folder / "a.usda")
    made.OverridePrim("/World/MaterialX").GetReferences().AddReference("look.mtlx", "/MaterialX")
    for k, name in enumerate(names):
        shape = mesh(made, f"/World/{name}", [(3 * k, 0, 0), (3 * k + 1, 0, 0), (3 * k + 1, 1, 0), (3 * k, 1, 0)])
        coordinates(shape, [(0, 0), (1, 0), (1, 1), (0, 1)], "vertex")
        target = pxr().UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).GetDirectBindingRel()
        target.SetTargets([f"/World/MaterialX/Materials/{name}"])
    return made


def test_documents(stage: Any, tmp_path: Path) -> None:
    relief = '<input name="displacementshader" type="displacementshader" nodename="D" /></surfacematerial>'
    above, _, below = DOCUMENT.rpartition("</surfacematerial>")
    shader = '<displacement name="D" type="displacementshader" /></materialx>'
    (tmp_path / "look.mtlx").write_text(above + relief + below.replace("</materialx>", shader))
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
    assert "displacement is left out: Glass" in scene.report.notes
    np.testing.assert_allclose(scene.emission[row["Standard"]], (2.0, 1.0, 0.5))
    coats = {name: (scene.coat[k], scene.coat_roughness[k]) for name, k in row.items()}
    assert coats == {name: (1.0, np.float32(0.1)) if name == "Standard" else (0.0, 0.0) for name in row}
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
    shader.GetInput("diffuseColor").GetAttr().SetColorSpace("srgb_texture")
    material.GetPrim().RemoveProperty("outputs:surface")
    material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.ConnectableAPI(), "surface")
    bind(mesh(stage, "/World/M").GetPrim(), material)
    scene = load_scene(save(stage), as_file=True)
    np.testing.assert_allclose(scene.reflectivity[0], linear_from_srgb(np.array((0.1, 0.2, 0.3))), rtol=1e-6)


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


# Images of one texel, (200, 100, 50), in several colour spaces, and nodes after the first.
SPACES = {"coded": "srgb_texture", "line": "raw", "given": "", "power": "g22_rec709", "wide": "acescg"}
PLACED = (
    ("file", "filename", "b.png"),
    ("factor", "color3", "0.5, 0.25, 1"),
    ("scale", "vector2", "2, 4"),
    ("offset", "vector2", "0.25, 0.5"),
)
NODES = {
    "dim": ("multiply", "color3", ("in1", "node", "coded"), ("in2", "color3", "0.5, 0.25, 1")),
    "square": ("multiply", "color3", ("in1", "node", "coded"), ("in2", "node", "line")),
    "half": ("mix", "color3", ("fg", "node", "coded"), ("bg", "color3", "0, 0, 0"), ("mix", "float", "0.5")),
    "parts": ("separate3", "multioutput", ("in", "node", "coded")),
    "blue": ("extract", "float", ("in", "node", "coded"), ("index", "integer", "2")),
    "bumps": ("normalmap", "vector3", ("in", "node", "line"), ("scale", "float", "0.4")),
    "placed": ("gltf_image", "color3", *PLACED),
    "ordered": ("gltf_image", "color3", *PLACED, ("operationorder", "integer", "1")),
}


def looks(folder: Path, *, as_file: bool = True, **shaders: tuple[str, dict[str, float | str]]) -> tuple[Any, Any]:
    """Materials by name, of shaders with the outputs of these images and nodes as "G.x"; and what was read."""
    pytest.importorskip("MaterialX", reason="needs MaterialX: pip install MaterialX")
    (folder / "images").mkdir(exist_ok=True)
    (folder / "images" / "b.png").write_bytes(png(np.full((1, 1, 3), (200, 100, 50), np.uint8)))
    lines = ['<nodegraph name="G">']
    for name, space in SPACES.items():
        file = f'<input name="file" type="filename" value="b.png" {f"colorspace={space!r}" if space else ""}/>'
        lines.append(f'<image name="n{name}" type="color3">{file}</image>')
    for name, (category, kind, *inputs) in NODES.items():
        lines.append(f'<{category} name="n{name}" type="{kind}">')
        for key, entry, value in inputs:
            source = f'type="color3" nodename="n{value}"' if entry == "node" else f'type="{entry}" value="{value}"'
            lines.append(f'<input name="{key}" {source}/>')
        lines.append(f"</{category}>")
    lines += [f'<output name="{name}" type="color3" nodename="n{name}"/>' for name in (*SPACES, *NODES)]
    lines += ['<output name="green" type="float" nodename="nparts" output="outg"/>', "</nodegraph>"]
    text = document("\n".join(lines), *(material(name, shader, **inputs) for name, (shader, inputs) in shaders.items()))
    found = read_meshes(save(squares(folder, text, tuple(shaders))), as_file=as_file)
    return {made.name: made for made in found.materials}, found


def test_nodes(tmp_path: Path) -> None:
    shaders: dict[str, dict[str, float | str]] = {
        "Dim": {"base_color": "G.dim", "base": 0.5},
        "Square": {"base_color": "G.square"},
        "Half": {"base_color": "G.half"},
        "Weight": {"base": "G.coded", "base_color": "0.5, 0.25, 1"},
        "Green": {"specular_roughness": "G.green"},
        "Blue": {"specular_roughness": "G.blue"},
        "Bumps": {"normal": "G.bumps"},
        "Placed": {"base_color": "G.placed"},
        "Ordered": {"base_color": "G.ordered"},
        "Lamp": {"emission": "G.coded", "emission_color": "0.5, 0.25, 1"},
    }
    made, found = looks(tmp_path, **{name: ("standard_surface", inputs) for name, inputs in shaders.items()})
    for name, factor in {"Dim": (0.25, 0.125, 0.5), "Weight": (0.5, 0.25, 1), "Square": (1, 1, 1)}.items():
        assert made[name].texture >= 0 and made[name].reflectivity == pytest.approx(factor), name
    assert made["Half"].texture >= 0
    assert [found.textures[made[name].gloss_texture][0, 0, 1] for name in ("Green", "Blue")] == [100, 50]
    assert made["Bumps"].normal_texture >= 0 and made["Bumps"].normal_scale == pytest.approx(0.4)
    assert made["Lamp"].emission_texture >= 0 and made["Lamp"].emission == pytest.approx((0.5, 0.25, 1))
    # pivot (0, 1), and v upwards: scale and then move, or move and then scale
    for name, places in {"Placed": [(0.25, -3.5), (2.25, 0.5)], "Ordered": [(0.5, -5.0), (2.5, -1.0)]}.items():
        (part,) = (part for part in found.parts if found.materials[part.material].name == name)
        assert part.uvs is not None and made[name].reflectivity == pytest.approx((0.5, 0.25, 1))
        np.testing.assert_allclose(part.uvs.reshape(-1, 2)[[0, 2]], places)
    for note in (
        "factors of vertex colours, and textures that multiply other textures, are left out: Square",
        "shaders ND_mix_color3 are left out; their first texture or value shows: Half",
    ):
        assert note in found.notes


def test_colour_spaces(tmp_path: Path) -> None:
    """An image without one has the space of its document, which is linear."""
    made, found = looks(tmp_path, **{name: ("gltf_pbr", {"base_color": f"G.{name}"}) for name in SPACES})
    codes = np.array((200, 100, 50)) / 255
    linear = np.rint(srgb_from_linear(codes) * 255).tolist()
    power = np.rint(srgb_from_linear(codes**2.2) * 255).tolist()
    expected = {"coded": [200, 100, 50], "line": linear, "given": linear, "power": power, "wide": linear}
    assert {name: found.textures[made[name].texture][0, 0, :3].tolist() for name in SPACES} == expected
    assert [note for note in found.notes if "colours of" in note] == [
        "colours of the space acescg are taken as Rec. 709: wide"
    ]


def test_layers_have_the_colours_that_a_viewer_shows(tmp_path: Path) -> None:
    shaders: dict[str, tuple[str, dict[str, float | str]]] = {
        "Skin": (
            "standard_surface",
            {"subsurface": 0.25, "subsurface_color": "1, 0.2, 0.4", "base_color": "0.4, 0.4, 0.4"},
        ),
        "Varnish": ("open_pbr_surface", {"coat_weight": 0.5, "coat_color": "1, 0.5, 0", "base_color": "0.4, 0.4, 0.4"}),
        "Brass": ("standard_surface", {"coat": 1.0, "coat_color": "G.coded", "base_color": "0.5, 0.5, 0.5"}),
        "Opaque": ("gltf_pbr", {"alpha": 0.1, "metallic": 0.0}),
    }
    made, found = looks(tmp_path, as_file=False, **shaders)
    assert made["Skin"].reflectivity == pytest.approx((0.55, 0.35, 0.4))
    assert made["Varnish"].reflectivity == pytest.approx((0.4, 0.3, 0.2))
    assert made["Brass"].texture >= 0 and made["Brass"].reflectivity == pytest.approx((0.5, 0.5, 0.5))
    assert not made["Opaque"].left_out
    assert "subsurface scattering is left out; its colour is diffuse: Skin" in found.notes


def test_weights_of_reflection(tmp_path: Path) -> None:
    """Base colours make up for what a lobe of 4 % reflects otherwise, in the mean over all directions."""
    inputs = {"None": {"specular": 0.0}, "Half": {"specular": 0.5}, "Tint": {"specular_color": "0.5, 0.2, 0.1"}}
    grey = {"base_color": "0.5, 0.5, 0.5"}
    made, _ = looks(tmp_path, **{name: ("standard_surface", grey | more) for name, more in inputs.items()})
    usual = 0.04 + 0.96 / 21
    tint = 0.04 * np.array((0.5, 0.2, 0.1))
    for name, face_on, grazing in (("Half", np.full(3, 0.02), 0.5), ("Tint", tint, 1.0)):
        share = face_on + (grazing - face_on) / 21
        expected = (share + (1 - share.max()) * 0.5 - usual) / (1 - usual)
        assert made[name].reflectivity == pytest.approx(tuple(expected)), name
    assert made["None"].reflectivity == pytest.approx((0.5,) * 3) and made["None"].roughness == 0


@pytest.mark.parametrize(
    ("shader", "inputs", "note"),
    [
        ("standard_surface", {"specular_anisotropy": 0.5}, "brushed surfaces"),
        ("standard_surface", {"thin_film_thickness": 300.0}, "the surface under the thin film"),
        ("open_pbr_surface", {"thin_film_weight": 0.0, "thin_film_thickness": 0.5, "transmission_depth": 1.0}, ""),
        ("open_pbr_surface", {"thin_film_weight": "G.green"}, "the surface under the thin film"),
        ("open_pbr_surface", {"base_diffuse_roughness": 0.5}, "rough diffuse"),
        ("open_pbr_surface", {"base_metalness": 1.0, "specular_color": "1, 1, 0"}, "metals have one colour"),
        ("gltf_pbr", {"iridescence": 1.0, "occlusion": 1.0}, "the surface under the thin film"),
        ("gltf_pbr", {"occlusion": "G.green"}, "occlusion maps"),
        ("standard_surface", {"transmission": 1.0, "transmission_depth": 2.0}, "glass has one colour"),
        ("standard_surface", {"transmission": 1.0, "transmission_scatter": "1, 1, 1"}, "cloudy glass"),
        ("standard_surface", {"coat": 1.0, "coat_normal": "G.bumps"}, "clear coats have the normals"),
    ],
)
def test_inputs_that_are_left_out_are_notes(
    tmp_path: Path, shader: str, inputs: dict[str, float | str], note: str
) -> None:
    _, found = looks(tmp_path, Look=(shader, inputs))
    lines = [line for line in found.notes if not re.match("transmissive|glass:", line)]
    assert len(lines) == bool(note) and all(line.startswith(note) for line in lines)
