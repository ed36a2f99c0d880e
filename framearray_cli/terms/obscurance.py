"""Obscurance W with colour bleeding [FA eq. 1].

    W(P) = 1/pi * integral over the hemisphere of R(Q) rho(d) cos(theta) dw

Cosine-distributed rays cancel cos(theta) / pi, so W is the mean of R(Q) rho(d) over rays. What the paper leaves open
(the curve rho, rays that meet nothing) is decided in docs/decisions/obscurance.md.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from ..arrays import Float32, Rgb
from ..embree.packets import LANES, MISS, TFAR, Tracer, U, V, hit_triangle, intersect, set_ray
from ..hits import SURFACE, Hits
from ..sampling import HEMISPHERE, above, cosine_direction, r2, word
from ..surface import Surfaces, reflectivity_at, specular_at

SQRT, LINEAR, CBRT, EXPONENTIAL, CONSTANT = range(5)
FALLOFFS = {"sqrt": SQRT, "linear": LINEAR, "cbrt": CBRT, "exponential": EXPONENTIAL, "constant": CONSTANT}


class ObscuranceSettings(NamedTuple):
    """The job's [obscurance] and [samples] tables for kernels.

    Attributes:
        d_max: range, scene units.
        falloff: code of the curve rho.
        tau: steepness of the exponential curve.
        n_rays: rays a hit.
        sky: whether rays are traced past d_max and escaping ones see the background.
        average: (3,) reflectivity that stands in for R(Q) where a ray meets nothing.
        background: (3,) radiance outside the scene.
    """

    d_max: float
    falloff: int
    tau: float
    n_rays: int
    sky: bool
    average: Rgb
    background: Rgb


@nb.njit(nogil=True, cache=True)
def rho(falloff: int, tau: float, x: float) -> float:
    """The falloff curve at x = d / d_max, rising from 0 (0 for `constant`) at 0 to 1 at 1."""
    if falloff == SQRT:
        return np.sqrt(x)
    if falloff == LINEAR:
        return x
    if falloff == CBRT:
        return x ** np.float32(1.0 / 3.0)
    if falloff == EXPONENTIAL:
        return np.float32(math.expm1(-tau * x) / math.expm1(-tau))
    return np.float32(0.0)


@nb.njit(nogil=True, cache=True)
def _gather(
    surfaces: Surfaces,
    tracer: Tracer,
    packets: Float32,
    n: int,
    owner: Float32,
    settings: ObscuranceSettings,
    result: Rgb,
    skylight: Rgb,
) -> None:
    """Trace the waiting hemisphere rays and add their R(Q) rho(d), or the background, to their hits."""
    intersect(tracer, packets, n)
    share = np.float32(1.0 / settings.n_rays)
    d_max = np.float32(settings.d_max)
    for i in range(n):
        w = result[owner[i]]
        triangle = hit_triangle(tracer, packets, i)
        distance = packets[i >> 4, TFAR, i & 15]
        if triangle == MISS and settings.sky:
            for channel in range(3):
                skylight[owner[i], channel] += share * settings.background[channel]
        elif triangle == MISS or distance >= d_max:
            for channel in range(3):
                w[channel] += share * settings.average[channel]
        elif settings.falloff != CONSTANT:
            u, v = packets[i >> 4, U, i & 15], packets[i >> 4, V, i & 15]
            near = share * rho(settings.falloff, settings.tau, distance / d_max)
            diffuse, mirror = reflectivity_at(surfaces, triangle, u, v), specular_at(surfaces, triangle, u, v)
            for channel in range(3):
                w[channel] += near * (diffuse[channel] + mirror[channel])


@nb.njit(nogil=True, cache=True)
def obscurance(
    hits: Hits,
    n: int,
    settings: ObscuranceSettings,
    surfaces: Surfaces,
    tracer: Tracer,
    packets: Float32,
    result: Rgb,
    skylight: Rgb,
) -> int:
    """Estimate W of hits 0 to n - 1 [FA eq. 1]; hits that reflect nothing get 0.

    Args:
        packets: room for rays; as many as fit are traced together.
        result: (n, 3) W, 0 to 1, overwritten.
        skylight: (n, 3) mean background radiance of escaping rays, overwritten; (0, 3) unless `settings.sky`.

    Returns:
        number of rays.
    """
    result[:n] = 0.0
    skylight[:n] = 0.0
    capacity = packets.shape[0] * LANES
    owner = np.empty(capacity, np.int32)
    reach = np.float32(np.inf if settings.sky else settings.d_max)
    waiting = total = 0
    for i in range(n):
        r = hits.reflectivity[i]
        if hits.kind[i] != SURFACE or (r[0] <= 0.0 and r[1] <= 0.0 and r[2] <= 0.0):
            continue
        if waiting > capacity - settings.n_rays:
            _gather(surfaces, tracer, packets, waiting, owner, settings, result, skylight)
            total, waiting = total + waiting, 0
        g, m, e, p = hits.geometric[i], hits.shading[i], hits.offset[i], hits.position[i]
        ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
        bits = word(hits.key[i], HEMISPHERE)
        for ray in range(settings.n_rays):
            a, b = r2(bits, ray)
            x, y, z = cosine_direction(m[0], m[1], m[2], a, b)
            x, y, z = above(x, y, z, g[0], g[1], g[2])
            set_ray(packets, waiting, ox, oy, oz, x, y, z, reach)
            owner[waiting] = i
            waiting += 1
    _gather(surfaces, tracer, packets, waiting, owner, settings, result, skylight)
    return total + waiting
