"""Materials, parts and the binary glTF writer of the project's own scenes.

A part is a list of (material name, mesh). A part placed more than once is stored once and instanced by nodes.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .parts import Part
from .shapes import Array, Mesh

FLOAT, USHORT, UINT = 5126, 5123, 5125  # glTF component types


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """A glTF material: linear colour, or a texture that covers `metres` x `metres` (times the colour)."""

    colour: tuple[float, float, float]
    mirror: bool = False
    texture: Image.Image | None = None
    metres: float = 1.0


@dataclass(slots=True, kw_only=True, eq=False)
class Model:
    """The scene that a generator collects: materials, and parts with their places.

    Attributes:
        normals: write vertex normals; without them every triangle is flat.
        decimals: of points, few enough that the last bits of sin and cos do not change a file.
    """

    materials: dict[str, Material]
    normals: bool = True
    decimals: int = 5
    placed: list[tuple[str, Part, list[Array]]] = field(default_factory=list)

    def add(self, name: str, part: Part, places: Iterable[Array] | None = None) -> None:
        """Add a part, once where it is or once per (4, 4) matrix of `places`."""
        self.placed.append((name, part, [np.eye(4)] if places is None else list(places)))

    def triangles(self) -> int:
        """Number of triangles, with instances."""
        return sum(len(places) * sum(len(mesh.faces) for _, mesh in part) for _, part, places in self.placed)


def place(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn_y: float = 0.0, size: float = 1.0) -> Array:
    """A (4, 4) matrix that scales, turns about y (degrees) and moves."""
    c, s = np.cos(np.radians(turn_y)) * size, np.sin(np.radians(turn_y)) * size
    return np.array([[c, 0, s, x], [0, size, 0, y], [-s, 0, c, z], [0, 0, 0, 1.0]])


def write(model: Model, file: Path) -> None:
    """Write the model as binary glTF: one mesh per part, one primitive per material, one node per place."""
    names = list(model.materials)
    out = _Buffers()
    meshes: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    for name, part, places in model.placed:
        primitives = []
        for material in dict.fromkeys(m for m, _ in part):
            textured = model.materials[material].texture is not None
            meshes_here = [_rounded(mesh, model.decimals) for m, mesh in part if m == material]
            points, normals, uvs, faces = _primitive(
                meshes_here, model.normals, textured, model.materials[material].metres
            )
            attributes = {"POSITION": out.floats(points, limits=True)}
            if model.normals:
                attributes["NORMAL"] = out.floats(normals)
            if textured:
                attributes["TEXCOORD_0"] = out.floats(uvs)
            primitives.append(
                {"attributes": attributes, "indices": out.indices(faces), "material": names.index(material)}
            )
        meshes.append({"name": name, "primitives": primitives})
        for i, matrix in enumerate(places):
            node: dict[str, Any] = {"name": f"{name}-{i}" if len(places) > 1 else name, "mesh": len(meshes) - 1}
            if not np.array_equal(matrix, np.eye(4)):
                node["matrix"] = [round(float(v), 7) + 0.0 for v in matrix.T.ravel()]
            nodes.append(node)
    images = [_jpeg(m.texture) for m in model.materials.values() if m.texture is not None]
    image_views = [out.view(data) for data in images]
    _write_glb(
        file,
        {
            "asset": {"version": "2.0", "generator": "framearray scenes"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(nodes)))}],
            "nodes": nodes,
            "meshes": meshes,
            "materials": _material_table(model.materials),
            "textures": [{"source": i} for i in range(len(images))],
            "images": [{"bufferView": view, "mimeType": "image/jpeg"} for view in image_views],
            "accessors": out.accessors,
            "bufferViews": out.views,
            "buffers": [{"byteLength": len(out.data)}],
        },
        bytes(out.data),
    )


class _Buffers:
    """The binary chunk of a file, and the tables that describe its parts."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.views) - 1

    def floats(self, values: NDArray[np.float32], *, limits: bool = False) -> int:
        accessor = {
            "bufferView": self.view(values.astype("<f4").tobytes()),
            "componentType": FLOAT,
            "count": len(values),
            "type": f"VEC{values.shape[1]}",
        }
        if limits:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def indices(self, faces: NDArray[np.int64]) -> int:
        small = faces.max() < 65535
        self.accessors.append(
            {
                "bufferView": self.view(faces.astype("<u2" if small else "<u4").tobytes()),
                "componentType": USHORT if small else UINT,
                "count": faces.size,
                "type": "SCALAR",
            }
        )
        return len(self.accessors) - 1


