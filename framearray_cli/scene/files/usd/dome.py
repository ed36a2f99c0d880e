"""Dome lights -> one panorama: images of longitude and latitude as OpenEXR defines them, or one colour."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.colour import linear_from_srgb
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import LINEAR_MAPS, read_rgb
from framearray_cli.base.radiance import mend_radiance

from ..assets import AssetError, Assets
from ..staging import StageEnvironment
from ..textures import decode_image
from .blender import turn_of_dome
from .lights import STRENGTH, radiance
from .usdcore import read_asset

PLAIN_ROWS, MOST_ROWS = 16, 2048  # of the panorama of a colour, and of an image
TOGETHER = 64  # rows that are made together
CODES = 255.0
Z_FROM_Y = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # turns y into z
LATLONG = ("automatic", "latlong", "")


def read_domes(
    domes: list[tuple[Any, Float64]], up: str, time: Any, assets: Assets, notes: list[str]
) -> StageEnvironment | None:
    """Add up all dome lights; None if there are none, or they are black.

    Args:
        domes: prims and their (4, 4) places in the world.
        up: axis of the scene that points up, "y" or "z".
    """
    found: list[tuple[Float32, Float64]] = []  # radiance, and (3, 3) from directions of the panorama
    for prim, world in domes:
        pixels = _pixels(prim, time, assets, notes)
        if pixels is None or not pixels.any():
            continue
        turn = world[:3, :3] / np.maximum(np.linalg.norm(world[:3, :3], axis=0), 1e-30) @ turn_of_dome(prim, time)
        if str(prim.GetTypeName()) == "DomeLight_1":
            axis = str(prim.GetAttribute("poleAxis").Get() or "scene")
            if axis == "Z" or (axis == "scene" and up == "z"):
                turn = turn @ Z_FROM_Y
        found.append((pixels, np.linalg.pinv(turn) @ (Z_FROM_Y if up == "z" else np.eye(3))))
    if not found:
        return None
    rows = min(max(len(pixels) for pixels, _ in found), MOST_ROWS)
    assets.limit.take("a panorama", 2 * rows * rows * 12)
    panorama = sum(_turned(pixels, turn, rows) for pixels, turn in found)
    return StageEnvironment(name=domes[0][0].GetName(), pixels=np.asarray(panorama, np.float32), intensity=1.0)


def _pixels(prim: Any, time: Any, assets: Assets, notes: list[str]) -> Float32 | None:
    """(h, w, 3) radiance of a dome light; a colour is an image of few pixels."""
    name, colour = prim.GetName(), radiance(prim, time).astype(np.float32)
    if any(prim.GetAttribute(key).ValueMightBeTimeVarying() for key in STRENGTH):
        notes.append(f"light {name}: its strength changes; that of the first frame is taken")
    asset = prim.GetAttribute("inputs:texture:file").Get(time)
    if asset is None or not asset.path:
        return np.broadcast_to(colour, (PLAIN_ROWS, 2 * PLAIN_ROWS, 3))
    layout = str(prim.GetAttribute("inputs:texture:format").Get(time) or "")
    if layout not in LATLONG:
        notes.append(f"light {name}: expected a texture of longitude and latitude, got {layout}; it is left out")
        return None
    try:
        key, read = read_asset(asset, assets)
        pixels, note = mend_radiance(_decode(key, read(), assets), panorama=True)
        notes += [f"light {name}: {note}"] if note else []
        return np.asarray(pixels * colour, np.float32)
    except (AssetError, OutputError) as error:
        notes.append(f"light {name}: is left out: {error}")
        return None


def _decode(key: str, data: bytes, assets: Assets) -> Float32:
    suffix = Path(key.rstrip("]")).suffix.lower()
    if suffix not in LINEAR_MAPS:
        codes = decode_image(data, Path(key).name, assets.limit)
        return linear_from_srgb((codes[..., :3] / CODES).astype(np.float32))
    with tempfile.TemporaryDirectory(prefix="framearray-") as folder:
        file = Path(folder) / f"dome{suffix}"  # it may lie in a package
        file.write_bytes(data)
        return read_rgb(file)


def _turned(pixels: Float32, local_from_panorama: Float64, rows: int) -> Float32:
    """(rows, 2 rows, 3): north, -z, in the middle, of an image with z in its middle and x to the left of it."""
    height, width, _ = pixels.shape
    around = ((np.arange(2 * rows) + 0.5) / rows - 1) * np.pi
    bands = []
    for first in range(0, rows, TOGETHER):
        up = (0.5 - (np.arange(first, min(first + TOGETHER, rows)) + 0.5) / rows) * np.pi
        level, sine = np.cos(up)[:, None], np.broadcast_to(np.sin(up)[:, None], (len(up), 2 * rows))
        ways = np.stack([level * np.sin(around), sine, -level * np.cos(around)], axis=-1) @ local_from_panorama.T
        x, y, z = np.moveaxis(ways, -1, 0)
        column = (np.pi - np.arctan2(x, z)) / (2 * np.pi) * width - 0.5
        row = np.clip((0.5 - np.arcsin(np.clip(y, -1.0, 1.0)) / np.pi) * height - 0.5, 0, height - 1)
        left, top = np.floor(column + 1e-6).astype(int), np.floor(row + 1e-6).astype(int)  # rounding is no step
        right, below = (left + 1) % width, np.minimum(top + 1, height - 1)
        a, b = np.clip(column - left, 0, 1)[..., None], np.clip(row - top, 0, 1)[..., None]
        upper = pixels[top, left % width] * (1 - a) + pixels[top, right] * a
        lower = pixels[below, left % width] * (1 - a) + pixels[below, right] * a
        bands.append(np.asarray(upper * (1 - b) + lower * b, np.float32))
    return np.concatenate(bands)
