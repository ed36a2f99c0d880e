"""Nodes of a glTF file: what of them can be read, and every place of a mesh."""

import importlib.util

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.base.extras import install_command

from ..limit import Limit
from ..model import Notes
from .container import Gltf
from .materials import KNOWN, SILENT
from .motion import AT_REST, PATHS, rest_transform, rotations
from .triangles import triangle_count
from .values import Tree

# Least memory per triangle while a scene is read (measured: 460 to 800 bytes, with texture coordinates, normals and
# colours), and per place of a mesh.
TRIANGLE_BYTES, PLACE_BYTES = 450, 1000
INSTANCE_KEYS = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
HANDLED = KNOWN | SILENT | {"KHR_texture_transform", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"}
HANDLED |= {"EXT_texture_webp", "KHR_draco_mesh_compression", "KHR_materials_unlit"}
LIGHTS = ("KHR_lights_punctual", "EXT_lights_ies", "EXT_lights_image_based")  # for first jobs; a job has its own


def check_readable(gltf: Gltf) -> None:
    """Refuse a file that would load as nothing or as garbage.

    Raises:
        SceneError: the geometry is compressed, there is no scene, or the node graph has a cycle.
    """
    used = set(gltf.tree.get("extensionsUsed") or [])
    for meshopt in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
        if meshopt in used:
            raise SceneError(f"the geometry is compressed with {meshopt}, which cannot be read; export without it")
    if "KHR_draco_mesh_compression" in used and importlib.util.find_spec("DracoPy") is None:
        raise SceneError(
            "the geometry is compressed with Draco; export without it, or install DracoPy with: "
            + install_command("[draco]")
        )
    if not gltf.items("scenes"):
        raise SceneError("expected a scene in the file, got none; nothing says which nodes to show")
    _check_nodes(gltf)


def _check_nodes(gltf: Gltf) -> None:
    """Refuse nodes that are their own ancestors or have several parents; removes leaves until none is left."""
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
    """Indices of the materials that some primitive uses."""
    primitives = [primitive for mesh in gltf.items("meshes") for primitive in mesh["primitives"]]
    return {primitive["material"] for primitive in primitives if "material" in primitive}


def note_unread(gltf: Gltf, notes: Notes) -> None:
    """Note what the file contains and the renderer does not show."""
    for extension in sorted(set(gltf.tree.get("extensionsUsed") or []) - HANDLED):
        if extension not in LIGHTS and not extension.startswith("KHR_materials_"):
            notes.add(f"{extension} is left out")  # the others are noted elsewhere
    if _moves_meshes(gltf):
        notes.add("animations of meshes are left out; they stand in their rest pose")
    if gltf.items("skins"):
        notes.add("skins are left out; meshes stand in their rest pose")
    if len(gltf.items("scenes")) > 1:
        notes.add("only the file's default scene is read")
    if any(primitive.get("targets") for mesh in gltf.items("meshes") for primitive in mesh["primitives"]):
        notes.add("morph targets are left out")


def _moves_meshes(gltf: Gltf) -> bool:
    """Whether an animation moves a mesh, and not only cameras and lights, which jobs have paths for."""
    nodes, seen = gltf.items("nodes"), set[int]()
    channels = [channel for animation in gltf.items("animations") for channel in animation.get("channels") or []]
    waiting = [node for channel in channels if (node := channel["target"].get("node")) is not None]
    while waiting:
        node = waiting.pop()
        if node in seen:
            continue
        seen.add(node)
        if nodes[node].get("mesh") is not None:
            return True
        waiting += nodes[node].get("children") or []
    return False


def placed_meshes(gltf: Gltf, limit: Limit) -> list[tuple[int, Float64, str]]:
    """List every mesh that the default scene shows: its index, its places, (n, 4, 4) `world_from_mesh`, and its name.

    The name is that of the node, else of the mesh.

    Args:
        limit: counts triangles and places before they are allocated.

    Raises:
        SceneError: they need more memory than there is.
    """
    nodes, meshes = gltf.items("nodes"), gltf.items("meshes")
    triangles = [sum(triangle_count(gltf, primitive) for primitive in mesh["primitives"]) for mesh in meshes]
    scene = gltf.tree["scenes"][gltf.tree.get("scene") or 0]
    waiting = [(node, np.eye(4)) for node in reversed(scene.get("nodes") or [])]
    placed: list[tuple[int, Float64, str]] = []
    seen: set[int] = set()
    while waiting:
        index, world_from_parent = waiting.pop()
        if index in seen:
            continue
        seen.add(index)
        node = nodes[index]
        world_from_node = world_from_parent @ rest_transform(node)
        waiting += [(child, world_from_node) for child in reversed(node.get("children") or [])]
        mesh = node.get("mesh")
        if mesh is None:
            continue
        places = _places(gltf, node, limit)
        limit.take("triangles", TRIANGLE_BYTES * triangles[mesh] * len(places))
        limit.take("places", PLACE_BYTES * len(places))
        name = str(node.get("name") or meshes[mesh].get("name") or f"node {index}")
        placed.append((mesh, world_from_node @ places, name))
    return placed


def _places(gltf: Gltf, node: Tree, limit: Limit) -> Float64:
    """(n, 4, 4) transforms of the instances of a node, in the node; of a plain node, one identity."""
    instancing = (node.get("extensions") or {}).get("EXT_mesh_gpu_instancing")
    if instancing is None:
        return np.eye(4)[None]
    found = {INSTANCE_KEYS[name]: number for name, number in instancing["attributes"].items() if name in INSTANCE_KEYS}
    if not found:
        raise ValueError("EXT_mesh_gpu_instancing: expected TRANSLATION, ROTATION or SCALE, got none of them")
    count = min(gltf.tree["accessors"][number]["count"] for number in found.values())
    limit.take("instances", PLACE_BYTES * count)
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
