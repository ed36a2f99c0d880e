"""Rays of cameras with lenses of their own, where they see hits, and with which density; see `inputs/cameras.py`.

Kernels write what a plain perspective sees. Where `Cameras.lens` has rows, they call these steps, which write over it.
Notation: `outer.py`.

A ray of an orthographic camera that left the scene is known by its origin too, stored instead of the normal that
an escaped ray lacks: only an eye that looks the same way sees what it sees.
"""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Points, Real

from ..embree.packets import DIRECTION, ORIGIN, TFAR, TNEAR, Tracer, decode_hits, set_ray
from ..inputs.cameras import (
    KIND,
    OF_ORTHOGRAPHIC,
    OF_PANORAMA,
    OF_PERSPECTIVE,
    OUTSIDE,
    PARALLEL,
    Cameras,
    corner_of,
    is_orthographic,
    lens_density,
    lens_position,
    lens_ray,
)
from ..kernels.kernel import inlined, kernel, step
from ..kernels.simd import (
    LANES,
    doubles,
    gather,
    integers,
    load,
    load_row,
    put_triples,
    select,
    sqrt,
    store,
    store_row,
    triples_at,
)
from .hits import SURFACE, Hits, World, triple
from .rays import Rays

PARTS = 16  # of a pixel along each axis, see `places.py`
# Visibility rays end this multiple of `Cameras.near` before an eye. Their directions are rounded: an eye on a surface
# would otherwise lose what it sees less than two degrees above that surface.
EYE_END = np.float32(8.0)
LEAST_DENSITY = 1e-30  # of a hit for the eye that found it


@step
def aim_rays(cams: Cameras, c: int, x: Real, y: Real, i: int, packets: Float32) -> None:
    """Write eye rays i to i + 15 of eye c, through image positions (x, y)."""
    (ox, oy, oz), (dx, dy, dz) = lens_ray(cams, c, x, y)
    store_row(packets, i, ORIGIN, ox)
    store_row(packets, i, ORIGIN + 1, oy)
    store_row(packets, i, ORIGIN + 2, oz)
    store_row(packets, i, DIRECTION, dx)
    store_row(packets, i, DIRECTION + 1, dy)
    store_row(packets, i, DIRECTION + 2, dz)


@step
def aim_ray(cams: Cameras, c: int, x: Real, y: Real, i: int, packets: Float32) -> None:
    """Write the eye ray i of eye c, through an image position."""
    (ox, oy, oz), (dx, dy, dz) = lens_ray(cams, c, x, y)
    set_ray(packets, i, ox, oy, oz, dx, dy, dz, np.float32(np.inf))


@inlined
def _seen_from(cams: Cameras, k: int, hits: Hits, i: int) -> tuple[Real, Real, Real, Real, Any]:
    """Image position and depth of hits i to i + 15 for eye k, the cosine part of p_k, and whether eye k may see them.

    They are in the picture's plane; whether within its borders is for the caller.
    """
    o, f, nothing = cams.position, cams.forward, np.float32(0.0)
    x, y, z = triples_at(hits.position, i)
    gx, gy, gz = triples_at(hits.geometric, i)
    surface = load(hits.kind, i) == np.uint8(SURFACE)
    if cams.lens[k, KIND] == OF_ORTHOGRAPHIC:
        # an escaped ray is seen where its origin is, by an eye that looks along it
        along = x * f[k, 0] + y * f[k, 1] + z * f[k, 2]
        px, py, pz = select(surface, x, gx), select(surface, y, gy), select(surface, z, gz)
        column, row, depth = lens_position(cams, k, px - o[k, 0], py - o[k, 1], pz - o[k, 2])
        facing = -doubles(gx * f[k, 0] + gy * f[k, 1] + gz * f[k, 2])
        return (
            column,
            row,
            depth,
            select(surface, facing, 1.0),
            (surface & (depth > 0.0)) | (~surface & (along > PARALLEL)),
        )
    from_eye = select(surface, np.float32(1.0), nothing)
    dx, dy, dz = x - from_eye * o[k, 0], y - from_eye * o[k, 1], z - from_eye * o[k, 2]
    facing = -(doubles(dx) * doubles(gx) + doubles(dy) * doubles(gy) + doubles(dz) * doubles(gz))
    column, row, depth = lens_position(cams, k, dx, dy, dz)
    return column, row, depth, select(surface, facing, 1.0), depth > 0.0


@step
def place_hits(cams: Cameras, k: int, own: bool, hits: Hits, i: int, at: int, pixel: Int32, density: Float64) -> None:
    """Find the pixels in which eye k sees hits i to i + 15, and p_k, before any test of visibility.

    Args:
        own: whether eye k found them.
        at: place in the flat arrays `pixel` and `density`, which are overwritten.
    """
    column, row, depth, facing, may = _seen_from(cams, k, hits, i)
    inside = may & (facing > 0.0) & (column >= 0.0) & (column < cams.width) & (row >= 0.0) & (row < cams.height)
    left, top = select(inside, column, 0.0), select(inside, row, 0.0)
    found = select(inside, integers(top) * np.int32(cams.width) + integers(left), np.int32(OUTSIDE))
    if own:
        found = load(hits.pixel, i)
    store(pixel, at, found)
    if density.size > 0:
        p = select(found >= np.int32(0), lens_density(cams, k, facing, row, select(depth > 0.0, depth, 1.0)), 0.0)
        if own:
            p = select(p > LEAST_DENSITY, p, LEAST_DENSITY)
        store(density, at, p)


