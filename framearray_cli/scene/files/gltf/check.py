"""Checks of a glTF file before anything of it is used: types, bounds and references of all keys that are read.

A check of a value yields problems with their places. A key whose value is null counts as missing.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from framearray_cli.base.errors import SceneError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import agree, counted

from ..assets import Limit

Tree = dict[str, Any]
Check = Callable[[Any, str, Tree], Iterator[str]]  # value, its place, the whole tree -> problems

LARGEST_FLOAT = 1.7e308
LIGHTS = "lights"  # the list of KHR_lights_punctual, which is not at the top level


def _got(value: Any) -> str:
    return "an object" if isinstance(value, dict) else shown(value)


def number(low: float = -math.inf, high: float = math.inf, *, whole: bool = False) -> Check:
    """A number between two bounds, both included; JSON has neither infinities nor NaN."""
    kind = "a whole number" if whole else "a number"
    bounds = f" from {low:g} to {high:g}" if math.isfinite(low + high) else f" of at least {low:g}"
    expected = kind + bounds if math.isfinite(low) else kind

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        good = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
        good = good and abs(value) <= LARGEST_FLOAT
        if not good or value < low or value > high:
            yield f"{place}: expected {expected}, got {_got(value)}"

    return check


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


def text(value: Any, place: str, tree: Tree) -> Iterator[str]:
    """Text."""
    if not isinstance(value, str):
        yield f"{place}: expected text, got {_got(value)}"


def one_of(*values: Any) -> Check:
    """One of some texts or whole numbers."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, int | str) or isinstance(value, bool) or value not in values:
            yield f"{place}: expected {', '.join(map(str, values[:-1]))} or {values[-1]}, got {_got(value)}"

    return check


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

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, list):
            yield f"{place}: expected a list, got {_got(value)}"
        else:
            for index, item in enumerate(value):
                yield from one(item, f"{place}[{index}]", tree)

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


def map_of(one: Check) -> Check:
    """An object with any keys, and such values."""

    def check(value: Any, place: str, tree: Tree) -> Iterator[str]:
        if not isinstance(value, dict):
            yield f"{place}: expected an object, got {_got(value)}"
        else:
            for key, item in value.items():
                yield from one(item, f"{place}.{key}", tree)

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
