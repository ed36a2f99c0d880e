"""Small whole scenes of every format and feature, as bytes; mutations begin with these."""

import io
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from support import tiny
from support.scenes import QUAD_UVS, Glb, split_glb
from support.staged import LENS, animate, light

OBJ = """mtllib seed.mtl
v -2 0 2
v 2 0 2
v 2 0 -2
v -2 0 -2
v -2 2 -2 1 0 0
v 2 2 -2 0 1 0
v 0.5 1 -2
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 1 0
vn 0 0 1
usemtl Floor
f 1/1/1 2/2/1 3/3/1 4/4/1
usemtl Mirror
f -4/1/2 -5/2/2 -2/3/2 -1 -3/4/2
usemtl Cut
s off
g wall two
f 1//1 4//1 5//1
"""
MTL = """newmtl Floor
Kd 0.8 0.7 0.6
map_Kd -s 2 2 -o 0.1 0 seed.png
newmtl Mirror
Kd 0 0 0
Ks 0.9 0.9 0.9
Ns 1000
illum 3
newmtl Cut
Kd 0.5 0.5 0.5
d 0.9
map_d seed.png
"""
PLY = """ply
format ascii 1.0
comment TextureFile seed.png
element vertex 5
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 2
property list uchar int vertex_indices
end_header
-2 -2 0 255 0 0
2 -2 0 0 255 0
2 2 0 0 0 255
-2 2 0 255 255 255
0 0 2 9 9 9
4 0 1 2 3
3 0 1 4
"""
UV_PLY = """ply
format ascii 1.0
comment TextureFile seed.png
element vertex 4
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
end_header
-2 -2 0 0 0 1
2 -2 0 0 0 1
2 2 0 0 0 1
-2 2 0 0 0 1
3 0 1 2 6 0 0 1 0 1 1
3 0 2 3 6 0 0 1 1 0 1
"""
OFF = "OFF\n5 3 0\n-2 -2 0\n2 -2 0\n2 2 0\n-2 2 0\n0 0 2\n4 0 1 2 3\n3 0 1 4\n3 1 2 4\n"
STL = """solid seed
facet normal 0 0 1
outer loop
vertex -2 -2 0
vertex 2 -2 0
vertex 2 2 0
endloop
endfacet
facet normal 0 0 1
outer loop
vertex -2 -2 0
vertex 2 2 0
vertex -2 2 0
endloop
endfacet
endsolid seed
"""


@dataclass(frozen=True)
class Seed:
    """A scene file that is read without a complaint.

    Attributes:
        suffix: of its name, with the dot.
        beside: name -> bytes of the files that it names.
    """

    name: str
    suffix: str
    data: bytes
    beside: dict[str, bytes] = field(default_factory=dict)


def picture(kind: str = "PNG", mode: str = "RGBA") -> bytes:
    """A small image with every opacity in it."""
    from PIL import Image

    data = io.BytesIO()
    texels = tiny.checks(8)
    texels[..., 3] = np.linspace(0, 255, 8).astype(np.uint8)
    Image.fromarray(texels).convert(mode).save(data, format=kind)
    return data.getvalue()


