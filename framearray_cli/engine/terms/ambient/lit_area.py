"""The area of the surface sides that light reaches, by which `method = "light"` divides the light's power.

It must depend neither on the triangulation of a surface nor on the number of particles, so it is not the area of the
triangles that particles hit. Instead points are spread over all surfaces by area. A side of a point counts if a random
walk from it meets light of position l: directly, or at a vertex of a particle that it sees.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Float64, Int32

from ...embree.packets import Tracer, is_blocked, occlude, room_in, set_ray
from ...hits.hits import ESCAPED, SURFACE, Hits, World, ray_origin
from ...hits.rays import NO_RAYS, Rays
from ...inputs.lights import LightArrays
from ...inputs.random import HEMISPHERE, PIXEL, r2, random_word, stream
from ...inputs.surfaces import Surfaces, geometric_normal, position_at, reflectivity_at, specular_at
from ...kernels.kernel import kernel, step
from .estimate import AMBIENT_STREAM, BATCH, Workspace, choose_steps
from .walks import DIFFUSE, END, Walkers

# Number of points, of two sides each.
AREA_POINTS = 4 * BATCH
# A side counts as dark after this many bounces without light.
AREA_BOUNCES = 16
# Particle vertices to which each vertex of a walk is connected.
CONNECTIONS = 4
# Particle vertices kept per source: of this many bounces, this many each. In a house most early ones lie on the roof.
KEPT_BOUNCES, KEPT_EACH = 32, 256
_POINTS = 2  # sample number of these walks
_CONNECT = 16  # first dimension of the choice among particle vertices, beyond those of a walk


class VertexPool(NamedTuple):
    """Vertices from which particles continued: places that light of each position reaches.

    Attributes:
        position: (n_lights, n, 3) points slightly above the surface.
        normal: (n_lights, n, 3) geometric normals.
        size: (n_lights,) number of vertices.
    """

    position: Float32
    normal: Float32
    size: Int32


def empty_vertices(n_lights: int, n_sources: int) -> VertexPool:
    """Allocate the vertices of all sources."""
    n = n_sources * KEPT_BOUNCES * KEPT_EACH
    room = np.empty((2, n_lights, n, 3), np.float32)
    return VertexPool(room[0], room[1], np.zeros(n_lights, np.int32))


def keep_vertices(pool: VertexPool, hits: Hits, walkers: Walkers, n: int, lights: range) -> None:
    """Add the first KEPT_EACH of hits 0 to n - 1 that particles leave diffusely."""
    rows = np.flatnonzero((hits.kind[:n] == SURFACE) & (walkers.step[:n] == DIFFUSE))[:KEPT_EACH]
    above = hits.position[rows] + hits.offset[rows, None] * hits.geometric[rows]
    for l in lights:
        room = slice(pool.size[l], pool.size[l] + len(rows))
        pool.position[l, room], pool.normal[l, room] = above, hits.geometric[rows]
        pool.size[l] += len(rows)


@kernel
def _choose_places(seed: int, first: int, n: int, places: Float64) -> None:
    """Choose random places in [0, 1) for points first to first + n - 1, one in each equal part of the area."""
    for i in range(n):
        a, _ = r2(random_word(stream(seed, AMBIENT_STREAM, first + i, _POINTS), PIXEL + 1), 0)
        places[i] = (first + i + a) / AREA_POINTS


@kernel
def _write_sides(
    surfaces: Surfaces, triangle: Int32, seed: int, first: int, n: int, hits: Hits, walkers: Walkers
) -> None:
    """Write 2 n hits: both sides of n points, uniform on the given triangles."""
    for i in range(n):
        key = stream(seed, AMBIENT_STREAM, first + i, _POINTS)
        a, b = r2(random_word(key, PIXEL), 0)
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
            hits.key[h] = random_word(key, HEMISPHERE + 1 + side)
            walkers.walk[h], walkers.step[h] = h, DIFFUSE
            for axis in range(3):
                walkers.throughput[h, axis] = 1.0
                hits.position[h, axis] = p[axis]
                hits.geometric[h, axis] = normal[axis] if side == 0 else -normal[axis]
                hits.shading[h, axis] = hits.geometric[h, axis]
                hits.reflectivity[h, axis], hits.specular[h, axis] = diffuse[axis], mirror[axis]


@step
def _trace_connections(tracer: Tracer, rays: Rays, n: int, walkers: Walkers, lit: Bytes) -> None:
    """Trace the n queued connections; light reaches the walks of those that nothing blocks."""
    occlude(tracer, rays.packets, n, False)
    for ray in range(n):
        if not is_blocked(rays.packets, ray):
            i, l = divmod(rays.place[ray], lit.shape[1])
            lit[walkers.walk[i], l] = 1


@kernel
def _connect(hits: Hits, walkers: Walkers, n: int, pool: VertexPool, tracer: Tracer, rays: Rays, lit: Bytes) -> int:
    """Connect hits 0 to n - 1 to particle vertices of each light position that has not reached their walk yet.

    Args:
        lit: (n_walks, n_lights) set to 1 where a hit of the walk sees a vertex.

    Returns:
        number of rays.
    """
    capacity = room_in(rays.packets)
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for i in range(n):
        if hits.kind[i] != SURFACE or walkers.step[i] != DIFFUSE:
            continue
        # origin of the rays and geometric normal
        ox, oy, oz = ray_origin(hits, i)
        g = hits.geometric[i]
        for l in range(lit.shape[1]):
            if lit[walkers.walk[i], l] or pool.size[l] == 0:
                continue
            for k in range(CONNECTIONS):
                # a random vertex; both sides must face each other
                j = int(random_word(hits.key[i], _CONNECT + k) % np.uint64(pool.size[l]))
                q, m = pool.position[l, j], pool.normal[l, j]
                x, y, z = q[0] - ox, q[1] - oy, q[2] - oz
                if not (x * g[0] + y * g[1] + z * g[2] > 0.0 and x * m[0] + y * m[1] + z * m[2] < 0.0):
                    continue
                # queue the ray to it
                if waiting == capacity:
                    _trace_connections(tracer, rays, waiting, walkers, lit)
                    total, waiting = total + waiting, 0
                set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, np.float32(1.0))
                rays.place[waiting] = i * lit.shape[1] + l
                waiting += 1
    _trace_connections(tracer, rays, waiting, walkers, lit)
    return total + waiting


@kernel
def _end_lit_walks(hits: Hits, walkers: Walkers, n: int, lit: Bytes) -> int:
    """End walks that every light position has reached or that left the scene; returns the number of the others."""
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


def _find_lit_sides(work: Workspace, n: int, world: World, lights: LightArrays, pool: VertexPool, sky: bool) -> Bytes:
    """Whether walks from hits 0 to n - 1 meet light of each position, (n, n_lights), 0 or 1."""
    lit = np.zeros((n, lights.n_lights), np.uint8)
    for _ in range(AREA_BOUNCES):
        hits, walkers = work.hits[0], work.walkers[0]
        lit[walkers.walk[:n]] |= (work.diffuse_direct(n, lights, world.sight) > 0).any(axis=1)
        work.rays += _connect(hits, walkers, n, pool, world.tracer, work.test_rays, lit)
        if sky:
            lit[walkers.walk[:n][hits.kind[:n] == ESCAPED]] = 1
        if not _end_lit_walks(hits, walkers, n, lit):
            break
        n = work.advance(n, world)
        choose_steps(work.hits[0], work.walkers[0], n, True)
    return lit


def measure_lit_area(
    work: Workspace, seed: int, world: World, lights: LightArrays, pool: VertexPool, sky: bool
) -> tuple[Float64, Float64, Float64]:
    """Measure the area of the surface sides that light reaches.

    Args:
        sky: whether the background is a source too.

    Returns:
        area of each light position, (n_lights,); its relative variance, (n_lights,); and the average reflectivity of
        those sides, all light positions together, (3,).
    """
    edges = world.surfaces.corners[:, 1:].astype(np.float64) - world.surfaces.corners[:, :1]
    cumulated = np.cumsum(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))
    half = BATCH // 2
    places, reflectivity, points = np.empty(half), np.zeros(3), []
    for first in range(0, AREA_POINTS, half):
        _choose_places(seed, first, half, places)
        triangle = np.searchsorted(cumulated, places * cumulated[-1], side="right")
        triangle = np.minimum(triangle, len(cumulated) - 1).astype(np.int32)
        _write_sides(world.surfaces, triangle, seed, first, half, work.hits[0], work.walkers[0])
        own = (work.hits[0].reflectivity + work.hits[0].specular).astype(np.float64)
        lit = _find_lit_sides(work, BATCH, world, lights, pool, sky)
        reflectivity += lit.sum(axis=1) @ own
        points.append(lit.reshape(half, 2, -1).sum(axis=1))
    lit_sides = np.concatenate(points).astype(np.float64)  # (AREA_POINTS, n_lights), 0 to 2
    total = lit_sides.sum(axis=0)
    # Consecutive points lie close together, so the variance within a part of the area is that between two of them.
    squares = 0.5 * (np.diff(lit_sides, axis=0) ** 2).sum(axis=0) * (AREA_POINTS / (AREA_POINTS - 1))
    variance = np.divide(squares, total**2, out=np.zeros_like(total), where=total > 0)
    return cumulated[-1] * total / AREA_POINTS, variance, reflectivity / max(total.sum(), 1.0)
