"""Lights of every kind that has arrays of its own: tests that mix kinds of light share the kernels of these."""

from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.scene.paths.lightpath import Cone, LightPath, Panel
from framearray_cli.scene.paths.profiles import Profile, Web

from .iesfiles import ies
from .irradiance import arrays

PLACE, DOWN, ACROSS = (3.0, 5.0, 4.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)
_KEY = {"frame": 0, "position": list(PLACE), "direction": list(DOWN)}


def mixed_arrays(*sources: LightPath) -> LightArrays:
    """Arrays of some sources and, behind them, of dark ones: a spot, a panel, and a measured lamp with a size."""
    n = len(sources[0].vector)
    axis, across = np.tile(DOWN, (n, 1)), np.tile(ACROSS, (n, 1))
    place: dict[str, Any] = {"kind": "point", "vector": np.tile(PLACE, (n, 1)), "intensity": np.zeros((n, 3))}
    table = Web(
        polar_deg=np.array([0.0, 90.0]), around_deg=np.zeros(1), share=np.ones((1, 2)), candela=1, sideways=False
    )
    dark = (
        LightPath(**place, cone=Cone(axis=axis, angles_deg=np.tile((20.0, 40.0), (n, 1)))),
        LightPath(**place, panel=Panel(shape="rect", axis=axis, across=across, sides=np.ones((n, 2)), two_sided=False)),
        LightPath(**place, size=np.full(n, 0.1), profile=Profile(file="a.ies", web=table, axis=axis, zero=across)),
    )
    return arrays(*sources, *dark)


def dark_sources(folder: Path) -> list[dict[str, Any]]:
    """Sources of a job, for the kernels of `mixed_arrays`; the file of the measured lamp is written to the folder."""
    file = folder / "lamp.ies"
    file.write_text(ies())
    return [
        {"type": "spot", "keys": [_KEY | {"intensity": 0.0}]},
        {"type": "rect", "keys": [_KEY | {"width": 0.5, "height": 0.2, "radiance": 0.0}]},
        {"type": "spot", "ies": str(file), "keys": [_KEY | {"intensity": 0.0, "radius": 0.1}]},
    ]
