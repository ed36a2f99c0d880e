"""glTF primitives -> triangles: lists, strips and fans, plain, sparse or compressed with Draco."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64

from ..materials import clean_colours
from ..model import Notes
from ..tangents import compute_tangents
from .check import TRIANGLES
from .container import Gltf, normalise
from .materials import GltfMaterial, TexturePlaces
from .values import Tree

LIST, STRIP, FAN = TRIANGLES
DRACO = "KHR_draco_mesh_compression"

Attributes = dict[str, NDArray[Any]]  # name -> (v, width)
Faces = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Triangles:
    """f triangles of one material between v vertices, in the coordinates of their mesh.

    Attributes:
        material: its index.
        vertices: (v, 3).
        faces: (f, 3), all of them between 0 and v.
        normals: (v, 3), or None.
        uvs: (v, 2) with v upwards, or None.
        colours: (v, 3) linear, or None.
        tangents: (f, 3, 4) of the normal map, see `Part`; None without one.
        normal_uvs: (v, 2) texture coordinates of the normal map with v upwards, or None.
        outside: the number of triangles left out because a vertex of theirs does not exist.
    """

    material: int
    vertices: Float64
    faces: Faces
    normals: Float64 | None
    uvs: Float64 | None
    colours: Float32 | None
    tangents: Float64 | None
    normal_uvs: Float64 | None
    outside: int


def triangle_count(gltf: Gltf, primitive: Tree) -> int:
    """The number of triangles that a primitive declares."""
    number = primitive.get("indices", primitive["attributes"].get("POSITION"))
    mode = primitive.get("mode", LIST)
    if number is None or mode not in TRIANGLES:
        return 0
    corners = int(gltf.tree["accessors"][number]["count"])
    return corners // 3 if mode == LIST else max(corners - 2, 0)


def read_triangles(
    gltf: Gltf, primitive: Tree, materials: list[GltfMaterial], notes: Notes, *, all_uvs: bool = False
) -> Triangles | None:
    """Read one primitive; None if it holds no triangles.

    Args:
        materials: those of the file. The two indices behind them stand for no material: without and with vertex
            colours.
        notes: gets what is left out.
        all_uvs: see `Assets`.
    """
    mode = primitive.get("mode", LIST)
    if mode not in TRIANGLES:
        notes.add("points and lines are left out")
        return None
    if "POSITION" not in primitive["attributes"]:
        notes.add("primitives without positions are left out")
        return None
    number = primitive.get("material")
    material = None if number is None else materials[number]
    places, bumps = (
        (TexturePlaces(), TexturePlaces()) if material is None else (material.places, material.normal_places)
    )
    if all_uvs and not places.attribute:
        places = TexturePlaces(uv_set=0)
    names = ["POSITION", "NORMAL", "COLOR_0", places.attribute]
    names += ["TANGENT", bumps.attribute] if bumps.attribute else []
    found, indices = _arrays(gltf, primitive, names)
    count = len(found["POSITION"])
    for name in [name for name, values in found.items() if len(values) != count]:
        notes.add(f"{name} of another length than POSITION is left out")
        del found[name]
    faces = _faces(np.arange(count, dtype=np.int64) if indices is None else indices, mode, notes)
    if faces is None:
        return None
    inside = ((faces >= 0) & (faces < count)).all(axis=1)
    kept = faces[inside]
    if kept.size < count:  # primitives may share one large array of vertices
        found = {name: values[kept.reshape(-1)] for name, values in found.items()}
        kept = np.arange(kept.size, dtype=np.int64).reshape(-1, 3)
    if number is None:
        number = len(materials) + ("COLOR_0" in found)
    vertices, normals = found["POSITION"].astype(np.float64), found.get("NORMAL")
    normals = None if normals is None else normals.astype(np.float64)
    name = "" if material is None else material.material.name
    uvs, normal_uvs = _uvs(found, places, name, notes), _uvs(found, bumps, name, notes)
    if bumps.attribute and normal_uvs is None:
        notes.add("meshes without texture coordinates show no normal map", name)
    return Triangles(
        material=number,
        vertices=vertices,
        faces=kept,
        normals=normals,
        uvs=uvs,
        colours=_colours(found["COLOR_0"], notes) if "COLOR_0" in found else None,
        tangents=None if normal_uvs is None else _tangents(found, vertices, normals, normal_uvs, kept),
        normal_uvs=normal_uvs,
        outside=int((~inside).sum()),
    )


def _tangents(found: Attributes, vertices: Float64, normals: Float64 | None, uvs: Float64, faces: Faces) -> Float64:
    """(f, 3, 4) tangents of the file, or computed ones where it has none, or not a direction for every corner."""
    tangents = found.get("TANGENT")
    if tangents is not None and normals is not None and tangents.shape[1] == 4:  # they belong to the file's normals
        given = tangents.astype(np.float64)[faces]
        if np.isfinite(given).all() and given[..., :3].any(axis=2).all():
            given[..., 3] = np.where(given[..., 3] < 0, -1.0, 1.0)
            return given
    return compute_tangents(vertices[faces], None if normals is None else normals[faces], uvs[faces])


def _arrays(gltf: Gltf, primitive: Tree, names: Sequence[str]) -> tuple[Attributes, Faces | None]:
    """Read those of the named attributes that exist, and the indices, if any."""
    attributes: Mapping[str, int] = primitive["attributes"]
    packed: Attributes = {}
    indices: NDArray[Any] | None = None
    draco = (primitive.get("extensions") or {}).get(DRACO)
    if draco is not None:
        packed, indices = _decode_draco(gltf, draco, attributes)
    elif "indices" in primitive:
        indices = gltf.read_accessor(primitive["indices"])
    found = {
        name: packed[name] if name in packed else gltf.read_accessor(attributes[name])
        for name in names
        if name in attributes
    }
    return found, None if indices is None else indices.reshape(-1).astype(np.int64)


def _decode_draco(gltf: Gltf, draco: Tree, attributes: Mapping[str, int]) -> tuple[Attributes, NDArray[Any]]:
    """Decode the attributes and indices of a primitive that is compressed with Draco."""
    import DracoPy

    mesh: Any = DracoPy.decode(gltf.view_bytes(draco["bufferView"]))
    names = {number: name for name, number in draco["attributes"].items()}
    found = {names[entry["unique_id"]]: entry["data"] for entry in mesh.attributes if entry["unique_id"] in names}
    flat = {
        name: normalise(np.asarray(values).reshape(len(values), -1), gltf.tree["accessors"][attributes[name]])
        for name, values in found.items()
        if name in attributes
    }
    return flat, np.asarray(mesh.faces)


def _faces(indices: Faces, mode: int, notes: Notes) -> Faces | None:
    """(f, 3) corners of a list, strip or fan."""
    count = len(indices)
    if count < 3:
        notes.add("primitives with fewer than 3 corners are left out")
        return None
    if mode == FAN:
        return np.column_stack([np.full(count - 2, indices[0]), indices[1:-1], indices[2:]])
    if mode == STRIP:
        faces = np.column_stack([indices[:-2], indices[1:-1], indices[2:]])
        faces[1::2] = faces[1::2, ::-1]
        return faces
    if count % 3:
        notes.add("corners beyond a multiple of three are left out")
    return indices[: count - count % 3].reshape(-1, 3)


def _uvs(found: Attributes, places: TexturePlaces, name: str, notes: Notes) -> Float64 | None:
    """(v, 2) texture coordinates, transformed, v upwards; None if there are none."""
    if places.attribute not in found:
        return None
    uv = found[places.attribute].astype(np.float64)
    if places.matrix is not None:
        with np.errstate(all="ignore"):
            uv = np.column_stack([uv, np.ones(len(uv))]) @ places.matrix.T
    if not places.repeats and len(uv) and (uv.min() < 0 or uv.max() > 1):
        notes.add("textures that clamp or mirror at their edges repeat", name)
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])


def _colours(values: NDArray[Any], notes: Notes) -> Float32:
    """(v, 3) linear vertex colours."""
    colours = values.astype(np.float64)
    if colours.shape[1] > 3 and (colours[:, 3] < 1).any():
        notes.add("the opacity of vertex colours is left out")
    return clean_colours(colours[:, :3], notes)
