"""Lights as kernels take them: where they are, how strong, and the irradiance they give at a point.

Light reuse keeps one number a hit and a light position where it can. All sources of a light position often share one
colour; then a hit stores a scalar irradiance and the colour is multiplied in once a pixel. Only where sources of
different colours shine together does a hit store three channels.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from .arrays import Float32, Float64
from .paths import Lights

POINT, DIRECTIONAL = 0, 1


class LightArrays(NamedTuple):
    """All sources of a job for kernels.

    Attributes:
        kind: (n_sources,) POINT or DIRECTIONAL.
        vector: (n_sources, n_lights, 3) position, centred, or the unit direction that light travels.
        strength: (n_sources, n_lights, channels) W/sr or W/m2 in units of `colour`; 1 or 3 channels.
        colour: (n_lights, 3) what a stored irradiance is multiplied with; ones where there are 3 channels.
    """

    kind: Float32
    vector: Float32
    strength: Float32
    colour: Float32

    @property
    def channels(self) -> int:
        """1 where all sources of each light position share a colour, else 3."""
        return int(self.strength.shape[2])

    @property
    def n_lights(self) -> int:
        """Number of light positions N_l."""
        return int(self.vector.shape[1])


def light_arrays(lights: Lights, centre: Float64) -> LightArrays:
    """Gather what kernels read of the lights, and find out whether one channel does."""
    intensity = np.stack([source.intensity for source in lights.sources])  # (n_sources, n_lights, 3)
    vector = np.stack(
        [source.vector - centre if source.kind == "point" else source.vector for source in lights.sources]
    )
    colour = intensity.sum(axis=0)
    largest = colour.max(axis=-1, keepdims=True)
    colour = np.divide(colour, largest, out=np.ones_like(colour), where=largest > 0)
    scalar = intensity.max(axis=-1, keepdims=True)
    if np.allclose(scalar * colour, intensity, rtol=1e-6, atol=0.0):  # beyond that, float32 would show the difference
        strength = scalar
    else:
        strength, colour = intensity, np.ones_like(colour)
    kind = [POINT if source.kind == "point" else DIRECTIONAL for source in lights.sources]
    return LightArrays(
        kind=np.array(kind, np.int32),
        vector=np.ascontiguousarray(vector, np.float32),
        strength=np.ascontiguousarray(strength, np.float32),
        colour=np.ascontiguousarray(colour, np.float32),
    )


@nb.njit(nogil=True, cache=True)
def towards(
    lights: LightArrays, s: int, l: int, px: float, py: float, pz: float
) -> tuple[float, float, float, float, float]:
    """The vector from a point to source s at light index l, the reach of a ray along it, and the geometry factor.

    Irradiance = strength * factor * (normal . vector). A point source's vector ends at the source (reach 1) and its
    factor is 1 / d^3; a directional source's vector is a unit vector without end and its factor is 1.
    A point exactly at the source gets no light: the factor is 0.
    """
    v = lights.vector[s, l]
    if lights.kind[s] == DIRECTIONAL:
        return -v[0], -v[1], -v[2], np.float32(np.inf), np.float32(1.0)
    x, y, z = v[0] - px, v[1] - py, v[2] - pz
    square = x * x + y * y + z * z
    if not square > 0.0:
        return x, y, z, np.float32(1.0), np.float32(0.0)
    inverse = np.float32(1.0) / np.sqrt(square)
    return x, y, z, np.float32(1.0), inverse * inverse * inverse
