"""Mesh files -> triangles, materials and textures; the only door to trimesh."""

from .cleaning import finite, has_area, repeated
from .merge import Merged, merge, near_uvs, unit_normals, untextured_variants
from .model import Material, Meshes, Notes, Part
from .overrides import Override, overridden
from .read import read_meshes

__all__ = [
    "Material",
    "Merged",
    "Meshes",
    "Notes",
    "Override",
    "Part",
    "finite",
    "has_area",
    "merge",
    "near_uvs",
    "overridden",
    "read_meshes",
    "repeated",
    "unit_normals",
    "untextured_variants",
]
