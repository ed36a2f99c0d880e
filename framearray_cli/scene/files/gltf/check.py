"""Check a glTF file before anything of it is used: types, bounds and references of all keys that a reader reads.

A key whose value is null counts as missing.
"""

from collections.abc import Iterator

import numpy as np

from framearray_cli.base.errors import SceneError
from framearray_cli.base.units import agree, counted

from ..limit import Limit
from .values import LIGHTS, Tree, extensions, list_of, map_of, number, number_of, numbers, one_of, table, text

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