def _material_table(materials: dict[str, Material]) -> list[dict[str, Any]]:
    table = []
    n_textures = 0
    for name, m in materials.items():
        pbr: dict[str, Any] = {
            "baseColorFactor": [*m.colour, 1.0],
            "metallicFactor": 1.0 if m.mirror else 0.0,
            "roughnessFactor": 0.0 if m.mirror else 1.0,
        }
        if m.texture is not None:
            pbr["baseColorTexture"] = {"index": n_textures}
            n_textures += 1
        table.append({"name": name, "pbrMetallicRoughness": pbr, "doubleSided": True})
    return table


def _primitive(
    meshes: Sequence[Mesh], smooth: bool, textured: bool, metres: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Points, normals, texture coordinates (all per vertex) and faces of several meshes of one material."""
    corners = np.vstack([mesh.points[mesh.faces].reshape(-1, 3) for mesh in meshes])
    owner = np.repeat(np.arange(len(meshes)), [3 * len(mesh.faces) for mesh in meshes])
    cos_crease = np.repeat(np.cos(np.radians([mesh.crease_deg for mesh in meshes])), [3 * len(m.faces) for m in meshes])
    normals = np.tile([0.0, 0.0, 1.0], (len(corners), 1))
    if smooth:
        normals = np.round(_corner_normals(corners, owner, cos_crease), 4) + 0.0
    uvs = np.zeros((len(corners), 2))
    if textured:
        uvs = np.round(np.vstack([_corner_uvs(mesh) for mesh in meshes]) / metres, 5) + 0.0
    table = np.hstack([corners, normals, uvs])
    vertices, index = np.unique(table, axis=0, return_inverse=True)
    first = np.full(len(vertices), len(table))  # keep the order of first use, which is good for caches and for readers
    np.minimum.at(first, index.ravel(), np.arange(len(table)))
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    vertices = vertices[order].astype(np.float32)
    unit = vertices[:, 3:6] / np.linalg.norm(vertices[:, 3:6], axis=1, keepdims=True)
    return vertices[:, :3], unit, vertices[:, 6:], rank[index.ravel()].reshape(-1, 3)


def _rounded(mesh: Mesh, decimals: int) -> Mesh:
    """The mesh with rounded points, without triangles that lose their area in rounding."""
    points = np.round(mesh.points, decimals) + 0.0
    p = points[mesh.faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return replace(mesh, points=points, faces=mesh.faces[area > 1e-9])


def _corner_normals(corners: Array, owner: NDArray[np.int64], cos_crease: Array) -> Array:
    """Unit normal per corner: area-weighted mean of the faces around its point that turn by less than the crease."""
    p = corners.reshape(-1, 3, 3)
    area_vec = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(area_vec, axis=1, keepdims=True)
    face_dir = np.repeat(area_vec / np.maximum(length, 1e-30), 3, axis=0)
    weighted = np.repeat(area_vec, 3, axis=0)
    _, point = np.unique(np.c_[owner, np.round(corners / 2e-5)], axis=0, return_inverse=True)
    order = np.argsort(point.ravel(), kind="stable")
    counts = np.bincount(point.ravel())
    starts = np.cumsum(counts) - counts
    size = counts[point.ravel()[order]]  # corners that share the point of each sorted corner
    a = np.repeat(order, size)  # every pair (a, b) of corners at one point
    within = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    b = order[np.repeat(starts[point.ravel()[order]], size) + within]
    smooth = np.einsum("ij,ij->i", face_dir[a], face_dir[b]) > cos_crease[a]
    total = np.stack([np.bincount(a[smooth], weighted[b[smooth], i], len(corners)) for i in range(3)], axis=-1)
    norm = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(norm > 1e-15, total / np.maximum(norm, 1e-30), face_dir)


def _corner_uvs(mesh: Mesh) -> Array:
    """Texture coordinates per corner in metres: the mesh's own, or the two axes that each face spans best."""
    if mesh.uvs is not None:
        return mesh.uvs[mesh.faces].reshape(-1, 2)
    p = mesh.points[mesh.faces]
    axis = np.abs(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])).argmax(axis=1)
    u = np.array([2, 0, 0])[axis]
    v = np.array([1, 2, 1])[axis]
    rows = np.arange(len(p))[:, None]
    return np.stack([p[rows, [0, 1, 2], u[:, None]], p[rows, [0, 1, 2], v[:, None]]], axis=-1).reshape(-1, 2)


def _jpeg(image: Image.Image) -> bytes:
    out = BytesIO()
    image.convert("RGB").save(out, "JPEG", quality=88, subsampling=0)
    return out.getvalue()


def _write_glb(file: Path, tables: dict[str, Any], binary: bytes) -> None:
    tables = {key: value for key, value in tables.items() if value != []}
    text = json.dumps(tables, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    header = b"glTF" + np.array([2, 12 + 8 + len(text) + 8 + len(binary)], "<u4").tobytes()
    chunks = np.array([len(text)], "<u4").tobytes() + b"JSON" + text
    chunks += np.array([len(binary)], "<u4").tobytes() + b"BIN\0" + binary
    file.write_bytes(header + chunks)
