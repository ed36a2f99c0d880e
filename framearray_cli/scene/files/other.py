"""PLY, STL and all other formats that trimesh reads -> parts; remedies for formats that no reader knows.

The sizes of what would be unpacked are checked before trimesh reads a file.
"""

import io
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from framearray_cli.base.arrays import Flags, Float32
from framearray_cli.base.colour import linear_from_srgb8
from framearray_cli.base.errors import SceneError
from framearray_cli.base.extras import install_command
from framearray_cli.base.forms.toml import SCENE_FORMATS, unknown_format

from .assets import AssetError, Assets, Limit, shorten
from .geometry import Indices, Mesh
from .materials import BLACK, MaterialSource, MeshBuilder, clean_colours, default_material
from .model import GREY, Material, Meshes, Notes, rgb3
from .staging import Stage

# Further packages that trimesh needs.
_PACKAGES = {
    **dict.fromkeys(("dae", "zae"), "pycollada"),
    **dict.fromkeys(("step", "stp"), "cascadio"),
    **dict.fromkeys(("3mf", "3dxml", "xaml"), "lxml networkx"),
}


def _missing_package(extension: str) -> str:
    """Name the package that a format needs, and how to install it."""
    remedy = "export the scene as GLB"
    if package := _PACKAGES.get(extension):
        needs = " and ".join(package.split())
        wanted = package if package == "cascadio" else "[formats]"
        return f"reading .{extension} files needs {needs}; {remedy}, or install it with: {install_command(wanted)}"
    return f"reading .{extension} files needs a further package; {remedy}"


ARCHIVES = ("3mf", "3dxml", "zae")  # each is a ZIP with XML in it
XML = ("dae", "xaml")
LONGEST_HEADER = 100_000  # bytes in which XML defines its entities
BETWEEN_SOLIDS = re.compile(rb"^[ \t]*endsolid[^\r\n]*[\r\n\s]+solid[^\r\n]*$", re.IGNORECASE | re.MULTILINE)


def check_headers(data: bytes, extension: str, limit: Limit) -> None:
    """Refuse an archive that is too large unpacked, and XML that defines entities.

    Raises:
        SceneError: gives the reason.
    """
    if extension in XML:
        _check_xml(data, f"the {extension.upper()}")
    if extension not in ARCHIVES:
        return
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        limit.take("unpacked files", sum(info.file_size for info in archive.infolist()))
        for info in archive.infolist():
            if not (info.is_dir() or info.flag_bits & 1):  # nor encrypted
                with archive.open(info) as file:
                    _check_xml(file.read(LONGEST_HEADER), f"{shorten(info.filename)} in it")


def _check_xml(data: bytes, name: str) -> None:
    """Refuse XML that defines entities: they can read other files, or grow without end. No exporter writes any."""
    plain = data.replace(b"\0", b"")  # UTF-16 and UTF-32 as well
    if b"<!ENTITY" in plain or (b"<!DOCTYPE" in plain and (b"[" in plain.partition(b"<!DOCTYPE")[2][:1000])):
        raise SceneError(f"{name} defines XML entities, which are refused; export it anew")


def _model_of(data: bytes, most: int = -1) -> bytes:
    """The main XML of a 3MF, or its first bytes."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return archive.open(next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())).read(most)


def other_stage(data: bytes, extension: str) -> Stage:
    """The up axis and the unit of a COLLADA or 3MF; cameras and lights are not read."""
    if extension == "3mf":
        named = re.search(rb"<(?:\w+:)?model\b[^>]*\bunit=[\"'](\w+)", _model_of(data, LONGEST_HEADER))
        return Stage(up="z", metres=_UNITS.get(named[1].decode() if named else "millimeter"))
    head = data[:LONGEST_HEADER]
    unit, up = re.search(rb"<unit\b[^>]*\bmeter=[\"']([0-9.eE+-]+)", head), b"Z_UP" in head
    metres = float(unit[1]) if unit else 1.0
    return Stage(up="z" if up else "y", metres=metres if 0 < metres < np.inf else None)


_UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
_CORNERS = ("p1", "p2", "p3")
BYTE = 255.0


class FolderResolver:
    """Gives trimesh's loaders only the files next to the scene."""

    def __init__(self, assets: Assets, notes: Notes) -> None:
        self.assets = assets
        self.notes = notes

    def get(self, name: str) -> bytes:
        """Read the bytes of a named file."""
        try:
            return self.assets.read(name)
        except AssetError as error:
            self.notes.add(f"texture left out, {error}")
            raise

    __getitem__ = get


