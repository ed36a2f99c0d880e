"""GLB or glTF bytes -> a checked JSON tree and one block of binary data.

Types, bounds and references of all keys that are read are checked before anything of a file is used. A check of a value
yields problems with their places. A key with the value null counts as missing.
"""

import base64
import itertools
import json
import math
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.errors import SceneError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import agree, counted

from ..assets import AssetError, Assets, Limit, shorten

Tree = dict[str, Any]
Check = Callable[[Any, str, Tree], Iterator[str]]  # value, its place, the whole tree -> problems

LARGEST_FLOAT = 1.7e308
LIGHTS = "lights"  # the list of KHR_lights_punctual, which is not at the top level


def _got(value: Any) -> str:
    return "an object" if isinstance(value, dict) else shown(value)


def _check(expected: str, good: Callable[[Any], bool]) -> Check:
    """The check of a value by itself."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not good(value):
            yield f"{place}: expected {expected}, got {_got(value)}"

    return check


def number(low: float = -math.inf, high: float = math.inf, *, whole: bool = False) -> Check:
    """A number between two bounds, both included; JSON has neither infinities nor NaN."""
    kind = "a whole number" if whole else "a number"
    bounds = f" from {low:g} to {high:g}" if math.isfinite(low + high) else f" of at least {low:g}"

    def good(value: Any) -> bool:
        is_number = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
        return is_number and abs(value) <= LARGEST_FLOAT and low <= value <= high

    return _check(kind + bounds if math.isfinite(low) else kind, good)


def numbers(count: int) -> Check:
    """A list of `count` numbers; only the first wrong one is reported."""
    one = number()

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, list) or len(value) != count:
            yield f"{place}: expected {count} numbers, got {_got(value)}"
        else:
            wrong = (problem for item in value for problem in one(item, place, tree))
            yield from itertools.islice(wrong, 1)

    return check


text = _check("text", lambda value: isinstance(value, str))


def one_of(*values: Any) -> Check:
    """One of some texts or whole numbers."""
    expected = f"{', '.join(map(str, values[:-1]))} or {values[-1]}"
    return _check(expected, lambda value: type(value) in (int, str) and value in values)


def number_of(key: str) -> Check:
    """The index of an entry of a top-level list."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        entries = _lights(tree) if key == LIGHTS else tree.get(key)
        count = len(entries) if isinstance(entries, list) else 0
        if key == "scenes" and not count:
            return  # reported in clearer words later
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < count:
            wanted = f"the number of one of {count} {key}, from 0" if count > 1 else f"0, the only one of {key}"
            yield f"{place}: expected {wanted if count else f'none, as there are no {key}'}, got {_got(value)}"

    return check


def _lights(tree: Tree) -> Any:
    """The list of lights of a tree; an empty object if the tree has none."""
    for key in ("extensions", "KHR_lights_punctual", LIGHTS):
        tree = tree.get(key) or {} if isinstance(tree, dict) else {}
    return tree


def list_of(one: Check) -> Check:
    """A list of such values."""
    return _each(list, "a list", enumerate, "[{}]", one)


def map_of(one: Check) -> Check:
    """An object with any keys, and such values."""
    return _each(dict, "an object", dict.items, ".{}", one)


def _each(kind: type, expected: str, items: Callable[[Any], Any], form: str, one: Check) -> Check:
    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, kind):
            yield f"{place}: expected {expected}, got {_got(value)}"
        else:
            for key, item in items(value):
                yield from one(item, place + form.format(key), tree)

    return check


