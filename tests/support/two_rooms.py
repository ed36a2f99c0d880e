"""Two rooms and a thin wall between them, one of them lit."""

from typing import Any

import numpy as np

from support import tiny

HEIGHT, DEPTH = 2.5, 2.0
LAMP = {"type": "point", "keys": [{"frame": 0, "position": [1.0, 2.0, 0.2], "intensity": [8, 8, 6]}]}
# one eye in the dark room, one in the lit one
EYES = {
    "resolution": [32, 24],
    "frames": 2,
    "keys": [
        {"frame": 0, "eye": [-0.3, 1.2, 1.5], "target": [-1.5, 1.0, -1.0]},
        {"frame": 1, "eye": [0.5, 1.2, 1.5], "target": [1.5, 1.0, -1.0]},
    ],
}


def wall(x: float, hole: float) -> list[Any]:
    """A wall across the room at x, without thickness, with a square hole in its middle."""
    h, z, low, high, side = HEIGHT, DEPTH, 1.2 - hole / 2, 1.2 + hole / 2, hole / 2
    if hole == 0:
        return [tiny.quad((x, 0, -z), (x, 0, z), (x, h, z), (x, h, -z))]
    return [
        tiny.quad((x, 0, -z), (x, 0, z), (x, low, z), (x, low, -z)),
        tiny.quad((x, high, -z), (x, high, z), (x, h, z), (x, h, -z)),
        tiny.quad((x, low, -z), (x, low, -side), (x, high, -side), (x, high, -z)),
        tiny.quad((x, low, side), (x, low, z), (x, high, z), (x, high, side)),
    ]


def rooms(walls: list[Any], method: str = "cells", samples: int = 2**17, hits: int = 8) -> Any:
    """Two rooms, and the job that looks into both: camera 0 into the dark one."""
    scene = tiny.scene_of(
        np.concatenate([tiny.box((-2, 0, -DEPTH), (2, HEIGHT, DEPTH)), *walls]),
        tiny.Material(name="Grey", reflectivity=(0.6, 0.5, 0.4)),
    )
    job = tiny.job(
        camera=EYES,
        light={"frames": 1, "sources": [LAMP]},
        samples={"hits": hits, "obscurance": 8},
        indirect={"method": method, **({"samples": samples} if method == "cells" else {})},
    )
    return tiny.prepared(job, scene)
