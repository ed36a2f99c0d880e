"""GLB or glTF bytes -> a checked JSON tree and one block of binary data.

Types, bounds and references of all keys that are read are checked before anything of a file is used. A key with the
value null counts as missing.
"""

import base64
import importlib.util
import json
import struct
from dataclasses import dataclass, field
from functools import cache
from graphlib import CycleError, TopologicalSorter
from types import GenericAlias
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field, ValidationError, ValidationInfo, create_model

from framearray_cli.base.errors import SceneError
from framearray_cli.base.extras import install_command
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.table import Table, fail

from ..assets import AssetError, Assets, Limit, shorten

Tree = dict[str, Any]

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MOST_SHOWN = 3  # problems per file; further ones are mostly the same
LARGEST = 2**53  # a double does not hold all whole numbers beyond
LARGEST_ANGLE = np.pi / 2 + 1e-6  # radians, of the cone of a spot; rounded to float32 it may be above a right angle
TRIANGLES = (4, 5, 6)  # modes: list, strip, fan

Size: TypeAlias = Annotated[int, Field(ge=0, le=LARGEST)]


def _check_gltf(tree: Tree, limit: Limit) -> None:
    """Refuse a tree that breaks the format: name the first problems and their places."""
    counts = {key: len(value) for key, value in tree.items() if isinstance(value, list)}
    try:
        kind_of("file").model_validate(tree, context=counts)
    except ValidationError as error:
        problems = problems_of(error, kind_of("file"), MOST_SHOWN)
        raise SceneError(f"broken glTF: {'; '.join(problems)}; export it anew") from error
    sizes = (_row(accessor) * accessor["count"] for accessor in tree.get("accessors") or [])
    limit.take("accessors", sum(sizes))


class _Object(Table):
    """An object of the file; keys that are not read may hold anything."""

    model_config = ConfigDict(extra="ignore", defer_build=True)


def checked_entry(place: str, entry: object, kind: str) -> Tree:
    """Return a camera or a light of the file, which `_check_gltf` leaves to this function: others are read without it.

    Args:
        place: its path in the file, for messages.
        kind: its type, see `kind_of`.

    Raises:
        ValueError: names the path of the first problem.
    """
    if not isinstance(entry, dict):
        raise ValueError(f"{place}: missing" if entry is None else f"{place}: expected a table")
    try:
        kind_of(kind).model_validate(entry)
    except ValidationError as error:
        raise ValueError(f"{place}.{problems_of(error, kind_of(kind), 1)[0]}") from error
    return entry


def entry_of(table: object, number: object) -> object:
    """Return an entry of a list of the file, neither of which is checked; None if it is missing."""
    if isinstance(table, list) and type(number) is int and 0 <= number < len(table):
        return table[number]
    return None


def tree_of(value: object) -> Tree:
    """Return an object of the file that is not checked; an empty one if it is missing or something else."""
    return value if isinstance(value, dict) else {}


def _number_of(key: str) -> Any:
    """The index of an entry of a list."""

    def check(value: int, info: ValidationInfo) -> int:
        count = (info.context or {}).get(key, 0)
        if value >= count and (count or key != "scenes"):  # no scene is reported in clearer words later
            wanted = f"the number of one of {count} {key}, from 0" if count else f"none, as there are no {key}"
            fail([((), f"expected {wanted}, got {value}")])
        return value

    return Annotated[Size, AfterValidator(check)]


