"""Scene files -> triangles, materials, textures, cameras and lights. The only door to trimesh."""

from .model import Material, Meshes, Notes, Part
from .read import read_meshes, read_stage
from .staging import Stage, StageCamera, StageEnvironment, StageLight

__all__ = [
    "Material",
    "Meshes",
    "Notes",
    "Part",
    "Stage",
    "StageCamera",
    "StageEnvironment",
    "StageLight",
    "read_meshes",
    "read_stage",
]
