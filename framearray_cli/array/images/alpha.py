"""Coverage as alpha: premultiplied, as renders, EXR and TIFF have it; or unassociated, as PNG stores it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32, Image
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import read_pixels

from .png import open_picture

OPAQUE_CODE = 255
WITH_ALPHA = ("exr", "png", "tif")  # formats that have an alpha channel


def unassociated(image: Image, alpha: Float32) -> tuple[Image, Bytes]:
    """Divide premultiplied linear light by alpha, as a PNG has it.

    8 bits cannot hold light where nothing is covered, as of a lamp before the sky: alpha is there the light itself.

    Args:
        image: (h, w, 3).
        alpha: (h, w) in [0, 1].

    Returns:
        Linear light that is not premultiplied, (h, w, 3); and codes of alpha, (h, w).
    """
    alpha = np.where(alpha > 0, alpha, np.clip(image.max(axis=-1), 0, 1)).astype(np.float32)
    covered = np.rint(alpha * OPAQUE_CODE).astype(np.uint8)
    return np.asarray(image / np.where(covered > 0, alpha, np.inf)[..., None], np.float32), covered


def unassociated_codes(image: Image, alpha: Float32) -> Bytes:
    """Encode premultiplied linear light as codes of a PNG, (h, w, 4): sRGB, and alpha; see `unassociated`."""
    shown, covered = unassociated(image, alpha)
    return np.dstack([srgb8_from_linear(shown), covered])


def premultiplied(codes: Bytes) -> Image:
    """Decode what `unassociated_codes` encodes: premultiplied linear light, (h, w, 3)."""
    light: Image = linear_from_srgb8(np.ascontiguousarray(codes[..., :3]))
    return light * (codes[..., 3:].astype(np.float32) / np.float32(OPAQUE_CODE))


def read_alpha(path: Path) -> Float32 | None:
    """Read the alpha channel of an image, (h, w) float32 in [0, 1]; None if it has none.

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    if path.suffix.lower() == ".png":
        with open_picture(path) as picture:
            if picture.mode != "RGBA":
                return None
            codes: NDArray[np.uint8] = np.asarray(picture)[..., 3]
            return codes.astype(np.float32) / np.float32(OPAQUE_CODE)
    if path.suffix.lower() in (".jpg", ".jpeg"):
        return None
    names, pixels = read_pixels(path)
    return np.ascontiguousarray(pixels[..., names.index("A")]) if "A" in names else None


def require_alpha(path: Path) -> Float32:
    """Read the alpha channel of an image that must have one, see `read_alpha`.

    Raises:
        OutputError: as `read_alpha`, or there is none.
    """
    alpha = read_alpha(path)
    if alpha is None:
        raise OutputError(f"{path}: expected an alpha channel, found none; render again with output.alpha = true")
    return alpha
