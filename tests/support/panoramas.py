"""Environments for tests, over scenes with y up, and their irradiance by quadrature."""

from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.panorama import Environment, Panorama, norths
from support.irradiance import UP

TURNS = np.array([0.0, 70.0, 200.0, 359.0, -30.0])


def environment(pixels: Any, turns_deg: Any = TURNS, factor: Any = (1.0, 1.0, 1.0)) -> LightPath:
    """A map that turns."""
    panorama, n = Panorama(file="sky.exr", pixels=np.asarray(pixels, np.float32)), len(turns_deg)
    factors = np.tile(np.array(factor, np.float64), (n, 1))
    around = Environment(panorama=panorama, rotation_deg=np.array(turns_deg), factor=factors, up=np.array(UP))
    return LightPath(
        kind="directional", vector=-norths("y", around.rotation_deg), intensity=factors * panorama.flux,
        environment=around,
    )  # fmt: skip


def irradiance(pixels: Any, normal: Any, turn_deg: float) -> Any:
    """E = integral of L cos over the sphere, by 40 x 80 points in each texel; the middle of the map is -z."""
    fine = np.asarray(pixels, np.float64).repeat(40, axis=0).repeat(40, axis=1)
    height, width, _ = fine.shape
    up = np.pi / 2 - (np.arange(height) + 0.5) / height * np.pi
    around = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi + np.radians(turn_deg)
    x = np.cos(up)[:, None] * np.sin(around)
    z = -np.cos(up)[:, None] * np.cos(around)
    cosine = x * normal[0] + np.sin(up)[:, None] * normal[1] + z * normal[2]
    solid_angle = np.cos(up) * (np.pi / height) * (2 * np.pi / width)
    return np.einsum("yx,yxk->k", np.maximum(cosine, 0) * solid_angle[:, None], fine)


def write_overcast(file: Path, rows: int = 90) -> Path:
    """Write the overcast sky of the CIE, L = L_z (1 + 2 sin(elevation)) / 3 with L_z = 1, over black ground."""
    sines = np.sin(np.linspace(np.pi / 2, -np.pi / 2, rows + 1))
    mean = (sines[:-1] - sines[1:] + sines[:-1] ** 2 - sines[1:] ** 2) / 3 / (sines[:-1] - sines[1:])  # of each row
    sky = np.where(np.arange(rows) < rows // 2, mean, 0.0).astype(np.float32)
    write_image(file, np.tile(sky[:, None, None], (1, 2 * rows, 3)), ImageFormat(half="never", compression="zip"))
    return file
