"""The image-based light of a glTF file [EXT_lights_image_based] -> a panorama."""

import math
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.colour import LUMINANCE, linear_from_srgb
from framearray_cli.base.forms.words import shown

from ..assets import AssetError, Assets
from ..staging import StageEnvironment
from ..textures import decode_image
from .container import Gltf, image_bytes
from .cubemap import panorama_of
from .values import Tree, list_of, number, number_of, numbers, table, text

IMAGE_BASED = "EXT_lights_image_based"
FACES, COEFFICIENTS = 6, 9
PNG = b"\x89PNG"
CODES = 255.0
# Bytes per texel of a face: its radiance, and the four floats that make a pixel of the panorama of twice as many rows.
FACE_BYTES, PANORAMA_BYTES = 12, 12 * 8
MEAN_OF_FIRST = math.sqrt(1 / (4 * math.pi)) / math.pi  # of the first coefficient of irradiance: mean radiance
CHECK = table(
    {
        "name": text,
        "intensity": number(0),
        "rotation": numbers(4),
        "specularImages": list_of(list_of(number_of("images"))),
    },
    ("specularImages",),
)
AGREED = 1.25  # factor between both means up to which pictures of 8 bits and prefiltering explain it


def scene_light(gltf: Gltf) -> Any:
    """The number of the image-based light of the default scene, as the file has it; None without one."""
    scenes = gltf.items("scenes")
    scene = scenes[gltf.tree.get("scene") or 0] if scenes else {}
    used = (scene.get("extensions") or {}).get(IMAGE_BASED)
    return None if used is None else used["light"]


def read_image_light(gltf: Gltf, assets: Assets, notes: list[str]) -> StageEnvironment | None:
    """Read the image-based light of the default scene, or note why it cannot be used.

    Only the first level of its pictures is read: the others are blurred copies of it, for glossy surfaces. The
    irradiance coefficients are compared with the mean of the pictures and serve no other end.

    Raises:
        SceneError: its pictures take more memory than there is.
    """
    name = "image-based light"
    try:
        index = scene_light(gltf)
        if index is None:
            return None
        entry = _entry(gltf, index)
        name = f"image-based light {entry.get('name') or index}"
        intensity, rotation = float(entry.get("intensity", 1.0)), _rotation(entry)
        faces = _faces(gltf, assets, entry)
        with assets.limit.lend("a panorama", PANORAMA_BYTES * faces.shape[1] ** 2):
            pixels = panorama_of(faces, rotation)
        if not pixels.any() or intensity == 0:
            notes.append(f"{name}: is black and is left out")
            return None
        notes += _disagreement(name, entry, pixels)
        return StageEnvironment(name=str(entry.get("name") or "environment"), pixels=pixels, intensity=intensity)
    except (AssetError, ValueError) as error:
        notes.append(f"{name}: is left out: {error}")
    except (LookupError, TypeError, AttributeError, OverflowError):
        notes.append(f"{name}: its {IMAGE_BASED} is broken and is left out")
    return None


def _entry(gltf: Gltf, index: Any) -> Tree:
    """The light of an index, whose values are checked."""
    lights = gltf.tree["extensions"][IMAGE_BASED]["lights"]
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(lights):
        raise ValueError(f"expected the number of a light, below {len(lights)}, got {shown(index)}")
    found: Tree = lights[index]
    for problem in CHECK(found, f"lights[{index}]", gltf.tree):
        raise ValueError(problem)
    return found


def _rotation(entry: Tree) -> Float64:
    rotation = np.array(entry.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64)
    largest = np.abs(rotation).max()
    if largest == 0:
        raise ValueError("expected a rotation x, y, z, w that is not all 0")
    return np.asarray(rotation / largest / np.linalg.norm(rotation / largest))


def _faces(gltf: Gltf, assets: Assets, entry: Tree) -> Float32:
    """Read the six pictures of the first level, (6, n, n, 3) radiance."""
    first = (entry["specularImages"] or [[]])[0]
    if len(first) != FACES:
        raise ValueError(f"specularImages[0]: expected six pictures of the faces of a cube, got {len(first)}")
    found = [_radiance(gltf, assets, image, f"specularImages[0][{k}]") for k, image in enumerate(first)]
    n = len(found[0])
    for k, texels in enumerate(found):
        height, width, _ = texels.shape
        if (height, width) != (n, n):
            squares = f"a square of {n} x {n}, as all faces have one size"
            raise ValueError(f"specularImages[0][{k}]: expected {squares}, got {width} x {height}")
    return np.stack(found)


def _radiance(gltf: Gltf, assets: Assets, image: int, place: str) -> Float32:
    """Decode a picture, (h, w, 3): the colours of a PNG with alpha are divided by it (RGBD)."""
    data = image_bytes(gltf, image, assets)
    codes = decode_image(data, place, assets.limit)
    assets.limit.take("faces", FACE_BYTES * codes.shape[0] * codes.shape[1])
    colours = linear_from_srgb((codes[..., :3] / CODES).astype(np.float32))
    if not data.startswith(PNG):
        return colours
    # alpha 0 stands for what is brighter than 255, where the colours are 0 too
    return np.asarray(colours / (np.maximum(codes[..., 3:], 1) / np.float32(CODES)), np.float32)


def _disagreement(name: str, entry: Tree, pixels: Float32) -> list[str]:
    """A note where the irradiance coefficients stand for another mean radiance than the pictures."""
    try:
        first = np.array(entry["irradianceCoefficients"], np.float64).reshape(COEFFICIENTS, 3)[0]
    except (LookupError, TypeError, ValueError):
        return [f"{name}: expected irradiance coefficients of {COEFFICIENTS} x 3 numbers; the pictures count"]
    edges = np.sin(np.linspace(np.pi / 2, -np.pi / 2, len(pixels) + 1))
    seen = float((pixels.mean(axis=1) @ LUMINANCE) @ -np.diff(edges)) / 2
    said = float(first @ LUMINANCE) * MEAN_OF_FIRST
    if seen / AGREED <= said <= seen * AGREED:
        return []
    means = f"a mean radiance of {said:.3g}, its pictures for {seen:.3g}"
    return [f"{name}: its irradiance coefficients stand for {means}; the pictures count"]
