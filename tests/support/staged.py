"""Cameras, lights and their animations in GLB files that tests make, and the matrices they should have."""

import math
from copy import deepcopy
from typing import Any

import numpy as np
from trimesh.transformations import rotation_matrix, translation_matrix

from support.scenes import Glb

LENS = {"type": "perspective", "perspective": {"yfov": math.radians(50), "aspectRatio": 1.5, "znear": 0.1}}
QUARTER = math.sqrt(0.5)  # sine and cosine of an eighth of a turn: a quaternion of a quarter turn


def camera(glb: Glb, **more: Any) -> int:
    """A camera without a node of its own in the scene's list."""
    return glb.add("nodes", {"camera": glb.add("cameras", deepcopy(LENS)), "name": "Shot"} | more)


def animate(glb: Glb, node: int, path: str, times: Any, values: Any, interpolation: str = "LINEAR") -> None:
    sampler = {
        "input": glb.accessor(np.array(times, np.float32)),
        "output": glb.accessor(np.array(values, np.float32)),
        "interpolation": interpolation,
    }
    channel = {"sampler": 0, "target": {"node": node, "path": path}}
    glb.add("animations", {"samplers": [sampler], "channels": [channel]})


def light(glb: Glb, kind: str = "point", **more: Any) -> dict[str, Any]:
    """The part of a node that refers to a light."""
    table = glb.tree.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
    table["lights"].append({"type": kind} | more)
    glb.tree["extensionsUsed"] = ["KHR_lights_punctual"]
    return {"extensions": {"KHR_lights_punctual": {"light": len(table["lights"]) - 1}}}


def turn_y(angle: float) -> Any:
    return rotation_matrix(angle, (0, 1, 0))


def shift(x: float, y: float, z: float) -> Any:
    return translation_matrix((x, y, z))
