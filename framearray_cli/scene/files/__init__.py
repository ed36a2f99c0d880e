"""Mesh files -> triangles, materials and textures. The only door to trimesh."""

from ..cleaning import finite, has_area, repeated
from ..merge import Merged, merge, near_uvs, unit_normals, untextured_variants
from ..overrides import Override, override_materials
from .gltf.stage import Stage, StageCamera, StageLight
from .model import Material, Meshes, Notes, Part
from .read import read_meshes, read_stage

__all__ = [
    "Material",
    "Merged",
    "Meshes",
    "Notes",
    "Override",
    "Part",
    "Stage",
    "StageCamera",
    "StageLight",
    "finite",
    "has_area",
    "merge",
    "near_uvs",
    "override_materials",
    "read_meshes",
    "read_stage",
    "repeated",
    "unit_normals",
    "untextured_variants",
]
