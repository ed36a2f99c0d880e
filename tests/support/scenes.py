"""Real scenes beside the checkout (or in FRAMEARRAY_SCENES), and small GLB and OBJ files that tests make."""

import io
import json
import os
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from framearray_cli.base.openimage import oiio
from framearray_cli.scene.merge import has_area
from framearray_cli.scene.scene import Scene
from support import ROOT

COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

QUAD = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=np.float32)
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16)
# texture coordinates as glTF has them, v downwards: the corner (0, 0, 0) shows the image's lower left
QUAD_UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)


def scenes_folder() -> Path:
    """The folder of real scenes."""
    default = ROOT / "shared" / "scenes"
    # as the program names files in messages: links on the way followed
    return Path(os.environ.get("FRAMEARRAY_SCENES", default)).resolve()


def suites_folder() -> Path:
    """The folder of public test suites: beside the folder of real scenes, or that of FRAMEARRAY_SUITES."""
    return Path(os.environ.get("FRAMEARRAY_SUITES", scenes_folder().with_name("suites"))).resolve()


def shared_scene(name: str) -> Path:
    """Return a file in the folder of real scenes; skip the test where there is none."""
    file = scenes_folder() / name
    if not file.is_file():
        pytest.skip(f"no real scene {name}; set FRAMEARRAY_SCENES to the folder of scenes")
    return file


def png(texels: Any) -> bytes:
    """Encode (height, width, 3 or 4) uint8 as PNG."""
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(np.asarray(texels, dtype=np.uint8)).save(data, format="PNG")
    return data.getvalue()


def write_floats(file: Path, pixels: Any, **window: int) -> Path:
    """Write floats (height, width, channels) in the format of the suffix; `window` as in OpenImageIO's ImageSpec."""
    spec = oiio().ImageSpec(*pixels.shape[1::-1], pixels.shape[2], "float")
    for name, value in window.items():
        setattr(spec, name, value)
    output = oiio().ImageOutput.create(str(file))
    assert output.open(str(file), spec) and output.write_image(pixels.astype(np.float32)) and output.close()
    return file


def made_png(
    width: int, height: int, data: bytes, *, depth: int = 8, colour: int = 2, interlaced: int = 0,
    before: Sequence[tuple[bytes, bytes]] = (), whole: bool = True,
) -> bytes:  # fmt: skip
    """A PNG with any head and the packed bytes of any rows.

    Args:
        before: kind and content of chunks before the rows.
        whole: with a chunk that ends the file.
    """
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlaced)
    end = [(b"IEND", b"")] if whole else []
    chunks = [(b"IHDR", head), *before, (b"IDAT", zlib.compress(data)), *end]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


def glb_of(text: bytes, blob: bytes) -> bytes:
    """A GLB of its JSON and its binary chunk."""
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def split_glb(data: bytes) -> tuple[Any, bytes]:
    """The JSON tree and the binary chunk of a GLB."""
    size = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def bounds(values: Any) -> dict[str, Any]:
    """The bounds of an accessor, which glTF wants of positions; none of what JSON cannot hold."""
    array = np.asarray(values)
    if not len(array) or not np.isfinite(array).all():
        return {}
    return {"min": np.atleast_1d(array.min(0)).tolist(), "max": np.atleast_1d(array.max(0)).tolist()}