_TYPES: dict[str, Any] = {
    "float": float,
    "str": str,
    "size": Size,
    "angle": Annotated[float, Field(ge=0, le=LARGEST_ANGLE)],
    "component": Literal[5120, 5121, 5122, 5123, 5125, 5126],
    "light_type": Literal["point", "directional", "spot"],
    "mode": Annotated[int, Field(ge=0, le=6)],
    "shape": Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"],
    "stride": Annotated[int, Field(ge=1, le=2**16)],
    "unsigned": Literal[5121, 5123, 5125],
}
# Objects of a file: each key that is read, "!" if it is needed, and its type. "float3" is a list of three numbers, "[]"
# a list of a type, "{}" a map from texts to it, and "#nodes" the number of an entry of the file's list of nodes.
_OBJECTS = {
    "file": "asset:anything extensionsUsed:str[] scene:#scenes scenes:scene[] nodes:node[] meshes:mesh[] skins:skin[] "
    "accessors:accessor[] bufferViews:view[] buffers:buffer[] materials:material[] textures:texture[] images:image[] "
    "samplers:sampler[] animations:animation[]",
    "anything": "",
    "scene": "nodes:#nodes[]",
    "node": "children:#nodes[] mesh:#meshes skin:#skins weights:float[] matrix:float16 translation:float3 "
    "rotation:float4 scale:float3 extensions:node_extensions",
    "node_extensions": "EXT_mesh_gpu_instancing:instancing",
    "instancing": "attributes!:#accessors{}",
    "mesh": "primitives!:primitive[] weights:float[]",
    "primitive": "attributes!:#accessors{} indices:#accessors material:#materials targets:#accessors{}[] mode:mode "
    "extensions:primitive_extensions",
    "primitive_extensions": "KHR_draco_mesh_compression:draco",
    "draco": "bufferView!:#bufferViews attributes!:size{}",
    "skin": "joints!:#nodes[] inverseBindMatrices:#accessors",
    "accessor": "bufferView:#bufferViews byteOffset:size componentType!:component count!:size type!:shape "
    "sparse:sparse",
    "sparse": "count!:size indices!:sparse_indices values!:sparse_values",
    "sparse_indices": "bufferView!:#bufferViews byteOffset:size componentType!:unsigned",
    "sparse_values": "bufferView!:#bufferViews byteOffset:size",
    "view": "buffer!:#buffers byteOffset:size byteLength!:size byteStride:stride",
    "buffer": "byteLength!:size uri:str",
    "material": "pbrMetallicRoughness:metal alphaMode:str alphaCutoff:float emissiveFactor:float3 emissiveTexture:use "
    "normalTexture:normal_use extensions:material_extensions",
    "metal": "metallicFactor:float roughnessFactor:float baseColorFactor:float4 baseColorTexture:use "
    "metallicRoughnessTexture:use",
    "use": "index!:#textures texCoord:size extensions:use_extensions",
    "normal_use": "index!:#textures texCoord:size extensions:use_extensions scale:float",
    "use_extensions": "KHR_texture_transform:moved",
    "moved": "offset:float2 scale:float2 rotation:float texCoord:size",
    "material_extensions": "KHR_materials_pbrSpecularGlossiness:glossy KHR_materials_transmission:transmission "
    "KHR_materials_ior:ior KHR_materials_volume:volume",
    "glossy": "diffuseFactor:float4 specularFactor:float3 glossinessFactor:float diffuseTexture:use "
    "specularGlossinessTexture:use",
    "transmission": "transmissionFactor:float",
    "ior": "ior:float",
    "volume": "thicknessFactor:float attenuationDistance:float attenuationColor:float3",
    "texture": "source:#images sampler:#samplers extensions:texture_extensions",
    "texture_extensions": "EXT_texture_webp:webp",
    "webp": "source:#images",
    "image": "uri:str bufferView:#bufferViews mimeType:str",
    "sampler": "wrapS:size wrapT:size",
    "animation": "channels:channel[] samplers:curve[]",
    "channel": "sampler!:size target!:target",
    "target": "node:#nodes path!:str",
    "curve": "input!:#accessors output!:#accessors interpolation:str",
    "perspective": "yfov!:float aspectRatio:float",
    "orthographic": "xmag:float ymag!:float",
    "light": "type!:light_type intensity:float color:float3 spot:spot",  # of KHR_lights_punctual
    "spot": "innerConeAngle:angle outerConeAngle:angle",
}


@cache
def kind_of(name: str) -> Any:
    """The type of a name in the tables."""
    if name.endswith("[]"):
        return GenericAlias(list, (kind_of(name[:-2]),))
    if name.endswith("{}"):
        return GenericAlias(dict, (str, kind_of(name[:-2])))
    if name.startswith("#"):
        return _number_of(name[1:])
    if (count := name.removeprefix("float")).isdigit():
        return Annotated[list[float], Field(min_length=int(count), max_length=int(count))]
    if name in _TYPES:
        return _TYPES[name]
    fields: dict[str, Any] = {}
    for entry in _OBJECTS[name].split():
        key, kind = entry.split(":")
        fields[key.rstrip("!")] = (kind_of(kind), ... if key.endswith("!") else None)
    return create_model("Object", __base__=_Object, **fields)


