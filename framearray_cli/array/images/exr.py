"""Describe EXR and TIFF files to OpenImageIO: channels, their number types and attributes."""

from fractions import Fraction
from typing import Any

import numpy as np

from framearray_cli.base.openimage import FIXED_DATE, oiio

from .attributes import Attribute, Attributes

OIIO_NAMES = {"exr": "openexr", "tif": "tiff"}


def spec_of(shape: tuple[int, ...], names: list[str], kinds: list[str], attributes: Attributes) -> Any:
    """Describe an image of `shape` (h, w, channels) with "half" or "float" per channel."""
    library = oiio()
    height, width, channels = shape
    spec = library.ImageSpec(width, height, channels, "float" if "float" in kinds else "half")
    spec.channelnames = names
    if len(set(kinds)) > 1:
        spec.channelformats = kinds
    for name, value in {"DateTime": FIXED_DATE, **attributes}.items():
        _set_attribute(spec, name, value)
    return spec


def _set_attribute(spec: Any, name: str, value: Attribute) -> None:
    library = oiio()
    if isinstance(value, np.ndarray):
        rows = np.asarray(value.T, np.float32)  # row vectors in the file, see attributes.py
        spec.attribute(name, library.TypeDesc("matrix44"), tuple(rows.ravel().tolist()))
    elif isinstance(value, Fraction):
        spec.attribute(name, library.TypeDesc("rational"), (value.numerator, value.denominator))
    elif isinstance(value, tuple):
        spec.attribute(name, library.TypeDesc("vector"), tuple(float(x) for x in value))
    else:
        spec.attribute(name, value)
