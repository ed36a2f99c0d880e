"""The area that light reaches: what the light's power is divided by, for `method = "light"`.

It must not depend on how finely a surface is triangulated, nor on how many particles there are. So it is not the area
of triangles that were hit. Points are spread over all surfaces by area, and each of the two sides of a point counts
if a random walk from it meets light of position l: directly, or at a vertex of a particle that it sees.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Float64, Int32

from ...embree.packets import Tracer, is_blocked, occlude, set_ray
from ...hits.hits import ESCAPED, SURFACE, Hits, World, ray_origin
from ...hits.rays import Rays
from ...inputs.lights import LightArrays
from ...inputs.random import HEMISPHERE, PIXEL, r2, stream, word
from ...inputs.surfaces import Surfaces, geometric_normal, position_at, reflectivity_at, specular_at
from ...kernels.kernel import kernel
from ...kernels.simd import LANES
from .estimate import AMBIENT_STREAM, BATCH, Workspace, choose_all
from .walks import DIFFUSE, END, Walkers

# Points whose two sides are tested.
AREA_POINTS = 4 * BATCH
# A side counts as dark after this many bounces without light.
AREA_BOUNCES = 16
# Particle vertices that each vertex of a walk looks for.
CONNECTIONS = 4
# Particle vertices that are kept of each source, by bounce: in a house most of the early ones lie on the roof.
KEPT_BOUNCES, KEPT_EACH = 32, 256
_POINTS = 2  # sample number of these walks
_CONNECT = 16  # first dimension of the choice among particle vertices, beyond those of a walk


class Pool(NamedTuple):
    """Vertices at which particles went on: places that light of each position gets to.

    Attributes:
        position: (n_lights, n, 3), above the surface.
        normal: (n_lights, n, 3).
        size: (n_lights,) how many there are.
    """

    position: Float32
    normal: Float32
    size: Int32


def empty_pool(n_lights: int, n_sources: int) -> Pool:
    """Room for the vertices of all sources."""
    n = n_sources * KEPT_BOUNCES * KEPT_EACH
    room = np.empty((2, n_lights, n, 3), np.float32)
    return Pool(room[0], room[1], np.zeros(n_lights, np.int32))


def keep(pool: Pool, hits: Hits, walkers: Walkers, n: int, lights: range) -> None:
    """Take the first vertices among hits 0 to n - 1 that particles leave diffusely."""
    rows = np.flatnonzero((hits.kind[:n] == SURFACE) & (walkers.step[:n] == DIFFUSE))[:KEPT_EACH]
    above = hits.position[rows] + hits.offset[rows, None] * hits.geometric[rows]
    for l in lights:
        room = slice(pool.size[l], pool.size[l] + len(rows))
        pool.position[l, room], pool.normal[l, room] = above, hits.geometric[rows]
        pool.size[l] += len(rows)


@kernel
def _spread(seed: int, first: int, n: int, places: Float64) -> None:
    """Random places in [0, 1) for points first to first + n - 1: one in each equal share of the area."""
    for i in range(n):
        a, _ = r2(word(stream(seed, AMBIENT_STREAM, first + i, _POINTS), PIXEL + 1), 0)
        places[i] = (first + i + a) / AREA_POINTS


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
        diffuse, mirror = reflectivity_at(surfaces, t, u, v), specular_at(surfaces, t, u, v)
        for side in range(2):
            h = 2 * i + side
            hits.kind[h] = SURFACE
            hits.offset[h] = surfaces.offset[t]
            hits.key[h] = word(key, HEMISPHERE + 1 + side)
            walkers.walk[h], walkers.step[h] = h, DIFFUSE
            for axis in range(3):
                walkers.throughput[h, axis] = 1.0
                hits.position[h, axis] = p[axis]
                hits.geometric[h, axis] = normal[axis] if side == 0 else -normal[axis]
                hits.shading[h, axis] = hits.geometric[h, axis]
                hits.reflectivity[h, axis], hits.specular[h, axis] = diffuse[axis], mirror[axis]


@kernel
def _settle(tracer: Tracer, rays: Rays, n: int, walkers: Walkers, lit: Bytes) -> None:
    """Trace the waiting connections; where nothing is between, light reaches the walk."""
    occlude(tracer, rays.packets, n)
    for ray in range(n):
        if not is_blocked(rays.packets, ray):
            i, l = divmod(rays.place[ray], lit.shape[1])
            lit[walkers.walk[i], l] = 1


@kernel
def _connect(hits: Hits, walkers: Walkers, n: int, pool: Pool, tracer: Tracer, rays: Rays, lit: Bytes) -> int:
    """Look from hits 0 to n - 1 for particle vertices of each light position that has not reached their walk yet.

    Args:
        lit: (n_walks, n_lights) set to 1 where a vertex is seen.

    Returns:
        number of rays.
    """
    capacity = rays.packets.shape[0] * LANES
    waiting = total = 0
    for i in range(n):
        if hits.kind[i] != SURFACE or walkers.step[i] != DIFFUSE:
            continue
        ox, oy, oz = ray_origin(hits, i)
        g = hits.geometric[i]
        for l in range(lit.shape[1]):
            if lit[walkers.walk[i], l] or pool.size[l] == 0:
                continue
            for k in range(CONNECTIONS):
                j = int(word(hits.key[i], _CONNECT + k) % np.uint64(pool.size[l]))
                q, m = pool.position[l, j], pool.normal[l, j]
                x, y, z = q[0] - ox, q[1] - oy, q[2] - oz
                if not (x * g[0] + y * g[1] + z * g[2] > 0.0 and x * m[0] + y * m[1] + z * m[2] < 0.0):
                    continue
                if waiting == capacity:
                    _settle(tracer, rays, waiting, walkers, lit)
                    total, waiting = total + waiting, 0
                set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, np.float32(1.0))
                rays.place[waiting] = i * lit.shape[1] + l
                waiting += 1
    _settle(tracer, rays, waiting, walkers, lit)
    return total + waiting


@kernel
def _still_dark(hits: Hits, walkers: Walkers, n: int, lit: Bytes) -> int:
    """End walks that every light position reaches, and those that left the scene; returns how many go on."""
    left = 0
    for i in range(n):
        dark = False
        for l in range(lit.shape[1]):
            dark |= lit[walkers.walk[i], l] == 0
        if not dark or hits.kind[i] != SURFACE:
            walkers.step[i] = END
        elif walkers.step[i] != END:
            left += 1
    return left


def _reach(work: Workspace, n: int, world: World, lights: LightArrays, pool: Pool, sky: bool) -> Bytes:
    """Which of the walks that stand at hits 0 to n - 1 meet light of each position, (n, n_lights), 0 or 1."""
    lit = np.zeros((n, lights.n_lights), np.uint8)
    for _ in range(AREA_BOUNCES):
        hits, walkers = work.hits[0], work.walkers[0]
        lit[walkers.walk[:n]] |= (work.diffuse_direct(n, lights, world.tracer) > 0).any(axis=1)
        work.rays += _connect(hits, walkers, n, pool, world.tracer, work.test_rays, lit)
        if sky:
            lit[walkers.walk[:n][hits.kind[:n] == ESCAPED]] = 1
        if not _still_dark(hits, walkers, n, lit):
            break
        n = work.advance(n, world)
        choose_all(work.hits[0], work.walkers[0], n, True)
    return lit


def reached_area(
    work: Workspace, seed: int, world: World, lights: LightArrays, pool: Pool, sky: bool
) -> tuple[Float64, Float64, Float64]:
    """Measure the surface sides that light reaches.

    Args:
        sky: whether the background gives light too.

    Returns:
        area of each light position, (n_lights,); its relative variance, (n_lights,); and the average reflectivity of
        those sides, all light positions together, (3,).
    """
    edges = world.surfaces.corners[:, 1:].astype(np.float64) - world.surfaces.corners[:, :1]
    cumulated = np.cumsum(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))
    half = BATCH // 2
    places, reflectivity, points = np.empty(half), np.zeros(3), []
    for first in range(0, AREA_POINTS, half):
        _spread(seed, first, half, places)
        triangle = np.searchsorted(cumulated, places * cumulated[-1], side="right")
        triangle = np.minimum(triangle, len(cumulated) - 1).astype(np.int32)
        _stand_on(world.surfaces, triangle, seed, first, half, work.hits[0], work.walkers[0])
        own = (work.hits[0].reflectivity + work.hits[0].specular).astype(np.float64)
        lit = _reach(work, BATCH, world, lights, pool, sky)
        reflectivity += lit.sum(axis=1) @ own
        points.append(lit.reshape(half, 2, -1).sum(axis=1))
    lit_sides = np.concatenate(points).astype(np.float64)  # (AREA_POINTS, n_lights), 0 to 2
    total = lit_sides.sum(axis=0)
    # Neighbours in the order of triangles are alike, so that a share's own spread is that against the next one.
    squares = 0.5 * (np.diff(lit_sides, axis=0) ** 2).sum(axis=0) * (AREA_POINTS / (AREA_POINTS - 1))
    variance = np.divide(squares, total**2, out=np.zeros_like(total), where=total > 0)
    return cumulated[-1] * total / AREA_POINTS, variance, reflectivity / max(total.sum(), 1.0)