def table(keys: Mapping[str, Check], needed: tuple[str, ...] = ()) -> Check:
    """An object whose known keys have such values and whose needed keys exist; other keys may hold anything."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, dict):
            yield f"{place or 'the file'}: expected an object, got {_got(value)}"
            return
        before = f"{place}." if place else ""
        for key in needed:
            if value.get(key) is None:
                yield f"{before}{key}: is missing"
        for key, one in keys.items():
            if value.get(key) is not None:
                yield from one(value[key], before + key, tree)

    return check


def extensions(**keys: Check) -> dict[str, Check]:
    """The key "extensions" of an object, with the extensions that are read."""
    return {"extensions": table(keys)}


COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MOST_SHOWN = 3  # problems per file; further ones are mostly the same
LARGEST = 2**53  # a double does not hold all whole numbers beyond
TRIANGLES = (4, 5, 6)  # modes: list, strip, fan
KINDS = {"POSITION": ("VEC3",), "NORMAL": ("VEC3",), "TEXCOORD": ("VEC2",), "COLOR": ("VEC3", "VEC4")}


def check_gltf(tree: Tree, limit: Limit) -> None:
    """Refuse a tree that breaks the format.

    Raises:
        SceneError: names the first problems and their places.
    """
    problems: list[str] = []
    for problem in _problems(tree):
        problems.append(problem)
        if len(problems) > MOST_SHOWN:
            break
    if problems:
        more = ["and more"] if len(problems) > MOST_SHOWN else []
        raise SceneError(f"broken glTF: {'; '.join(problems[:MOST_SHOWN] + more)}; export it anew")
    sizes = (_row(accessor) * accessor["count"] for accessor in tree.get("accessors") or [])
    limit.take("accessors", sum(sizes))


def _problems(tree: Tree) -> Iterator[str]:
    """Find all problems; check bounds only if all types are right."""
    wrong = False
    for problem in FILE(tree, "", tree):
        wrong = True
        yield problem
    if not wrong:
        yield from _views(tree)
        yield from _accessors(tree)
        yield from _primitives(tree)
        for index, animation in enumerate(tree.get("animations") or []):
            samplers = animation.get("samplers") or []
            if any(channel["sampler"] >= len(samplers) for channel in animation.get("channels") or []):
                yield f"animations[{index}]: a channel has no sampler"


SIZE = number(0, LARGEST, whole=True)
VIEW, ACCESSOR = number_of("bufferViews"), number_of("accessors")
COMPONENT = one_of(*COMPONENTS)
MOVED = table({"offset": numbers(2), "scale": numbers(2), "rotation": number(), "texCoord": SIZE})
USE = {"index": number_of("textures"), "texCoord": SIZE, **extensions(KHR_texture_transform=MOVED)}
IMAGE_USE = table(USE, ("index",))
METAL = {"metallicFactor": number(), "roughnessFactor": number(), "baseColorFactor": numbers(4)}
METAL |= {"baseColorTexture": IMAGE_USE, "metallicRoughnessTexture": IMAGE_USE}
GLOSSY = {"diffuseFactor": numbers(4), "specularFactor": numbers(3), "glossinessFactor": number()}
GLOSSY |= {"diffuseTexture": IMAGE_USE, "specularGlossinessTexture": IMAGE_USE}
MATERIAL = {
    "pbrMetallicRoughness": table(METAL),
    "alphaMode": text,
    "alphaCutoff": number(),
    "emissiveFactor": numbers(3),
    "normalTexture": table({**USE, "scale": number()}, ("index",)),
    **extensions(
        KHR_materials_pbrSpecularGlossiness=table(GLOSSY),
        KHR_materials_transmission=table({"transmissionFactor": number()}),
        KHR_materials_ior=table({"ior": number()}),
        KHR_materials_volume=table(
            {"thicknessFactor": number(), "attenuationDistance": number(), "attenuationColor": numbers(3)}
        ),
    ),
}
PRIMITIVE = {
    "attributes": map_of(ACCESSOR),
    "indices": ACCESSOR,
    "material": number_of("materials"),
    "mode": number(0, 6, whole=True),
    **extensions(KHR_draco_mesh_compression=table({"bufferView": VIEW, "attributes": map_of(SIZE)})),
}
NODE = {
    "children": list_of(number_of("nodes")),
    "mesh": number_of("meshes"),
    "camera": number_of("cameras"),
    "matrix": numbers(16),
    "translation": numbers(3),
    "rotation": numbers(4),
    "scale": numbers(3),
    **extensions(
        KHR_lights_punctual=table({"light": number_of(LIGHTS)}, ("light",)),
        EXT_mesh_gpu_instancing=table({"attributes": map_of(ACCESSOR)}, ("attributes",)),
    ),
}
SPARSE_PLACES = {"bufferView": VIEW, "byteOffset": SIZE, "componentType": one_of(5121, 5123, 5125)}
SPARSE = {
    "count": SIZE,
    "indices": table(SPARSE_PLACES, ("bufferView", "componentType")),
    "values": table({"bufferView": VIEW, "byteOffset": SIZE}, ("bufferView",)),
}
ACCESSOR_KEYS = {
    "bufferView": VIEW,
    "byteOffset": SIZE,
    "componentType": COMPONENT,
    "count": SIZE,
    "type": one_of(*WIDTHS),
    "sparse": table(SPARSE, tuple(SPARSE)),
}
VIEW_KEYS = {"buffer": number_of("buffers"), "byteOffset": SIZE, "byteLength": SIZE}
VIEW_KEYS["byteStride"] = number(1, 65536, whole=True)
CAMERA = {"type": text, "perspective": table({"yfov": number(), "aspectRatio": number()})}
LIGHT = {"type": text, "intensity": number(), "color": numbers(3)}
CHANNEL = {"sampler": SIZE, "target": table({"node": number_of("nodes"), "path": text}, ("path",))}
SAMPLER = {"input": ACCESSOR, "output": ACCESSOR, "interpolation": text}
ANIMATION = {
    "channels": list_of(table(CHANNEL, tuple(CHANNEL))),
    "samplers": list_of(table(SAMPLER, ("input", "output"))),
}
WEBP = extensions(EXT_texture_webp=table({"source": number_of("images")}))
FILE = table(
    {
        "asset": table({}),
        "extensionsUsed": list_of(text),
        "scene": number_of("scenes"),
        "scenes": list_of(table({"nodes": list_of(number_of("nodes"))})),
        "nodes": list_of(table(NODE)),
        "meshes": list_of(table({"primitives": list_of(table(PRIMITIVE, ("attributes",)))}, ("primitives",))),
        "accessors": list_of(table(ACCESSOR_KEYS, ("componentType", "count", "type"))),
        "bufferViews": list_of(table(VIEW_KEYS, ("buffer", "byteLength"))),
        "buffers": list_of(table({"byteLength": SIZE, "uri": text}, ("byteLength",))),
        "materials": list_of(table(MATERIAL)),
        "textures": list_of(table({"source": number_of("images"), "sampler": number_of("samplers"), **WEBP})),
        "images": list_of(table({"uri": text, "bufferView": VIEW, "mimeType": text})),
        "samplers": list_of(table({"wrapS": SIZE, "wrapT": SIZE})),
        "cameras": list_of(table(CAMERA, ("type",))),
        "animations": list_of(table(ANIMATION)),
        **extensions(KHR_lights_punctual=table({LIGHTS: list_of(table(LIGHT, ("type",)))})),
    },
)


def _row(accessor: Tree) -> int:
    """Bytes per value of an accessor."""
    return WIDTHS[accessor["type"]] * np.dtype(COMPONENTS[accessor["componentType"]]).itemsize


def _views(tree: Tree) -> Iterator[str]:
    """Find buffer views that reach beyond their buffer."""
    buffers = tree.get("buffers") or []
    for index, view in enumerate(tree.get("bufferViews") or []):
        end, size = (view.get("byteOffset") or 0) + view["byteLength"], buffers[view["buffer"]]["byteLength"]
        if end > size:
            yield f"bufferViews[{index}]: ends at byte {end} of a buffer of {size} bytes"


def _accessors(tree: Tree) -> Iterator[str]:
    """Find accessors that reach beyond their view, or whose values overlap."""
    views = tree.get("bufferViews") or []
    for index, accessor in enumerate(tree.get("accessors") or []):
        if accessor.get("bufferView") is None or not accessor["count"]:
            continue
        view, row = views[accessor["bufferView"]], _row(accessor)
        stride = view.get("byteStride") or row
        end = (accessor.get("byteOffset") or 0) + (accessor["count"] - 1) * stride + row
        if stride < row:
            yield f"accessors[{index}]: expected a byteStride of at least {row}, got {stride}"
        elif end > view["byteLength"]:
            values = f"{counted(accessor['count'], 'value')} {agree(accessor['count'], 'ends', 'end')}"
            yield f"accessors[{index}]: its {values} at byte {end} of {view['byteLength']}"


def _primitives(tree: Tree) -> Iterator[str]:
    """Find attributes and indices of triangles whose type no reader supports."""
    accessors = tree.get("accessors") or []
    for m, mesh in enumerate(tree.get("meshes") or []):
        for p, primitive in enumerate(mesh["primitives"]):
            if primitive.get("mode", TRIANGLES[0]) not in TRIANGLES:
                continue
            for name, accessor_number in primitive["attributes"].items():
                kinds, found = KINDS.get(name.split("_")[0]), accessors[accessor_number]["type"]
                if kinds and found not in kinds:
                    place = f"meshes[{m}].primitives[{p}].attributes.{name}"
                    yield f"{place}: expected an accessor of {' or '.join(kinds)}, got {found}"
            if primitive.get("indices") is not None:
                accessor = accessors[primitive["indices"]]
                if accessor["type"] != "SCALAR" or accessor["componentType"] not in (5121, 5123, 5125):
                    yield f"meshes[{m}].primitives[{p}].indices: expected an accessor of unsigned whole numbers"


MAGIC = b"glTF"
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
        dtype = np.dtype(COMPONENTS[accessor["componentType"]]).newbyteorder("<")
        width, count = WIDTHS[accessor["type"]], int(accessor["count"])
        values = np.zeros((count, width), dtype=dtype)
        if "bufferView" in accessor:
            values = self._rows(accessor["bufferView"], accessor.get("byteOffset", 0), dtype, count, width)
        sparse = accessor.get("sparse")
        if sparse is not None:
            where, what = sparse["indices"], sparse["values"]
            place_type = np.dtype(COMPONENTS[where["componentType"]]).newbyteorder("<")
            n = int(sparse["count"])
            places = self._rows(where["bufferView"], where.get("byteOffset", 0), place_type, n, 1)[:, 0]
            if places.size and places.max() >= count:
                raise ValueError(f"accessors[{index}]: expected sparse places below {count}, got {places.max()}")
            values = values.copy()
            values[places] = self._rows(what["bufferView"], what.get("byteOffset", 0), dtype, n, width)
        return normalise(values, accessor)

    def _rows(self, view_index: int, offset: int, dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Copy strided data to (count, width); raise ValueError if the view is too short."""
        row = width * dtype.itemsize
        stride = int(self.tree["bufferViews"][view_index].get("byteStride") or row)
        data = np.frombuffer(self.view_bytes(view_index), dtype=np.uint8)[offset:]
        if count == 0:
            return np.zeros((0, width), dtype=dtype)
        if (count - 1) * stride + row > len(data):
            raise ValueError(f"bufferViews[{view_index}] is too short for {count} elements")
        rows = np.lib.stride_tricks.as_strided(data, (count, row), (stride, 1))
        return np.ascontiguousarray(rows).view(dtype).reshape(count, width)


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
        SceneError: the JSON is invalid (`check_gltf`).
        AssetError: a buffer file is missing.
    """
    text, binary = _split_glb(data) if data[:4] == MAGIC else (data, None)
    tree = _parse_json(text)
    asset = tree.get("asset")
    version = str(asset.get("version", "2.0")) if isinstance(asset, dict) else "2.0"
    if not version.startswith("2"):
        raise ValueError(f"expected glTF 2, got version {version[:10]}; convert it")
    check_gltf(tree, assets.limit)
    starts, blocks, size = [], [], 0
    for index, buffer in enumerate(tree.get("buffers") or []):
        block = _buffer(buffer, index, binary, assets)
        padded = block + b"\0" * (-len(block) % 4)
        starts.append(size)
        blocks.append(padded)
        size += len(padded)
    for view in tree.get("bufferViews") or []:
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    return Gltf(tree, b"".join(blocks))


def _parse_json(text: bytes) -> Tree:
    """Parse the JSON of a glTF file, without keys whose value is null."""
    try:
        tree = json.loads(text.decode("utf-8-sig"), object_hook=_without_null if b"null" in text else None)
        if b"\\ud" in text.lower():  # half of a surrogate pair is no character, and could not be encoded later
            tree = json.loads(json.dumps(tree, ensure_ascii=False).encode(errors="replace"))
    except RecursionError as error:
        raise ValueError("lists or objects are nested too deeply") from error
    if not isinstance(tree, dict):
        raise ValueError(f"expected a JSON object, got {type(tree).__name__}")
    return tree


def _without_null(table: Tree) -> Tree:
    return {key: value for key, value in table.items() if value is not None}


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


def _buffer(buffer: Tree, index: int, binary: bytes | None, assets: Assets) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        if index > 0 or binary is None:
            raise ValueError(f"buffers[{index}] has no data")
        block = binary
    else:
        block = uri_bytes(uri, assets)
    if len(block) < buffer["byteLength"]:
        raise ValueError(f"buffers[{index}]: expected {buffer['byteLength']} bytes, got {len(block)}")
    return block[: buffer["byteLength"]]


def image_bytes(gltf: Gltf, index: int, assets: Assets) -> bytes:
    """Read the encoded bytes of an image.

    Raises:
        AssetError: it is missing, elsewhere, or in a format that cannot be read.
    """
    entry = gltf.tree["images"][index]
    if entry.get("mimeType") == "image/ktx2":
        raise AssetError(f"images[{index}]: KTX2 cannot be read; export PNG or JPEG")
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
