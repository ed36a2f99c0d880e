"""Put meshes at their places in the scene; list the instances of a trimesh scene."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64

from ..vectors import cross
from .model import Part


def instances(scene: Any) -> Iterator[tuple[str, Any, Float64]]:
    """Yield each instance of a triangle mesh in a trimesh scene: node, mesh and its (4, 4) `world_from_mesh`."""
    import trimesh

    for node in scene.graph.nodes_geometry:
        world_from_mesh, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            yield str(node), mesh, np.array(world_from_mesh, dtype=np.float64)


def place_mesh(
    vertices: Float64,
    faces: NDArray[np.int64],
    world_from_mesh: Float64,
    material: int,
    *,
    normals: Float64 | None,
    uvs: Float64 | None,
    colours: Float32 | None,
    face_colours: Float32 | None = None,
    tangents: Float64 | None = None,
    normal_uvs: Float64 | None = None,
    names: Sequence[str] = ("",),
) -> Part:
    """Put a mesh at all of its places, one after another, in float64, one row per corner of a triangle.

    A mirroring transform turns triangles inside out, so their winding is reversed. The cofactors of the matrix are its
    inverse transpose times its determinant, and also exist for singular matrices; they transform the normals.

    Args:
        vertices: (v, 3).
        faces: (f, 3), all of them between 0 and v.
        world_from_mesh: (n, 4, 4), one per place.
        material: index for the part.
        normals, uvs, colours: (v, 3), (v, 2) and (v, 3) per vertex; normals from the file.
        face_colours: (f, 3) per face; used if `colours` is None.
        tangents, normal_uvs: (f, 3, 4) per corner and (v, 2) per vertex, of a normal map.
        names: of the object at each place, or one for all.
    """
    linear = world_from_mesh[:, :3, :3]
    with np.errstate(all="ignore"):  # the scene counts and drops non-finite triangles later
        world = vertices @ linear.transpose(0, 2, 1) + world_from_mesh[:, None, :3, 3]
        mirrored = np.linalg.det(linear) < 0
        if normals is not None:
            sign = np.where(mirrored, -1.0, 1.0)[:, None, None]
            normals = normals @ (cofactors(linear) * sign).transpose(0, 2, 1)

    def join_places(rows: NDArray[Any]) -> NDArray[Any]:
        """Reshape (n, f, 3, k) to (n f, 3, k), the corners of mirrored places in reverse order."""
        if mirrored.any():
            rows = rows.copy()
            rows[mirrored] = rows[mirrored][:, :, ::-1]
        return rows.reshape(-1, *rows.shape[2:])

    def repeat_at_places(rows: NDArray[Any]) -> NDArray[Any]:
        """Repeat (f, 3, k) at all places."""
        return join_places(np.broadcast_to(rows, (len(linear), *rows.shape)))

    at_corners = _corner_colours(faces, colours, face_colours)
    return Part(
        material=material,
        corners=join_places(np.take(world, faces, axis=1)),
        normals=None if normals is None else join_places(np.take(normals, faces, axis=1)),
        uvs=None if uvs is None else repeat_at_places(uvs[faces]),
        colours=None if at_corners is None else repeat_at_places(at_corners),
        tangents=None if tangents is None else join_places(_place_tangents(tangents, linear, mirrored)),
        normal_uvs=None if normal_uvs is None else repeat_at_places(normal_uvs[faces]),
        objects=tuple(names),
        object=np.repeat(np.arange(len(names), dtype=np.int32), len(faces)) if len(names) > 1 else None,
    )


def _corner_colours(
    faces: NDArray[np.int64], colours: Float32 | None, face_colours: Float32 | None
) -> NDArray[Any] | None:
    """(f, 3, 3) colours of the corners of all faces; see `place_mesh`."""
    if colours is not None:
        return colours[faces]
    return None if face_colours is None else np.repeat(face_colours[:, None], 3, axis=1)


def _place_tangents(tangents: Float64, linear: Float64, mirrored: NDArray[np.bool_]) -> Float64:
    """(n, f, 3, 4) tangents at all places; where normal x tangent points the other way in a mirror, w does too."""
    with np.errstate(all="ignore"):
        along = np.einsum("nij,fkj->nfki", linear, tangents[..., :3])
    w = np.where(mirrored, -1.0, 1.0)[:, None, None] * tangents[None, ..., 3]
    return np.concatenate([along, w[..., None]], axis=3)


def cofactors(matrices: Float64) -> Float64:
    """(n, 3, 3) cofactor matrices: each row is the cross product of the two other rows."""
    a, b, c = matrices[:, 0], matrices[:, 1], matrices[:, 2]
    return np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=1)


def file_normals(mesh: Any) -> Float64 | None:
    """(v, 3) vertex normals of the file itself; trimesh would invent some for a mesh without."""
    if "vertex_normals" not in mesh._cache:
        return None
    return np.asarray(mesh._cache["vertex_normals"], dtype=np.float64)
