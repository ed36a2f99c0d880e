"""Direct light: the irradiance of every light position at a hit, one shadow ray a hit a source a light position."""

import numba as nb
import numpy as np

from ..arrays import Float32
from ..embree.packets import LANES, Tracer, is_blocked, occlude, set_ray
from ..hits import SURFACE, Hits
from ..lights import LightArrays, towards

# Hits whose shadow rays are traced together: their rays to one light position are neighbours, and the rays of all
# light positions of a block still fit the cache.
BLOCK = 64
# A shadow ray ends this share of its length before the light, so that a light on a surface is not hidden by it.
FAR_END = np.float32(1.0 - 1e-4)


@nb.njit(nogil=True, cache=True)
def _settle(tracer: Tracer, packets: Float32, n: int, place: Float32, value: Float32, irradiance: Float32) -> None:
    """Trace the waiting shadow rays and add what is not blocked."""
    occlude(tracer, packets, n)
    for i in range(n):
        if not is_blocked(packets, i):
            for channel in range(irradiance.shape[1]):
                irradiance[place[i, 0], channel, place[i, 1]] += value[i, channel]


@nb.njit(nogil=True, cache=True)
def direct(hits: Hits, n: int, lights: LightArrays, tracer: Tracer, packets: Float32, irradiance: Float32) -> int:
    """Compute the irradiance of each light position at hits 0 to n - 1.

    A source counts where it is in front of both normals; else no ray is spent. Hits that reflect nothing get 0.

    Args:
        packets: room for rays; as many as fit are traced together.
        irradiance: (n, channels, n_lights), overwritten; in units of `lights.colour`.

    Returns:
        number of shadow rays.
    """
    irradiance[:n] = 0.0
    n_sources, n_lights, channels = lights.strength.shape
    capacity = packets.shape[0] * LANES
    place = np.empty((capacity, 2), np.int32)
    value = np.empty((capacity, channels), np.float32)
    waiting = total = 0
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        for s in range(n_sources):
            for l in range(n_lights):
                if waiting > capacity - BLOCK:
                    _settle(tracer, packets, waiting, place, value, irradiance)
                    total, waiting = total + waiting, 0
                for i in range(start, stop):
                    r = hits.reflectivity[i]
                    if hits.kind[i] != SURFACE or (r[0] <= 0.0 and r[1] <= 0.0 and r[2] <= 0.0):
                        continue
                    g, e, p = hits.geometric[i], hits.offset[i], hits.position[i]
                    x, y, z, reach, factor = towards(lights, s, l, p[0], p[1], p[2])
                    m = hits.shading[i]
                    cosine = m[0] * x + m[1] * y + m[2] * z
                    if not (cosine > 0.0 and g[0] * x + g[1] * y + g[2] * z > 0.0 and factor > 0.0):
                        continue
                    ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
                    set_ray(packets, waiting, ox, oy, oz, x, y, z, reach * FAR_END)
                    place[waiting, 0], place[waiting, 1] = i, l
                    for channel in range(channels):
                        value[waiting, channel] = lights.strength[s, l, channel] * factor * cosine
                    waiting += 1
    _settle(tracer, packets, waiting, place, value, irradiance)
    return total + waiting
