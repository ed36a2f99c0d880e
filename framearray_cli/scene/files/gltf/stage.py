"""Cameras and lights of a glTF file, and where they are at any time.

Nodes move with their ancestors and by all animations of a file together. Notation of glTF 2.0, section 3.11 and
appendix C: a channel moves one property of one node by a sampler, which has key times, key values and an interpolation.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.units import counted

from ..staging import Stage, StageBuilder, StageCamera, StageLens, StageLight
from .container import Gltf, Tree, checked_entry, entry_of, tree_of

PATHS = ("translation", "rotation", "scale")
WEIGHTS = "weights"  # of morph targets, the fourth property that animations move
AT_REST: dict[str, Sequence[float]] = {
    "translation": (0.0, 0.0, 0.0),
    "rotation": (0.0, 0.0, 0.0, 1.0),
    "scale": (1.0, 1.0, 1.0),
}


class Channel(NamedTuple):
    """Movement of one property of a node.

    Attributes:
        times: (k,) seconds, rising.
        values: (k, w) at the keys.
        tangents: (k, 2, w) arriving and leaving, per second; only of a cubic spline.
    """

    times: Float64
    values: Float64
    tangents: Float64 | None
    interpolation: Literal["STEP", "LINEAR", "CUBICSPLINE"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """All nodes of a file, and what moves them.

    Attributes:
        nodes: from the file's JSON.
        parents: the parent of each node; -1 for a root.
        channels: (node, property) -> how it moves.
        notes: broken channels, which are left out.
    """

    nodes: Sequence[Tree]
    parents: Sequence[int]
    channels: dict[tuple[int, str], Channel]
    notes: tuple[str, ...] = ()

    def chain(self, node: int) -> list[int]:
        """A node and its ancestors, from the node upwards."""
        found = [node]
        while self.parents[found[-1]] >= 0:
            found.append(self.parents[found[-1]])
        return found

    def span(self, nodes: Sequence[int]) -> tuple[float, float] | None:
        """First and last key time, in seconds, of the channels that move any of the nodes; None if none does."""
        links = {link for node in nodes for link in self.chain(node)}
        return span_of([channel for (node, path), channel in self.channels.items() if node in links and path in PATHS])

    def world_from_node(self, node: int, times: Sequence[float]) -> Float64:
        """(n, 4, 4) transform of a node at n times, its ancestors' included."""
        at = np.asarray(times, dtype=np.float64)
        world = np.tile(np.eye(4), (len(at), 1, 1))
        for link in self.chain(node):
            world = self.parent_from_node(link, at) @ world
        return world

    def parent_from_node(self, node: int, at: Float64) -> Float64:
        """(n, 4, 4) transform of a node in its parent at n times."""
        channels = {path: self.channels[node, path] for path in PATHS if (node, path) in self.channels}
        moved = {path: sample_channel(channel, at, path == "rotation") for path, channel in channels.items()}
        return transforms(self.nodes[node], moved, len(at))


def span_of(channels: Sequence[Channel]) -> tuple[float, float] | None:
    """First and last key time of some channels, seconds; None without any."""
    if not channels:
        return None
    return float(min(channel.times[0] for channel in channels)), float(max(channel.times[-1] for channel in channels))


def transforms(node: Tree, moved: Mapping[str, Float64], n: int) -> Float64:
    """(n, 4, 4) transforms of a node in its parent: scale, rotation by a quaternion of any length, and translation.

    Args:
        moved: n rows of what is not at rest.
    """
    if "matrix" in node:  # column by column; a node with a matrix must not be animated
        return np.tile(np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T, (n, 1, 1))
    rest = {path: np.tile(np.array(node.get(path, AT_REST[path]), np.float64), (n, 1)) for path in PATHS}
    parts = rest | dict(moved)
    length, matrix = np.linalg.norm(parts["rotation"], axis=1, keepdims=True), np.tile(np.eye(4), (n, 1, 1))
    turn = np.divide(parts["rotation"], length, out=np.tile(AT_REST["rotation"], (n, 1)), where=length > 0)
    x, y, z, w = turn.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:, :3, :3] = np.moveaxis(np.array(rows), -1, 0) * parts["scale"][:, None, :]
    matrix[:, :3, 3] = parts["translation"]
    return matrix


