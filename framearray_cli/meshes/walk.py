"""Meshes into their places in the scene; and those of a trimesh scene, one an instance."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float32, Float64
from .model import Part


def instances(scene: Any) -> Iterator[tuple[Any, Float64]]:
    """Every triangle mesh of a trimesh scene with its (4, 4) `world_from_mesh`; a mesh may come several times."""
    import trimesh

    for node in scene.graph.nodes_geometry:
        world_from_mesh, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            yield mesh, np.array(world_from_mesh, dtype=np.float64)


def place(
    vertices: Float64,
    faces: NDArray[np.int64],
    world_from_mesh: Float64,
    material: int,
    *,
    normals: Float64 | None,
    uvs: Float64 | None,
    colours: Float32 | None,
    face_colours: Float32 | None = None,
) -> Part:
    """Put a mesh where its node says, in float64, one row a triangle corner.

    A mirrored transform turns triangles inside out: their winding is turned back. Normals go with the
    cofactors of the matrix, which are its inverse transpose times its determinant and exist for flat matrices too.

    Args:
        vertices: (v, 3).
        faces: (f, 3), all of them between 0 and v.
        world_from_mesh: (4, 4).
        material: number that the part gets.
        normals: (v, 3) that the file gives.
        uvs: (v, 2) a vertex.
        colours: (v, 3) a vertex.
        face_colours: (f, 3) a face; count where `colours` is None.
    """
    linear = world_from_mesh[:3, :3]
    with np.errstate(all="ignore"):  # non-finite vertices are counted and dropped by whoever takes the part
        world = vertices @ linear.T + world_from_mesh[:3, 3]
        determinant = float(np.linalg.det(linear))
        if normals is not None:
            normals = normals @ (cofactors(linear) * (-1.0 if determinant < 0 else 1.0)).T
    if determinant < 0:
        faces = faces[:, ::-1]
    if colours is not None:
        colours = colours[faces]
    elif face_colours is not None:
        colours = np.repeat(face_colours[:, None], 3, axis=1)
    return Part(
        material=material,
        corners=world[faces],
        normals=None if normals is None else normals[faces],
        uvs=None if uvs is None else uvs[faces],
        colours=colours,
    )


def cofactors(matrix: Float64) -> Float64:
    """(3, 3) cofactor matrix: rows are cross products of the other rows."""
    return np.stack([np.cross(matrix[1], matrix[2]), np.cross(matrix[2], matrix[0]), np.cross(matrix[0], matrix[1])])


def file_normals(mesh: Any) -> Float64 | None:
    """(v, 3) vertex normals that the file itself has; trimesh would make some up for any other mesh."""
    if "vertex_normals" not in mesh._cache:
        return None
    return np.asarray(mesh._cache["vertex_normals"], dtype=np.float64)
