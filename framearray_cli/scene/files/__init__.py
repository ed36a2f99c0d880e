"""Scene files -> triangles, materials, textures, cameras and lights. The only door to trimesh."""

from .gltf.imagelight import StageEnvironment
from .gltf.stage import Stage, StageCamera, StageLight
from .model import Material, Meshes, Notes, Part
from .read import read_meshes, read_stage

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
