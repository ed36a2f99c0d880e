"""PLY, STL and all other formats that trimesh reads -> parts."""

import io
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import SceneError

from .assets import AssetError, Assets
from .formats import missing_package
from .headers import check_headers, one_solid
from .materials import blended_opacity, clean_colours, default_material, make_material, shown_alpha
from .model import Material, Meshes, Notes, Part
from .placing import file_normals, instances, place_mesh
from .textures import TextureTable

BYTE = 255.0


class FolderResolver:
    """Gives trimesh's loaders the files beside the scene, and only those."""

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

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)


def readable_formats() -> set[str]:
    """The file extensions of meshes that trimesh reads, without the dot; some need a further package."""
    from trimesh.exchange.load import mesh_loaders

    return set(mesh_loaders) - {"dict", "dict64", "json", "msgpack", "stl_ascii"}


def read_other(data: bytes, extension: str, assets: Assets) -> Meshes:
    """Read a file of any format that trimesh reads."""
    import PIL.Image  # noqa: F401  (without it trimesh silently reads no texture)
    import trimesh

    notes = Notes()
    folder: Any = FolderResolver(assets, notes)  # it has the methods of trimesh's own resolvers that loaders use
    check_headers(data, extension, assets.limit)
    if extension == "ply":
        data = _without_blank_lines(data)
    elif extension == "stl":
        data = one_solid(data)
    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=extension, resolver=folder, process=False)
    except ImportError as error:
        raise SceneError(missing_package(extension)) from error
    textures = TextureTable(notes, assets.limit)
    materials: list[Material] = []
    numbers: dict[Any, int] = {}
    parts: list[Part] = []
    outside = 0
    if any(not isinstance(geometry, trimesh.Trimesh) for geometry in scene.geometry.values()):
        notes.add("points and lines are left out")
    for node, mesh, world_from_mesh in instances(scene):
        vertex_colours, face_colours = _colours(mesh, notes)
        coloured = vertex_colours is not None or face_colours is not None
        textured = mesh.visual.kind == "texture"
        key = id(mesh.visual.material) if textured else coloured
        if key not in numbers:
            numbers[key] = len(materials)
            materials.append(
                _material(mesh.visual.material, len(materials), textures, notes)
                if textured
                else default_material(coloured, notes)
            )
        uv = mesh.visual.uv if textured and (assets.all_uvs or materials[numbers[key]].texture >= 0) else None
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
        inside = ((faces >= 0) & (faces < len(vertices))).all(axis=1)
        outside += int((~inside).sum())
        parts.append(
            place_mesh(
                vertices,
                faces[inside],
                world_from_mesh[None],
                numbers[key],
                normals=file_normals(mesh),
                uvs=None if uv is None else np.array(uv, dtype=np.float64),
                colours=vertex_colours,
                face_colours=None if face_colours is None else face_colours[inside],
                names=(node,),
            )
        )
    return Meshes(
        parts=tuple(parts),
        materials=tuple(materials),
        textures=tuple(textures.textures),
        dropped={"index out of range": outside} if outside else {},
        notes=notes.lines(),
    )


def _without_blank_lines(data: bytes) -> bytes:
    """Remove the empty lines of an ASCII PLY, on which trimesh fails; leave other data as it is."""
    if b"format ascii" not in data[:200].lower():
        return data
    return b"\n".join(line for line in data.splitlines() if line.strip()) + b"\n"


def _colours(mesh: Any, notes: Notes) -> tuple[Float32 | None, Float32 | None]:
    """(v, 3) vertex colours and (f, 3) face colours; at least one of them is None."""
    visual = mesh.visual
    kind = visual.kind
    found = {"vertex": lambda: visual.vertex_colors, "face": lambda: visual.face_colors}
    if kind in found:
        colours = np.array(found[kind](), dtype=np.float64) / BYTE
    else:
        attributes = getattr(visual, "vertex_attributes", None)
        colours = np.array([] if attributes is None else attributes.data.get("color", []), dtype=np.float64)
        if len(colours) == 0 or len(colours) != len(mesh.vertices):
            return None, None
        kind = "vertex"
    if colours.shape[1] > 3 and (colours[:, 3] < 1).any():
        notes.add("the opacity of vertex colours is left out")
    clean = clean_colours(colours[:, :3], notes)
    return (clean, None) if kind == "vertex" else (None, clean)


def _material(source: Any, number: int, textures: TextureTable, notes: Notes) -> Material:
    """Map a trimesh material: its main colour and its image."""
    name = str(getattr(source, "name", None) or f"material {number}")
    image = getattr(source, "baseColorTexture", None) or getattr(source, "image", None)
    texture = -1 if image is None else textures.add(("trimesh", id(image)), f"material {name}", image)
    colour = np.asarray(source.main_color, dtype=np.float64) / BYTE
    if texture >= 0 and getattr(source, "diffuse", None) is not None:
        colour = np.array([1.0, 1.0, 1.0, colour[3]])  # trimesh's default grey must not darken an image
    alpha = shown_alpha(name, float(colour[3]), texture >= 0, notes)
    opacity = blended_opacity(name, alpha, texture, textures, notes)
    base = (float(colour[0]), float(colour[1]), float(colour[2]))
    return make_material(name, base, (0.0, 0.0, 0.0), opacity, notes, texture=texture)
