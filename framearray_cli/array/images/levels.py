"""The shares of an image's pixels that are clipped or black."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .images import FOR_SCREENS, ImageFormat

# Pixels that are counted, about; every second, third, ... row and column of a larger image.
COUNTED = 2048
# The largest radiance that rounds to code 0 of an sRGB screen.
CODE_0 = 0.5 / 255 / 12.92


def counted_part(images: NDArray[Any]) -> NDArray[Any]:
    """Return the pixels that are counted, of images (..., h, w, 3)."""
    step = max(1, int(np.sqrt(images.shape[-3] * images.shape[-2] / COUNTED)))
    return images[..., ::step, ::step, :]


def pixel_shares(
    image: NDArray[Any], image_format: ImageFormat, alpha: NDArray[Any] | None = None
) -> tuple[float, float]:
    """Return the shares of the pixels of which any channel is clipped, and of those that are black.

    PNG and JPEG clip values above 1 after the exposure, and show code 0 as black. In EXR and TIFF, which clip nothing,
    values above 1 count, which a screen clips, and pixels without any light.

    Args:
        image: (h, w, 3), linear radiance.
        alpha: (h, w); pixels of which it is 0 do not count as black. None: all do.
    """
    part = counted_part(image).astype(np.float32)
    largest = np.maximum(np.maximum(part[..., 0], part[..., 1]), part[..., 2])  # max(axis=-1) takes ten times as long
    screens = image_format.format in FOR_SCREENS
    factor = 2.0**image_format.exposure if screens else 1.0
    black = largest < CODE_0 / factor if screens else largest == 0
    if alpha is not None:
        black &= counted_part(alpha[..., None])[..., 0] > 0
    return np.count_nonzero(largest > 1 / factor) / largest.size, np.count_nonzero(black) / largest.size


def mean_shares(shares: Iterable[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the means of the shares of several images; None of none."""
    each = list(shares)
    if not each:
        return None
    clipped, black = (math.fsum(values) / len(each) for values in zip(*each, strict=True))
    return clipped, black
