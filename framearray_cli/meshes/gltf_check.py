"""What a glTF file must say for its readers: types, bounds and references, checked before anything of it is used.

Only keys that some reader reads are checked; a key with the value null counts as missing.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ..errors import SceneError
from ..jobvalues import shown
from .limit import Limit

Tree = dict[str, Any]
Check = Callable[[Any, str, Tree], Iterator[str]]  # value, its place, the whole tree -> problems

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MOST_SHOWN = 3  # problems of a file; the next ones are most often the same
LARGEST_FLOAT = 1.7e308
LARGEST = 2**53  # whole numbers beyond are not whole in JSON
LIGHTS = "lights"  # of the extension, beside the top-level lists
TRIANGLES = (4, 5, 6)  # modes: list, strip, fan
KINDS = {"POSITION": ("VEC3",), "NORMAL": ("VEC3",), "TEXCOORD": ("VEC2",), "COLOR": ("VEC3", "VEC4")}


def check_gltf(tree: Tree, limit: Limit) -> None:
    """Refuse a tree that cannot be read as it is.

    Raises:
        SceneError: tells the first problems, with their places.
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
    """All problems; those of bounds only where types are right."""
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


def _got(value: Any) -> str:
    return "an object" if isinstance(value, dict) else shown(value)


def _number(low: float = -math.inf, high: float = math.inf, *, whole: bool = False) -> Check:
    kind = "a whole number" if whole else "a number"
    bounds = f" from {low:g} to {high:g}" if math.isfinite(low + high) else f" of at least {low:g}"
    expected = kind + bounds if math.isfinite(low) else kind

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        good = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
        good = good and abs(value) <= LARGEST_FLOAT  # neither infinite nor NaN, which are no JSON
        if not good or value < low or value > high:
            yield f"{place}: expected {expected}, got {_got(value)}"

    return check


def _numbers(count: int) -> Check:
    one = _number()

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, list) or len(value) != count:
            yield f"{place}: expected {count} numbers, got {_got(value)}"
        else:
            wrong = (problem for item in value for problem in one(item, place, tree))
            yield from itertools.islice(wrong, 1)

    return check


def _text(value: Any, place: str, tree: Tree) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{place}: expected text, got {_got(value)}"


def _one_of(*values: Any) -> Check:
    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, int | str) or isinstance(value, bool) or value not in values:
            yield f"{place}: expected {', '.join(map(str, values[:-1]))} or {values[-1]}, got {_got(value)}"

    return check


def _number_of(key: str) -> Check:
    """The number of an entry of a top-level list, from 0."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        entries = _lights(tree) if key == LIGHTS else tree.get(key)
        count = len(entries) if isinstance(entries, list) else 0
        if key == "scenes" and not count:
            return  # told in a better way later
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < count:
            yield f"{place}: expected the number of one of {count} {key}, from 0, got {_got(value)}"

    return check


def _lights(tree: Tree) -> Any:
    """The lights of a tree, whatever it is like."""
    for key in ("extensions", "KHR_lights_punctual", LIGHTS):
        tree = tree.get(key) or {} if isinstance(tree, dict) else {}
    return tree


def _list(one: Check) -> Check:
    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, list):
            yield f"{place}: expected a list, got {_got(value)}"
        else:
            for index, item in enumerate(value):
                yield from one(item, f"{place}[{index}]", tree)

    return check


def _table(keys: Mapping[str, Check], needed: tuple[str, ...] = ()) -> Check:
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


def _map(one: Check) -> Check:
    """An object with whatever keys."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, dict):
            yield f"{place}: expected an object, got {_got(value)}"
        else:
            for key, item in value.items():
                yield from one(item, f"{place}.{key}", tree)

    return check


def _extensions(**keys: Check) -> dict[str, Check]:
    return {"extensions": _table(keys)}


