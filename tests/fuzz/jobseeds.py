"""Job files that are right, to be broken: small ones that use every key of a job."""

from pathlib import Path
from typing import Any

import numpy as np
from support import tiny

from framearray_cli.array.images import ImageFormat, write_image

SUN = {
    "type": "sun",
    "latitude": 41.9,
    "longitude": 12.5,
    "date": "2026-06-21",
    "timezone": "Europe/Rome",
    "start": "08:30",
    "stop": "15:30",
    "north": [-1.0, 0.0, 0.0],
    "irradiance": [24.0, 22.5, 19.5],
    "angle": 0.53,
}
YEAR = SUN | {"date": ["2026-03-20", "2026-06-21"], "step": 180.0}
DOME = {"type": "dome", "positions": 3, "shape": "sphere", "top": [0.1, 1, 0], "irradiance": 2.0, "color": "3200 K"}
PATCHES = {"type": "dome", "shape": "tregenza", "irradiance": 1.0}
SENSORS = [
    {"name": "desks", "points": [[0.1, 0.8, 0.2], [0.5, 0.8, -0.3]], "normal": [0.2, 1.0, 0.0], "error": 0.5},
    {"name": "floor", "grid": [-1.0, -1.0, 1.0, 1.0], "height": 0.01, "spacing": 1.0, "error": 0.5},
]
LAMPS = {"type": "dome", "positions": 2, "target": [0.1, 0.9, 0.2], "radius": 1.5, "intensity": [4.0, 3.0, 2.0]}
TURNS = [
    {"frame": 0, "rotation": -30.0, "intensity": 2.0, "color": "5000 K"},
    {"frame": 2, "rotation": 90, "intensity": [1.0, 0.5, 0.2], "color": [1.0, 0.9, 0.8]},
]
IN_PICTURE = {
    "type": "point",
    "space": "camera",
    "scale": 0.5,
    "center": [0.0, 1.0, 0.0],
    "keys": [{"frame": 0, "position": [0, 1, 1], "intensity": 3.0, "color": "2700 K", "radius": 0.05}],
}
SOFT_SUN = tiny.SUN | {"keys": [key | {"angle": 2.0 * k} for k, key in enumerate(tiny.SUN["keys"])]}
SPOTS = [
    {
        "type": "spot",
        "keys": [
            {"frame": 2 * k, "position": [0.5, 1.9, k], "target": [0, 0, -k], "intensity": 3.0, "inner": 10.0 * k}
            for k in range(2)
        ],
    },
    {
        "type": "spot",
        "keys": [{"frame": 0, "position": [0, 1.9, 0], "direction": [0, -1, 0.2], "intensity": 3.0, "outer": 30.0}],
    },
]
PANELS = [
    {
        "type": "rect",
        "keys": [
            {"frame": 2 * k, "position": [0.5, 1.9, k], "target": [0, 0, -k], "power": 30.0, "width": 1.0, "height": 1}
            for k in range(2)
        ],
    },
    {
        "type": "rect",
        "two_sided": True,
        "units": "cd/m2",
        "keys": [
            {"frame": 0, "position": [0, 1.9, 0], "direction": [0, -1, 0], "up": [1, 0, 0], "radiance": [3.0, 2.0, 1.0],
             "width": 0.5, "height": 0.2, "color": "2700 K"}
        ],
    },
    {
        "type": "disc",
        "keys": [{"frame": 0, "position": [0, 1.9, 0], "direction": [0, -1, 0.2], "radiance": 3.0, "radius": 0.2}],
    },
]  # fmt: skip
MESHES = [
    {
        "type": "mesh",
        "material": "Smooth",
        "units": "cd/m2",
        "keys": [
            {"frame": 0, "radiance": 600.0, "color": "2700 K"},
            {"frame": 2, "radiance": [0.0, 0.0, 9.0], "color": [1, 1, 1]},
        ],
    },
    {
        "type": "mesh",
        "material": "Plain",
        "two_sided": False,
        "keys": [{"frame": 0, "radiance": [0.5, 1.0, 2.0]}],
    },
]
UNITS = [
    {**tiny.SUN, "units": "lux"},
    {"type": "point", "units": "lm", "keys": [{"frame": 0, "position": [0, 2, 0], "intensity": 800.0}]},
]
GROUPED = {
    "frames": 2,
    "axes": {"lamps": 2},
    "sources": [
        {**tiny.SUN, "group": "sky"},
        {**tiny.RED, "group": "lamp", "axis": "lamps"},
        {"type": "point", "keys": [{"frame": 0, "position": [0, 2, 0], "intensity": 3.0, "color": [1, 0.5, 0]}]},
    ],
}
FOUR_KEYS = {
    "frames": 8,
    "keys": [
        {"frame": 0, "eye": [0.2, 1.3, 1.7], "target": [-0.1, 0.9, -1.0], "up": [0, 1, 0]},
        {"frame": 2, "eye": [0.3, 1.3, 1.5], "target": [-0.1, 0.9, -1.0], "up": [0, 1, 0.2]},
        {"frame": 3, "eye": [0.3, 1.3, 1.5], "target": [-0.1, 0.7, -1.0], "up": [0.1, 1, 0]},
        {"frame": 7, "eye": [0.5, 1.4, 1.2], "target": [0.1, 0.8, -1.0], "up": [0, 1, 0]},
    ],
}
EXR = {"format": "exr"}
ZOOM = {
    "frames": 4,
    "keys": [
        {**tiny.WALK["keys"][0], "fov": 60.0, "shift": [0.0, 0.2], "pixel_aspect": 1.0},
        {**tiny.WALK["keys"][1], "frame": 3, "fov": 40.0, "shift": [0.1, 0.0], "pixel_aspect": 1.2},
    ],
}
PLAN = {
    "type": "orthographic",
    "frames": 4,
    "shift": [0.1, -0.1],
    "pixel_aspect": 0.9,
    "keys": [{**tiny.WALK["keys"][0], "height": 2.0}, {**tiny.WALK["keys"][1], "frame": 3, "height": 1.5}],
}
AROUND = {"type": "panorama", "resolution": [12, 6], **tiny.WALK}


