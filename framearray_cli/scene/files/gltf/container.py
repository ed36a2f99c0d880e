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
        _file().model_validate(tree, context=counts)
    except ValidationError as error:
        problems = problems_of(error, _file(), MOST_SHOWN)
        raise SceneError(f"broken glTF: {'; '.join(problems)}; export it anew") from error
    sizes = (_row(accessor) * accessor["count"] for accessor in tree.get("accessors") or [])
    limit.take("accessors", sum(sizes))


class _Object(Table):
    """An object of the file; keys that are not read may hold anything."""

    model_config = ConfigDict(extra="ignore", defer_build=True)


def checked_entry(place: str, entry: object, kind: Any) -> Tree:
    """Return a camera or a light of the file, which `_check_gltf` leaves to this function: others are read without it.

    Args:
        place: its path in the file, for messages.
        kind: its type.

    Raises:
        ValueError: names the path of the first problem.
    """
    if not isinstance(entry, dict):
        raise ValueError(f"{place}: missing" if entry is None else f"{place}: expected a table")
    try:
        kind.model_validate(entry)
    except ValidationError as error:
        raise ValueError(f"{place}.{problems_of(error, kind, 1)[0]}") from error
    return entry


def entry_of(table: object, number: object) -> object:
    """Return an entry of a list of the file, neither of which is checked; None if it is missing."""
    if isinstance(table, list) and type(number) is int and 0 <= number < len(table):
        return table[number]
    return None


def tree_of(value: object) -> Tree:
    """Return an object of the file that is not checked; an empty one if it is missing or something else."""
    return value if isinstance(value, dict) else {}


def _object(needed: tuple[str, ...] = (), **kinds: Any) -> Any:
    """The type of an object with such values, of which some are needed."""
    fields: Any = {key: (kind, ... if key in needed else None) for key, kind in kinds.items()}
    return create_model("Object", __base__=_Object, **fields)


def _number_of(key: str) -> Any:
    """The index of an entry of a list."""

    def check(value: int, info: ValidationInfo) -> int:
        count = (info.context or {}).get(key, 0)
        if value >= count and (count or key != "scenes"):  # no scene is reported in clearer words later
            wanted = f"the number of one of {count} {key}, from 0" if count else f"none, as there are no {key}"
            fail([((), f"expected {wanted}, got {value}")])
        return value

    return Annotated[Size, AfterValidator(check)]


def _list_of(item: Any) -> Any:
    return GenericAlias(list, (item,))


def _map_of(item: Any) -> Any:
    return GenericAlias(dict, (str, item))


def _numbers(count: int) -> Any:
    return Annotated[list[float], Field(min_length=count, max_length=count)]


def _material() -> Any:
    """The type of a material."""
    moved = _object(offset=_numbers(2), scale=_numbers(2), rotation=float, texCoord=Size)
    use: dict[str, Any] = {"index": _number_of("textures"), "texCoord": Size}
    use["extensions"] = _object(KHR_texture_transform=moved)
    texture = _object(("index",), **use)
    metal = _object(
        metallicFactor=float,
        roughnessFactor=float,
        baseColorFactor=_numbers(4),
        baseColorTexture=texture,
        metallicRoughnessTexture=texture,
    )
    glossy = _object(
        diffuseFactor=_numbers(4),
        specularFactor=_numbers(3),
        glossinessFactor=float,
        diffuseTexture=texture,
        specularGlossinessTexture=texture,
    )
    return _object(
        pbrMetallicRoughness=metal,
        alphaMode=str,
        alphaCutoff=float,
        emissiveFactor=_numbers(3),
        emissiveTexture=texture,
        normalTexture=_object(("index",), **use, scale=float),
        extensions=_object(
            KHR_materials_pbrSpecularGlossiness=glossy,
            KHR_materials_transmission=_object(transmissionFactor=float),
            KHR_materials_ior=_object(ior=float),
            KHR_materials_volume=_object(
                thicknessFactor=float, attenuationDistance=float, attenuationColor=_numbers(3)
            ),
        ),
    )


def _primitive(accessor: Any, view: Any) -> Any:
    """The type of a primitive of a mesh."""
    draco = _object(("bufferView", "attributes"), bufferView=view, attributes=_map_of(Size))
    return _object(
        ("attributes",),
        attributes=_map_of(accessor),
        indices=accessor,
        material=_number_of("materials"),
        targets=_list_of(_map_of(accessor)),
        mode=Annotated[int, Field(ge=0, le=6)],
        extensions=_object(KHR_draco_mesh_compression=draco),
    )


