"""Edits a glTF tree so that trimesh reads all of it, and reads it right.

trimesh ignores sparse and normalised accessors, skips triangle fans, fails on index counts that are no multiple
of three, loses what hangs below a camera, and knows neither GPU instances nor a second set of texture
coordinates. Each of these is rewritten here into a form that it does read.
"""

import importlib.util

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from .container import Gltf, Tree
from .gltf_materials import KNOWN, SILENT, GltfMaterial
from .model import Notes

FLOAT, UINT = 5126, 5125
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6
HANDLED = KNOWN | SILENT | {"KHR_texture_transform", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"}
HANDLED |= {"EXT_texture_webp", "KHR_draco_mesh_compression", "KHR_materials_unlit"}


def check_readable(gltf: Gltf) -> None:
    """Refuse what would load as nothing or as garbage.

    Raises:
        SceneError: compressed geometry, no scene, or a node graph with a cycle.
    """
    used = set(gltf.tree.get("extensionsUsed") or [])
    for meshopt in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
        if meshopt in used:
            raise SceneError(f"the geometry is compressed with {meshopt}, which cannot be read; export without it")
    if "KHR_draco_mesh_compression" in used and importlib.util.find_spec("DracoPy") is None:
        raise SceneError(
            "the geometry is compressed with Draco; install DracoPy (pip install DracoPy) or export without it"
        )
    if not gltf.items("scenes"):
        raise SceneError("expected a scene in the file, got none; nothing says which nodes to show")
    _check_nodes(gltf)


def _check_nodes(gltf: Gltf) -> None:
    """Raise where a node is its own ancestor, by taking away leaves until none is left."""
    nodes = gltf.items("nodes")
    waiting = [len(node.get("children") or []) for node in nodes]
    parents: list[list[int]] = [[] for _ in nodes]
    for index, node in enumerate(nodes):
        for child in node.get("children") or []:
            parents[child].append(index)
    leaves = [index for index, count in enumerate(waiting) if count == 0]
    gone = 0
    while leaves:
        gone += 1
        for parent in parents[leaves.pop()]:
            waiting[parent] -= 1
            if waiting[parent] == 0:
                leaves.append(parent)
    if gone < len(nodes):
        cyclic = next(index for index, count in enumerate(waiting) if count > 0)
        raise SceneError(f"nodes[{cyclic}] is below itself: the node graph has a cycle")
    if any(len(found) > 1 for found in parents):
        raise SceneError("a node has several parents, which glTF forbids; export the file anew")


def used_materials(gltf: Gltf) -> set[int]:
    """Indices of the materials that some primitive has."""
    primitives = [primitive for mesh in gltf.items("meshes") for primitive in mesh["primitives"]]
    return {primitive["material"] for primitive in primitives if "material" in primitive}


def note_unread(gltf: Gltf, notes: Notes) -> None:
    """Note what the file has and the renderer does not show."""
    for extension in sorted(set(gltf.tree.get("extensionsUsed") or []) - HANDLED):
        if extension == "KHR_lights_punctual":
            notes.add("lights in the scene file are left out; the job gives the lights")
        elif not extension.startswith("KHR_materials_"):  # those are noted with their materials
            notes.add(f"{extension} is left out")
    if gltf.items("animations"):
        notes.add("animations are left out; everything stands in its rest pose")
    if gltf.items("skins"):
        notes.add("skins are left out; meshes stand in their rest pose")
    if len(gltf.items("scenes")) > 1:
        notes.add("only the file's default scene is read")
    if any(primitive.get("targets") for mesh in gltf.items("meshes") for primitive in mesh["primitives"]):
        notes.add("morph targets are left out")


def prepare(gltf: Gltf, materials: list[GltfMaterial], plain: int, coloured: int, notes: Notes) -> None:
    """Edit the tree in place.

    Args:
        gltf: the file.
        materials: what its materials were mapped to.
        plain: material number for primitives without material.
        coloured: the same for those with vertex colours.
        notes: takes what is left out.
    """
    _prepare_instances(gltf)
    for mesh in gltf.items("meshes"):
        mesh["primitives"] = [
            primitive
            for primitive in mesh["primitives"]
            if _prepare_primitive(gltf, primitive, materials, plain, coloured, notes)
        ]
    _prepare_accessors(gltf)
    for node in gltf.items("nodes"):
        node.pop("camera", None)
        if "mesh" in node and not gltf.tree["meshes"][node["mesh"]]["primitives"]:
            del node["mesh"]  # trimesh would lose the node's children
    # trimesh hands materials back by name: their number; images are read apart
    gltf.tree["materials"] = [{"name": str(number)} for number in range(coloured + 1)]
    for key in ("images", "textures", "samplers", "cameras", "animations", "skins"):
        gltf.tree.pop(key, None)
    gltf.tree.setdefault("bufferViews", [])
    gltf.tree.setdefault("accessors", [])


def _prepare_primitive(
    gltf: Gltf, primitive: Tree, materials: list[GltfMaterial], plain: int, coloured: int, notes: Notes
) -> bool:
    """Rewrite one primitive; return whether it holds triangles."""
    mode, attributes = primitive.get("mode", TRIANGLES), primitive["attributes"]
    if mode not in (TRIANGLES, STRIP, FAN):
        notes.add("points and lines are left out")
        return False
    if "POSITION" not in attributes:
        notes.add("primitives without positions are left out")
        return False
    draco = "KHR_draco_mesh_compression" in (primitive.get("extensions") or {})
    if not draco and not _prepare_indices(gltf, primitive, mode, notes):
        return False
    if "material" not in primitive:
        primitive["material"] = coloured if "COLOR_0" in attributes else plain
    number = primitive["material"]
    uv_set = materials[number].uv_set if number < len(materials) else -1
    kept = attributes.get(f"TEXCOORD_{uv_set}")
    for name in [name for name in attributes if name not in ("POSITION", "NORMAL", "COLOR_0")]:
        if not (name == "TEXCOORD_0" and kept is not None):
            del attributes[name]
    if kept is not None:
        attributes["TEXCOORD_0"] = kept
    return True


def _prepare_indices(gltf: Gltf, primitive: Tree, mode: int, notes: Notes) -> bool:
    """Turn fans, and lists of a length that is no multiple of three, into plain triangle lists."""
    accessor = gltf.tree["accessors"][primitive.get("indices", primitive["attributes"]["POSITION"])]
    count = accessor["count"]
    if count < 3:
        notes.add("primitives with fewer than 3 corners are left out")
        return False
    if mode == STRIP or (mode == TRIANGLES and count % 3 == 0):
        return True
    flat: NDArray[np.int64] = np.arange(count, dtype=np.int64)
    if "indices" in primitive:
        flat = gltf.read_accessor(primitive["indices"])[:, 0].astype(np.int64)
    if mode == FAN:
        flat = np.column_stack([np.full(count - 2, flat[0]), flat[1:-1], flat[2:]]).reshape(-1)
    else:
        notes.add("corners beyond a multiple of three are left out")
        flat = flat[: count - count % 3]
    primitive["indices"] = gltf.append_accessor(flat, UINT, "SCALAR")
    primitive["mode"] = TRIANGLES
    return True


def _prepare_accessors(gltf: Gltf) -> None:
    """Give sparse accessors, and attributes stored as integers, a plain copy in the same place."""
    attributes: set[int] = set()
    indices: set[int] = set()
    for mesh in gltf.items("meshes"):
        for primitive in mesh["primitives"]:
            attributes.update(primitive["attributes"].values())
            if "indices" in primitive:
                indices.add(primitive["indices"])
    for index in sorted(attributes | indices):
        accessor = gltf.tree["accessors"][index]
        plain = "sparse" not in accessor and (index not in attributes or accessor["componentType"] == FLOAT)
        if plain or ("bufferView" not in accessor and "sparse" not in accessor):
            continue
        component = FLOAT if index in attributes else UINT
        new = gltf.append_accessor(gltf.read_accessor(index), component, accessor["type"])
        gltf.tree["accessors"][index] = gltf.tree["accessors"][new]


def _prepare_instances(gltf: Gltf) -> None:
    """Replace GPU instances by child nodes, one an instance."""
    nodes = gltf.items("nodes")
    for node in list(nodes):
        instancing = (node.get("extensions") or {}).get("EXT_mesh_gpu_instancing")
        if instancing is None or "mesh" not in node:
            continue
        keys = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
        tables = {
            keys[name]: gltf.read_accessor(accessor)
            for name, accessor in instancing["attributes"].items()
            if name in keys
        }
        mesh = node.pop("mesh")
        children = node.setdefault("children", [])
        for row in range(min(len(table) for table in tables.values())):
            children.append(len(nodes))
            nodes.append({"mesh": mesh} | {key: table[row].tolist() for key, table in tables.items()})
