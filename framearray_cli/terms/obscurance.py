"""Obscurance W with colour bleeding [FA eq. 1].

    W(P) = 1/pi * integral over the hemisphere of R(Q) rho(d) cos(theta) dw

Cosine-distributed rays cancel cos(theta) / pi, so W is the mean of R(Q) rho(d) over rays. What the paper leaves open
(the curve rho, rays that meet nothing) is decided in docs/decisions/obscurance.md.
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Real, Rgb
from ..embree.packets import LANES, MISS, TFAR, Tracer, U, V, hit_triangle, intersect, set_ray
from ..hits import Hits, ray_origin, reflects
from ..kernel import inlined, kernel
from ..rays import Rays
from ..sampling import HEMISPHERE, above, cosine_direction, shifted, word
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
        step_x, step_y: the lattice that spreads them, see `lattice_steps`.
        sky: whether rays are traced past d_max and escaping ones see the background.
        average: (3,) reflectivity that stands in for R(Q) where a ray meets nothing.
        background: (3,) radiance outside the scene.
    """

    d_max: float
    falloff: int
    tau: float
    n_rays: int
    step_x: int
    step_y: int
    sky: bool
    average: Rgb
    background: Rgb


@inlined
def rho(falloff: int, tau: Real, x: Real) -> Real:
    """The falloff curve at x = d / d_max, rising from 0 (0 for `constant`) at 0 to 1 at 1."""
    if falloff == SQRT:
        return np.float32(np.sqrt(x))
    if falloff == LINEAR:
        return x
    if falloff == CBRT:
        return np.float32(x ** np.float32(1.0 / 3.0))
    if falloff == EXPONENTIAL:
        return np.float32(math.expm1(-tau * x) / math.expm1(-tau))
    return np.float32(0.0)


@kernel
def _gather(
    surfaces: Surfaces,
    tracer: Tracer,
    rays: Rays,
    n: int,
    settings: ObscuranceSettings,
    result: Rgb,
    skylight: Rgb,
) -> None:
    """Trace the waiting hemisphere rays and add their R(Q) rho(d), or the background, to their hits."""
    packets = rays.packets
    intersect(tracer, packets, n, False)
    share = np.float32(1.0 / settings.n_rays)
    d_max = np.float32(settings.d_max)
    for i in range(n):
        owned = rays.place[i]
        triangle = hit_triangle(tracer, packets, i)
        distance = packets[i >> 4, TFAR, i & 15]
        if triangle == MISS and settings.sky:
            for channel in range(3):
                skylight[owned, channel] += share * settings.background[channel]
        elif triangle == MISS or distance >= d_max:
            for channel in range(3):
                result[owned, channel] += share * settings.average[channel]
        elif settings.falloff != CONSTANT:
            u, v = packets[i >> 4, U, i & 15], packets[i >> 4, V, i & 15]
            near = share * rho(settings.falloff, settings.tau, distance / d_max)
            diffuse, mirror = reflectivity_at(surfaces, triangle, u, v), specular_at(surfaces, triangle, u, v)
            for channel in range(3):
                result[owned, channel] += near * (diffuse[channel] + mirror[channel])


@kernel
def obscurance(
    hits: Hits,
    n: int,
    settings: ObscuranceSettings,
    surfaces: Surfaces,
    tracer: Tracer,
    rays: Rays,
    result: Rgb,
    skylight: Rgb,
) -> int:
    """Estimate W of hits 0 to n - 1 [FA eq. 1]; hits that reflect nothing get 0.

    Args:
        rays: room for rays; as many as fit are traced together.
        result: (n, 3) W, 0 to 1, overwritten.
        skylight: (n, 3) mean background radiance of escaping rays, overwritten; (0, 3) unless `settings.sky`.

    Returns:
        number of rays.
    """
    for i in range(n):
        for channel in range(3):
            result[i, channel] = 0.0
            if settings.sky:
                skylight[i, channel] = 0.0
    capacity = rays.packets.shape[0] * LANES
    reach = np.float32(np.inf if settings.sky else settings.d_max)
    waiting = total = 0
    for i in range(n):
        if not reflects(hits, i):
            continue
        if waiting > capacity - settings.n_rays:
            _gather(surfaces, tracer, rays, waiting, settings, result, skylight)
            total, waiting = total + waiting, 0
        ox, oy, oz = ray_origin(hits, i)
        gx, gy, gz = hits.geometric[i, 0], hits.geometric[i, 1], hits.geometric[i, 2]
        mx, my, mz = hits.shading[i, 0], hits.shading[i, 1], hits.shading[i, 2]
        bits = word(hits.key[i], HEMISPHERE)
        for ray in range(settings.n_rays):
            a, b = shifted(bits, ray, settings.step_x, settings.step_y)
            x, y, z = cosine_direction(mx, my, mz, a, b)
            x, y, z = above(x, y, z, gx, gy, gz)
            set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, reach)
            rays.place[waiting] = i
            waiting += 1
    _gather(surfaces, tracer, rays, waiting, settings, result, skylight)
    return total + waiting