def read_other(data: bytes, file: Path, assets: Assets) -> Meshes:
    """Read a file of any format that trimesh reads.

    Raises:
        SceneError: the format is unknown, or needs a further package.
    """
    import PIL.Image  # noqa: F401  (without it trimesh silently reads no texture)
    import trimesh
    from trimesh.exchange.load import mesh_loaders

    extension = file.suffix[1:].lower()
    if extension not in SCENE_FORMATS:
        raise SceneError(unknown_format(file))
    if extension not in mesh_loaders:
        raise SceneError(_missing_package(extension))
    found = MeshBuilder(assets=assets)
    notes = found.notes
    folder: Any = FolderResolver(assets, notes)  # it has the methods of trimesh's own resolvers that loaders use
    check_headers(data, extension, assets.limit)
    if extension == "ply" and b"format ascii" in data[:200].lower():  # trimesh fails on empty lines
        data = b"\n".join(line for line in data.splitlines() if line.strip()) + b"\n"
    elif extension == "stl" and data[:200].lstrip()[:5].lower() == b"solid" and b"\0" not in data[:200]:
        data = BETWEEN_SOLIDS.sub(b"", data)  # trimesh makes a mesh of each solid, which is slow for very many
    try:
        scene: Any = trimesh.load_scene(io.BytesIO(data), file_type=extension, resolver=folder, process=False)
    except ImportError as error:
        raise SceneError(_missing_package(extension)) from error
    numbers: dict[Any, int] = {}
    meshes: dict[str, Any] = {name: mesh for name, mesh in scene.geometry.items() if isinstance(mesh, trimesh.Trimesh)}
    if len(meshes) < len(scene.geometry):
        notes.add("points and lines are left out")
    painted = _painted(data, meshes) if extension == "3mf" else {}
    for node in scene.graph.nodes_geometry:
        world_from_mesh, name = scene.graph[node]
        mesh = meshes.get(name)
        if mesh is None or not len(mesh.faces):
            continue
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
        inside: Flags = (faces >= 0) & (faces < len(vertices))
        colours = painted[name] if name in painted else _colours(mesh, np.where(inside, faces, 0), notes)
        inside = np.asarray(inside.all(axis=1))
        textured = mesh.visual.kind == "texture"
        key = id(mesh.visual.material) if textured else colours is not None
        if key not in numbers:
            plain = None if textured else default_material(colours is not None, notes)
            numbers[key] = found.add_material(plain or _material(mesh.visual.material, found))
        shown = found.materials[numbers[key]].material.texture >= 0
        uv = mesh.visual.uv if textured and (assets.all_uvs or shown) else None
        own_normals = "vertex_normals" in mesh._cache  # of the file itself; trimesh invents some for a mesh without
        placed = Mesh(
            material=numbers[key],
            vertices=vertices,
            faces=faces[inside],
            normals=np.asarray(mesh._cache["vertex_normals"], dtype=np.float64) if own_normals else None,
            uvs=None if uv is None else np.array(uv, dtype=np.float64),
            colours=None if colours is None else colours[inside],
            outside=int((~inside).sum()),
        )
        found.place(placed, np.array(world_from_mesh, np.float64)[None], (str(node),))
    return found.meshes()


def _painted(data: bytes, meshes: Mapping[str, Any]) -> dict[str, Float32]:
    """(f, 3, 3) colours of the corners of meshes of a 3MF, which trimesh leaves out: base materials, colour groups."""
    root, found = ElementTree.fromstring(_model_of(data)), dict[str, Float32]()
    colours: dict[Any, Any] = {
        (group.get("id"), str(k)): linear_from_srgb8(np.frombuffer(bytes.fromhex(code[1:7]), np.uint8))
        for group in root.findall("{*}resources/{*}basematerials") + root.findall("{*}resources/{*}colorgroup")
        for k, code in enumerate(entry.get("displaycolor", entry.get("color", "")) for entry in group)
    }
    bodies = root.findall("{*}resources/{*}object[{*}mesh]") if colours else []
    for (name, mesh), body in zip(meshes.items(), bodies, strict=False):  # in the order of the file
        own, first = body.get("pid"), body.get("pindex")
        corners = [
            [colours.get((face.get("pid", own), face.get(key, face.get("p1", first))), (GREY,) * 3) for key in _CORNERS]
            for face in body.iterfind("{*}mesh/{*}triangles/{*}triangle")
        ]
        if len(corners) == len(mesh.faces):
            found[name] = np.array(corners, np.float32)
    return found


def _colours(mesh: Any, faces: Indices, notes: Notes) -> Float32 | None:
    """(f, 3, 3) colours of the corners of all faces, from colours of vertices or faces; None without any."""
    visual = mesh.visual
    kind = visual.kind
    if kind in ("vertex", "face"):
        colours = np.array(getattr(visual, f"{kind}_colors"), dtype=np.float64) / BYTE
    else:
        attributes = getattr(visual, "vertex_attributes", None)
        colours = np.array([] if attributes is None else attributes.data.get("color", []), dtype=np.float64)
        if len(colours) == 0 or len(colours) != len(mesh.vertices):
            return None
        kind = "vertex"
    clean = clean_colours(colours, notes)
    return clean[faces] if kind == "vertex" else np.repeat(clean[:, None], 3, axis=1)


def _material(entry: Any, found: MeshBuilder) -> Material:
    """Map a trimesh material: its main colour and its image."""
    name = str(getattr(entry, "name", None) or f"material {len(found.materials)}")
    source = MaterialSource(name=name, assets=found.assets, textures=found.textures)
    image = getattr(entry, "baseColorTexture", None) or getattr(entry, "image", None)
    texture = -1 if image is None else found.textures.add(("trimesh", id(image)), f"material {name}", image)
    colour = np.asarray(entry.main_color, dtype=np.float64) / BYTE
    if texture >= 0 and getattr(entry, "diffuse", None) is not None:
        colour = np.array([1.0, 1.0, 1.0, colour[3]])  # trimesh's default grey must not darken an image
    opacity = source.blended(source.shown_alpha(float(colour[3]), texture >= 0), texture)
    return source.make(opacity, (rgb3(colour), BLACK), texture=texture)
