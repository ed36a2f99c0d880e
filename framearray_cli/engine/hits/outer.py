"""Camera reuse: native hits become outer hits of neighbour eyes (reproject, test visibility, weigh).

Notation of the kernels: a hit P of eye c is used in frame j where eye j sees it. The density of the hits of eye k
at P, per pixel sample, is

    p_k = cos(theta_k) f^2 / (d_k^2 cos(alpha_k)^3) = f^2 (N . (O_k - P)) / z_k^3

with z_k the depth of P along the axis of eye k (cos(alpha_k) = z_k / d_k); for an escaped ray of unit direction it is
f^2 / z_k^3, the d_k being 1. It is zero where P is hidden from k, behind it, outside its image or seen from its back.

`average` [FA] weighs every hit of a frame alike. `balance` weighs a hit of any eye, used in frame j, with
p_j / sum of n_k p_k over the eyes k of the window of j (balance heuristic, [Veach95]).
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Real

from ..embree.packets import DIRECTION, ORIGIN, TFAR, TNEAR, Tracer, is_blocked, occlude
from ..inputs.cameras import OUTSIDE, Cameras, project
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, compress, doubles, gather, lane_numbers, load, popcount, select, store, triples_at
from .hits import SURFACE, Hits, triple
from .rays import Rays

# Visibility rays end this many times as far before an eye as it sees from: their directions are rounded, and an eye
# that stands on a surface would lose what it sees at less than two degrees above it.
EYE_END = np.float32(8.0)


@inlined
def _seen(cams: Cameras, k: int, hits: Hits, i: int) -> tuple[int, Real, Real]:
    """The pixel of eye k that hits i to i + 15 fall into, were nothing in between (OUTSIDE if none).

    Also what the density p_k is made of: how far the surface faces the eye, and the hit's depth.
    """
    o = cams.position
    x, y, z = triples_at(hits.position, i)
    gx, gy, gz = triples_at(hits.geometric, i)
    surface = load(hits.kind, i) == np.uint8(SURFACE)
    # what is infinitely far lies in one direction from all eyes
    from_eye = select(surface, np.float32(1.0), np.float32(0.0))
    dx, dy, dz = x - from_eye * o[k, 0], y - from_eye * o[k, 1], z - from_eye * o[k, 2]
    facing = -(doubles(dx) * doubles(gx) + doubles(dy) * doubles(gy) + doubles(dz) * doubles(gz))
    facing = select(surface, facing, 1.0)
    pixel, depth = project(cams, k, dx, dy, dz)
    return select(facing > 0.0, pixel, np.int32(OUTSIDE)), facing, doubles(depth)


@kernel
def _aim(cams: Cameras, first_eye: int, hits: Hits, stride: int, rays: Rays, n: int) -> None:
    """Write the queued visibility rays between hits and eyes; for an escaped ray, from the eye out of the scene.

    Eyes see from the depth `cams.near` on, as where they look for hits of their own: rays start there, or end a little
    before.
    """
    packet, one, nothing = rays.packets.shape[1] * LANES, np.float32(1.0), np.float32(0.0)
    near, f = np.float32(cams.near), cams.forward
    for ray in range(n, (n + LANES - 1) // LANES * LANES):
        rays.place[ray], rays.number[0, ray] = rays.place[n - 1], rays.number[0, n - 1]
    for first in range(0, n, LANES):
        place = load(rays.place, first)
        row = load(rays.number, first)
        i = place - row * np.int32(stride)
        surface = gather(hits.kind, i) == np.uint8(SURFACE)
        ox, oy, oz = triple(cams.position, row + np.int32(first_eye))
        px, py, pz = triple(hits.position, i)
        gx, gy, gz = triple(hits.geometric, i)
        e, at = gather(hits.offset, i), (first >> 4) * packet
        x, y, z = px + e * gx, py + e * gy, pz + e * gz
        store(rays.packets, at + ORIGIN * LANES, select(surface, x, ox))
        store(rays.packets, at + (ORIGIN + 1) * LANES, select(surface, y, oy))
        store(rays.packets, at + (ORIGIN + 2) * LANES, select(surface, z, oz))
        dx, dy, dz = select(surface, ox - x, px), select(surface, oy - y, py), select(surface, oz - z, pz)
        store(rays.packets, at + DIRECTION * LANES, dx)
        store(rays.packets, at + (DIRECTION + 1) * LANES, dy)
        store(rays.packets, at + (DIRECTION + 2) * LANES, dz)
        fx, fy, fz = triple(f, row + np.int32(first_eye))
        along = dx * fx + dy * fy + dz * fz
        depth = select(surface, -along, along)
        beyond = depth > near
        share = near / select(beyond, depth, one)
        end = select(beyond, one - EYE_END * share, -one)  # a hit that is too near is hidden
        store(rays.packets, at + TNEAR * LANES, select(surface, nothing, share))
        store(rays.packets, at + TFAR * LANES, select(surface, end, np.float32(np.inf)))


@kernel
def _confirm(
    cams: Cameras, first_eye: int, hits: Hits, tracer: Tracer, rays: Rays, n: int, pixel: Int32, density: Float64
) -> None:
    """Trace the queued visibility rays; what is hidden is forgotten."""
    if n == 0:
        return
    _aim(cams, first_eye, hits, pixel.shape[1], rays, n)
    occlude(tracer, rays.packets, n, True)
    flat_pixel, flat_density = pixel.reshape(pixel.size), density.reshape(density.size)
    for ray in range(n):
        if is_blocked(rays.packets, ray):
            flat_pixel[rays.place[ray]] = OUTSIDE
            if density.size > 0:
                flat_density[rays.place[ray]] = 0.0
    for first in range(0, n, LANES):  # shadow rays take the same packets, and start at 0
        store(rays.packets, (first >> 4) * rays.packets.shape[1] * LANES + TNEAR * LANES, np.float32(0.0))


@kernel
def outer_hits(
    cams: Cameras,
    c: int,
    first_eye: int,
    hits: Hits,
    n: int,
    tracer: Tracer,
    rays: Rays,
    pixel: Int32,
    density: Float64,
) -> int:
    """Find where eyes first_eye, first_eye + 1, ... see native hits 0 to n - 1 of eye c, and how densely they do.

    Args:
        pixel: (n_eyes, >= n, a multiple of LANES) overwritten: the pixel of each eye that sees the hit, or OUTSIDE.
        density: of the same shape, overwritten: p_k, pixel samples per area; or (0, 0) where nobody asks.

    Returns:
        number of visibility rays.
    """
    capacity, stride = rays.packets.shape[0] * LANES, pixel.shape[1]
    waiting = total = 0
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(0, n, LANES):
            seen, facing, depth = _seen(cams, k, hits, i)
            if k == c:  # the eye that found the hit sees it, whatever rounding says of borders and grazing angles
                seen = gather(hits.pixel, lane_numbers() + np.int32(i))
            store(pixel, row * stride + i, seen)
            wanted = (seen >= np.int32(0)) & (lane_numbers() < np.int32(n - i))
            if density.size > 0:
                p = select(seen >= np.int32(0), cams.focal * cams.focal * facing / (depth * depth * depth), 0.0)
                if k == c:
                    p = select(p > 1e-30, p, 1e-30)
                store(density, row * stride + i, p)
            if k != c:
                if waiting > capacity - LANES:
                    _confirm(cams, first_eye, hits, tracer, rays, waiting, pixel, density)
                    total, waiting = total + waiting, 0
                compress(wanted, lane_numbers() + np.int32(row * stride + i), rays.place, waiting)
                store(rays.number, waiting, np.int32(row))
                waiting += popcount(wanted)
    _confirm(cams, first_eye, hits, tracer, rays, waiting, pixel, density)
    return total + waiting


@kernel
def balance_weights(
    per_pixel: Float64,
    n_r: int,
    first_eye: int,
    first_frame: int,
    n: int,
    pixel: Int32,
    density: Float64,
    weight: Float32,
) -> None:
    """Balance-heuristic weights of hits 0 to n - 1 in each frame they are used in.

    Args:
        per_pixel: (n_c,) native hits a pixel n_k of every eye.
        pixel, density: (n_eyes, >= n) from `outer_hits`, for all eyes of the windows of all frames of `weight`.
        weight: (n_frames, >= n) overwritten: frame first_frame + row; 0 where the frame does not see the hit.
    """
    last_eye = first_eye + pixel.shape[0] - 1
    for row in range(weight.shape[0]):
        j = first_frame + row
        for i in range(n):
            weight[row, i] = 0.0
            if pixel[j - first_eye, i] == OUTSIDE:
                continue
            total = 0.0
            for k in range(max(j - n_r, first_eye), min(j + n_r, last_eye) + 1):
                total += per_pixel[k] * density[k - first_eye, i]
            weight[row, i] = density[j - first_eye, i] / total


@kernel
def scale_by_expected_hits(
    hits: Float32, of_pixel: Int32, first_eye: int, n: int, pixel: Int32, density: Float64
) -> None:
    """Make densities of hits of those of a hit a pixel: n_k p_k of p_k, where n_k differs from place to place.

    Args:
        hits: (n_c, n_blocks) native hits a pixel of every eye.
        of_pixel: (n_pixels,) the block of a pixel.
        pixel, density: (n_eyes, >= n) from `outer_hits`; densities of hits 0 to n - 1 are changed.
    """
    for row in range(pixel.shape[0]):
        for i in range(n):
            if pixel[row, i] != OUTSIDE:
                density[row, i] *= hits[first_eye + row, of_pixel[pixel[row, i]]]


@kernel
def divide_by_own_hits(hits: Float32, of_pixel: Int32, first_frame: int, n: int, pixel: Int32, weight: Float32) -> None:
    """Make weights of one hit of those of the n_j hits that frame j's own eye finds there.

    Args:
        hits, of_pixel: as for `scale_by_expected_hits`.
        pixel: (n_frames, >= n) that see each hit.
        weight: (n_frames, >= n) changed.
    """
    for row in range(pixel.shape[0]):
        for i in range(n):
            if pixel[row, i] != OUTSIDE:
                weight[row, i] /= hits[first_frame + row, of_pixel[pixel[row, i]]]


@kernel
def sort_by_pixel(pixel: Int32, first: int, last: int, start: Int32, order: Int32) -> None:
    """Counting sort of the hits that fall into pixels first to last - 1; hits of one pixel stay in their order.

    Ranges of pixels may be sorted at the same time: each writes its own part of `start` and `order`.

    Args:
        pixel: (n,) a pixel or OUTSIDE.
        start: (n_pixels + 1,) written from first to last - 1, and at n_pixels if that is `last`: hits
            order[start[p] : start[p + 1]] fall into pixel p.
        order: (n,) written from start[first] to start[last] - 1.
    """
    for p in range(first, last):
        start[p] = 0
    before = 0
    for i in range(pixel.shape[0]):
        p = pixel[i]
        if first <= p < last:
            start[p] += 1
        elif OUTSIDE < p < first:
            before += 1
    end = before
    for p in range(first, last):
        count = start[p]
        start[p] = end
        end += count
    for i in range(pixel.shape[0]):
        p = pixel[i]
        if first <= p < last:
            order[start[p]] = i
            start[p] += 1
    for p in range(last - 1, first, -1):  # each start has moved to its pixel's end, which is the next one's start
        start[p] = start[p - 1]
    if first < last:
        start[first] = before
    if last == start.shape[0] - 1:
        start[last] = end
