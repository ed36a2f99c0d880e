"""Cameras and lights of a glTF file, and where they are at any time."""

import math
from contextlib import suppress

from ..assets import Assets
from ..staging import Stage, StageBuilder, StageCamera, StageLens, StageLight
from .check import Tree
from .container import Gltf
from .imagelight import read_image_light, scene_light
from .motion import read_motion

PUNCTUAL = "KHR_lights_punctual"
MEASURED = "EXT_lights_ies"


def read_gltf_stage(gltf: Gltf, assets: Assets) -> Stage:
    """Find the cameras and lights of the file's default scene.

    Raises:
        ValueError, KeyError, IndexError, ...: the file is broken.
    """
    motion, found = read_motion(gltf), StageBuilder(assets)
    lights_table = ((gltf.tree.get("extensions") or {}).get(PUNCTUAL) or {}).get("lights") or []
    for index in _shown(gltf):
        node = motion.nodes[index]
        if "camera" in node:
            found.add_camera(_camera(index, node, gltf.items("cameras")[node["camera"]]))
        punctual = (node.get("extensions") or {}).get(PUNCTUAL)
        if punctual is not None:
            found.add_light(_light(index, node, lights_table[punctual["light"]]))
        measured = (node.get("extensions") or {}).get(MEASURED)
        if measured is not None:
            found.add_light(_measured(index, node, measured, gltf, found))
    return found.stage(read_image_light(gltf, assets, found.notes), motion)


def count_lights(gltf: Gltf) -> int:
    """Return the number of lights that the default scene shows; 0 if they are broken, as no render needs them."""
    with suppress(LookupError, TypeError, ValueError, AttributeError):
        nodes = gltf.items("nodes")
        around = scene_light(gltf) is not None
        return around + sum(PUNCTUAL in (nodes[index].get("extensions") or {}) for index in _shown(gltf))
    return 0


def _shown(gltf: Gltf) -> list[int]:
    """Indices of the nodes that the default scene shows; each node once, even if the graph is no tree."""
    nodes, scenes = gltf.items("nodes"), gltf.items("scenes")
    waiting = list(scenes[gltf.tree.get("scene", 0)].get("nodes") or []) if scenes else []
    found: set[int] = set()
    while waiting:
        index = waiting.pop()
        if index not in found:
            found.add(index)
            waiting += nodes[index].get("children") or []
    return sorted(found)


def _camera(index: int, node: Tree, entry: Tree) -> StageCamera:
    name = str(node.get("name") or entry.get("name") or f"camera {index}")
    if entry.get("type") == "orthographic":
        wide, tall = (2 * abs(float(entry["orthographic"][key])) for key in ("xmag", "ymag"))
        return StageCamera(
            name=name, node=index, lens=StageLens(height=tall), aspect=wide / tall if wide * tall > 0 else None
        )
    lens = entry["perspective"]
    fov, aspect = math.degrees(float(lens["yfov"])), lens.get("aspectRatio")
    return StageCamera(name=name, node=index, lens=StageLens(fov_deg=fov), aspect=float(aspect) if aspect else None)


def _light(index: int, node: Tree, entry: Tree) -> StageLight:
    kind = entry["type"]
    if kind not in ("point", "directional", "spot"):
        raise ValueError(f"a light has the unknown type {kind!r}")
    strength = float(entry.get("intensity", 1.0))
    red, green, blue = (max(strength * float(channel), 0.0) for channel in entry.get("color", (1.0, 1.0, 1.0)))
    name = str(node.get("name") or entry.get("name") or f"light {index}")
    cone = _cone_deg(entry.get("spot", {})) if kind == "spot" else None
    return StageLight(name=name, node=index, kind=kind, intensity=(red, green, blue), schema=PUNCTUAL, cone_deg=cone)


def _measured(index: int, node: Tree, instance: Tree, gltf: Gltf, stage: StageBuilder) -> StageLight | None:
    """Read a lamp with a file of its light [EXT_lights_ies], or note why it cannot be used."""
    name = str(node.get("name") or f"light {index}")
    try:
        uri = gltf.tree["extensions"][MEASURED]["lights"][instance["light"]].get("uri")
        if not isinstance(uri, str) or uri.startswith("data:"):
            stage.note_light(name, "its IES file lies inside the scene file and is left out; save it next to it")
            return None
        if (found := stage.photometry(name, uri, "is left out")) is None:
            return None
        peak = found[1] * float(instance.get("multiplier", 1.0))
        red, green, blue = (max(peak * float(channel), 0.0) for channel in instance.get("color", (1.0, 1.0, 1.0)))
        return StageLight(
            name=name, node=index, kind="spot", intensity=(red, green, blue), schema=MEASURED, profile=found[0]
        )
    except (LookupError, TypeError, ValueError, AttributeError):
        stage.note_light(name, f"its {MEASURED} is broken and is left out")
    return None


def _cone_deg(spot: Tree) -> tuple[float, float]:
    """Read the angles of a spot [KHR_lights_punctual]."""
    inner, outer = float(spot.get("innerConeAngle", 0.0)), float(spot.get("outerConeAngle", math.pi / 4))
    if not 0 <= inner <= outer <= math.pi / 2 + 1e-6 or outer == 0:
        raise ValueError(f"a spot has the cone angles {inner:g} and {outer:g}, expected 0 to pi / 2, in this order")
    return math.degrees(inner), math.degrees(outer)
