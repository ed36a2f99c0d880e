"""Scene files that were made to do harm: each is small, and wants files, memory or time that it must not have."""

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
from support.scenes import QUAD, QUAD_UVS, Glb, made_png, png, quad_of

Files = dict[str, bytes]  # name -> content; the scene comes first
CORNERS = "v 0 0 0\nv 2 0 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
PICTURE = png(np.full((2, 2, 3), 200, np.uint8))
PLY = "ply\nformat {} 1.0\n{}element vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
PLY += "property list uchar int vertex_indices\nend_header\n"

ELSEWHERE = ("../secret.png", "..\\secret.png", "%2e%2e/secret.png", "/etc/passwd", "file:///etc/passwd", "/dev/zero")
ELSEWHERE += ("http://localhost:1/secret.png", "\\\\server\\share\\secret.png", "C:\\secret.png", "/dev/stdin")
NAMES = ("\ud800", "\x1b[31m red", "a\0b", "\u202e", "x" * 100_000, "\n\n\n", "é" * 500, "'\"`$(ls)", "{0}%s", "", " ")
REALS = (float("nan"), float("inf"), -float("inf"), 1e38, -3e38, 1e-45, 1e20, 1e-20, 1e-38, 0.0, 1e7)


def textured(uri: str | None = None, image: bytes = PICTURE) -> Glb:
    """A quad with a picture, embedded or elsewhere."""
    glb = quad_of("Paint", {"baseColorTexture": image})
    if uri is not None:
        glb.tree["images"][0] = {"uri": uri}
    return glb


def as_gltf(glb: Glb) -> Files:
    """A glTF with its data beside it."""
    glb.tree["buffers"] = [{"byteLength": len(glb.blob), "uri": "a.bin"}]
    return {"scene.gltf": json.dumps(glb.tree).encode(), "a.bin": glb.blob}


def as_obj(texture: str, image: bytes = PICTURE) -> Files:
    text = f"mtllib a.mtl\n{CORNERS}usemtl Paint\nf 1/1 2/2 3/3\n"
    return {"scene.obj": text.encode(), "a.mtl": f"newmtl Paint\nmap_Kd {texture}\n".encode(), "a.png": image}


def elsewhere(rng: Random) -> Files:
    """A texture, buffer or library outside the scene's folder."""
    name = rng.choice(ELSEWHERE)
    if rng.random() < 0.3:
        return as_obj(name)
    if rng.random() < 0.3:
        return {"scene.obj": f"mtllib {name}\n{CORNERS}usemtl a\nf 1 2 3\n".encode()}
    if rng.random() < 0.5:
        return as_gltf(textured(name))
    files = as_gltf(textured())
    files["scene.gltf"] = files["scene.gltf"].replace(b'"a.bin"', json.dumps(name).encode())
    return files


def png_bomb(rng: Random) -> Files:
    """A PNG of a few kilobytes with millions of pixels, or with a text or profile that unpacks to megabytes."""
    width, height = rng.choice(
        ((60_000, 60_000), (2**31 - 1, 2**31 - 1), (9_000, 9_000), (1, 2**31 - 1), (0, 0), (70_000, 3))
    )
    packed = zlib.compress(bytes(rng.choice((1_000, 20_000_000))))
    texts = ((b"zTXt", b"a\0\0" + packed), (b"iCCP", b"a\0\0" + packed), (b"iTXt", b"a\0\1\0\0\0" + packed))
    image = made_png(
        width,
        height,
        bytes(rng.choice((1_000, 20_000_000))),
        depth=rng.choice((1, 8, 16)),
        colour=rng.choice((0, 2, 3, 6)),
        interlaced=rng.choice((0, 1)),
        before=rng.choice(((), *((text,) for text in texts))),
        whole=rng.random() < 0.5,
    )
    return as_obj("a.png", image) if rng.random() < 0.5 else {"scene.glb": textured(image=image).data()}


def odd_image(rng: Random) -> Files:
    """Any kind and mode of image, by a name that says otherwise, whole or not."""
    from PIL import Image

    kind = rng.choice(("PNG", "JPEG", "GIF", "TIFF", "BMP", "TGA", "WEBP", "PPM", "EPS", "ICO", "PCX", "DDS"))
    mode = rng.choice(("RGB", "RGBA", "L", "LA", "P", "1", "CMYK", "I;16", "I", "F"))
    data = io.BytesIO()
    try:
        image = Image.new(mode, rng.choice(((1, 1), (3, 5), (1, 4000))))
        image.save(
            data, format=kind, **({"save_all": True, "append_images": [image] * 50} if kind in ("GIF", "TIFF") else {})
        )
    except (OSError, ValueError, KeyError):
        data.write(rng.randbytes(100))
    found = data.getvalue()
    if rng.random() < 0.5:
        found = found[: rng.randrange(len(found))]
    return as_obj("a.png", found) if rng.random() < 0.5 else {"scene.glb": textured(image=found).data()}


def node_graph(rng: Random) -> Files:
    """Nodes in a chain, in a ring, doubling at each level, or very many."""
    glb = Glb()
    mesh = glb.mesh()
    n = rng.choice((10, 300, 5_000))
    nodes: list[Any] = [{"mesh": mesh, "translation": [3, 0, 0], "children": [k + 1]} for k in range(n)] + [
        {"mesh": mesh}
    ]
    shape = rng.choice(("chain", "ring", "doubling", "wide", "self"))
    if shape == "ring":
        nodes[-1]["children"] = [rng.randrange(n)]
    elif shape == "doubling":
        nodes = [{"children": [k + 1, k + 1]} for k in range(n)] + [{"mesh": mesh}]
    elif shape == "wide":
        nodes = [{"children": list(range(1, n + 1))}] + [{"mesh": mesh, "translation": [k, 0, 0]} for k in range(n)]
    elif shape == "self":
        nodes[0]["children"] = [0]
    glb.tree["nodes"], glb.tree["scenes"] = nodes, [{"nodes": [0] * rng.choice((1, 1, 500))}]
    return {"scene.glb": glb.data()}


