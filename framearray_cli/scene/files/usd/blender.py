"""What Blender's exporter of USD writes otherwise than the schemas of UsdLux define it.

Its suns have a quarter of their strength and half of their angle. The softness of a spot is Blender's `blend`, a share
of the cosine. Every light has a temperature, switched on: 6500 K where nobody gave one, and then it is white.
"""

import re
from typing import Any

from .library import usd

SUN_STRENGTH, SUN_ANGLE = 4.0, 2.0
SUN_NOTE = "its strength and angle are those of Blender, which writes a quarter and a half of them"
MADE_BY = re.compile(r"Blender v(\d+)\.")  # documentation of a layer
FIRST = 4  # version that writes lights so


def is_by_blender(prim: Any) -> bool:
    """Whether the strength of a light stands in a layer that Blender wrote."""
    attribute = prim.GetAttribute("inputs:intensity")
    specs = attribute.GetPropertyStack(usd().Usd.TimeCode.Default()) if attribute else []
    made = MADE_BY.match(specs[0].layer.documentation) if specs else None
    return made is not None and int(made[1]) >= FIRST
