"""Cameras and lights of a glTF file, and where they are at any time."""

import math
from contextlib import suppress

from framearray_cli.job.camera import LEAST_FOV, LEAST_HEIGHT, MOST_FOV, MOST_HEIGHT
from framearray_cli.job.ies import read_photometry
from framearray_cli.job.rowfile import RowFileError

from ..assets import AssetError, Assets
from ..staging import Stage, StageCamera, StageLens, StageLight
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
    motion = read_motion(gltf)
    lights_table = ((gltf.tree.get("extensions") or {}).get(PUNCTUAL) or {}).get("lights") or []
    cameras: list[StageCamera] = []
    lights: list[StageLight] = []
    notes: list[str] = []
    for index in _shown(gltf):
        node = motion.nodes[index]
        if "camera" in node:
            camera = _camera(index, node, gltf.items("cameras")[node["camera"]], notes)
            cameras += [camera] if camera else []
        punctual = (node.get("extensions") or {}).get(PUNCTUAL)
        if punctual is not None:
            lights.append(_light(index, node, lights_table[punctual["light"]]))
        measured = (node.get("extensions") or {}).get(MEASURED)
        if measured is not None:
            light = _measured(index, node, measured, gltf, assets, notes)
            lights += [light] if light else []
    environment = read_image_light(gltf, assets, notes)
    return Stage(
        cameras=tuple(cameras), lights=tuple(lights), environment=environment, motion=motion, notes=tuple(notes)
    )


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


def _camera(index: int, node: Tree, entry: Tree, notes: list[str]) -> StageCamera | None:
    """Read a camera, or note why it cannot be used."""
    name = str(node.get("name") or entry.get("name") or f"camera {index}")
    if entry.get("type") == "orthographic":
        lens = entry["orthographic"]
        wide, tall = (2 * abs(float(lens[key])) for key in ("xmag", "ymag"))
        if not (LEAST_HEIGHT <= tall <= MOST_HEIGHT and 0 < wide <= MOST_HEIGHT):
            notes.append(f"camera {name}: sees a height of {tall:g} scene units and is left out")
            return None
        return StageCamera(name=name, node=index, lens=StageLens(height=tall), aspect=wide / tall)
    lens = entry["perspective"]
    fov, aspect = math.degrees(float(lens["yfov"])), lens.get("aspectRatio")
    if not LEAST_FOV <= fov <= MOST_FOV:
        notes.append(f"camera {name}: has a field of view of {fov:g} degrees and is left out")
        return None
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


def _measured(
    index: int, node: Tree, instance: Tree, gltf: Gltf, assets: Assets, notes: list[str]
) -> StageLight | None:
    """Read a lamp with a file of its light [EXT_lights_ies], or note why it cannot be used."""
    name = str(node.get("name") or f"light {index}")
    try:
        entry = gltf.tree["extensions"][MEASURED]["lights"][instance["light"]]
        uri = entry.get("uri")
        if not isinstance(uri, str) or uri.startswith("data:"):
            notes.append(f"light {name}: its IES file lies inside the scene file and is left out; save it beside it")
            return None
        file = assets.locate(uri)
        web = read_photometry(file)
        peak = web.factor * max(map(max, web.candela)) * float(instance.get("multiplier", 1.0))
        red, green, blue = (max(peak * float(channel), 0.0) for channel in instance.get("color", (1.0, 1.0, 1.0)))
        return StageLight(
            name=name, node=index, kind="spot", intensity=(red, green, blue), schema=MEASURED, profile=file
        )
    except AssetError as error:
        notes.append(f"light {name}: is left out: {error}")
    except RowFileError as error:
        notes.append(f"light {name}: is left out: {uri}: {error.args[0]}")
    except (LookupError, TypeError, ValueError, AttributeError):
        notes.append(f"light {name}: its {MEASURED} is broken and is left out")
    return None


def _cone_deg(spot: Tree) -> tuple[float, float]:
    """Read the angles of a spot [KHR_lights_punctual]."""
    inner, outer = float(spot.get("innerConeAngle", 0.0)), float(spot.get("outerConeAngle", math.pi / 4))
    if not 0 <= inner <= outer <= math.pi / 2 + 1e-6 or outer == 0:
        raise ValueError(f"a spot has the cone angles {inner:g} and {outer:g}, expected 0 to pi / 2, in this order")
    return math.degrees(inner), math.degrees(outer)
