"""Jobs for the nasty set: a sun and a lamp on any scene file, seen from outside by two eyes that see all of it."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.scene.scene import Scene
from support.stages import sun


def nasty_files(scenes: Path) -> list[str]:
    """Return the names of the set, from its index; none where the set is absent."""
    index = scenes / "nasty" / "INDEX.json"
    return [entry["file"] for entry in json.loads(index.read_text())] if index.is_file() else []


def job_table(file: Path, scene: Scene | None, resolution: tuple[int, int], out: Path) -> dict[str, Any]:
    """A job for a scene file.

    Args:
        scene: the scene if it can be read, else None; eyes and lights then stand anywhere.
    """
    low, high, centre = np.full(3, -1.0), np.full(3, 1.0), np.zeros(3)
    if scene is not None:
        low, high = (getattr(scene.corners, side)(axis=(0, 1)).astype(float) for side in ("min", "max"))
        centre = scene.centre + (low + high) / 2
    radius = float(np.linalg.norm(high - low)) / 2
    # 2.6 radii away a sphere of that radius fills a field of view of 45 degrees
    eyes = [centre + 2.6 * radius * np.array(way) / np.linalg.norm(way) for way in ((1, 0.7, 1.6), (-0.4, 0.9, 1.6))]
    dark = {"frame": 0, "position": (centre + radius * np.array([1.5, 2.0, 1.0])).tolist(), "intensity": 0.0}
    bright = {"frame": 1, "intensity": 10 * radius**2}
    return {
        "name": "nasty",
        "scene": {"file": str(file), "up": "y", "background": [0.05, 0.07, 0.1]},
        "camera": {
            "resolution": list(resolution),
            "fov": 45.0,
            "frames": 2,
            "keys": [{"frame": k, "eye": eye.tolist(), "target": centre.tolist()} for k, eye in enumerate(eyes)],
        },
        "light": {
            "frames": 2,
            "sources": [sun((0.5, -1.0, -0.7), 2.0), {"type": "point", "keys": [dark, dark | bright]}],
        },
        "samples": {"hits": 2, "obscurance": 3},
        "reuse": {"n_r": 1, "weights": "balance"},
        "indirect": {"method": "obscurance"},
        "obscurance": {"range": radius},
        "ambient": {"paths": 256},
        "output": {"directory": str(out), "format": "png", "layers": False},
    }