def reals(rng: Random) -> Files:
    """Positions, normals, coordinates, colours and transforms that are no numbers, or hardly."""
    glb = Glb()

    def some(values: Any) -> Any:
        values = np.array(values, np.float32)
        for _ in range(rng.choice((0, 1, 3))):
            values[rng.randrange(values.shape[0]), rng.randrange(values.shape[1])] = rng.choice(REALS)
        with np.errstate(over="ignore"):
            return glb.accessor(values * np.float32(rng.choice((1, 1, 1e-30, 1e30))))

    paint = glb.material(
        "Paint", {"baseColorTexture": {"index": glb.texture(PICTURE)}, "baseColorFactor": [rng.choice(REALS)] * 4}
    )
    more = {"TEXCOORD_0": some(QUAD_UVS), "NORMAL": some([[0, 0, 1]] * 4), "COLOR_0": some([[1, 0, 0]] * 4)}
    mesh = glb.mesh(paint, **{key: more[key] for key in more if rng.random() < 0.6})
    glb.tree["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = some(QUAD)
    matrix = [float(v) for v in np.eye(4).ravel()]
    for _ in range(rng.choice((0, 1, 2))):
        matrix[rng.randrange(16)] = rng.choice(REALS)
    glb.node(mesh, matrix=matrix)
    glb.node(glb.mesh())
    return {"scene.glb": glb.data()}


def names(rng: Random) -> Files:
    """Names that terminals, files and text formats do not like."""
    name = rng.choice(NAMES)
    glb = textured()
    glb.tree["materials"][0] |= {"name": name, "emissiveFactor": [1, 1, 1], "extensions": {name: {}}}
    glb.tree["extensionsUsed"] = [name]
    glb.tree["nodes"][0]["name"] = glb.tree["meshes"][0]["name"] = name
    glb.tree["images"][0] |= {"name": name}
    if rng.random() < 0.4:
        glb.tree["images"][0] = {"uri": name}
    if rng.random() < 0.3:
        glb.tree["meshes"][0]["extras"] = {name: name, "faces": [], "process": True}
    if rng.random() < 0.4:
        text = f"mtllib {name}\nmtllib a.mtl\n{CORNERS}usemtl {name}\nf 1 2 3\no {name}\n"
        return {
            "scene.obj": text.encode("utf-8", "surrogatepass"),
            "a.mtl": f"newmtl {name}\nKe 1 1 1\n".encode("utf-8", "surrogatepass"),
        }
    return {"scene.glb": glb.data()}


def counts(rng: Random) -> Files:
    """Numbers of things that are not there."""
    n = rng.choice((0, -1, 4, 10**6, 2**31 - 1, 2**32, 2**63, 10**30))
    ply = PLY.format(rng.choice(("ascii", "binary_little_endian", "binary_big_endian")), "", n, rng.choice((1, n)))
    stl = bytes(80) + struct.pack("<I", n % 2**32) + bytes(50 * rng.choice((0, 3)))
    glb = textured()
    entry = rng.choice(glb.tree["accessors"] + glb.tree["bufferViews"])
    entry[rng.choice(("count", "byteOffset", "byteLength", "byteStride"))] = n
    ends = glb.data()
    found = [{"scene.ply": (ply + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").encode()}, {"scene.stl": stl}]
    found += [{"scene.off": f"OFF\n{n} {n} 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode()}, {"scene.glb": ends}]
    found += [{"scene.glb": ends[:8] + struct.pack("<I", n % 2**32) + ends[12:]}]
    found += [{"scene.glb": ends[:12] + struct.pack("<I", n % 2**32) + ends[16:]}]
    return rng.choice(found)


def packed(rng: Random) -> Files:
    """Archives that unpack to very much, and XML that grows or reads files."""
    xml = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
    xml += '<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;"><!ENTITY d SYSTEM "file:///etc/passwd">]><a>&c;&d;</a>'
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", xml if rng.random() < 0.5 else bytes(rng.choice((10, 50_000_000))))
        archive.writestr(rng.choice(("../../a.dae", "/etc/a.dae", "a.dae")), xml)
    suffix = rng.choice(("3mf", "zae", "3dxml", "dae", "xaml", "zip", "glb", "obj"))
    return {f"scene.{suffix}": xml.encode() if suffix in ("dae", "xaml") else data.getvalue()}


def nested(rng: Random) -> Files:
    """JSON that is deep, long, repeated, or not JSON."""
    n = rng.choice((50, 5_000, 200_000))
    whole = json.dumps(textured().tree)
    texts = ("[" * n, '{"a":' * n, whole[:-1] + ', "extras": ' + "[" * n + "]" * n + "}", whole[:-1] + ', "nodes": []}')
    texts += (whole.replace("4", "4" * min(n, 5_000), 1), whole.replace("0", "1e999", 1), whole.replace("0", "-0", 1))
    texts += (
        whole.replace('"', "'"),
        whole + whole,
        "null",
        "[]",
        "3",
        '""',
        whole.replace("true", "nul"),
        "\ufeff" + whole,
    )
    return {"scene.gltf": rng.choice(texts).encode(), "a.bin": b""}


HOSTILE: dict[str, Callable[[Random], Files]] = {
    "files elsewhere": elsewhere,
    "image bombs": png_bomb,
    "odd images": odd_image,
    "node graphs": node_graph,
    "numbers that are none": reals,
    "odd names": names,
    "counts of things not there": counts,
    "packed files and XML": packed,
    "deep JSON": nested,
}
