"""Gloss of materials, for the readers of all formats: everything becomes metal and roughness of glTF."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float64

from .materials import Rgb3
from .model import Material

MIRROR_ROUGHNESS = 0.1  # up to it a metal is a mirror
# Nothing shines more sharply: light of a point on a smooth dielectric would be seen in single pixels only.
SMOOTHEST = 0.1
DIELECTRIC = 0.04  # what is no metal reflects, face on
_BRIGHTNESS = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, slots=True, kw_only=True)
class Gloss:
    """How a material shines.

    Attributes:
        base: base colour factor, of any size.
        roughness, metallic: factors.
        texture: index of the texture whose green and blue multiply them, or -1.
    """

    base: Rgb3
    roughness: float
    metallic: float
    texture: int = -1


def with_gloss(material: Material, gloss: Gloss | None) -> Material:
    """Give a material its gloss, if any; its reflectivity is the base colour."""
    if gloss is None:
        return material
    roughness, metallic = min(max(gloss.roughness, SMOOTHEST), 1.0), min(max(gloss.metallic, 0.0), 1.0)
    return replace(material, roughness=roughness, metallic=metallic, gloss_texture=gloss.texture)


def is_mirror(metallic: float, roughness: float) -> bool:
    """Whether a metal is so smooth that it is a mirror."""
    return metallic > 0 and roughness <= MIRROR_ROUGHNESS


def from_specular(diffuse: Sequence[float] | Float64, specular: Sequence[float] | Float64) -> tuple[Float64, float]:
    """Convert a diffuse and a specular colour to a base colour, (3,), and metal [KHR_materials_pbrSpecularGlossiness].

    Metal is what makes F0, the mean of 0.04 and the base colour by metal, as bright as the specular colour.
    """
    diffuse, specular = np.asarray(diffuse, np.float64), np.asarray(specular, np.float64)
    rest = 1.0 - min(float(specular.max()), 1.0)
    d, s = (float(np.sqrt(_BRIGHTNESS @ (colour * colour))) for colour in (diffuse, specular))
    metallic = 0.0
    if s > DIELECTRIC:
        b = d * rest / (1 - DIELECTRIC) + s - 2 * DIELECTRIC
        root = np.sqrt(max(b * b - 4 * DIELECTRIC * (DIELECTRIC - s), 0.0))
        metallic = min(max(float(-b + root) / (2 * DIELECTRIC), 0.0), 1.0)
    of_diffuse = diffuse * rest / (1 - DIELECTRIC) / max(1 - metallic, 1e-6)
    of_specular = (specular - DIELECTRIC * (1 - metallic)) / max(metallic, 1e-6)
    share = metallic * metallic
    return np.clip(of_diffuse * (1 - share) + of_specular * share, 0.0, 1.0), metallic
