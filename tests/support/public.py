"""The array of the examples in docs/guide/python.md and in the docstrings of `framearray`."""

from pathlib import Path
from typing import Any

import tomli_w

from support import tiny

N_C, N_L, N_LAMPS = 4, 3, 2
LAMP = {
    **tiny.TABLE["light"]["sources"][0],
    "group": "lamp",
    "axis": "lamps",
    "keys": [
        {"frame": 0, "position": [-0.9, 2.2, 0.3], "intensity": [8.0, 8.0, 6.0]},
        {"frame": 1, "position": [0.7, 1.9, 0.6], "intensity": [6.0, 7.0, 8.0]},
    ],
}
SUN = {
    "type": "directional",
    "group": "sun",
    "keys": [
        {"frame": 0, "direction": [-0.6, -1.0, -0.3], "irradiance": [3.0, 2.5, 1.5]},
        {"frame": 2, "direction": [0.5, -1.0, -0.2], "irradiance": [2.0, 2.5, 3.5]},
    ],
}


def table(**changes: Any) -> dict[str, Any]:
    """A job of 4 camera positions, 3 positions of a sun and 2 of a lamp; the kernels are those of other tests."""
    keys = [tiny.WALK["keys"][0], {**tiny.WALK["keys"][1], "frame": N_C - 1}]
    found = tiny.table(
        name="room",
        scene={"file": "room.glb", "background": [0.3, 0.4, 0.5]},
        camera={"frames": N_C, "keys": keys},
        reuse={"n_r": 1},
        obscurance={"outside": "background"},
        output={"directory": "array", "format": "exr", "half": "never"},
        **changes,
    )
    found["light"] = {"sources": [LAMP, SUN]}
    return found


def write_job(folder: Path) -> Path:
    """Write the scene and the job into a folder."""
    tiny.save_glb(tiny.room_meshes(), folder / "room.glb")
    file = folder / "room.toml"
    file.write_text(tomli_w.dumps(table()), encoding="utf-8")
    return file