def read_motion(gltf: Gltf) -> Motion:
    """Read the hierarchy and the channels of all animations; if two move the same property, the first counts."""
    nodes, notes = gltf.items("nodes"), list[str]()
    parents = [-1] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.get("children") or []:
            parents[child] = index
    channels: dict[tuple[int, str], Channel] = {}
    for index, animation in enumerate(gltf.items("animations")):
        for number, entry in enumerate(animation.get("channels") or []):
            target = entry["target"]
            place = (int(target.get("node", -1)), str(target["path"]))
            if place[0] >= 0 and place[1] in (*PATHS, WEIGHTS) and place not in channels:
                try:
                    channels[place] = _channel(gltf, animation["samplers"][entry["sampler"]], place[1])
                except (ValueError, KeyError, IndexError) as error:
                    notes.append(f"animations[{index}].channels[{number}] is left out: {error}")
    return Motion(nodes=nodes, parents=parents, channels=channels, notes=tuple(notes))


def _channel(gltf: Gltf, sampler: Tree, path: str) -> Channel:
    """Read one sampler; refuse times that do not rise, and another number of values."""
    times = gltf.read_accessor(sampler["input"])[:, 0].astype(np.float64)
    values = gltf.read_accessor(sampler["output"]).astype(np.float64)
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in ("STEP", "LINEAR", "CUBICSPLINE"):
        raise ValueError(f"unknown interpolation {interpolation!r}")
    keys, each = len(times), 3 if interpolation == "CUBICSPLINE" else 1
    wide = path == WEIGHTS and keys > 0 and len(values) % (each * keys) == 0  # one number per morph target
    if keys == 0 or (len(values) != each * keys and not wide):
        raise ValueError(f"it has {counted(keys, 'time')} and {counted(len(values), 'value')}")
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any() or not np.isfinite(values).all():
        raise ValueError("its times do not rise, or are not finite")
    rows = values.reshape(keys, each, -1)  # of a spline: arriving tangent, value, leaving tangent
    return Channel(times, rows[:, each // 2], rows[:, ::2] if each == 3 else None, interpolation)


def sample_channel(channel: Channel, at: Float64, is_rotation: bool) -> Float64:
    """Evaluate a channel at n times, (n, w); before the first and after the last key it rests.

    Rotations are quaternions x, y, z, w, and turn the shorter way between two keys.
    """
    times, values = channel.times, channel.values
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)
    after = np.minimum(before + 1, len(times) - 1)
    span = times[after] - times[before]
    t = np.clip(np.divide(at - times[before], span, out=np.zeros_like(at), where=span > 0), 0.0, 1.0)[:, None]
    a, b = values[before], values[after]
    if channel.interpolation == "STEP":
        return a
    if channel.tangents is not None:
        leave, arrive = channel.tangents[before, 1] * span[:, None], channel.tangents[after, 0] * span[:, None]
        at_ends = (2 * t**3 - 3 * t**2 + 1) * a + (t**3 - 2 * t**2 + t) * leave
        return np.asarray(at_ends + (3 * t**2 - 2 * t**3) * b + (t**3 - t**2) * arrive)
    if is_rotation:  # at constant speed, the shorter way [Shoemake85]
        cosine = (a * b).sum(axis=1, keepdims=True)
        b = np.where(cosine < 0, -b, b)
        angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0)) / np.pi
        weights = ((1 - t) * np.sinc((1 - t) * angle), t * np.sinc(t * angle))  # sin(t x) / sin(x), also where x is 0
        return np.asarray((weights[0] * a + weights[1] * b) / np.sinc(angle))
    return np.asarray((1 - t) * a + t * b)


PUNCTUAL = "KHR_lights_punctual"
LENSES = ("perspective", "orthographic")  # of cameras


