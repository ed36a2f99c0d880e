"""What a job may say of how a surface shines, lets light through and emits, where surfaces follow the file."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.job.job import KEYS_BY_FILE, MaterialTable
from framearray_cli.scene.files.model import SCREENED, Material, Notes, PaneGlass
from framearray_cli.scene.overrides import override_materials

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
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    assert found.glass.colour == pytest.approx(tuple(0.9 * linear * c for c in RED))
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
    with pytest.raises(ValueError, match=r"expected none with scene\.surfaces"):
        tiny.job(scene={"materials": {"Wall": {key: value}}})
    tiny.job(scene={"surfaces": "file", "materials": {"Wall": {key: value}}})


@pytest.mark.parametrize("key", ["roughness", "metallic", "transmission"])
def test_a_mirror_is_not_glossy(key: str) -> None:
    with pytest.raises(ValueError, match="expected none next to `specular`"):
        MaterialTable.model_validate({"specular": 0.5, key: 0.5})
