"""Gloss of glTF materials, where surfaces are as the file says."""

from typing import Protocol

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..gloss import MIRROR_ROUGHNESS, Gloss, from_specular, is_mirror
from ..model import Notes
from .values import Tree


class Images(Protocol):
    """Finds images by texture infos, see `ImageFinder`."""

    def index(self, info: Tree | None) -> int:
        """Index in the texture table, or -1."""

    def mean(self, info: Tree) -> Float64 | None:
        """(4,) mean of the raw channels; None if the image cannot be read."""


def metal_gloss(name: str, base: Float64, pbr: Tree, source: Images, notes: Notes, *, shared: bool) -> Gloss | None:
    """Gloss of metal and roughness; None where the material is a mirror.

    Args:
        shared: whether the texture has the texture coordinates of the base colour, or that has no texture.
    """
    metallic, roughness = float(pbr.get("metallicFactor", 1.0)), float(pbr.get("roughnessFactor", 1.0))
    info: Tree | None = pbr.get("metallicRoughnessTexture")
    mean = None if info is None else source.mean(info)
    green, blue = (1.0, 1.0) if mean is None else (float(mean[1]), float(mean[2]))
    if is_mirror(metallic * blue, roughness * green):
        return None
    texture = -1
    if mean is not None and shared:
        texture = source.index(info)
    elif mean is not None:
        metallic, roughness = metallic * blue, roughness * green
        notes.add("metallic-roughness textures with texture coordinates of their own count by their mean", name)
    return Gloss(base=_rgb(base), roughness=roughness, metallic=metallic, texture=texture)


def specular_gloss(name: str, base: Float64, entry: Tree, source: Images, notes: Notes) -> Gloss | None:
    """Gloss of the older specular-glossiness description; None where the material is a mirror.

    Args:
        entry: of KHR_materials_pbrSpecularGlossiness.
    """
    specular = np.array(entry.get("specularFactor", [1.0, 1.0, 1.0]), dtype=np.float64)
    glossiness = float(entry.get("glossinessFactor", 1.0))
    if (info := entry.get("specularGlossinessTexture")) is not None and (mean := source.mean(info)) is not None:
        specular, glossiness = specular * linear_from_srgb(mean[:3]), glossiness * float(mean[3])
        notes.add("specular-glossiness textures count by their mean", name)
    texture = entry.get("diffuseTexture")
    mean = None if texture is None else source.mean(texture)
    shade = np.ones(3) if mean is None else np.maximum(linear_from_srgb(mean[:3]), 1e-3)
    colour, metallic = from_specular(base[:3] * shade, specular)
    roughness = 1.0 - glossiness
    if metallic > 0.5 and roughness <= MIRROR_ROUGHNESS:
        return None
    return Gloss(base=_rgb(colour / shade), roughness=roughness, metallic=metallic)


def _rgb(values: Float64) -> tuple[float, float, float]:
    return (float(values[0]), float(values[1]), float(values[2]))
