"""Direct light: the irradiance of every light position at a hit, one shadow ray a hit a source a light position."""

import numpy as np

from ..arrays import Float32, Real, Triple
from ..embree.packets import DIRECTION, LANES, ORIGIN, TFAR, Tracer, is_blocked, occlude
from ..hits import Hits, ray_origin, reflects
from ..kernel import inlined, kernel
from ..lights import DIRECTIONAL, LightArrays
from ..rays import Rays

# A shadow ray ends this share of its length before the light, so that a light on a surface is not hidden by it.
FAR_END = np.float32(1.0 - 1e-4)
# Rows of candidates: vector to the light, geometry factor, and the light index it belongs to.
X, Y, Z, VALUE, LIGHT = range(5)


@inlined
def look(hits: Hits, i: int, lights: LightArrays, s: int, row: Float32) -> None:
    """Compute, for every light position, the vector from hit i to source s and the geometry factor of its irradiance.

    The factor is cos(theta) / d^2 for a point source, whose vector ends at the source, and cos(theta) for a
    directional one, whose vector has length 1. It is 0 where the source does not shine, is behind either normal, or
    is exactly at the hit.
    """
    px, py, pz = hits.position[i, 0], hits.position[i, 1], hits.position[i, 2]
    gx, gy, gz = hits.geometric[i, 0], hits.geometric[i, 1], hits.geometric[i, 2]
    mx, my, mz = hits.shading[i, 0], hits.shading[i, 1], hits.shading[i, 2]
    nothing, one = np.float32(0.0), np.float32(1.0)
    if lights.kind[s] == DIRECTIONAL:
        for l in range(row.shape[1]):
            x, y, z = -lights.vector[s, 0, l], -lights.vector[s, 1, l], -lights.vector[s, 2, l]
            cosine = mx * x + my * y + mz * z
            in_front = (cosine > nothing) & (gx * x + gy * y + gz * z > nothing)
            row[X, l], row[Y, l], row[Z, l] = x, y, z
            row[VALUE, l] = cosine * lights.lit[s, l] if in_front else nothing
    else:
        for l in range(row.shape[1]):
            x, y, z = lights.vector[s, 0, l] - px, lights.vector[s, 1, l] - py, lights.vector[s, 2, l] - pz
            inverse = one / np.sqrt(x * x + y * y + z * z)
            cosine = mx * x + my * y + mz * z
            in_front = (cosine > nothing) & (gx * x + gy * y + gz * z > nothing)
            row[X, l], row[Y, l], row[Z, l] = x, y, z
            row[VALUE, l] = cosine * inverse * inverse * inverse * lights.lit[s, l] if in_front else nothing


@inlined
def _keep_lit(row: Float32) -> int:
    """Move the candidates whose factor is not 0 to the front, with the light index of each; returns their number."""
    n_lights = row.shape[1]
    m = 0
    for l in range(n_lights):
        m += row[VALUE, l] > 0.0
    index = row.view(np.int32)
    if m == n_lights:
        for l in range(n_lights):
            index[LIGHT, l] = l
        return m
    k = 0
    for l in range(n_lights):
        if row[VALUE, l] > 0.0:
            row[X, k], row[Y, k], row[Z, k], row[VALUE, k] = row[X, l], row[Y, l], row[Z, l], row[VALUE, l]
            index[LIGHT, k] = l
            k += 1
    return m


@inlined
def _queue(row: Float32, first: int, m: int, origin: Triple, reach: Real, rays: Rays, waiting: int) -> None:
    """Write candidates first to first + m - 1 as waiting rays; they fit one packet: a few vector stores."""
    p, lane = waiting >> 4, waiting & 15
    ox, oy, oz = origin
    for k in range(m):
        rays.packets[p, ORIGIN, lane + k] = ox
        rays.packets[p, ORIGIN + 1, lane + k] = oy
        rays.packets[p, ORIGIN + 2, lane + k] = oz
        rays.packets[p, DIRECTION, lane + k] = row[X, first + k]
        rays.packets[p, DIRECTION + 1, lane + k] = row[Y, first + k]
        rays.packets[p, DIRECTION + 2, lane + k] = row[Z, first + k]
        rays.packets[p, TFAR, lane + k] = reach


@kernel
def _settle(tracer: Tracer, rays: Rays, n: int, irradiance: Float32) -> None:
    """Trace the waiting shadow rays and add what is not blocked."""
    occlude(tracer, rays.packets, n, True)
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    flat = irradiance.reshape(irradiance.size)
    for channel in range(channels):
        for ray in range(n):
            value = np.float32(0.0) if is_blocked(rays.packets, ray) else rays.value[channel, ray]
            flat[rays.place[ray] + channel * n_lights] += value


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
    index = rays.row.view(np.int32)
    waiting = total = 0
    for i in range(n):
        for channel in range(channels):
            for l in range(n_lights):
                irradiance[i, channel, l] = 0.0
        if not reflects(hits, i):
            continue
        origin = ray_origin(hits, i)
        for s in range(lights.kind.shape[0]):
            look(hits, i, lights, s, rays.row)
            reach = np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END
            m = _keep_lit(rays.row)
            k = 0
            while k < m:
                if waiting == capacity:
                    _settle(tracer, rays, waiting, irradiance)
                    total, waiting = total + waiting, 0
                fit = min(LANES - (waiting & 15), m - k)
                _queue(rays.row, k, fit, origin, reach, rays, waiting)
                for ray in range(fit):
                    rays.place[waiting + ray] = i * channels * n_lights + index[LIGHT, k + ray]
                for channel in range(channels):
                    for ray in range(fit):
                        strength = lights.strength[s, channel, index[LIGHT, k + ray]]
                        rays.value[channel, waiting + ray] = rays.row[VALUE, k + ray] * strength
                waiting += fit
                k += fit
    _settle(tracer, rays, waiting, irradiance)
    return total + waiting
