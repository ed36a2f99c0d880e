"""The colour of a black body: linear light with Rec. 709 primaries, scaled to luminance 1."""

from functools import cache
from math import exp

# Second radiation constant, nm K; Planck's law: radiance ~ wavelength^-5 / (exp(C2 / (wavelength T)) - 1).
C2 = 1.438776877e7
FIRST_NM, LAST_NM, STEP_NM = 360, 830, 5

# CIE 1931 colour matching functions as sums of Gaussians with two widths each [Wyman13]: height, middle, widths (nm).
_X = ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2))
_Y = ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1))
_Z = ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8))

_RGB_FROM_XYZ = (  # IEC 61966-2-1
    (3.2406255, -1.5372080, -0.4986286),
    (-0.9689307, 1.8757561, 0.0415175),
    (0.0557101, -0.2040211, 1.0569959),
)
_LUMINANCE = (0.2126, 0.7152, 0.0722)  # of the Rec. 709 primaries


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
    rgb = [max(sum(row[k] * xyz[k] for k in range(3)), 0.0) for row in _RGB_FROM_XYZ]
    luminance = sum(weight * value for weight, value in zip(_LUMINANCE, rgb, strict=True))
    red, green, blue = (value / luminance for value in rgb)
    return red, green, blue


def _lobe(nm: float, height: float, middle: float, before: float, after: float) -> float:
    """A Gaussian of one width before its middle, and another after it."""
    return height * exp(-0.5 * ((nm - middle) / (before if nm < middle else after)) ** 2)