def _accessor(view: Any) -> Any:
    """The type of an accessor."""
    sparse_places = _object(
        ("bufferView", "componentType"), bufferView=view, byteOffset=Size, componentType=Literal[5121, 5123, 5125]
    )
    sparse = _object(
        ("count", "indices", "values"),
        count=Size,
        indices=sparse_places,
        values=_object(("bufferView",), bufferView=view, byteOffset=Size),
    )
    return _object(
        ("componentType", "count", "type"),
        bufferView=view,
        byteOffset=Size,
        componentType=Literal[5120, 5121, 5122, 5123, 5125, 5126],
        count=Size,
        type=Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"],
        sparse=sparse,
    )


@cache
def _file() -> Any:
    """The type of a file."""
    accessor, view, node, image = map(_number_of, ("accessors", "bufferViews", "nodes", "images"))
    copies = _object(("attributes",), attributes=_map_of(accessor))
    target = _object(("path",), node=node, path=str)
    animation = _object(
        channels=_list_of(_object(("sampler", "target"), sampler=Size, target=target)),
        samplers=_list_of(_object(("input", "output"), input=accessor, output=accessor, interpolation=str)),
    )
    return _object(
        asset=_object(),
        extensionsUsed=list[str],
        scene=_number_of("scenes"),
        scenes=_list_of(_object(nodes=_list_of(node))),
        nodes=_list_of(
            _object(
                children=_list_of(node),
                mesh=_number_of("meshes"),
                skin=_number_of("skins"),
                weights=list[float],
                matrix=_numbers(16),
                translation=_numbers(3),
                rotation=_numbers(4),
                scale=_numbers(3),
                extensions=_object(EXT_mesh_gpu_instancing=copies),
            )
        ),
        meshes=_list_of(_object(("primitives",), primitives=_list_of(_primitive(accessor, view)), weights=list[float])),
        skins=_list_of(_object(("joints",), joints=_list_of(node), inverseBindMatrices=accessor)),
        accessors=_list_of(_accessor(view)),
        bufferViews=_list_of(
            _object(
                ("buffer", "byteLength"),
                buffer=_number_of("buffers"),
                byteOffset=Size,
                byteLength=Size,
                byteStride=Annotated[int, Field(ge=1, le=2**16)],
            )
        ),
        buffers=_list_of(_object(("byteLength",), byteLength=Size, uri=str)),
        materials=_list_of(_material()),
        textures=_list_of(
            _object(
                source=image,
                sampler=_number_of("samplers"),
                extensions=_object(EXT_texture_webp=_object(source=image)),
            )
        ),
        images=_list_of(_object(uri=str, bufferView=view, mimeType=str)),
        samplers=_list_of(_object(wrapS=Size, wrapT=Size)),
        animations=_list_of(animation),
    )


@cache
def lens_kinds() -> dict[str, Any]:
    """Types of the lenses of cameras, by the type of the camera."""
    return {
        "perspective": _object(("yfov",), yfov=float, aspectRatio=float),
        "orthographic": _object(("ymag",), xmag=float, ymag=float),
    }


@cache
def light_kind() -> Any:
    """The type of a light of KHR_lights_punctual."""
    angle = Annotated[float, Field(ge=0, le=LARGEST_ANGLE)]
    spot = _object(innerConeAngle=angle, outerConeAngle=angle)
    kinds = Literal["point", "directional", "spot"]
    return _object(("type",), type=kinds, intensity=float, color=_numbers(3), spot=spot)


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
    text, binary, at = None, None, 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8 : at + 8 + size]
        if len(chunk) < size:
            raise ValueError("cut short inside a chunk")
        if kind == JSON_CHUNK and text is None:
            text = chunk
        elif kind == BIN_CHUNK and binary is None:
            binary = chunk
        at += 8 + size
    if text is None:
        raise ValueError("no JSON chunk")
    return text, binary


def image_bytes(gltf: Gltf, index: int, assets: Assets) -> bytes:
    """Read the encoded bytes of an image.

    Raises:
        AssetError: it is missing, elsewhere, or in a format that cannot be read.
    """
    entry = gltf.tree["images"][index]
    if entry.get("mimeType") == "image/ktx2":
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
