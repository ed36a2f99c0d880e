"""Scene files -> triangles, materials, textures, cameras and lights. The only door to trimesh."""

from .model import Material, Meshes, Notes, Part
from .read import read_meshes, read_stage
from .staging import Stage, StageCamera, StageEnvironment, StageLens, StageLight

__all__ = [
    "Material",
    "Meshes",
    "Notes",
    "Part",
    "Stage",
    "StageCamera",
    "StageEnvironment",
    "StageLens",
    "StageLight",
    "read_meshes",
    "read_stage",
]
