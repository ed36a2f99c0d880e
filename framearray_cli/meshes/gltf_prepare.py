"""Edits a glTF tree so that trimesh reads all of it, and reads it right.

trimesh ignores sparse and normalised accessors, skips triangle fans, fails on index counts that are no multiple
of three, loses what hangs below a camera, takes time that grows with the square of the depth of a node graph,
and knows neither GPU instances nor a second set of texture coordinates. Each of these is rewritten here into a
form that it does read.
"""

import importlib.util

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float64
from ..errors import SceneError
from .container import Gltf
from .gltf_check import Tree
from .gltf_materials import KNOWN, SILENT, GltfMaterial
from .gltf_motion import AT_REST, PATHS, at_rest, rotations
from .limit import Limit
from .model import Notes

FLOAT, UINT = 5126, 5125
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6
# Memory that a triangle takes while a scene is read, at least: measured 460 to 800 bytes, with texture coordinates,
# normals and colours; and a node, as JSON and in trimesh's graph.
TRIANGLE_BYTES, NODE_BYTES = 450, 3000
INSTANCE_KEYS = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
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


def prepare(gltf: Gltf, materials: list[GltfMaterial], plain: int, coloured: int, notes: Notes, limit: Limit) -> None:
    """Edit the tree in place.

    Args:
        gltf: the file.
        materials: what its materials were mapped to.
        plain: material number for primitives without material.
        coloured: the same for those with vertex colours.
        notes: takes what is left out.
        limit: counts triangles and nodes, before they are there.

    Raises:
        SceneError: they take more memory than there is.
    """
    for number, mesh in enumerate(gltf.items("meshes")):
        mesh["name"] = str(number)  # trimesh fails on some names, and takes `extras` for its own
        mesh.pop("extras", None)
        mesh["primitives"] = [
            primitive
            for primitive in mesh["primitives"]
            if _prepare_primitive(gltf, primitive, materials, plain, coloured, notes)
        ]
    _prepare_accessors(gltf)
    _flatten(gltf, limit)
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
    count = gltf.tree["accessors"][attributes["POSITION"]]["count"]
    for name in [name for name in attributes if gltf.tree["accessors"][attributes[name]]["count"] != count]:
        notes.add(f"{name} of another length than POSITION is left out")
        del attributes[name]
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


def _flatten(gltf: Gltf, limit: Limit) -> None:
    """Replace the nodes of the default scene by one for each place where a mesh stands, all below the root."""
    nodes, meshes = gltf.items("nodes"), gltf.items("meshes")
    triangles = [sum(_triangles(gltf, primitive) for primitive in mesh["primitives"]) for mesh in meshes]
    scene = gltf.tree["scenes"][gltf.tree.get("scene") or 0]
    waiting = [(node, np.eye(4)) for node in reversed(scene.get("nodes") or [])]
    placed: list[Tree] = []
    seen: set[int] = set()
    while waiting:
        index, world_from_parent = waiting.pop()
        if index in seen:
            continue
        seen.add(index)
        node = nodes[index]
        world_from_node = world_from_parent @ at_rest(node)
        waiting += [(child, world_from_node) for child in reversed(node.get("children") or [])]
        mesh = node.get("mesh")
        if mesh is None or not meshes[mesh]["primitives"]:
            continue
        places = _places(gltf, node, limit)
        limit.take("triangles", TRIANGLE_BYTES * triangles[mesh] * len(places))
        limit.take("nodes", NODE_BYTES * len(places))
        placed += [{"mesh": mesh, "matrix": m.T.reshape(16).tolist()} for m in world_from_node @ places]
    gltf.tree["nodes"] = placed
    gltf.tree["scenes"], gltf.tree["scene"] = [{"nodes": list(range(len(placed)))}], 0


def _triangles(gltf: Gltf, primitive: Tree) -> int:
    """How many triangles a primitive has, whose corners were counted already."""
    corners = gltf.tree["accessors"][primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
    return int(corners // 3 if primitive.get("mode", TRIANGLES) == TRIANGLES else max(corners - 2, 0))


def _places(gltf: Gltf, node: Tree, limit: Limit) -> Float64:
    """(n, 4, 4) transforms of the instances of a node in the node; of a plain node, one that changes nothing."""
    instancing = (node.get("extensions") or {}).get("EXT_mesh_gpu_instancing")
    if instancing is None:
        return np.eye(4)[None]
    found = {INSTANCE_KEYS[name]: number for name, number in instancing["attributes"].items() if name in INSTANCE_KEYS}
    if not found:
        raise ValueError("EXT_mesh_gpu_instancing: expected TRANSLATION, ROTATION or SCALE, got none of them")
    count = min(gltf.tree["accessors"][number]["count"] for number in found.values())
    limit.take("instances", NODE_BYTES * count)
    tables = {path: np.tile(np.array(AT_REST[path], dtype=np.float64), (count, 1)) for path in PATHS}
    for path, number in found.items():
        table = gltf.read_accessor(number)
        if table.shape[1] != tables[path].shape[1]:
            raise ValueError(f"EXT_mesh_gpu_instancing: expected {tables[path].shape[1]} numbers for each {path}")
        tables[path] = table[:count].astype(np.float64)
    with np.errstate(all="ignore"):
        length = np.linalg.norm(tables["rotation"], axis=1, keepdims=True)
        turn = np.where(length > 0, tables["rotation"] / length, AT_REST["rotation"])
    places = np.tile(np.eye(4), (count, 1, 1))
    places[:, :3, :3] = rotations(turn) * tables["scale"][:, None, :]
    places[:, :3, 3] = tables["translation"]
    return places