def read_gltf_stage(gltf: Gltf) -> Stage:
    """Find the cameras and lights of the file's default scene; broken ones are left out, with a note.

    Raises:
        ValueError, KeyError, IndexError, ...: the file is broken.
    """
    motion = read_motion(gltf)
    found = StageBuilder(notes=list(motion.notes))
    table = tree_of(tree_of(gltf.tree.get("extensions")).get(PUNCTUAL)).get("lights")
    for index in _shown(gltf):
        node = motion.nodes[index]
        try:
            if (number := node.get("camera")) is not None:
                noun = "camera"
                found.add_camera(_camera(index, node, f"cameras[{number}]", entry_of(gltf.tree.get("cameras"), number)))
            if (punctual := tree_of(node.get("extensions")).get(PUNCTUAL)) is not None:
                noun, number = "light", tree_of(punctual).get("light")
                place = f"extensions.{PUNCTUAL}.lights[{number}]"
                found.lights.append(_light(index, node, place, entry_of(table, number)))
        except ValueError as error:
            found.notes.append(f"{error}; the {noun} of nodes[{index}] is left out")
    return found.stage(motion)


def count_lights(gltf: Gltf) -> int:
    """Return the number of lights that the default scene shows."""
    nodes = gltf.items("nodes")
    return sum(PUNCTUAL in tree_of(nodes[index].get("extensions")) for index in _shown(gltf))


def _shown(gltf: Gltf) -> list[int]:
    """Indices of the nodes that the default scene shows; each node once, even if the graph is no tree."""
    scenes = gltf.items("scenes")
    return sorted(with_descendants(gltf, scenes[gltf.tree.get("scene", 0)].get("nodes") or [])) if scenes else []


def with_descendants(gltf: Gltf, nodes: Sequence[int]) -> set[int]:
    """Indices of some nodes and of all below them."""
    waiting, found = list(nodes), set[int]()
    while waiting:
        index = waiting.pop()
        if index not in found:
            found.add(index)
            waiting += gltf.items("nodes")[index].get("children") or []
    return found


def _camera(index: int, node: Tree, place: str, entry: object) -> StageCamera:
    """Read the camera of a node; ValueError if it is broken."""
    table = tree_of(entry)
    name, kind = str(node.get("name") or table.get("name") or f"camera {index}"), table.get("type")
    if kind not in LENSES:
        kind = next((kind for kind in LENSES if kind in table), "perspective")
    lens = checked_entry(f"{place}.{kind}" if entry else place, table.get(kind), kind)
    if kind == "orthographic":
        wide, tall = (2 * abs(float(lens.get(key, 0.0))) for key in ("xmag", "ymag"))
        return StageCamera(
            name=name, node=index, lens=StageLens(height=tall), aspect=wide / tall if wide * tall > 0 else None
        )
    fov, aspect = math.degrees(float(lens["yfov"])), lens.get("aspectRatio")
    return StageCamera(name=name, node=index, lens=StageLens(fov_deg=fov), aspect=float(aspect) if aspect else None)


def _light(index: int, node: Tree, place: str, entry: object) -> StageLight:
    """Read the light of a node; ValueError if it is broken."""
    light = checked_entry(place, entry, "light")
    kind, strength = light["type"], float(light.get("intensity", 1.0))
    red, green, blue = (max(strength * float(channel), 0.0) for channel in light.get("color", (1.0, 1.0, 1.0)))
    name = str(node.get("name") or light.get("name") or f"light {index}")
    cone = None
    if kind == "spot":
        spot = light.get("spot", {})
        inner, outer = float(spot.get("innerConeAngle", 0.0)), float(spot.get("outerConeAngle", math.pi / 4))
        if inner > outer or outer == 0:
            raise ValueError(f"{place}.spot: expected cone angles in this order, got {inner:g} and {outer:g}")
        cone = (math.degrees(inner), math.degrees(outer))
    return StageLight(name=name, node=index, kind=kind, intensity=(red, green, blue), schema=PUNCTUAL, cone_deg=cone)
