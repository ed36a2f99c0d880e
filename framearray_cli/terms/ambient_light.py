"""Ambient intensity by particles from the light, as in [FA]: deposited power divided by the area that light reaches.

    E[l] = (power deposited, all bounces) / (area of the surface sides that light of position l reaches)

The area must not depend on how finely a surface is triangulated, nor on how many particles there are. So it is not
the area of triangles that were hit: points are spread over all surfaces by area, and each of the two sides of a point
counts if a random walk from it meets light of position l. In a room with windows the lit facade counts too, which
makes E[l] too small or too large there; `method = "eye"` does not have that fault.
"""

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..embree.packets import Tracer, intersect, set_ray
from ..hits import SURFACE, Hits, record_hits
from ..kernel import kernel
from ..lights import DIRECTIONAL, LightArrays
from ..sampling import HEMISPHERE, PIXEL, r2, stream, word
from ..surface import Surfaces, geometric_normal, position_at, reflectivity_at, specular_at
from .ambient import AMBIENT_STREAM, BATCH, TARGET_ERROR, Ambient, Workspace, choose_all, relative_error, summarise
from .walks import DIFFUSE, MAX_BOUNCES, Walkers

# Points whose two sides measure the area that light reaches.
AREA_POINTS = 4 * BATCH
# A side counts as dark after this many bounces without light.
AREA_BOUNCES = 16
# Particles a light position, unless the job says.
MOST = 16 * BATCH
_PARTICLES, _POINTS = 1, 2  # sample numbers that keep the two uses apart


@kernel
def _emit(
    lights: LightArrays,
    s: int,
    l: int,
    seed: int,
    first: int,
    n: int,
    radius: float,
    surfaces: Surfaces,
    tracer: Tracer,
    packets: Float32,
    hits: Hits,
    walkers: Walkers,
) -> None:
    """Send particles first to first + n - 1 from source s; the random numbers are the same for every light position.

    A directional source sends them through a disc as wide as the scene, placed before it.
    """
    start = word(stream(seed, AMBIENT_STREAM, 0, _PARTICLES), PIXEL)
    v = lights.vector[s, 0, l], lights.vector[s, 1, l], lights.vector[s, 2, l]
    for i in range(n):
        a, b = r2(start, first + i)
        angle = 2.0 * np.pi * a
        if lights.kind[s] == DIRECTIONAL:
            side = (0.0, 1.0, 0.0) if abs(v[0]) > 0.5 else (1.0, 0.0, 0.0)
            ux, uy, uz = (
                v[1] * side[2] - v[2] * side[1],
                v[2] * side[0] - v[0] * side[2],
                v[0] * side[1] - v[1] * side[0],
            )
            scale = radius * np.sqrt(b) / np.sqrt(ux * ux + uy * uy + uz * uz)
            wx, wy, wz = v[1] * uz - v[2] * uy, v[2] * ux - v[0] * uz, v[0] * uy - v[1] * ux
            p, q = scale * np.cos(angle), scale * np.sin(angle)
            ox, oy, oz = p * ux + q * wx, p * uy + q * wy, p * uz + q * wz
            ox, oy, oz = ox - 2.0 * radius * v[0], oy - 2.0 * radius * v[1], oz - 2.0 * radius * v[2]
            dx, dy, dz = v[0], v[1], v[2]
        else:
            ox, oy, oz = v[0], v[1], v[2]
            dz = 1.0 - 2.0 * b
            r = np.sqrt(max(0.0, 1.0 - dz * dz))
            dx, dy = r * np.cos(angle), r * np.sin(angle)
        set_ray(packets, i, ox, oy, oz, dx, dy, dz, np.float32(np.inf))
        hits.key[i] = stream(seed, AMBIENT_STREAM, (first + i) & ((1 << 28) - 1), _PARTICLES)
        walkers.walk[i] = i
        for channel in range(3):
            walkers.throughput[i, channel] = 1.0
    intersect(tracer, packets, n)
    record_hits(surfaces, tracer, packets, n, True, hits)


@kernel
def _land(hits: Hits, walkers: Walkers, n: int, power: Float32, l: int, sums: Float32) -> None:
    """Leave the power of every particle that met a surface with its walk."""
    for i in range(n):
        if hits.kind[i] == SURFACE:
            for channel in range(3):
                sums[walkers.walk[i], channel, l] += walkers.throughput[i, channel] * power[channel]


@kernel
def _stand_on(surfaces: Surfaces, triangle: Int32, seed: int, first: int, n: int, hits: Hits, walkers: Walkers) -> None:
    """Place 2 n hits on both sides of n points, uniform on the given triangles."""
    for i in range(n):
        key = stream(seed, AMBIENT_STREAM, first + i, _POINTS)
        a, b = r2(word(key, PIXEL), 0)
        root = np.sqrt(a)
        u, v = root * (np.float32(1.0) - b), root * b
        t = triangle[i]
        p = position_at(surfaces, t, u, v)
        normal = geometric_normal(surfaces, t, 0.0, 0.0, 0.0)
        for side in range(2):
            h = 2 * i + side
            hits.kind[h] = SURFACE
            hits.offset[h] = surfaces.offset[t]
            hits.key[h] = word(key, HEMISPHERE + side)
            walkers.walk[h], walkers.step[h] = h, DIFFUSE
            diffuse, mirror = reflectivity_at(surfaces, t, u, v), specular_at(surfaces, t, u, v)
            for axis in range(3):
                hits.position[h, axis] = p[axis]
                hits.geometric[h, axis] = normal[axis] if side == 0 else -normal[axis]
                hits.shading[h, axis] = hits.geometric[h, axis]
                hits.reflectivity[h, axis], hits.specular[h, axis] = diffuse[axis], mirror[axis]


