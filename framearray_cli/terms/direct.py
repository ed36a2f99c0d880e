"""Direct light: the irradiance of every light position at a hit, one shadow ray a hit a source a light position."""

import numpy as np

from ..arrays import Float32
from ..embree.packets import LANES, Tracer, is_blocked, occlude, set_ray
from ..hits import Hits, ray_origin, reflects
from ..kernel import inlined, kernel
from ..lights import DIRECTIONAL, LightArrays
from ..rays import Rays

# A shadow ray ends this share of its length before the light, so that a light on a surface is not hidden by it.
FAR_END = np.float32(1.0 - 1e-4)
X, Y, Z, COSINE, VALUE = range(5)


@inlined
def _look(hits: Hits, i: int, lights: LightArrays, s: int, row: Float32) -> None:
    """Compute, for every light position, the vector from hit i to source s, its cosine and its geometry factor.

    Irradiance is strength * row[VALUE]: cos(theta) / d^2 of a point source, whose vector ends at the source;
    cos(theta) of a directional one, whose vector is a unit vector. 0 where the source is behind either normal, or
    exactly at the hit.
    """
    px, py, pz = hits.position[i, 0], hits.position[i, 1], hits.position[i, 2]
    gx, gy, gz = hits.geometric[i, 0], hits.geometric[i, 1], hits.geometric[i, 2]
    mx, my, mz = hits.shading[i, 0], hits.shading[i, 1], hits.shading[i, 2]
    nothing, one = np.float32(0.0), np.float32(1.0)
    if lights.kind[s] == DIRECTIONAL:
        for l in range(row.shape[1]):
            x, y, z = -lights.vector[s, 0, l], -lights.vector[s, 1, l], -lights.vector[s, 2, l]
            cosine = mx * x + my * y + mz * z
            row[X, l], row[Y, l], row[Z, l] = x, y, z
            row[VALUE, l] = cosine if cosine > nothing and gx * x + gy * y + gz * z > nothing else nothing
    else:
        for l in range(row.shape[1]):
            x, y, z = lights.vector[s, 0, l] - px, lights.vector[s, 1, l] - py, lights.vector[s, 2, l] - pz
            square = x * x + y * y + z * z
            inverse = one / np.sqrt(square)
            cosine = mx * x + my * y + mz * z
            value = cosine * inverse * inverse * inverse
            row[X, l], row[Y, l], row[Z, l] = x, y, z
            row[VALUE, l] = value if cosine > nothing and gx * x + gy * y + gz * z > nothing else nothing


@kernel
def _settle(tracer: Tracer, rays: Rays, n: int, irradiance: Float32) -> None:
    """Trace the waiting shadow rays and add what is not blocked."""
    occlude(tracer, rays.packets, n)
    for ray in range(n):
        if not is_blocked(rays.packets, ray):
            for channel in range(irradiance.shape[1]):
                irradiance[rays.place[ray, 0], channel, rays.place[ray, 1]] += rays.value[ray, channel]


@kernel
def direct(hits: Hits, n: int, lights: LightArrays, tracer: Tracer, rays: Rays, irradiance: Float32) -> int:
    """Compute the irradiance of each light position at hits 0 to n - 1.

    A source counts where it is in front of both normals; else no ray is spent. Hits that reflect nothing get 0.

    Args:
        rays: room for rays; as many as fit are traced together.
        irradiance: (n, channels, n_lights), overwritten; in units of `lights.colour`.

    Returns:
        number of shadow rays.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    capacity = rays.packets.shape[0] * LANES
    waiting = total = 0
    for i in range(n):
        for channel in range(channels):
            for l in range(n_lights):
                irradiance[i, channel, l] = 0.0
    for i in range(n):
        if not reflects(hits, i):
            continue
        ox, oy, oz = ray_origin(hits, i)
        for s in range(lights.kind.shape[0]):
            _look(hits, i, lights, s, rays.row)
            reach = np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END
            for l in range(n_lights):
                value = rays.row[VALUE, l]
                if not (value > 0.0 and lights.lit[s, l]):
                    continue
                if waiting == capacity:
                    _settle(tracer, rays, waiting, irradiance)
                    total, waiting = total + waiting, 0
                set_ray(rays.packets, waiting, ox, oy, oz, rays.row[X, l], rays.row[Y, l], rays.row[Z, l], reach)
                rays.place[waiting, 0], rays.place[waiting, 1] = i, l
                for channel in range(channels):
                    rays.value[waiting, channel] = value * lights.strength[s, channel, l]
                waiting += 1
    _settle(tracer, rays, waiting, irradiance)
    return total + waiting
