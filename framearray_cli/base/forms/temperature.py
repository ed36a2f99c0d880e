"""Colours that files give as temperatures: "3200 K"."""

import re

from ..blackbody import black_body
from .table import Float3, fail
from .words import shown

COLDEST, HOTTEST = 1000, 40000  # kelvin; below, only red light is left; above, nothing changes
PATTERN = r"\s*([0-9]{1,6}(?:\.[0-9]{1,6})?)\s*K\s*"
SCHEMA = {"type": "string", "pattern": r"^\s*[0-9]{1,6}(\.[0-9]{1,6})?\s*K\s*$"}  # without a group that captures
EXAMPLE = 'a temperature such as "3200 K"'


def temperature_colour(text: str) -> Float3 | None:
    """Return the colour of a black body of luminance 1 by its temperature; None if the text is no temperature.

    Raises:
        ValidationError: by `fail`, where no colour belongs to the temperature.
    """
    match = re.fullmatch(PATTERN, text)
    if not match:
        return None
    kelvin = float(match[1])
    if not COLDEST <= kelvin <= HOTTEST:
        fail([((), f"expected a temperature from {COLDEST} to {HOTTEST} K, got {shown(text)}")])
    return black_body(kelvin)