SIZE = _number(0, LARGEST, whole=True)
VIEW, ACCESSOR = _number_of("bufferViews"), _number_of("accessors")
COMPONENT = _one_of(*COMPONENTS)
MOVED = _table({"offset": _numbers(2), "scale": _numbers(2), "rotation": _number(), "texCoord": SIZE})
IMAGE_USE = _table(
    {"index": _number_of("textures"), "texCoord": SIZE, **_extensions(KHR_texture_transform=MOVED)}, ("index",)
)
METAL = {"metallicFactor": _number(), "roughnessFactor": _number(), "baseColorFactor": _numbers(4)}
METAL |= {"baseColorTexture": IMAGE_USE, "metallicRoughnessTexture": IMAGE_USE}
GLOSSY = {"diffuseFactor": _numbers(4), "specularFactor": _numbers(3), "glossinessFactor": _number()}
GLOSSY |= {"diffuseTexture": IMAGE_USE, "specularGlossinessTexture": IMAGE_USE}
MATERIAL = {
    "pbrMetallicRoughness": _table(METAL),
    "alphaMode": _text,
    "alphaCutoff": _number(),
    "emissiveFactor": _numbers(3),
    **_extensions(
        KHR_materials_pbrSpecularGlossiness=_table(GLOSSY),
        KHR_materials_transmission=_table({"transmissionFactor": _number()}),
    ),
}
PRIMITIVE = {
    "attributes": _map(ACCESSOR),
    "indices": ACCESSOR,
    "material": _number_of("materials"),
    "mode": _number(0, 6, whole=True),
    **_extensions(KHR_draco_mesh_compression=_table({"bufferView": VIEW, "attributes": _map(SIZE)})),
}
NODE = {
    "children": _list(_number_of("nodes")),
    "mesh": _number_of("meshes"),
    "camera": _number_of("cameras"),
    "matrix": _numbers(16),
    "translation": _numbers(3),
    "rotation": _numbers(4),
    "scale": _numbers(3),
    **_extensions(
        KHR_lights_punctual=_table({"light": _number_of(LIGHTS)}, ("light",)),
        EXT_mesh_gpu_instancing=_table({"attributes": _map(ACCESSOR)}, ("attributes",)),
    ),
}
SPARSE_PLACES = {"bufferView": VIEW, "byteOffset": SIZE, "componentType": _one_of(5121, 5123, 5125)}
SPARSE = {
    "count": SIZE,
    "indices": _table(SPARSE_PLACES, ("bufferView", "componentType")),
    "values": _table({"bufferView": VIEW, "byteOffset": SIZE}, ("bufferView",)),
}
ACCESSOR_KEYS = {
    "bufferView": VIEW,
    "byteOffset": SIZE,
    "componentType": COMPONENT,
    "count": SIZE,
    "type": _one_of(*WIDTHS),
    "sparse": _table(SPARSE, tuple(SPARSE)),
}
VIEW_KEYS = {"buffer": _number_of("buffers"), "byteOffset": SIZE, "byteLength": SIZE}
VIEW_KEYS["byteStride"] = _number(1, 65536, whole=True)
CAMERA = {"type": _text, "perspective": _table({"yfov": _number(), "aspectRatio": _number()})}
LIGHT = {"type": _text, "intensity": _number(), "color": _numbers(3)}
CHANNEL = {"sampler": SIZE, "target": _table({"node": _number_of("nodes"), "path": _text}, ("path",))}
SAMPLER = {"input": ACCESSOR, "output": ACCESSOR, "interpolation": _text}
ANIMATION = {
    "channels": _list(_table(CHANNEL, tuple(CHANNEL))),
    "samplers": _list(_table(SAMPLER, ("input", "output"))),
}
WEBP = _extensions(EXT_texture_webp=_table({"source": _number_of("images")}))
FILE = _table(
    {
        "asset": _table({}),
        "extensionsUsed": _list(_text),
        "scene": _number_of("scenes"),
        "scenes": _list(_table({"nodes": _list(_number_of("nodes"))})),
        "nodes": _list(_table(NODE)),
        "meshes": _list(_table({"primitives": _list(_table(PRIMITIVE, ("attributes",)))}, ("primitives",))),
        "accessors": _list(_table(ACCESSOR_KEYS, ("componentType", "count", "type"))),
        "bufferViews": _list(_table(VIEW_KEYS, ("buffer", "byteLength"))),
        "buffers": _list(_table({"byteLength": SIZE, "uri": _text}, ("byteLength",))),
        "materials": _list(_table(MATERIAL)),
        "textures": _list(_table({"source": _number_of("images"), "sampler": _number_of("samplers"), **WEBP})),
        "images": _list(_table({"uri": _text, "bufferView": VIEW, "mimeType": _text})),
        "samplers": _list(_table({"wrapS": SIZE, "wrapT": SIZE})),
        "cameras": _list(_table(CAMERA, ("type",))),
        "animations": _list(_table(ANIMATION)),
        **_extensions(KHR_lights_punctual=_table({LIGHTS: _list(_table(LIGHT, ("type",)))})),
    },
)


def _row(accessor: Tree) -> int:
    """Bytes of one value of an accessor."""
    return WIDTHS[accessor["type"]] * np.dtype(COMPONENTS[accessor["componentType"]]).itemsize


def _views(tree: Tree) -> Iterator[str]:
    """Buffer views that reach beyond their buffer."""
    buffers = tree.get("buffers") or []
    for index, view in enumerate(tree.get("bufferViews") or []):
        end, size = (view.get("byteOffset") or 0) + view["byteLength"], buffers[view["buffer"]]["byteLength"]
        if end > size:
            yield f"bufferViews[{index}]: ends at byte {end} of a buffer of {size} bytes"


def _accessors(tree: Tree) -> Iterator[str]:
    """Accessors that reach beyond their view, or whose values overlap."""
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
            yield f"accessors[{index}]: its {accessor['count']} values end at byte {end} of {view['byteLength']}"


def _primitives(tree: Tree) -> Iterator[str]:
    """Attributes of triangles that are of another type than readers take."""
    accessors = tree.get("accessors") or []
    for m, mesh in enumerate(tree.get("meshes") or []):
        for p, primitive in enumerate(mesh["primitives"]):
            if primitive.get("mode", TRIANGLES[0]) not in TRIANGLES:
                continue
            for name, number in primitive["attributes"].items():
                kinds, found = KINDS.get(name.split("_")[0]), accessors[number]["type"]
                if kinds and found not in kinds:
                    place = f"meshes[{m}].primitives[{p}].attributes.{name}"
                    yield f"{place}: expected an accessor of {' or '.join(kinds)}, got {found}"
            if primitive.get("indices") is not None:
                accessor = accessors[primitive["indices"]]
                if accessor["type"] != "SCALAR" or accessor["componentType"] not in (5121, 5123, 5125):
                    yield f"meshes[{m}].primitives[{p}].indices: expected an accessor of unsigned whole numbers"