class Glb:
    """Builds a GLB: a scene of all nodes given to `node`."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.blob = b""

    def add(self, key: str, entry: dict[str, Any]) -> int:
        self.tree.setdefault(key, []).append(entry)
        return len(self.tree[key]) - 1

    def view(self, data: bytes) -> int:
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)}
        self.blob += data
        return self.add("bufferViews", view)

    def accessor(self, values: Any, **more: Any) -> int:
        array = np.ascontiguousarray(values)
        kind = KINDS[1 if array.ndim == 1 else array.shape[1]]
        entry = {"bufferView": self.view(array.tobytes()), "componentType": COMPONENTS[array.dtype.name]}
        return self.add("accessors", entry | {"count": len(array), "type": kind} | more)

    def sparse(self, places: Any, values: Any) -> dict[str, Any]:
        """Values of an accessor at some places, instead of its own there."""
        indices = {"bufferView": self.view(places.tobytes()), "componentType": COMPONENTS[places.dtype.name]}
        return {"count": len(places), "indices": indices, "values": {"bufferView": self.view(values.tobytes())}}

    def texture(self, image: bytes, **sampler: Any) -> int:
        entry = {"source": self.add("images", {"bufferView": self.view(image), "mimeType": "image/png"})}
        if sampler:
            entry["sampler"] = self.add("samplers", sampler)
        return self.add("textures", entry)

    def material(self, name: str, pbr: dict[str, Any] | None = None, **more: Any) -> int:
        base = {"metallicFactor": 0.0} | (pbr or {})
        return self.add("materials", {"name": name, "pbrMetallicRoughness": base} | more)

    def mesh(self, material: int | None = None, *, positions: Any = QUAD, faces: Any = QUAD_FACES, **more: Any) -> int:
        """One primitive; keys of `more` in capitals are attributes, the others go into the primitive."""
        attributes = {"POSITION": self.accessor(positions, **bounds(positions))}
        attributes |= {key: value for key, value in more.items() if key.isupper()}
        primitive = {"attributes": attributes} | {key: value for key, value in more.items() if not key.isupper()}
        if faces is not None:
            primitive["indices"] = self.accessor(faces)
        if material is not None:
            primitive["material"] = material
        return self.add("meshes", {"primitives": [primitive]})

    def node(self, mesh: int | None = None, **more: Any) -> int:
        """A node below the scene's root."""
        return self.root(self.add("nodes", more if mesh is None else {"mesh": mesh} | more))

    def root(self, node: int) -> int:
        """Put a node below the scene's root."""
        self.tree["scenes"][0]["nodes"].append(node)
        return node

    def part(self, name: str, colour: Any, *shapes: Any, pbr: dict[str, Any] | None = None, **more: Any) -> int:
        """A node of triangles, (n, 3, 3) each, of one material; `more` are keys of the material."""
        material = self.material(name, {"baseColorFactor": [*colour, 1.0]} | (pbr or {}), **more)
        corners = np.concatenate(shapes).reshape(-1, 3).astype(np.float32)
        return self.node(self.mesh(material, positions=corners, faces=None))

    def data(self) -> bytes:
        """The file in memory."""
        return glb_of(json.dumps({**self.tree, "buffers": [{"byteLength": len(self.blob)}]}).encode(), self.blob)

    def save(self, file: Path) -> Path:
        file.write_bytes(self.data())
        return file


def quad_of(name: str | None = None, pbr: dict[str, Any] | None = None, **more: Any) -> Glb:
    """A quad of one material, or of none; keys of `more` in capitals are attributes, the others of the material.

    Images in `pbr` become textures with the coordinates QUAD_UVS.
    """
    glb, pbr = Glb(), dict(pbr or {})
    attributes = {key: more.pop(key) for key in [*more] if key.isupper()}
    for key, value in pbr.items():
        if isinstance(value, bytes):
            pbr[key], attributes["TEXCOORD_0"] = {"index": glb.texture(value)}, QUAD_UVS
    material = None if name is None else glb.material(name, pbr, **more)
    glb.node(glb.mesh(material, **{key: glb.accessor(values) for key, values in attributes.items()}))
    return glb


