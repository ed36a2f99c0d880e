"""Thin glass for kernels: what a face passes and mirrors of the light that meets it; see `scene/panes.py`."""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import CornerUvs, Float32, Int32, Real, Triple
from framearray_cli.scene.panes import BENDS, COLOUR, NORMAL, OFFSET, PANE_COLUMNS, SHEET, F, G
from framearray_cli.scene.scene import Scene

from ..embree.packets import Tracer, U, V
from ..kernels.bundle import bundle
from ..kernels.kernel import has_rows, inlined, outlined
from ..kernels.simd import width_of_packets
from .surfaces import NO_SURFACES, Surfaces, interpolate, surfaces, texture_at

NOWHERE = Tracer(0, 0, 0, 0, 0, 0, 0)


@bundle
class PaneArrays(NamedTuple):
    """The triangles of thin glass.

    Attributes:
        tracer: traces rays to them, and to nothing else.
        optics: (n, PANE_COLUMNS) of `Scene`; no rows where there are none.
        texture, uvs: `Scene.pane_texture` and `pane_uvs`; no rows where no pane has a texture.
        surfaces: of the scene, for its textures.
    """

    tracer: Tracer
    optics: Float32
    texture: Int32 = np.empty(0, np.int32)
    uvs: CornerUvs = np.empty((0, 3, 2), np.float32)
    surfaces: Surfaces = NO_SURFACES


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
    if not len(scene.pane_texture):
        return PaneArrays(tracer, optics)
    return PaneArrays(tracer, optics, scene.pane_texture, scene.pane_uvs, surfaces(scene))


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
def colour_at(panes: PaneArrays, triangle: int, packets: Float32, k: int) -> Triple:
    """The colour of light behind a triangle where ray k of packets has met it."""
    width, o = width_of_packets(), panes.optics
    red, green, blue = o[triangle, COLOUR], o[triangle, COLOUR + 1], o[triangle, COLOUR + 2]
    if has_rows(panes.texture) and panes.texture[triangle] >= 0:
        r, g, b = _stain(panes, triangle, packets[k // width, U, k % width], packets[k // width, V, k % width])
        red, green, blue = red * r, green * g, blue * b
    return red, green, blue


@outlined
def _stain(panes: PaneArrays, triangle: int, u: Real, v: Real) -> Triple:
    """The share of light that the texture of a triangle lets through it at barycentric (u, v)."""
    w = np.float32(1.0) - u - v
    tu, tv = interpolate(panes.uvs, triangle, 2, 0, u, v, w), interpolate(panes.uvs, triangle, 2, 1, u, v, w)
    red, green, blue, _ = texture_at(panes.surfaces, panes.texture[triangle], tu, tv)
    if panes.optics[triangle, SHEET] > 0.0:
        return red, green, blue
    return np.sqrt(red), np.sqrt(green), np.sqrt(blue)


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
