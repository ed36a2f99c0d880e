"""sRGB and linear light (IEC 61966-2-1), both with Rec. 709 primaries; black bodies and colour temperatures."""

import re
from functools import cache
from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Bytes, Float32
from .forms.words import shown

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of red, green and blue (Rec. 709)

# Second radiation constant, nm K; Planck's law: radiance ~ wavelength^-5 / (exp(C2 / (wavelength T)) - 1).
C2 = 1.438776877e7
FIRST_NM, LAST_NM, STEP_NM = 360, 830, 5

# CIE 1931 colour matching functions as sums of Gaussians with two widths each [Wyman13]: height, middle, widths (nm).
_X = ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2))
_Y = ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1))
_Z = ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8))

RGB_FROM_XYZ = (  # IEC 61966-2-1
    (3.2406255, -1.5372080, -0.4986286),
    (-0.9689307, 1.8757561, 0.0415175),
    (0.0557101, -0.2040211, 1.0569959),
)
COLDEST, HOTTEST = 1000, 40000  # kelvin; colder bodies emit only red light, and hotter ones all look the same
TEMPERATURE_SCHEMA = {"type": "string", "pattern": r"^\s*[0-9]{1,6}(\.[0-9]{1,6})?\s*K\s*$"}
TEMPERATURE_EXAMPLE = 'a temperature such as "3200 K"'


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


@cache
def black_body(kelvin: float) -> tuple[float, float, float]:
    """Return the linear RGB of a black body, of luminance 1; colours outside Rec. 709 are clipped to it.

    Below 1900 K such light has less blue than Rec. 709 can show, which counts as none. 6500 K is nearly white.

    Args:
        kelvin: its temperature, above 0.
    """
    xyz = [0.0, 0.0, 0.0]
    for nm in range(FIRST_NM, LAST_NM + 1, STEP_NM):
        radiance = (nm / 560) ** -5 / (exp(C2 / (nm * kelvin)) - 1)
        for k, lobes in enumerate((_X, _Y, _Z)):
            xyz[k] += radiance * sum(_lobe(nm, *lobe) for lobe in lobes)
    rgb = [max(sum(row[k] * xyz[k] for k in range(3)), 0.0) for row in RGB_FROM_XYZ]
    luminance = sum(weight * value for weight, value in zip(LUMINANCE.tolist(), rgb, strict=True))
    red, green, blue = (value / luminance for value in rgb)
    return red, green, blue


def _lobe(nm: float, height: float, middle: float, before: float, after: float) -> float:
    """A Gaussian of one width before its middle, and another after it."""
    return height * exp(-0.5 * ((nm - middle) / (before if nm < middle else after)) ** 2)


def temperature_colour(text: str) -> tuple[float, float, float] | None:
    """Return the colour of a black body of luminance 1 for a text such as "3200 K"; None for other texts.

    Raises:
        ValueError: no colour belongs to the temperature.
    """
    match = re.fullmatch(r"\s*([0-9]{1,6}(?:\.[0-9]{1,6})?)\s*K\s*", text)
    if not match:
        return None
    kelvin = float(match[1])
    if not COLDEST <= kelvin <= HOTTEST:
        raise ValueError(f"expected a temperature from {COLDEST} to {HOTTEST} K, got {shown(text)}")
    return black_body(kelvin)