def _reached_area(
    work: Workspace, seed: int, surfaces: Surfaces, tracer: Tracer, lights: LightArrays
) -> tuple[Float64, Float64]:
    """Area of the surface sides that each light position reaches, and its relative variance; (n_lights,) each."""
    edges = surfaces.corners[:, 1:].astype(np.float64) - surfaces.corners[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    cumulated = np.cumsum(areas)
    sides = np.zeros(lights.n_lights)
    half = BATCH // 2
    for first in range(0, AREA_POINTS, half):
        spread = (
            (np.arange(first, first + half) + 0.5) / AREA_POINTS * cumulated[-1]
        )  # one point an equal share of area
        triangle = np.minimum(np.searchsorted(cumulated, spread), len(areas) - 1).astype(np.int32)
        _stand_on(surfaces, triangle, seed, first, half, work.hits[0], work.walkers[0])
        lit = np.zeros((BATCH, lights.n_lights), bool)
        n = BATCH
        for _ in range(AREA_BOUNCES):
            irradiance = work.direct(np.ones((n, 3), np.float32), n, lights, tracer)
            np.logical_or.at(lit, work.walkers[0].walk[:n], (irradiance > 0).any(axis=1))
            n = work.advance(n, surfaces, tracer)
            choose_all(work.hits[0], work.walkers[0], n, True)
            if n == 0:
                break
        sides += lit.sum(axis=0)
    share = sides / (2 * AREA_POINTS)
    variance = np.divide(1 - share, share * 2 * AREA_POINTS, out=np.zeros_like(share), where=share > 0)
    return 2 * cumulated[-1] * share, variance


def ambient_by_light(seed: int, paths: int | None, surfaces: Surfaces, tracer: Tracer, lights: LightArrays) -> Ambient:
    """Estimate I_A[l] and the average reflectivity by particles from the lights [FA].

    Args:
        paths: particles a light position; None: as many as a standard error of 1 % takes, at most `MOST`.
    """
    work = Workspace(lights)
    area, area_variance = _reached_area(work, seed, surfaces, tracer, lights)
    radius = float(np.sqrt((surfaces.corners.reshape(-1, 3).astype(np.float64) ** 2).sum(axis=1).max()))
    total, squares = np.zeros((3, lights.n_lights)), np.zeros(lights.n_lights)
    reflectivity, landed, spent = np.zeros(3), 0, 0
    limit = paths or MOST
    while spent < limit:
        n = min(BATCH, limit - spent)
        work.sums[:] = 0.0
        for l in range(lights.n_lights):
            for s in range(len(lights.kind)):
                hits_in = _trace_particles(work, s, l, seed, spent, n, radius, surfaces, tracer, lights)
                reflectivity += hits_in[0]
                landed += hits_in[1]
        spent += n
        power = work.sums[:n].astype(np.float64)
        total += power.sum(axis=0)
        squares += (power.mean(axis=1) ** 2).sum(axis=0)
        if paths is None and relative_error(total, squares, spent).max() <= TARGET_ERROR:
            break
    per_area = np.divide(1.0, area, out=np.zeros_like(area), where=area > 0)
    return summarise(
        total * per_area,
        squares * per_area**2,
        spent,
        reflectivity * (spent / max(landed, 1)),
        spent,
        work.rays,
        paths is None,
        area_variance,
    )


def _trace_particles(
    work: Workspace,
    s: int,
    l: int,
    seed: int,
    first: int,
    n: int,
    radius: float,
    surfaces: Surfaces,
    tracer: Tracer,
    lights: LightArrays,
) -> tuple[Float64, int]:
    """Follow n particles of source s at light index l to their ends; returns summed reflectivity of hits, and hits."""
    flow = np.pi * radius**2 if lights.kind[s] == DIRECTIONAL else 4 * np.pi
    power = (flow * lights.strength[s, :, l] * lights.colour[l]).astype(np.float32)
    reflectivity, landed = np.zeros(3), 0
    _emit(lights, s, l, seed, first, n, radius, surfaces, tracer, work.hit_packets, work.hits[0], work.walkers[0])
    work.rays += n
    for _ in range(MAX_BOUNCES):
        hits, walkers = work.hits[0], work.walkers[0]
        _land(hits, walkers, n, power, l, work.sums)
        reflectivity += (hits.reflectivity[:n] + hits.specular[:n]).sum(axis=0, dtype=np.float64)
        landed += int((hits.kind[:n] == SURFACE).sum())
        choose_all(hits, walkers, n, False)
        n = work.advance(n, surfaces, tracer)
        if n == 0:
            break
    return reflectivity, landed
