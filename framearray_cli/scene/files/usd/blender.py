"""What Blender's exporter of USD writes otherwise than the schemas of UsdLux define it.

Its suns have a quarter of their strength and half of their angle. The softness of a spot is Blender's `blend`, a share
of the cosine. Every light has a temperature, switched on: 6500 K where nobody gave one, and then it is white. A dome
light whose image is not turned in Blender lacks the turn that its exporter gives all others.
"""

import re
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64

from .nodes import matrix
from .usdcore import usd

SUN_STRENGTH, SUN_ANGLE = 4.0, 2.0
SUN_NOTE = "its strength and angle are those of Blender, which writes a quarter and a half of them"
MADE_BY = re.compile(r"Blender v(\d+)\.")  # documentation of a layer
FIRST = 4  # version that writes lights so
TURN = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # about x and then z, by 90 degrees each


def turn_of_dome(prim: Any, time: Any) -> Float64:
    """(3, 3) turn of the image of a dome light before its own: that which Blender left out, or none."""
    local = matrix(usd().UsdGeom.Xformable(prim).GetLocalTransformation(time))
    left_out = is_by_blender(prim, "inputs:texture:file") and bool((local == np.eye(4)).all())
    return TURN if left_out else np.eye(3)


def is_by_blender(prim: Any, key: str = "inputs:intensity") -> bool:
    """Whether a value of a light stands in a layer that Blender wrote."""
    attribute = prim.GetAttribute(key)
    specs = attribute.GetPropertyStack(usd().Usd.TimeCode.Default()) if attribute else []
    made = MADE_BY.match(specs[0].layer.documentation) if specs else None
    return made is not None and int(made[1]) >= FIRST