def _seen_by(camera: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """A small job with another camera."""
    return {**tiny.table(**changes), "camera": {"resolution": [12, 9], **camera}}


def tables(scene: str) -> dict[str, dict[str, Any]]:
    """Small jobs by name; between them they use every key of the schema."""
    small = {"resolution": [12, 9]}
    sky = {"type": "environment", "file": str(Path(scene).with_name("sky.exr")), "keys": TURNS}
    jobs = {
        "plain": tiny.table(camera=small),
        "zoom": _seen_by(ZOOM, reuse={"n_r": 1}),
        "plan": _seen_by(PLAN, reuse={"n_r": 2, "weights": "area"}, output=EXR),
        "plan of one height": _seen_by(PLAN | {"height": 2.0, "keys": tiny.WALK["keys"][:1]}),
        "around": _seen_by(AROUND, reuse={"n_r": 1}),
        "cells": tiny.table(camera=small, indirect={"method": "cells", "samples": 1024, "cell": 0.2}),
        "walk": tiny.table(camera=small | tiny.WALK, reuse={"n_r": 2, "weights": "average"}, output=EXR),
        "spline": tiny.table(
            camera=small | FOUR_KEYS,
            light={"sources": [SOFT_SUN, tiny.RED], "frames": 3},
            samples={"hits": 0.5, "obscurance": 3},
            reuse={"n_r": 3, "weights": "balance"},
            specular={"depth": 2, "hits": 4},
            output={"format": "tif", "fps": 23.976, "layers": False},
        ),
        "groups": tiny.table(
            camera=small | tiny.WALK,
            scene={"background": [0.2, 0.3, 0.4]},
            light=GROUPED,
            reuse={"n_r": 1},
            obscurance={"range": 1.0, "falloff": "exponential", "tau": 5.0, "outside": "background"},
            output=EXR | {"compression": "zip", "half": "never"},
        ),
        "sun": tiny.table(camera=small, light={"sources": [SUN], "frames": 3}, ambient={"paths": 64}),
        "units": tiny.table(camera=small, light={"sources": UNITS, "frames": 3}),
        "year": tiny.table(camera=small, light={"sources": [YEAR], "frames": 6}),
        "domes": tiny.table(
            camera=small, light={"sources": [DOME, LAMPS, IN_PICTURE, *SPOTS, *PANELS, *MESHES], "frames": 4}
        ),
        "sensors": tiny.table(camera=small, light={"sources": [PATCHES], "frames": 145}, sensors=SENSORS),
        "panorama": tiny.table(camera=small, light={"sources": [sky], "frames": 3}),
        "automatic": tiny.table(
            camera=small | tiny.WALK, samples={"hits": "auto", "obscurance": 4}, reuse={"n_r": "auto"}, output=EXR
        ),
        "wanted error": tiny.table(
            camera=small | tiny.WALK, samples={"error": 0.5, "most_hits": 4}, reuse={"n_r": 1}, output=EXR
        ),
        "halves": tiny.table(
            camera=small | tiny.WALK,
            scene={"materials": {"Mirror": {"reflectivity": 0.1, "specular": [0.8, 0.8, 0.8]}, "Plain": {}}},
            samples={"hits": 4, "halves": True},
            ambient={"paths": 16},
            output=EXR | {"half": "always"},
        ),
        "surfaces": tiny.table(
            camera=small,
            scene={
                "surfaces": "file",
                "materials": {
                    "Mirror": {"roughness": 0.3, "metallic": 1.0, "emission": [1.0, 0.5, 0.0]},
                    "Plain": {"transmission": 0.9, "ior": 1.4, "normal_strength": 2.0},
                },
            },
        ),
        "fixed": tiny.table(
            camera=small,
            scene={"up": "z"},
            light={"sources": [tiny.RED], "frames": 2},
            ambient={"intensity": [0.1, 0.2, 0.3]},
            render={"memory": "2 GiB", "threads": 2},
            output={"format": "jpg", "quality": 60, "exposure": 1.5},
        ),
    }
    del jobs["wanted error"]["samples"]["hits"]
    del jobs["fixed"]["ambient"]["paths"]
    for name, job in jobs.items():
        job["scene"] = {**job["scene"], "file": scene}
        job["output"] = {**job.get("output", {}), "directory": "out"}
        job["name"] = name.replace(" ", "-")
    return jobs


def with_scene(folder: Path) -> Path:
    """The scene of all of them; beside it the environment of one."""
    write_image(folder / "sky.exr", np.full((4, 8, 3), (0.2, 0.5, 1.0), np.float32), ImageFormat())
    return tiny.save_glb(tiny.room_meshes(), folder / "tiny.glb")
