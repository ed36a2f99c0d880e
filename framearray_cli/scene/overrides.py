"""Replace values of the scene's materials by those of the job, by name."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import SceneError

from .files.model import Material, Notes, join_names
from .surface_overrides import SurfaceOverride, override_surface

LONGEST_NAME = 100  # characters of a name in a message
NAMES_IN_AN_ERROR = 12


class Override(SurfaceOverride, Protocol):
    """What a job may say about a material; None keeps the value of the file."""

    @property
    def reflectivity(self) -> Sequence[float] | None:
        """Diffuse reflectivity, linear RGB; with roughness or metal the base colour."""

    @property
    def specular(self) -> Sequence[float] | None:
        """Mirror reflectivity, linear RGB."""


def override_materials(
    materials: Sequence[Material], overrides: Mapping[str, Override], textures: Sequence[Bytes], notes: Notes
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


def _with_colours(material: Material, override: Override, notes: Notes) -> Material:
    """Replace colours. Glass is shown then, since its colour was set on purpose."""
    if override.roughness is None and override.metallic is None:
        material = replace(material, roughness=0.0, gloss_texture=-1)
    if material.left_out == "transmissive" or material.glass is not None:
        material = replace(material, left_out="", glass=None)
        if not override.transmission:
            notes.add("transmissive materials with an override are shown after all", material.name)
    if override.reflectivity is not None:
        material = replace(material, reflectivity=_rgb(override.reflectivity), texture=-1)
    if override.specular is not None:
        material = replace(material, specular=_rgb(override.specular), specular_texture=-1)
    if any(d + s > 1 for d, s in zip(material.reflectivity, material.specular, strict=True)):
        notes.add("overridden materials reflect more than they receive", material.name)
    return material


def _rgb(values: Sequence[float]) -> tuple[float, float, float]:
    return (float(values[0]), float(values[1]), float(values[2]))


def _unknown_material(name: str, names: Sequence[str]) -> str:
    """The error message; it lists the materials of the scene, the most similar name first."""

    def likeness(known: str) -> float:
        return difflib.SequenceMatcher(None, name.lower(), known.lower()).ratio()

    similar = sorted(names, key=likeness, reverse=True)
    short = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    return f'scene.materials."{short}": no such material in the scene; it has {join_names(similar, NAMES_IN_AN_ERROR)}'
