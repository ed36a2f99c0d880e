"""GLB and glTF -> parts: every mesh of the default scene, at each of its places."""

from ..assets import Assets
from ..materials import default_material
from ..model import Material, Meshes, Notes, Part
from ..placing import place_mesh
from ..tangents import CORNER_BYTES
from ..textures import TextureTable
from .container import Gltf, open_gltf
from .materials import GltfMaterial, read_materials
from .nodes import check_readable, note_unread, placed_meshes, used_materials
from .stage import count_lights
from .triangles import Triangles, read_triangles, triangle_count
from .values import Tree


def read_gltf(data: bytes, assets: Assets) -> Meshes:
    """Read a GLB or glTF file.

    Raises:
        ValueError, AssetError, KeyError, ...: the file is broken.
        SceneError: the file has a form that cannot be read.
    """
    notes = Notes()
    gltf = open_gltf(data, assets)
    check_readable(gltf)
    note_unread(gltf, notes)
    textures = TextureTable(notes, assets.limit)
    materials = read_materials(gltf, used_materials(gltf), assets, textures, notes)
    placed = placed_meshes(gltf, assets.limit)
    primitives: dict[int, list[Triangles]] = {}
    shown = {mesh for mesh, _, _ in placed}
    for number, entry in enumerate(gltf.items("meshes")):
        if number in shown:
            read = (_read_triangles(gltf, primitive, materials, assets, notes) for primitive in entry["primitives"])
            primitives[number] = [triangles for triangles in read if triangles is not None]
    parts: list[Part] = []
    outside = 0
    for mesh, places, name in placed:
        for found in primitives[mesh]:
            parts.append(
                place_mesh(
                    found.vertices,
                    found.faces,
                    places,
                    found.material,
                    normals=found.normals,
                    uvs=found.uvs,
                    colours=found.colours,
                    tangents=found.tangents,
                    normal_uvs=found.normal_uvs,
                    names=(name,),
                )
            )
            outside += found.outside * len(places)
    tables = [entry.material for entry in materials] + _defaults(parts, len(materials), len(materials) + 1, notes)
    return Meshes(
        parts=tuple(parts),
        materials=tuple(tables),
        textures=tuple(textures.textures),
        dropped={"index out of range": outside} if outside else {},
        notes=notes.lines(),
        lights=count_lights(gltf),
    )


def _read_triangles(
    gltf: Gltf, primitive: Tree, materials: list[GltfMaterial], assets: Assets, notes: Notes
) -> Triangles | None:
    """`read_triangles`, which may take memory for tangents."""
    material = primitive.get("material")
    mapped = material is not None and materials[material].normal_places.attribute
    with assets.limit.lend("tangents", 3 * CORNER_BYTES * triangle_count(gltf, primitive) if mapped else 0):
        return read_triangles(gltf, primitive, materials, notes, all_uvs=assets.all_uvs)


def _defaults(parts: list[Part], plain: int, coloured: int, notes: Notes) -> list[Material]:
    """The defaults for missing materials, as far as some part needs them."""
    needed = max((part.material for part in parts), default=-1)
    found = []
    if needed >= plain:
        found.append(default_material(False, notes if any(part.material == plain for part in parts) else Notes()))
    if needed >= coloured:
        found.append(default_material(True, notes))
    return found