@step
def aim_tests(cams: Cameras, first_eye: int, hits: Hits, stride: int, rays: Rays, first: int) -> None:
    """Write visibility rays first to first + 15, between hits and eyes, where eyes are no perspectives."""
    kind = cams.lens[first_eye, KIND]
    if kind == OF_PERSPECTIVE:
        return
    one, nothing, near = np.float32(1.0), np.float32(0.0), np.float32(cams.near)
    row = load(rays.number, first)
    i = load(rays.place, first) - row * np.int32(stride)
    surface = gather(hits.kind, i) == np.uint8(SURFACE)
    if kind == OF_PANORAMA:
        # the rays are right; depth is the distance
        dx, dy = load_row(rays.packets, first, DIRECTION), load_row(rays.packets, first, DIRECTION + 1)
        dz = load_row(rays.packets, first, DIRECTION + 2)
        depth = sqrt(dx * dx + dy * dy + dz * dz)
    else:
        k = row + np.int32(first_eye)
        (fx, fy, fz), (ox, oy, oz) = triple(cams.forward, k), triple(cams.position, k)
        px, py, pz = triple(hits.position, i)
        gx, gy, gz = triple(hits.geometric, i)
        e = gather(hits.offset, i)
        # from above P to the plane of the eye, or for an escaped ray from that plane on
        x, y, z = select(surface, px + e * gx, gx), select(surface, py + e * gy, gy), select(surface, pz + e * gz, gz)
        along = (x - ox) * fx + (y - oy) * fy + (z - oz) * fz
        back = select(surface, nothing, along)
        store_row(rays.packets, first, ORIGIN, x - back * fx)
        store_row(rays.packets, first, ORIGIN + 1, y - back * fy)
        store_row(rays.packets, first, ORIGIN + 2, z - back * fz)
        length = select(surface, -along, one)
        store_row(rays.packets, first, DIRECTION, length * fx)
        store_row(rays.packets, first, DIRECTION + 1, length * fy)
        store_row(rays.packets, first, DIRECTION + 2, length * fz)
        depth = select(surface, along, one)
    beyond = depth > near
    share = near / select(beyond, depth, one)
    store_row(rays.packets, first, TNEAR, select(surface, nothing, share))
    end = select(beyond, one - EYE_END * share, -one)
    store_row(rays.packets, first, TFAR, select(surface, end, np.float32(np.inf)))


@inlined
def part_of(x: Real) -> int:
    """The part of a pixel that a position lies in, from 0 at the pixel's border to 1 at the next."""
    within = select(x > 0.0, select(x < 1.0, x, 1.0 - 0.5 / PARTS), 0.0)
    part: int = integers(within * PARTS)
    return part


@step
def place_within(cams: Cameras, j: int, hits: Hits, i: int, at: int, pixel: int, place: Int32) -> None:
    """Find where hits i to i + 15 lie in their pixels of frame j; see `find_places`."""
    column, row, _, _, _ = _seen_from(cams, j, hits, i)
    left, top = corner_of(cams, pixel)
    store(place, at, part_of(row - top) * np.int32(PARTS) + part_of(column - left))


@step
def aim_view(cams: Cameras, k: int, hits: Hits, i: int, ray: int, reach: Real, packets: Float32) -> None:
    """Write the way from eye k to hit i as a ray, where rays of an eye start at different points.

    Args:
        reach: share of the way at which it ends; infinite for an escaped ray.
    """
    if cams.lens[k, KIND] != OF_ORTHOGRAPHIC:
        return
    f, o, p, g = cams.forward, cams.position, hits.position, hits.geometric
    surface = hits.kind[i] == SURFACE
    x, y, z = (p[i, 0], p[i, 1], p[i, 2]) if surface else (g[i, 0], g[i, 1], g[i, 2])
    along = (x - o[k, 0]) * f[k, 0] + (y - o[k, 1]) * f[k, 1] + (z - o[k, 2]) * f[k, 2]
    length = along if surface else np.float32(1.0)
    set_ray(
        packets, ray, x - along * f[k, 0], y - along * f[k, 1], z - along * f[k, 2],
        length * f[k, 0], length * f[k, 1], length * f[k, 2], reach,
    )  # fmt: skip


@kernel
def _keep_origins(tracer: Tracer, packets: Float32, n: int, hits: Hits) -> None:
    """Write the origins of traced rays 0 to n - 1 that left the scene, instead of their normals."""
    for i in range(0, n, LANES):
        missed, _, _, _ = decode_hits(tracer, packets, i)
        gx, gy, gz = triples_at(hits.geometric, i)
        x, y = load_row(packets, i, ORIGIN), load_row(packets, i, ORIGIN + 1)
        z = load_row(packets, i, ORIGIN + 2)
        put_triples(hits.geometric, i, select(missed, x, gx), select(missed, y, gy), select(missed, z, gz))


def keep_origins(cams: Cameras, c: int, world: World, packets: Float32, n: int, hits: Hits) -> None:
    """Keep where rays 0 to n - 1 of eye c that left the scene started, if not all at the eye."""
    if is_orthographic(cams, c):
        _keep_origins(world.tracer, packets, n, hits)


def ray_origins(cams: Cameras, c: int, hits: Hits, n: int) -> Points:
    """Origins of the rays of eye c that found hits 0 to n - 1, (n, 3), or (1, 3) if all start at the eye."""
    if not is_orthographic(cams, c):
        return cams.position[c : c + 1]
    surface = hits.kind[:n] == SURFACE
    on_ray = np.where(surface[:, None], hits.position[:n], hits.geometric[:n])
    away = (on_ray - cams.position[c]) @ cams.forward[c]
    return np.asarray(on_ray - away[:, None] * cams.forward[c], np.float32)