def rich_glb(folder: Path) -> bytes:
    """One of everything that the reader of glTF knows."""
    glb = Glb()
    texture = glb.texture(picture(), wrapS=33071)
    moved = {"KHR_texture_transform": {"offset": [0.1, 0.2], "scale": [2, 2], "rotation": 0.3}}
    floor = glb.material(
        "Floor",
        {"baseColorTexture": {"index": texture, "extensions": moved}, "metallicRoughnessTexture": {"index": texture}},
        alphaMode="MASK",
        alphaCutoff=0.3,
        normalTexture={"index": texture, "scale": 0.7, "extensions": moved},
    )
    mirror = glb.material(
        "Mirror", {"metallicFactor": 1.0, "roughnessFactor": 0.0, "baseColorFactor": [1, 0.8, 0.7, 1]}
    )
    clear = {
        "KHR_materials_transmission": {"transmissionFactor": 0.9},
        "KHR_materials_ior": {"ior": 1.4},
        "KHR_materials_volume": {
            "thicknessFactor": 0.1, "attenuationDistance": 0.5, "attenuationColor": [0.9, 0.5, 0.2],
        },
    }  # fmt: skip
    glass = glb.material("Pane", alphaMode="BLEND", extensions=clear)
    old = {"diffuseFactor": [0.5, 0.5, 0.5, 1], "specularFactor": [0.9, 0.9, 0.9], "glossinessFactor": 1.0}
    gloss = glb.material("Old", extensions={"KHR_materials_pbrSpecularGlossiness": old}, emissiveFactor=[1, 1, 1])
    up = np.tile(np.array([[0, 0, 1]], np.float32), (4, 1))
    quad = glb.mesh(floor, TEXCOORD_0=glb.accessor(QUAD_UVS), NORMAL=glb.accessor(up))
    half = glb.accessor(np.array([[0, 0], [255, 0], [255, 255], [0, 255]], np.uint8), normalized=True)
    painted = glb.accessor(np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], np.uint8), normalized=True)
    coloured = glb.mesh(None, COLOR_0=painted, TEXCOORD_1=half)
    strip = glb.mesh(mirror, mode=5, faces=np.array([0, 1, 3, 2], np.uint8))
    fan = glb.mesh(glass, mode=6, faces=np.array([0, 1, 2, 3], np.uint32), targets=[{"POSITION": 0}])
    bare = glb.mesh(gloss, faces=None, positions=np.eye(3, dtype=np.float32))
    moved_corner = glb.sparse(np.uint8([1]), np.float32([3, 3, 1]))
    corners = glb.tree["meshes"][quad]["primitives"][0]["attributes"]["POSITION"]
    sparse = glb.add("accessors", {**glb.tree["accessors"][corners], "sparse": moved_corner})
    glb.tree["meshes"][strip]["primitives"][0]["attributes"]["POSITION"] = sparse
    rows = glb.accessor(np.array([[0, 0, 1], [1, 0, 1], [2, 1, 1]], np.float32))
    turns = glb.accessor(np.tile(np.array([[0, 0, 0, 1]], np.float32), (3, 1)))
    many = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": rows, "ROTATION": turns}}}
    child = glb.add("nodes", {"mesh": strip, "rotation": [0, 0.7071, 0, 0.7071], "scale": [1, -1, 1]})
    glb.node(quad, children=[child], translation=[0, 0, -1], skin=glb.add("skins", {"joints": [0]}))
    glb.node(coloured, matrix=[2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, -2, 1])
    glb.node(fan, translation=[3, 0, 0])
    glb.node(bare, extensions=many)
    lamp = glb.node(
        None, name="Lamp", translation=[0, 2, 1], **light(glb, "point", intensity=20.0, color=[1, 0.9, 0.8])
    )
    glb.node(None, name="Sun", **light(glb, "directional", intensity=3.0))
    shot = glb.node(None, camera=glb.add("cameras", LENS), name="Shot", translation=[1, 0.5, 4])
    animate(glb, shot, "translation", [0.0, 1.0], [[1, 0.5, 4], [1.5, 0.5, 4]])
    animate(glb, lamp, "rotation", [0.0, 0.5], [[0, 0, 0, 1], [0, 1, 0, 0]], "STEP")
    splines = [[0, 0, 0], [0, 2, 1], [0, 0, 0], [0, 0, 0], [1, 2, 1], [0, 0, 0]]
    animate(glb, lamp, "translation", [0.0, 1.0], splines, "CUBICSPLINE")
    glb.tree["extensionsUsed"] += ["EXT_mesh_gpu_instancing", "KHR_texture_transform"]
    return glb.save(folder / "rich.glb").read_bytes()


def _gltf(data: bytes, uri: str, image: str) -> bytes:
    """The tree of a GLB as glTF with its data elsewhere."""
    tree, blob = split_glb(data)
    tree["buffers"] = [{"byteLength": len(blob), "uri": uri}]
    tree["images"] = [{"uri": image}]
    return json.dumps(tree).encode()


def _binary(kind: str) -> bytes:
    from trimesh import Trimesh

    corners = tiny.box([-1, -1, -1], [1, 1, 1]).reshape(-1, 3)
    data: bytes = Trimesh(corners, np.arange(36).reshape(-1, 3)).export(file_type=kind)
    return data


def made_seeds(folder: Path) -> list[Seed]:
    """Seeds that need no file from elsewhere."""
    import base64

    rich = rich_glb(folder)
    blob = split_glb(rich)[1]
    room = tiny.save_glb(tiny.room_meshes(), folder / "room.glb").read_bytes()
    embedded = ";base64,".join(("data:application/octet-stream", base64.b64encode(blob).decode()))
    inline = ";base64,".join(("data:image/png", base64.b64encode(picture()).decode()))
    image = {"seed.png": picture()}
    return [
        Seed("rich glb", ".glb", rich),
        Seed("room glb", ".glb", room),
        Seed("gltf and files", ".gltf", _gltf(rich, "seed.bin", "seed.png"), {"seed.bin": blob, **image}),
        Seed("gltf in one", ".gltf", _gltf(rich, embedded, inline)),
        Seed("obj", ".obj", OBJ.encode(), {"seed.mtl": MTL.encode(), **image}),
        Seed("ascii ply", ".ply", PLY.encode()),
        Seed("textured ply", ".ply", UV_PLY.encode(), image),
        Seed("binary ply", ".ply", _binary("ply")),
        Seed("binary stl", ".stl", _binary("stl")),
        Seed("ascii stl", ".stl", STL.encode()),
        Seed("off", ".off", OFF.encode()),
    ]
