"""glTF materials that let light through [KHR_materials_transmission, _ior, _volume].

KHR_materials_transmission describes a sheet without thickness: light passes straight through, coloured by the base
colour. With a volume, a closed mesh is a solid body; what it absorbs along its thickness counts as part of the colour.
"""

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..model import Glass
from .values import Tree

IOR = 1.5  # glTF's default


def pane_of(passed: float, base: Float64, texel: Float64 | None, extensions: Tree) -> Glass:
    """The pane of a material with a transmission.

    Args:
        passed: transmission, the share of light that is not reflected diffusely.
        base: (>= 3,) linear base colour.
        texel: (4,) mean of its texture, sRGB encoded; None without texture.
    """
    volume: Tree = extensions.get("KHR_materials_volume") or {}
    colour = _coloured(base, texel) * passed * _absorbed(volume)
    ior = float((extensions.get("KHR_materials_ior") or {}).get("ior", IOR))
    return Glass(colour=_rgb(colour), ior=max(ior, 1.0), solid=float(volume.get("thicknessFactor", 0.0)) > 0)


def cover_of(alpha: float, texel: Float64 | None) -> Glass:
    """The pane of a material that covers the share `alpha` of what is behind it, all colours alike."""
    shown = 1.0 - alpha * (1.0 if texel is None else float(texel[3]))
    return Glass(colour=_rgb(np.full(3, shown)), ior=1.0, covers=True)


def _coloured(base: Float64, texel: Float64 | None) -> Float64:
    colour = base[:3] if texel is None else base[:3] * linear_from_srgb(texel[:3])
    return np.asarray(np.where(np.isfinite(colour), colour, 1.0), np.float64)


def _absorbed(volume: Tree) -> Float64:
    """(3,) share of light that passes the thickness of a volume."""
    thickness, distance = float(volume.get("thicknessFactor", 0.0)), float(volume.get("attenuationDistance", np.inf))
    if not (thickness > 0 and 0 < distance < np.inf):
        return np.ones(3)
    colour = np.clip(np.array(volume.get("attenuationColor", [1.0, 1.0, 1.0]), np.float64), 0.0, 1.0)
    return np.asarray(colour ** (thickness / distance), np.float64)


def _rgb(values: Float64) -> tuple[float, float, float]:
    red, green, blue = np.clip(values, 0.0, 1.0).tolist()
    return red, green, blue
