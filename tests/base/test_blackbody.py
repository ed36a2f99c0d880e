"""Colours of black bodies, against published points of the Planckian locus."""

import pytest

from framearray_cli.base.colour import black_body

XYZ_FROM_RGB = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))  # IEC 61966-2-1
# CIE illuminant A, and points of the locus as tables of CIE 1931 chromaticities have them.
PUBLISHED = [(2856, 0.44757, 0.40745), (4000, 0.3804, 0.3768), (6500, 0.3135, 0.3237), (10000, 0.2807, 0.2883)]
# Error of the Gaussian sums for the colour matching functions, and of sRGB's matrix in four digits.
ERROR = 0.004


@pytest.mark.parametrize(("kelvin", "x", "y"), PUBLISHED)
def test_the_chromaticity_is_that_of_the_locus(kelvin: float, x: float, y: float) -> None:
    rgb = black_body(kelvin)
    xyz = [sum(a * b for a, b in zip(row, rgb, strict=True)) for row in XYZ_FROM_RGB]
    assert xyz[0] / sum(xyz) == pytest.approx(x, abs=ERROR)
    assert xyz[1] / sum(xyz) == pytest.approx(y, abs=ERROR)


@pytest.mark.parametrize("kelvin", [1000.0, 1900.0, 3200.0, 6504.0, 40000.0])
def test_the_luminance_is_1(kelvin: float) -> None:
    red, green, blue = black_body(kelvin)
    assert 0.2126 * red + 0.7152 * green + 0.0722 * blue == pytest.approx(1, abs=1e-12)
    assert min(red, green, blue) >= 0


def test_warmer_light_has_more_blue() -> None:
    blues = [black_body(kelvin)[2] for kelvin in (2000, 3200, 5000, 6500, 10000)]
    assert blues == sorted(blues)
    assert blues[0] < 0.1 < 1 < blues[-1]
