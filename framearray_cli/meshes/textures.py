"""Images -> RGBA texels, through Pillow."""

import io
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Bytes, Float64
from ..errors import SceneError
from .assets import AssetError
from .model import Notes

MAX_TEXELS = 2**31 - 1  # texel indices are int32
MAX_BYTE = 255.0


@dataclass(slots=True)
class TextureTable:
    """The textures of one scene; each image is decoded once."""

    notes: Notes
    textures: list[Bytes] = field(default_factory=list)
    indices: dict[Hashable, int] = field(default_factory=dict)

    def index(self, key: Hashable, label: str, read: Callable[[], bytes]) -> int:
        """Return the texture's index, or -1 with a note where the image cannot be had.

        Args:
            key: tells images apart.
            label: how a note names the image.
            read: gives the encoded image; may raise AssetError.

        Raises:
            SceneError: an image so large that reading it could exhaust the memory.
        """
        if key not in self.indices:
            texels = self._decode(label, read)
            self.indices[key] = -1 if texels is None else self._append(texels)
        return self.indices[key]

    def add(self, key: Hashable, texels: Bytes) -> int:
        """Return the index of texels that are decoded already."""
        if key not in self.indices:
            self.indices[key] = self._append(texels)
        return self.indices[key]

    def cutout(self, key: Hashable, label: str, read: Callable[[], bytes]) -> int:
        """As `index`, for an image that is an opacity map: its alpha, or its brightness where it has none."""
        cut_key = ("opacity", key)
        if cut_key not in self.indices:
            texels = self._decode(label, read)
            if texels is None:
                self.indices[cut_key] = -1
            elif texels[..., 3].min() < MAX_BYTE:
                self.indices[cut_key] = self.index(key, label, read)
            else:
                texels[..., 3] = np.rint(texels[..., :3].mean(axis=2))
                self.indices[cut_key] = self._append(texels)
        return self.indices[cut_key]

    def alpha_range(self, index: int) -> tuple[float, float]:
        """Lowest and highest alpha of a texture in [0, 1]; (1, 1) for no texture."""
        if index < 0:
            return 1.0, 1.0
        alpha = self.textures[index][..., 3]
        return float(alpha.min()) / MAX_BYTE, float(alpha.max()) / MAX_BYTE

    def mean(self, label: str, read: Callable[[], bytes]) -> Float64 | None:
        """(4,) mean of the raw channels in [0, 1] of an image that holds numbers, not colours; it is not kept."""
        texels = self._decode(label, read)
        return None if texels is None else np.asarray(texels.reshape(-1, 4).mean(axis=0, dtype=np.float64) / MAX_BYTE)

    def _decode(self, label: str, read: Callable[[], bytes]) -> Bytes | None:
        try:
            return decode_image(read(), label)
        except AssetError as error:
            self.notes.add(f"texture left out, {error}")
            return None

    def _append(self, texels: Bytes) -> int:
        n_texels = sum(texture.shape[0] * texture.shape[1] for texture in self.textures)
        if n_texels + texels.shape[0] * texels.shape[1] > MAX_TEXELS:
            raise SceneError(f"the textures have more than {MAX_TEXELS} texels in all; make them smaller")
        self.textures.append(texels)
        return len(self.textures) - 1


def decode_image(data: bytes, label: str) -> Bytes:
    """Decode an image of any kind that Pillow reads.

    Returns:
        (height, width, 4) uint8 RGBA, row 0 on top.

    Raises:
        AssetError: not an image, or a broken one.
        SceneError: larger than Pillow's limit against decompression bombs.
    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            return rgba(image)
    except Image.DecompressionBombError as error:
        raise SceneError(f"{label}: {error}; make the image smaller") from error
    except Exception as error:
        raise AssetError(f"{label}: not an image that can be read ({type(error).__name__}: {error})") from error


def rgba(image: Any) -> Bytes:
    """Convert a Pillow image of any mode to (height, width, 4) uint8 RGBA.

    Pillow cuts 16-bit and float greys off at 255 instead of scaling them, so these are scaled here.
    """
    if image.mode.startswith("I"):
        wide = np.asarray(image).astype(np.int64)
        grey = np.clip(wide >> 8, 0, 255).astype(np.uint8)
    elif image.mode == "F":
        grey = np.rint(np.clip(np.nan_to_num(np.asarray(image)), 0.0, 1.0) * MAX_BYTE).astype(np.uint8)
    else:
        return np.array(image.convert("RGBA"), dtype=np.uint8)
    return np.dstack([grey, grey, grey, np.full_like(grey, 255)])
