"""Thin glass for kernels: what a face passes and mirrors of the light that meets it; see `scene/panes.py`."""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Triple
from framearray_cli.scene.panes import BENDS, COLOUR, NORMAL, OFFSET, PANE_COLUMNS, SHEET, F, G
from framearray_cli.scene.scene import Scene

from ..embree.packets import Tracer
from ..kernels.bundle import bundle
from ..kernels.kernel import inlined

NOWHERE = Tracer(0, 0, 0, 0, 0, 0, 0)


@bundle
class PaneArrays(NamedTuple):
    """The triangles of thin glass.

    Attributes:
        tracer: traces rays to them, and to nothing else.
        optics: (n, PANE_COLUMNS) of `Scene`; no rows where there are none.
    """

    tracer: Tracer
    optics: Float32


NO_PANES = PaneArrays(NOWHERE, np.empty((0, PANE_COLUMNS), np.float32))


@bundle
class Sight(NamedTuple):
    """Visibility between two points: the tracer that finds what blocks light, and the thin glass that dims it."""

    tracer: Tracer
    panes: PaneArrays = NO_PANES


def pane_arrays(scene: Scene, tracer: Tracer | None, *, bends: bool = True) -> PaneArrays:
    """The panes of a scene.

    Args:
        tracer: of `EmbreeScene.panes`; None where there are none.
        bends: True if solid bodies bend the rays of eyes; else these pass straight.
    """
    if tracer is None:
        return NO_PANES
    optics = scene.pane_optics
    if not bends and (optics[:, BENDS] > 0).any():
        optics = optics.copy()
        optics[:, BENDS] = 0.0
    return PaneArrays(tracer, optics)


def has_panes(panes: PaneArrays) -> bool:
    """Return True if there is any glass."""
    return len(panes.optics) > 0


def bends_rays(panes: PaneArrays) -> bool:
    """Return True if any glass is a solid body."""
    return has_panes(panes) and bool((panes.optics[:, BENDS] > 0).any())


@inlined
def bent_by(panes: PaneArrays, triangle: int) -> bool:
    """Return True if a triangle bends the rays of eyes."""
    return bool(panes.optics[triangle, BENDS] > 0.0)


@inlined
def reflectance(panes: PaneArrays, triangle: int, d: Triple) -> Real:
    """F of a face under a ray of direction d, of any length."""
    o = panes.optics
    x, y, z = np.float64(d[0]), np.float64(d[1]), np.float64(d[2])
    along = x * o[triangle, NORMAL] + y * o[triangle, NORMAL + 1] + z * o[triangle, NORMAL + 2]
    c = min(abs(along) / np.sqrt(x * x + y * y + z * z), 1.0)
    s = (1.0 - c) * (1.0 - c)
    return np.float32(o[triangle, F] + o[triangle, G] * s * s * (1.0 - c))


@inlined
def passed_by(panes: PaneArrays, triangle: int, f: Real) -> Real:
    """The share of light that a triangle passes, before its colour, of the reflectance f of a face."""
    one = np.float32(1.0)
    return (one - f) / (one + f) if panes.optics[triangle, SHEET] > 0.0 else one - f


@inlined
def mirrored_by(panes: PaneArrays, triangle: int, f: Real) -> Real:
    """The share of light that a triangle reflects, of the reflectance f of a face."""
    return (f + f) / (np.float32(1.0) + f) if panes.optics[triangle, SHEET] > 0.0 else f


@inlined
def colour_of(panes: PaneArrays, triangle: int, channel: int) -> Real:
    """The colour of light behind a triangle."""
    return panes.optics[triangle, COLOUR + channel]


@inlined
def step_beyond(panes: PaneArrays, triangle: int, d: Triple) -> Real:
    """Distance to the nearest next triangle, in lengths of d, so that a ray does not meet the same one again."""
    length = np.sqrt(np.float64(d[0]) * d[0] + np.float64(d[1]) * d[1] + np.float64(d[2]) * d[2])
    return np.float32(panes.optics[triangle, OFFSET] / length)


@inlined
def normal_of(panes: PaneArrays, triangle: int) -> Triple:
    """The unit normal of a triangle."""
    o = panes.optics
    return o[triangle, NORMAL], o[triangle, NORMAL + 1], o[triangle, NORMAL + 2]