def packed_quad() -> Glb:
    """A quad whose mesh DracoPy packed."""
    import DracoPy

    data = DracoPy.encode(QUAD.astype(np.float64), faces=QUAD_FACES.reshape(2, 3), preserve_order=True)
    glb, name = Glb(), "KHR_draco_mesh_compression"
    packed = {
        "bufferView": glb.view(data),
        "attributes": {"POSITION": DracoPy.decode(data).attributes[0]["unique_id"]},
    }
    position = glb.add("accessors", {"componentType": 5126, "count": 4, "type": "VEC3"})
    indices = glb.add("accessors", {"componentType": 5123, "count": 6, "type": "SCALAR"})
    primitive = {"attributes": {"POSITION": position}, "indices": indices, "extensions": {name: packed}}
    glb.node(glb.add("meshes", {"primitives": [primitive]}))
    glb.tree["extensionsUsed"] = [name]
    return glb


def write_obj(folder: Path, text: str, mtl: str | None = None) -> Path:
    """An OBJ, and the library of materials that it then names."""
    if mtl is not None:
        (folder / "a.mtl").write_text(mtl)
        text = f"mtllib a.mtl\n{text}"
    (folder / "a.obj").write_text(text)
    return folder / "a.obj"


def area_vectors(corners: Any) -> Any:
    """(n, 3) normal times area of triangles."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def check_shapes(scene: Scene) -> None:
    """Check what kernels rely on, for every file."""
    n, m = len(scene.corners), len(scene.material_names)
    assert scene.corners.shape == (n, 3, 3)
    assert n == scene.report.triangles > 0
    for array, width in ((scene.normals, 3), (scene.uvs[:n], 2), (scene.colours, 3)):
        assert array.shape in ((n, 3, width), (0, 3, width))
        assert np.isfinite(array).all()
        assert array.dtype == np.float32
    if len(scene.normals):
        np.testing.assert_allclose(np.linalg.norm(scene.normals.astype(np.float64), axis=-1), 1, atol=1e-6)
    assert np.isfinite(scene.alpha).all() and np.isfinite(scene.uvs).all() and (scene.textures >= (0, 1, 1)).all()
    assert scene.corners.dtype == scene.reflectivity.dtype == scene.specular.dtype == np.float32
    assert scene.material.dtype == scene.textures.dtype == scene.reflectivity_texture.dtype == np.int32
    assert scene.centre.dtype == np.float64
    assert np.isfinite(scene.corners).all()
    assert has_area(scene.corners).all()
    np.testing.assert_allclose(scene.corners.max(axis=(0, 1)), -scene.corners.min(axis=(0, 1)), rtol=1e-5, atol=1e-30)
    assert scene.material.min() >= 0
    assert scene.material.max() < m
    assert scene.reflectivity.shape == scene.specular.shape == (m, 3)
    assert ((scene.reflectivity >= 0) & (scene.reflectivity <= 1)).all()
    total = scene.reflectivity + scene.specular
    assert ((total >= 0) & (total <= 1 + 1e-6)).all()
    for index in (scene.reflectivity_texture, scene.specular_texture, scene.alpha_texture):
        assert index.shape == (m,)
        assert -1 <= index.min(initial=-1) <= index.max(initial=-1) < len(scene.textures)
    assert len(scene.uvs) % n == 0
    used = [scene.reflectivity_texture, scene.specular_texture, scene.alpha_texture]
    if max(int(index[scene.material].max()) for index in used) >= 0:
        assert len(scene.uvs) in range(n, len(scene.textures) * n + 1, n)  # one or several sets
    starts, rows = np.unique(scene.textures[:, 0], return_index=True)  # textures of one image share their texels
    sizes = scene.textures[rows, 1] * scene.textures[rows, 2]
    assert (scene.textures[:, 0] + scene.textures[:, 1:].prod(axis=1) <= len(scene.texels)).all()
    assert np.array_equal(starts, np.cumsum(sizes) - sizes)
    assert scene.texels.shape == (int(sizes.sum()), 4)
    masked = scene.alpha_cutoff[scene.material] > 0
    assert not masked[: scene.n_opaque].any()
    assert masked[scene.n_opaque :].all()
