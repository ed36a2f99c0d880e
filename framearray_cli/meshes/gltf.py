"""GLB and glTF -> parts: trimesh reads a tree that was prepared for it."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float32, Float64
from .assets import Assets
from .container import open_gltf
from .defaults import clean_colours, default_material
from .gltf_materials import GltfMaterial, read_materials
from .gltf_prepare import check_readable, note_unread, prepare, used_materials
from .model import Material, Meshes, Notes, Part
from .textures import TextureTable
from .walk import instances, place


def read_gltf(data: bytes, assets: Assets) -> Meshes:
    """Read a GLB or glTF file.

    Raises:
        ValueError, AssetError, KeyError, ...: a broken file.
        SceneError: a file in a form that cannot be read.
    """
    import trimesh

    notes = Notes()
    gltf = open_gltf(data, assets)
    check_readable(gltf)
    note_unread(gltf, notes)
    textures = TextureTable(notes, assets.limit)
    materials = read_materials(gltf, used_materials(gltf), assets, textures, notes)
    plain, coloured = len(materials), len(materials) + 1
    prepare(gltf, materials, plain, coloured, notes, assets.limit)
    scene = trimesh.load_scene(io.BytesIO(gltf.to_glb()), file_type="glb", process=False)

    parts: list[Part] = []
    outside = 0
    for mesh, world_from_mesh in instances(scene):
        number = int(mesh.visual.material.name)
        material = materials[number] if number < plain else None
        part, lost = place(
            mesh,
            world_from_mesh,
            number,
            uvs=_uvs(mesh, material, notes),
            colours=_colours(mesh, notes),
        )
        parts.append(part)
        outside += lost
    tables = [entry.material for entry in materials] + _defaults(parts, plain, coloured, notes)
    return Meshes(
        parts=tuple(parts),
        materials=tuple(tables),
        textures=tuple(textures.textures),
        dropped={"index out of range": outside} if outside else {},
        notes=notes.lines(),
    )


def _defaults(parts: list[Part], plain: int, coloured: int, notes: Notes) -> list[Material]:
    """The stand-ins for missing materials, as far as some part needs them."""
    needed = max((part.material for part in parts), default=-1)
    found = []
    if needed >= plain:
        found.append(default_material(False, notes if any(part.material == plain for part in parts) else Notes()))
    if needed >= coloured:
        found.append(default_material(True, notes))
    return found


def _uvs(mesh: Any, material: GltfMaterial | None, notes: Notes) -> Float64 | None:
    """(v, 2) texture coordinates, transformed, v upwards; None where the material has no texture."""
    uv = mesh.visual.uv
    if material is None or material.uv_set < 0 or uv is None:
        return None
    uv = np.array(uv, dtype=np.float64)
    if material.uv_matrix is not None:
        down = np.column_stack([uv[:, 0], 1.0 - uv[:, 1], np.ones(len(uv))]) @ material.uv_matrix.T
        uv = np.column_stack([down[:, 0], 1.0 - down[:, 1]])
    if not material.repeats and len(uv) and (uv.min() < 0 or uv.max() > 1):
        notes.add("textures that clamp or mirror at their edges repeat", material.material.name)
    return uv


def _colours(mesh: Any, notes: Notes) -> Float32 | None:
    """(v, 3) linear vertex colours."""
    found: NDArray[Any] | None = mesh.visual.vertex_attributes.data.get("color")
    if found is None or len(found) != len(mesh.vertices):
        return None
    colours = np.array(found, dtype=np.float64)
    if colours.shape[1] > 3 and (colours[:, 3] < 1).any():
        notes.add("the opacity of vertex colours is left out")
    return clean_colours(colours[:, :3], notes)