def _row(accessor: Tree) -> int:
    """Bytes per value of an accessor."""
    return WIDTHS[accessor["type"]] * np.dtype(COMPONENTS[accessor["componentType"]]).itemsize


MAGIC = b"glTF"
DRACO = "KHR_draco_mesh_compression"
JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942


@dataclass(slots=True)
class Gltf:
    """A glTF file in memory: its JSON and all its buffers as one block."""

    tree: Tree
    blob: bytes
    _read: dict[int, NDArray[Any]] = field(default_factory=dict)  # accessors; each is read once

    def items(self, key: str) -> list[Tree]:
        """A top-level list of the JSON; empty if it is missing."""
        found: list[Tree] = self.tree.get(key) or []
        return found

    def view_bytes(self, index: int) -> bytes:
        """The bytes of a buffer view."""
        view = self.tree["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.blob[start : start + view["byteLength"]]

    def read_accessor(self, index: int) -> NDArray[Any]:
        """Read an accessor: (count, width) values. Normalised integers become floats; sparse values are filled in."""
        if index not in self._read:
            self._read[index] = self._values(index)
        return self._read[index]

    def _values(self, index: int) -> NDArray[Any]:
        accessor = self.tree["accessors"][index]
        kind, width, count = accessor["componentType"], WIDTHS[accessor["type"]], int(accessor["count"])
        values = np.zeros((count, width), COMPONENTS[kind])
        if "bufferView" in accessor:
            values = self._rows(accessor, kind, count, width)
        if (sparse := accessor.get("sparse")) is not None:
            where, n = sparse["indices"], int(sparse["count"])
            places = self._rows(where, where["componentType"], n, 1)[:, 0]
            if places.size and places.max() >= count:
                raise ValueError(f"accessors[{index}]: expected sparse places below {count}, got {places.max()}")
            values[places] = self._rows(sparse["values"], kind, n, width)
        return normalise(values, accessor)

    def _rows(self, place: Tree, kind: int, count: int, width: int) -> NDArray[Any]:
        """Copy strided data at a place of a view to (count, width); raise ValueError if the view is too short."""
        dtype, view = np.dtype(COMPONENTS[kind]).newbyteorder("<"), place["bufferView"]
        row = width * dtype.itemsize
        stride = int(self.tree["bufferViews"][view].get("byteStride") or row)
        data, offset = self.view_bytes(view), place.get("byteOffset", 0) if count else 0
        if count and offset + (count - 1) * stride + row > len(data):
            raise ValueError(f"bufferViews[{view}] is too short for {count} elements")
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize)).copy()


def normalise(values: NDArray[Any], accessor: Tree) -> NDArray[Any]:
    """Convert the values of an accessor: integers that encode numbers from 0 or -1 to 1 become these."""
    if accessor.get("normalized") and values.dtype.kind in "iu":
        largest = 2.0 ** (8 * values.dtype.itemsize - (values.dtype.kind == "i")) - 1.0
        return np.asarray(np.maximum(values.astype(np.float64) / largest, -1.0))
    return np.asarray(values)


def open_gltf(data: bytes, assets: Assets) -> Gltf:
    """Read the JSON and all buffers of a GLB or glTF file.

    Raises:
        ValueError: not glTF 2, cut short, or a buffer is shorter than it says.
        SceneError: the JSON is invalid, the geometry is compressed, there is no scene, or the nodes form no trees.
        AssetError: a buffer file is missing.
    """
    text, binary = _split_glb(data) if data[:4] == MAGIC else (data, None)
    tree = _parse_json(text)
    asset = tree.get("asset")
    version = str(asset.get("version", "2.0")) if isinstance(asset, dict) else "2.0"
    if not version.startswith("2"):
        raise ValueError(f"expected glTF 2, got version {version[:10]}; convert it")
    _check_gltf(tree, assets.limit)
    starts, blocks, size = [], [], 0
    for index, buffer in enumerate(tree.get("buffers") or []):
        uri, length = buffer.get("uri"), buffer["byteLength"]
        block = uri_bytes(uri, assets) if uri is not None else binary if index == 0 else None
        if block is None:
            raise ValueError(f"buffers[{index}] has no data")
        if len(block) < length:
            raise ValueError(f"buffers[{index}]: expected {length} bytes, got {len(block)}")
        padded = block[:length] + b"\0" * (-length % 4)
        starts.append(size)
        blocks.append(padded)
        size += len(padded)
    for view in tree.get("bufferViews") or []:
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    gltf = Gltf(tree, b"".join(blocks))
    _check_readable(gltf)
    return gltf


