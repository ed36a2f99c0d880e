"""GLB and glTF -> parts: every mesh of the default scene, at each of its places.

Primitives are lists, strips and fans of triangles, plain, sparse or compressed with Draco.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from ..assets import Assets
from ..geometry import Indices, Mesh, join_sets, tangents_within
from ..materials import MeshBuilder, PlacedMaterial, TexturePlaces, clean_colours, default_material
from ..model import POSED, Material, Meshes, Notes
from .container import DRACO, TRIANGLES, Gltf, Tree, normalise, open_gltf
from .materials import KNOWN, SILENT, GltfMaterial
from .pose import Attributes, Shape, joint_matrices, morphed, shape_of, skinned
from .stage import AT_REST, PATHS, Motion, count_lights, read_motion, span_of, transforms, with_descendants

LIST, STRIP, FAN = TRIANGLES
WIDTHS = {
    "POSITION": (3,),
    "NORMAL": (3,),
    "TEXCOORD": (2,),
    "COLOR": (3, 4),
    "JOINTS": (4,),
    "WEIGHTS": (4,),
}  # numbers per vertex

# Least memory per triangle while a scene is read (measured: 460 to 800 bytes, with texture coordinates, normals and
# colours), and per place of a mesh.
TRIANGLE_BYTES, PLACE_BYTES = 450, 1000
HANDLED = KNOWN | SILENT | {"KHR_texture_transform", "KHR_mesh_quantization", "KHR_materials_unlit"}
HANDLED |= {"EXT_texture_webp", "KHR_draco_mesh_compression", "KHR_lights_punctual", "EXT_mesh_gpu_instancing"}


def read_gltf(data: bytes, assets: Assets) -> Meshes:
    """Read a GLB or glTF file.

    Raises:
        ValueError, AssetError, KeyError, ...: the file is broken.
        SceneError: the file has a form that cannot be read.
    """
    return GltfReader(assets=assets, gltf=open_gltf(data, assets)).read()


@dataclass(slots=True, kw_only=True, eq=False)
class GltfReader(MeshBuilder):
    """Reads the meshes of a file's default scene."""

    gltf: Gltf

    def read(self) -> Meshes:
        """Read all meshes, and the materials that they use."""
        gltf = self.gltf
        self._note_unread()
        meshes = [mesh["primitives"] for mesh in gltf.items("meshes")]
        used = {primitive["material"] for mesh in meshes for primitive in mesh if "material" in primitive}
        for index, entry in enumerate(gltf.items("materials")):
            name = str(entry.get("name") or f"material {index}")
            source = GltfMaterial(name=name, assets=self.assets, textures=self.textures, gltf=gltf, entry=entry)
            # no triangle has the others: keep their names for overrides, read no image
            self.add_material(source.read() if index in used else Material(name=name))
        motion = read_motion(gltf)
        placed = self._placed_meshes(motion, time := self._time(motion))
        primitives: dict[Shape, list[Mesh | None]] = {}
        for shape in sorted({shape for shape, _, _ in placed}):
            joints = joint_matrices(gltf, motion, shape.skin, time)
            primitives[shape] = [self._triangles(primitive, shape.weights, joints) for primitive in meshes[shape.mesh]]
        for shape, places, name in placed:
            for found in filter(None, primitives[shape]):
                self.place(found, places, (name,))
        shown, named = {part.material for part in self.parts}, len(self.materials)
        for number in range(named, max(shown, default=-1) + 1):  # no material, without and with vertex colours
            self.add_material(default_material(number > named, self.notes if number in shown else Notes()))
        return self.meshes(count_lights(gltf))

    def _note_unread(self) -> None:
        """Note what the file contains and the renderer does not show."""
        gltf, notes = self.gltf, self.notes
        for extension in sorted(set(gltf.tree.get("extensionsUsed") or []) - HANDLED):
            if not extension.startswith("KHR_materials_"):
                notes.add(f"{extension} is left out")  # the others are noted elsewhere
        if len(gltf.items("scenes")) > 1:
            notes.add("only the file's default scene is read")

    def _time(self, motion: Motion) -> float:
        """The time of the scene, seconds; note it if meshes move."""
        first, last = span_of(list(motion.channels.values())) or (0.0, 0.0)
        time = first if self.assets.time is None else self.assets.time
        for note in motion.notes:
            self.notes.add(note)
        joints = {joint for skin in self.gltf.items("skins") for joint in skin["joints"]}
        moved = with_descendants(self.gltf, [node for node, _ in motion.channels])  # cameras move with the job
        if any("mesh" in motion.nodes[node] or node in joints for node in moved):
            self.notes.add(POSED.format(f"{time:.4g} s of {first:.4g} to {last:.4g} s"))
        return time

    def _placed_meshes(self, motion: Motion, time: float) -> list[tuple[Shape, Float64, str]]:
        """List every mesh that the default scene shows: its shape, its places, (n, 4, 4) `world_from_mesh`, its name.

        The joints of a skin place its mesh, instead of the node. The name comes from the node, else from the mesh.
        Triangles and places are counted before they are allocated.
        """
        nodes, meshes, at = self.gltf.items("nodes"), self.gltf.items("meshes"), np.array([time])
        triangles = [sum(map(self._triangle_count, mesh["primitives"])) for mesh in meshes]
        scene = self.gltf.tree["scenes"][self.gltf.tree.get("scene") or 0]
        waiting = [(node, np.eye(4)) for node in reversed(scene.get("nodes") or [])]
        placed: list[tuple[Shape, Float64, str]] = []
        seen: set[int] = set()
        while waiting:
            index, world_from_parent = waiting.pop()
            if index in seen:
                continue
            seen.add(index)
            node = nodes[index]
            world_from_node = world_from_parent @ motion.parent_from_node(index, at)[0]
            waiting += [(child, world_from_node) for child in reversed(node.get("children") or [])]
            if (mesh := node.get("mesh")) is None:
                continue
            places = self._instances(node)
            self.assets.limit.take("triangles", TRIANGLE_BYTES * triangles[mesh] * len(places))
            name = str(node.get("name") or meshes[mesh].get("name") or f"node {index}")
            shape = shape_of(self.gltf, motion, index, time)
            placed.append((shape, np.eye(4)[None] if shape.skin >= 0 else world_from_node @ places, name))
        return placed

    def _triangle_count(self, primitive: Tree) -> int:
        """The number of triangles that a primitive declares."""
        number = primitive.get("indices", primitive["attributes"].get("POSITION"))
        mode = primitive.get("mode", LIST)
        if number is None or mode not in TRIANGLES:
            return 0
        corners = int(self.gltf.tree["accessors"][number]["count"])
        return corners // 3 if mode == LIST else max(corners - 2, 0)

    def _instances(self, node: Tree) -> Float64:
        """(n, 4, 4) transforms of the instances of a node, in the node; of a plain node, one identity."""
        attributes = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {})
        found = {path: attributes[path.upper()] for path in PATHS if path.upper() in attributes}
        count = min((self.gltf.tree["accessors"][number]["count"] for number in found.values()), default=1)
        self.assets.limit.take("places", PLACE_BYTES * count)
        moved = {path: self.gltf.read_accessor(number)[:count].astype(np.float64) for path, number in found.items()}
        for path, rows in moved.items():
            if rows.shape[1] != (width := len(AT_REST[path])):
                raise ValueError(f"{path.upper()} of instances: expected {width} numbers for each, got {rows.shape[1]}")
        return transforms({}, moved, count)

    def _triangles(self, primitive: Tree, weights: Sequence[float], joints: Float64 | None) -> Mesh | None:
        """Read one primitive in a pose, see `Shape` and `joint_matrices`; None if it holds no triangles.

        The two indices behind all materials stand for no material: without and with vertex colours.
        """
        mode, number, notes = primitive.get("mode", LIST), primitive.get("material"), self.notes
        if mode not in TRIANGLES:
            notes.add("points and lines are left out")
            return None
        if "POSITION" not in primitive["attributes"]:
            notes.add("primitives without positions are left out")
            return None
        shown = PlacedMaterial(material=Material(name="")) if number is None else self.materials[number]
        name, places, bumps = shown.material.name, shown.places, shown.normal_places
        if self.assets.all_uvs and not places:
            places = [TexturePlaces(name="TEXCOORD_0")]
        names = ["POSITION", "NORMAL", "COLOR_0", *(one.name for one in places)]
        names += ["TANGENT", bumps.name] if bumps.name else []
        names += (
            [] if joints is None else [name for name in primitive["attributes"] if name[:6] in ("JOINTS", "WEIGHT")]
        )
        found, indices = self._arrays(primitive, names)
        count = len(found["POSITION"])
        for other in [other for other, values in found.items() if len(values) != count]:
            notes.add(f"{other} of another length than POSITION is left out")
            del found[other]
        found = morphed(self.gltf, found, primitive.get("targets") or (), weights)
        if joints is not None:
            found = skinned(found, joints, self.assets.limit, notes)
        faces = _faces(np.arange(count, dtype=np.int64) if indices is None else indices, mode, notes)
        if faces is None:
            return None
        inside = ((faces >= 0) & (faces < count)).all(axis=1)
        kept = faces[inside]
        if kept.size < count:  # primitives may share one large array of vertices
            found = {name: values[kept.reshape(-1)] for name, values in found.items()}
            kept = np.arange(kept.size, dtype=np.int64).reshape(-1, 3)
        normals = found["NORMAL"].astype(np.float64) if "NORMAL" in found else None
        normal_uvs = _uvs(found, bumps)
        if bumps.name and normal_uvs is None:
            notes.add("meshes without texture coordinates show no normal map", name)
        mesh = Mesh(
            material=len(self.materials) + ("COLOR_0" in found) if number is None else number,
            vertices=found["POSITION"].astype(np.float64),
            faces=kept,
            normals=normals,
            uvs=join_sets([_uvs(found, one) for one in places]),
            colours=clean_colours(found["COLOR_0"], notes)[kept] if "COLOR_0" in found else None,
            normal_uvs=normal_uvs,
            outside=int((~inside).sum()),
        )
        return mesh if normal_uvs is None else replace(mesh, tangents=self._tangents(mesh, found.get("TANGENT")))

    def _tangents(self, mesh: Mesh, tangents: NDArray[Any] | None) -> Float64:
        """(f, 3, 4) tangents of the file, or computed ones where it has none, or not a direction for every corner."""
        faces, normals, uvs = mesh.faces, mesh.normals, mesh.normal_uvs
        assert uvs is not None
        if tangents is not None and normals is not None and tangents.shape[1] == 4:  # they belong to the file's normals
            given = tangents.astype(np.float64)[faces]
            if np.isfinite(given).all() and given[..., :3].any(axis=2).all():
                given[..., 3] = np.where(given[..., 3] < 0, -1.0, 1.0)
                return given
        normals = None if normals is None else normals[faces]
        return tangents_within(self.assets.limit, mesh.vertices[faces], normals, uvs[faces])

    def _arrays(self, primitive: Tree, names: Sequence[str]) -> tuple[Attributes, Indices | None]:
        """Read the named attributes, as far as they exist, and the indices, if any."""
        attributes: dict[str, int] = primitive["attributes"]
        packed: Attributes = {}
        indices: NDArray[Any] | None = None
        draco = (primitive.get("extensions") or {}).get(DRACO)
        if draco is not None:
            packed, indices = self._decode_draco(draco, attributes)
        elif "indices" in primitive:
            indices = self.gltf.read_accessor(primitive["indices"])
        found = {
            name: packed[name] if name in packed else self.gltf.read_accessor(attributes[name])
            for name in names
            if name in attributes
        }
        for name, values in found.items():
            if values.shape[1] not in WIDTHS.get(name.split("_")[0], (values.shape[1],)):
                raise ValueError(f"{name}: expected another number than {values.shape[1]} for each vertex")
        return found, None if indices is None else indices.reshape(-1).astype(np.int64)

    def _decode_draco(self, draco: Tree, attributes: dict[str, int]) -> tuple[Attributes, NDArray[Any]]:
        """Decode the attributes and indices of a primitive that is compressed with Draco."""
        import DracoPy

        mesh: Any = DracoPy.decode(self.gltf.view_bytes(draco["bufferView"]))
        names = {number: name for name, number in draco["attributes"].items() if name in attributes}
        flat: Attributes = {}
        for entry in mesh.attributes:
            if (name := names.get(entry["unique_id"])) is not None:
                rows = np.asarray(entry["data"]).reshape(len(entry["data"]), -1)
                flat[name] = normalise(rows, self.gltf.tree["accessors"][attributes[name]])
        return flat, np.asarray(mesh.faces)


def _faces(indices: Indices, mode: int, notes: Notes) -> Indices | None:
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


def _uvs(found: Attributes, places: TexturePlaces) -> Float64 | None:
    """(v, 2) texture coordinates, transformed, v upwards; None if there are none."""
    if places.name not in found:
        return None
    uv = places.of(found[places.name].astype(np.float64))
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
