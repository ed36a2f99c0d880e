"""Colours of a scale of numbers: lightness rises in even steps, so that the order is visible without colours.

The path in OKLab [Ottosson20] goes from dark blue over red to pale yellow, a sequence that colour-blind people see too.
"""

from functools import cache

import numpy as np

from .arrays import Bytes, Float32
from .colour import srgb_from_linear

DARKEST, LIGHTEST = 0.17, 0.97  # lightness L of OKLab
FIRST_DEG, LAST_DEG = 280.0, 465.0  # hue: blue, purple, red, orange, yellow
LEAST_CHROMA, MORE_CHROMA = 0.03, 0.13
_LMS_FROM_LAB = ((1, 0.3963377774, 0.2158037573), (1, -0.1055613458, -0.0638541728), (1, -0.0894841775, -1.2914855480))
_RGB_FROM_LMS = (
    (4.0767416621, -3.3077115913, 0.2309699292),
    (-1.2684380046, 2.6097574011, -0.3413193965),
    (-0.0041960863, -0.7034186147, 1.7076147010),
)


def ramp(values: Float32) -> Bytes:
    """Return the sRGB codes of values from 0 to 1, (..., 3); others are clipped."""
    codes: Bytes = _codes()[np.rint(np.clip(values, 0, 1) * 255).astype(np.intp)]
    return codes


@cache
def _codes() -> Bytes:
    """Tabulate 256 colours, (256, 3)."""
    t = np.linspace(0, 1, 256)
    hue, chroma = (
        np.radians(FIRST_DEG + (LAST_DEG - FIRST_DEG) * t),
        LEAST_CHROMA + MORE_CHROMA * np.sin(np.pi * t) ** 0.7,
    )
    lab = np.stack([DARKEST + (LIGHTEST - DARKEST) * t, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1)
    linear = (lab @ np.array(_LMS_FROM_LAB).T) ** 3 @ np.array(_RGB_FROM_LMS).T
    return np.asarray(np.rint(srgb_from_linear(linear) * 255), np.uint8)
