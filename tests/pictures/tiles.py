"""A floor of tiles that goes to the horizon, for pictures of textures far away."""

from pathlib import Path

import numpy as np
from support.scenes import Glb, png

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Float32
from framearray_cli.job.job import Job
from framearray_cli.render.render import render

SIZE = (300, 130)
HALF, TILES = 60.0, 240  # half the side of the floor, units, and tiles along it


def images(folder: Path) -> dict[str, Float32]:
    """Render one frame with 2 hits, N_r = 3, with sharp and with blurred textures; (h, w, 3) radiance each."""
    glb = Glb()
    texels = np.full((64, 64, 3), 225, np.uint8)
    texels[:32, :32] = texels[32:, 32:] = (60, 70, 90)
    colour = {"baseColorTexture": {"index": glb.texture(png(texels))}, "roughnessFactor": 1.0, "metallicFactor": 0.0}
    corners = HALF * np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], np.float32)
    uvs = TILES * np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    glb.node(glb.mesh(glb.material("Tiles", colour), positions=corners, TEXCOORD_0=glb.accessor(uvs)))
    file = glb.save(folder / "tiles.glb")
    return {surfaces: _render(file, surfaces, folder / surfaces) for surfaces in ("diffuse", "file")}


def _render(file: Path, surfaces: str, folder: Path) -> Float32:
    table = {
        "name": "tiles",
        "scene": {"file": str(file), "surfaces": surfaces, "background": [0.5, 0.6, 0.75]},
        "camera": {
            "resolution": list(SIZE), "fov": 30.0, "frames": 7,
            "keys": [
                {"frame": 0, "eye": [0.0, 1.5, 0.0], "target": [1.0, 0.9, -4.0]},
                {"frame": 6, "eye": [0.3, 1.5, -0.3], "target": [1.3, 0.9, -4.3]},
            ],
        },
        "light": {"sources": [{"type": "directional", "keys": [
            {"frame": 0, "direction": [0.3, -0.8, 0.5], "irradiance": 2.5},
        ]}]},
        "reuse": {"weights": "balance"},
        "obscurance": {"range": 1.0},
        "indirect": {"method": "obscurance"},
        "output": {"directory": str(folder), "format": "exr"},
    }  # fmt: skip
    render(Job.model_validate(table))
    return read_image(image_path(read_manifest(folder), 3, 0))
