"""Light from cells where it could leak: two rooms and a thin wall, against paths."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.pathtraced import path_traced

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


def rooms(walls: list[Any]) -> Any:
    """Two rooms, and the job that looks into both."""
    scene = tiny.scene_of(
        np.concatenate([tiny.box((-2, 0, -DEPTH), (2, HEIGHT, DEPTH)), *walls]),
        tiny.Material(name="Grey", reflectivity=(0.6, 0.5, 0.4)),
    )
    job = tiny.job(
        camera=EYES,
        light={"frames": 1, "sources": [LAMP]},
        samples={"hits": 8, "obscurance": 8},
        indirect={"method": "cells", "samples": 2**17},
    )
    return tiny.prepared(job, scene)


@pytest.mark.parametrize("thickness", [0.0, 0.02])
def test_a_closed_room_stays_dark(thickness: float) -> None:
    images = tiny.render_frames(rooms([*wall(0.0, 0), *(wall(thickness, 0) if thickness else [])]), threads=2).images
    dark, lit = images.mean(axis=(1, 2, 3, 4))
    assert lit > 0.5
    assert dark < lit / 1000


@pytest.mark.slow
def test_a_room_behind_a_hole_is_as_bright_as_with_paths() -> None:
    inputs = rooms(wall(0.0, 0.15))
    image = tiny.render_frames(inputs, threads=2).images
    for c in range(2):
        paths = path_traced(inputs, c, 4096 if c == 0 else 64).mean(axis=(1, 2, 3))
        right, error = paths.mean(), paths.std(ddof=1) / len(paths) ** 0.5
        assert right > 0.001 and error < 0.04 * right
        assert abs(image[c].mean() - right) < 0.1 * right
