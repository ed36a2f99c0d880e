"""sRGB and linear light (IEC 61966-2-1), both with Rec. 709 primaries; only the curve differs."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Bytes, Float32

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of red, green and blue (Rec. 709)


def srgb_from_linear(linear: NDArray[Any]) -> NDArray[Any]:
    """Encode linear values with the sRGB curve; values outside [0, 1] are clipped.

    Args:
        linear: any shape, float32 or float64.

    Returns:
        The same shape and dtype, in [0, 1].
    """
    x = np.clip(linear, 0, 1)
    encoded: NDArray[Any] = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return encoded.astype(x.dtype)


def linear_from_srgb(encoded: NDArray[Any]) -> NDArray[Any]:
    """Decode sRGB values; the inverse of `srgb_from_linear` on [0, 1].

    Args:
        encoded: any shape, float32 or float64, in [0, 1].

    Returns:
        The same shape and dtype, linear, in [0, 1].
    """
    x = np.asarray(encoded)
    linear: NDArray[Any] = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return linear.astype(x.dtype)


def srgb8_from_linear(linear: NDArray[Any]) -> Bytes:
    """Encode linear values as 8-bit sRGB codes, clipped to 0 to 255.

    A table holds the code of every half: a value is rounded to half precision, and its 16 bits are the index. The
    rounding moves the code by at most 0.04, so a code is within 0.54 of the exact value; of a half it is the nearest.

    Args:
        linear: any shape, no NaN.

    Returns:
        The same shape, uint8.
    """
    with np.errstate(over="ignore"):  # values above 65504 become infinite, which the table clips to 255
        half = np.asarray(linear).astype(np.float16)
    return np.take(_code_of_half(), half.view(np.uint16), mode="clip")  # as below


def linear_from_srgb8(codes: Bytes) -> Float32:
    """Decode 8-bit sRGB codes: any shape, uint8 -> the same shape, float32 in [0, 1]."""
    # "clip": every code is in range, and the check for that takes three times as long as the rest
    return np.take(_linear_of_code(), codes, mode="clip")


@cache
def _code_of_half() -> Bytes:
    """Tabulate the 8-bit code of each of the 65536 halves; the code of NaN is 0."""
    halves = np.arange(65536, dtype=np.uint16).view(np.float16)
    linear = np.nan_to_num(halves.astype(np.float64), nan=0.0, posinf=1.0, neginf=0.0)
    codes: NDArray[Any] = np.rint(srgb_from_linear(linear) * 255)
    return codes.astype(np.uint8)


@cache
def _linear_of_code() -> Float32:
    """Tabulate the linear value of each of the 256 codes."""
    return linear_from_srgb(np.arange(256) / 255).astype(np.float32)
