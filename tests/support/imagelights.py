"""GLB files with an image-based light (EXT_lights_image_based)."""

from typing import Any

import numpy as np

from framearray_cli.base.colour import srgb_from_linear
from support.scenes import Glb, png

NAME = "EXT_lights_image_based"
COEFFICIENT_OF_MEAN = np.pi * np.sqrt(4 * np.pi)  # the first coefficient of irradiance under light of radiance 1


def rgbd(radiance: Any) -> bytes:
    """Encode (n, n, 3) radiance up to 255 as the extension has it: alpha is what colours were multiplied with."""
    peak = np.maximum(np.max(radiance, axis=-1, keepdims=True), 1.0)
    alpha = np.floor(255 / peak)
    colours = np.rint(255 * srgb_from_linear(np.asarray(radiance) * alpha / 255))
    return png(np.concatenate([colours, alpha], axis=-1))


def add_light(glb: Glb, pictures: Any, **keys: Any) -> dict[str, Any]:
    """Add an image-based light with one level of encoded pictures; return its table."""
    numbers = [glb.add("images", {"bufferView": glb.view(data), "mimeType": "image/png"}) for data in pictures]
    light = {"name": "Sky", "specularImages": [numbers], "specularImageSize": 16} | keys
    glb.tree["extensionsUsed"] = [*glb.tree.get("extensionsUsed", []), NAME]
    glb.tree.setdefault("extensions", {})[NAME] = {"lights": [light]}
    glb.tree["scenes"][0]["extensions"] = {NAME: {"light": 0}}
    return light


def coefficients(mean: float) -> list[list[float]]:
    """Irradiance coefficients of a mean radiance, the same from everywhere."""
    return [[mean * COEFFICIENT_OF_MEAN] * 3] + 8 * [[0.0] * 3]
