"""Values of the job that replace the scene's's materials, by name."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from framearray_cli.base.arrays import Bytes, Float64
from framearray_cli.base.colour import linear_from_srgb
from framearray_cli.base.errors import SceneError
from framearray_cli.job.job import MaterialTable

from .files.materials import COVERS, SMOOTHEST, TRANSMISSIVE_ALPHA, is_mirror
from .files.model import SCREENED, Material, Notes, PaneGlass, join_names, rgb3

ROUGH = 1.0  # glTF's default


def override_surface(
    material: Material, override: MaterialTable, textures: Sequence[Bytes], notes: Notes, was: PaneGlass | None
) -> Material:
    """Apply the values of the job to a material.

    Args:
        was: the glass that it was in the file, if any.
        textures: (height, width, 4) RGBA each.
    """
    if override.roughness is not None or override.metallic is not None:
        material = _with_gloss(material, override.roughness, override.metallic, textures, notes)
    if override.transmission is not None:
        material = _with_transmission(material, override.transmission, textures, notes, was)
    if override.ior is not None:
        if material.glass is None:
            notes.add("ior changes nothing where there is no glass", material.name)
        else:
            material = replace(material, glass=replace(material.glass, ior=override.ior))
    if override.normal_strength is not None:
        material = _with_strength(material, override.normal_strength, notes)
    if override.emission is not None:
        red, green, blue = override.emission
        material = replace(material, emission=(red, green, blue), emission_texture=-1)
    return material


def _with_gloss(
    material: Material, roughness: float | None, metallic: float | None, textures: Sequence[Bytes], notes: Notes
) -> Material:
    """Set roughness and metal; of a texture that holds both, what the job leaves out keeps its mean."""
    # 1. What the file says, of mirrors, too.
    diffuse, mirror = np.array(material.reflectivity), np.array(material.specular)
    base, texture = diffuse + mirror, material.texture if material.texture >= 0 else material.specular_texture
    was_metal, was_rough = material.metallic, material.roughness if material.roughness > 0 else ROUGH
    if mirror.any():
        was_metal, was_rough = float(mirror.max() / base.max()), SMOOTHEST
    if material.gloss_texture >= 0:
        _, green, blue, _ = _mean(textures[material.gloss_texture])
        was_metal, was_rough = was_metal * blue, was_rough * green
        if roughness is None or metallic is None:
            notes.add("metallic-roughness textures count by their mean where the job gives one of both", material.name)
    # 2. A mirror, or gloss.
    rough, metal = was_rough if roughness is None else roughness, was_metal if metallic is None else metallic
    share = metal if is_mirror(metal, rough) else 0.0
    return replace(
        material,
        reflectivity=rgb3((1 - share) * base),
        specular=rgb3(share * base),
        texture=texture,
        specular_texture=texture if share > 0 else -1,
        roughness=0.0 if share > 0 else max(rough, SMOOTHEST),
        metallic=0.0 if share > 0 else metal,
        gloss_texture=-1,
    )


def _with_transmission(
    material: Material, passed: float, textures: Sequence[Bytes], notes: Notes, was: PaneGlass | None
) -> Material:
    """Make a material glass, with the refractive index and the body that it `was`, a screen, or neither."""
    solid = replace(material, left_out="", glass=None)
    if material.alpha_cutoff == SCREENED:
        solid = replace(solid, alpha=1.0, alpha_texture=-1, alpha_cutoff=0.0)
    if passed == 0:
        return solid
    if 1 - passed >= TRANSMISSIVE_ALPHA:
        notes.add(COVERS, material.name)
        return replace(solid, alpha=1 - passed, alpha_texture=-1, alpha_cutoff=SCREENED)
    colour = np.array(material.reflectivity) + np.array(material.specular)
    if material.texture >= 0:
        colour = colour * linear_from_srgb(_mean(textures[material.texture])[:3])
    glass = PaneGlass(colour=rgb3(passed * np.clip(colour, 0.0, 1.0)))
    return replace(solid, glass=glass if was is None else replace(glass, ior=was.ior, solid=was.solid))


def _with_strength(material: Material, strength: float, notes: Notes) -> Material:
    """Multiply the slopes of a normal map; without slopes there is no map."""
    if material.normal_texture < 0:
        notes.add("normal_strength changes nothing where there is no normal map", material.name)
    texture = material.normal_texture if strength > 0 else -1
    return replace(material, normal_texture=texture, normal_scale=material.normal_scale * strength)


def _mean(texels: Bytes) -> Float64:
    """(4,) mean of the code values of a texture, in [0, 1]."""
    return np.asarray(texels.reshape(-1, 4).mean(axis=0, dtype=np.float64) / 255)


LONGEST_NAME = 100  # characters of a name in a message
NAMES_IN_AN_ERROR = 12


def override_materials(
    materials: Sequence[Material], overrides: Mapping[str, MaterialTable], textures: Sequence[Bytes], notes: Notes
) -> list[Material]:
    """Apply the values of the job.

    Args:
        textures: (height, width, 4) RGBA each.
    """
    names = sorted({material.name for material in materials})
    unknown = [name for name in overrides if name not in names]
    if unknown:
        raise SceneError("; ".join(_unknown_material(name, names) for name in unknown))
    found = []
    for material in materials:
        if (override := overrides.get(material.name)) is not None:
            was = material.glass
            if override.reflectivity is not None or override.specular is not None:
                material = _with_colours(material, override, notes)
            material = override_surface(material, override, textures, notes, was)
        found.append(material)
    return found


def _with_colours(material: Material, override: MaterialTable, notes: Notes) -> Material:
    """Replace colours. Glass is shown then, since its colour was set on purpose."""
    if override.roughness is None and override.metallic is None:
        material = replace(material, roughness=0.0, gloss_texture=-1)
    if material.left_out == "transmissive" or material.glass is not None:
        material = replace(material, left_out="", glass=None)
        if not override.transmission:
            notes.add("transmissive materials with an override are shown after all", material.name)
    if override.reflectivity is not None:
        material = replace(material, reflectivity=rgb3(override.reflectivity), texture=-1)
    if override.specular is not None:
        material = replace(material, specular=rgb3(override.specular), specular_texture=-1)
    if any(d + s > 1 for d, s in zip(material.reflectivity, material.specular, strict=True)):
        notes.add("overridden materials reflect more than they receive", material.name)
    return material


def _unknown_material(name: str, names: Sequence[str]) -> str:
    """The error message; it lists the materials of the scene, the most similar name first."""

    def likeness(known: str) -> float:
        return difflib.SequenceMatcher(None, name.lower(), known.lower()).ratio()

    similar = sorted(names, key=likeness, reverse=True)
    short = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    return f'scene.materials."{short}": no such material in the scene; it has {join_names(similar, NAMES_IN_AN_ERROR)}'
