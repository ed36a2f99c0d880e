"""A ball on a table before a window, for pictures of what keys of a material do."""

from pathlib import Path
from typing import Any

import numpy as np
from support.scenes import Glb, png

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Float32
from framearray_cli.job.job import Job
from framearray_cli.render.render import render

SIZE = (160, 120)
# Values of each key, from left to right, and the keys that are given beside it.
KEYS: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {
    "roughness": ((0.1, 0.3, 0.7), {"metallic": 0.0}),
    "metallic": ((0.0, 0.5, 1.0), {"roughness": 0.25}),
    "transmission": ((0.3, 0.6, 0.95), {}),
    "ior": ((1.05, 1.5, 2.4), {"transmission": 0.95}),
    "normal_strength": ((0.0, 1.0, 3.0), {"roughness": 0.4, "metallic": 0.0}),
    "emission": ((0.1, 0.4, 1.5), {}),
}
AROUND, UP = 96, 48  # patches of the ball


def scene(file: Path) -> Path:
    """Write a room with a window and a table, and a closed ball with texture coordinates and a normal map."""
    glb = Glb()
    walls = glb.material("Walls", {"baseColorFactor": [0.75, 0.72, 0.68, 1.0]})
    table = glb.material("Table", {"baseColorTexture": {"index": glb.texture(png(_checks()))}, "roughnessFactor": 1.0})
    relief = {"index": glb.texture(png(_dimples()))}
    ball = glb.material("Ball", {"baseColorFactor": [0.8, 0.25, 0.12, 1.0]}, normalTexture=relief)
    for quad in _room():
        glb.node(glb.mesh(walls, positions=quad))
    top = np.array([[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], np.float32)
    uvs = np.array([[0, 4], [4, 4], [4, 0], [0, 0]], np.float32)
    glb.node(glb.mesh(table, positions=top, TEXCOORD_0=glb.accessor(uvs)))
    positions, normals, places, faces = _ball()
    attributes = {"NORMAL": glb.accessor(normals), "TEXCOORD_0": glb.accessor(places)}
    glb.node(glb.mesh(ball, positions=positions, faces=faces, **attributes))
    return glb.save(file)


def images(folder: Path) -> dict[str, list[Float32]]:
    """Render the ball for each value of each key, (h, w, 3) radiance each."""
    file = scene(folder / "ball.glb")
    return {
        key: [_render(file, {**beside, key: value}, folder / f"{key}-{i}") for i, value in enumerate(values)]
        for key, (values, beside) in KEYS.items()
    }


def _render(file: Path, keys: dict[str, Any], folder: Path) -> Float32:
    table = {
        "name": "ball",
        "scene": {"file": str(file), "surfaces": "file", "background": [1.0, 1.1, 1.3], "materials": {"Ball": keys}},
        "camera": {
            "resolution": list(SIZE), "fov": 32.0, "frames": 1,
            "keys": [{"frame": 0, "eye": [0.5, 1.0, 1.9], "target": [0.0, 0.36, 0.0]}],
        },
        "light": {"frames": 1, "sources": [
            {"type": "rect", "keys": [{"frame": 0, "position": [-1.2, 1.9, 0.9], "direction": [0.6, -0.9, -0.4],
                                       "width": 0.5, "height": 0.5, "power": 22.0}]},
        ]},
        "obscurance": {"range": 2.0},
        "samples": {"hits": 48, "obscurance": 6},
        "reuse": {"n_r": 0},
        "indirect": {"method": "cells"},
        "output": {"directory": str(folder), "format": "exr"},
    }  # fmt: skip
    render(Job.model_validate(table))
    return read_image(image_path(read_manifest(folder), 0, 0))


def _room() -> list[Any]:
    """Walls about the table, with a gap to the left through which the sky shines."""
    w, h = 2.0, 2.2
    corners = {
        "back": [[-w, 0, -w], [w, 0, -w], [w, h, -w], [-w, h, -w]],
        "right": [[w, 0, -w], [w, 0, w], [w, h, w], [w, h, -w]],
        "front": [[w, 0, w], [-w, 0, w], [-w, h, w], [w, h, w]],
        "ceiling": [[-w, h, -w], [w, h, -w], [w, h, w], [-w, h, w]],
        "below": [[-w, 0, w], [-w, 0, -w], [-w, 0.5, -w], [-w, 0.5, w]],
        "beside": [[-w, 0.5, -0.4], [-w, 0.5, -w], [-w, h, -w], [-w, h, -0.4]],
    }
    return [np.array(quad, np.float32) for quad in corners.values()]


def _ball() -> tuple[Any, Any, Any, Any]:
    """Positions, normals, texture coordinates and faces of a ball of radius 0.4 that stands on the table."""
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, AROUND + 1), np.linspace(0, np.pi, UP + 1))
    around[:, -1] = 0.0  # the seam closes
    normal = np.stack([np.sin(up) * np.cos(around), np.cos(up), np.sin(up) * np.sin(around)], axis=-1)
    normal[0], normal[-1] = (0, 1, 0), (0, -1, 0)
    u, v = np.meshgrid(np.linspace(0, 8, AROUND + 1), np.linspace(0, 4, UP + 1))
    at = np.arange((AROUND + 1) * (UP + 1)).reshape(UP + 1, AROUND + 1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    faces = np.concatenate([np.stack([a, c, b], -1)[:-1].reshape(-1), np.stack([a, d, c], -1)[1:].reshape(-1)])
    positions = 0.4 * normal.reshape(-1, 3) + [0, 0.401, 0]
    places = np.stack([u, v], axis=-1).reshape(-1, 2)
    return (
        *(array.astype(np.float32) for array in (positions, normal.reshape(-1, 3), places)),
        faces.astype(np.uint32),
    )


def _checks() -> Any:
    texels = np.full((64, 64, 3), 205, np.uint8)
    texels[:32, :32] = texels[32:, 32:] = (120, 125, 135)
    return texels


def _dimples() -> Any:
    """A normal map of one round dimple."""
    y, x = (np.mgrid[:64, :64] - 31.5) / 32
    r = np.hypot(x, y)
    slope = np.where(r < 0.8, 0.9 * np.sin(np.pi * r / 0.8), 0.0) / np.maximum(r, 1e-6)
    normal = np.stack([slope * x, -slope * y, np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.rint((normal + 1) * 127.5).astype(np.uint8)
