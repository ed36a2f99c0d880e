"""Photometric units: lumens, candela and lux -> watts per steradian or square metre."""

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.job.sources import (
    DirectionalSource,
    DiscSource,
    DomeSource,
    GridSource,
    MeshSource,
    PointSource,
    RectSource,
    SpotSource,
    SunSource,
)

from .lightpath import LightPath

AnyPanel: TypeAlias = RectSource | DiscSource
LUMENS_PER_WATT = 683.0  # of light of 555 nm, by the definition of the candela; renderers take it for all light


def in_units(
    path: LightPath,
    source: PointSource | DirectionalSource | SpotSource | SunSource | DomeSource | GridSource | AnyPanel | MeshSource,
) -> LightPath:
    """Turn the strengths of a source from the units of its job into W/sr or W/m2.

    Lumens are those of all light that the lamp sends out: its intensity in candela is their number over the solid
    angle that would send out as much if it were lit evenly. What a file says of a lamp is in W/sr already.
    """
    own = isinstance(source, PointSource | SpotSource) and source.keys[0].intensity is None
    if own or source.units in (None, "W/sr", "W/m2", "W", "W/(m2 sr)"):
        return path
    by_angle = source.units == "lm" and path.panel is None  # a panel's are of its power, not of an intensity
    per_unit = 1 / LUMENS_PER_WATT / (_solid_angles(path) if by_angle else np.ones(len(path.vector)))
    return replace(path, intensity=path.intensity * per_unit[:, None])


def _solid_angles(path: LightPath) -> Float64:
    """The integral of a lamp's intensity over all directions, over its largest, at every light position, sr."""
    if path.profile is not None:
        return np.full(len(path.vector), path.profile.web.flux)
    if path.cone is None:
        return np.full(len(path.vector), 4 * np.pi)
    inner, outer = np.cos(np.radians(path.cone.angles_deg.T))
    return np.asarray(2 * np.pi * (1 - inner + (inner - outer) / 3))  # (a c + b)^2 between the cones