def _check_readable(gltf: Gltf) -> None:
    """Refuse a file that would load as nothing or as garbage."""
    used = set(gltf.tree.get("extensionsUsed") or [])
    for meshopt in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
        if meshopt in used:
            raise SceneError(
                f"the geometry is compressed with {meshopt}, which cannot be read; export without it, or unpack it: "
                "gltf-transform copy packed.glb unpacked.glb"
            )
    if DRACO in used and importlib.util.find_spec("DracoPy") is None:
        raise SceneError(
            "the geometry is compressed with Draco; export without it, or install DracoPy with: "
            + install_command("[draco]")
        )
    if not gltf.items("scenes"):
        raise SceneError("expected a scene in the file, got none; nothing says which nodes to show")
    children = {index: node.get("children") or [] for index, node in enumerate(gltf.items("nodes"))}
    try:
        TopologicalSorter(children).prepare()
    except CycleError as error:
        raise SceneError(f"nodes[{min(error.args[1])}] is below itself: the node graph has a cycle") from error
    every = [child for some in children.values() for child in some]
    if len(set(every)) < len(every):
        raise SceneError("a node has several parents, which glTF forbids; export the file anew")


def _parse_json(text: bytes) -> Tree:
    """Parse the JSON of a glTF file, without keys whose value is null."""

    def without_null(table: Tree) -> Tree:
        return {key: value for key, value in table.items() if value is not None}

    try:
        tree = json.loads(text.decode("utf-8-sig"), object_hook=without_null if b"null" in text else None)
        if b"\\ud" in text.lower():  # half of a surrogate pair is no character, and could not be encoded later
            tree = json.loads(json.dumps(tree, ensure_ascii=False).encode(errors="replace"))
    except RecursionError as error:
        raise ValueError("lists or objects are nested too deeply") from error
    if not isinstance(tree, dict):
        raise ValueError(f"expected a JSON object, got {type(tree).__name__}")
    return tree


def _split_glb(data: bytes) -> tuple[bytes, bytes | None]:
    """Split a GLB into its JSON chunk and its binary chunk, if it has one."""
    if len(data) < 20:
        raise ValueError(f"cut short: {len(data)} bytes")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise ValueError(f"expected GLB version 2, got {version}; convert it")
    if length > len(data):
        raise ValueError(f"cut short: expected {length} bytes, got {len(data)}")
    chunks, at = dict[int, bytes](), 12  # the first of each kind
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8 : at + 8 + size]
        if len(chunk) < size:
            raise ValueError("cut short inside a chunk")
        chunks.setdefault(kind, chunk)
        at += 8 + size
    if JSON_CHUNK not in chunks:
        raise ValueError("no JSON chunk")
    return chunks[JSON_CHUNK], chunks.get(BIN_CHUNK)


def image_bytes(gltf: Gltf, index: int, assets: Assets) -> bytes:
    """Read the encoded bytes of an image.

    Raises:
        AssetError: it is missing, elsewhere, or in a format that cannot be read.
    """
    entry = gltf.tree["images"][index]
    if entry.get("mimeType") == "image/ktx2" or str(entry.get("uri")).lower().endswith(".ktx2"):
        raise AssetError(
            f"images[{index}]: KTX2 cannot be read; export PNG or JPEG, or gltf-transform ktxdecompress a.glb b.glb"
        )
    if "bufferView" in entry:
        return gltf.view_bytes(entry["bufferView"])
    return uri_bytes(entry["uri"], assets)


def uri_bytes(uri: str, assets: Assets) -> bytes:
    """Read the bytes behind a URI: embedded data, or a file next to the scene."""
    if uri.startswith("data:"):
        head, comma, data = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise AssetError(f"{shorten(head)}: expected data in base64")
        return base64.b64decode(data)
    return assets.read(uri)
