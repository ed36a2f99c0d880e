"""Camera reuse: native hits become outer hits of neighbour eyes (reproject, test visibility, weight) [FA alg. 1].

Notation of the kernels: a hit P of eye c is used in frame j where eye j sees it. The density of the hits of eye k
at P, per pixel sample, is

    p_k = cos(theta_k) f^2 / (d_k^2 cos(alpha_k)^3) = f^2 (N . (O_k - P)) / z_k^3

with z_k the depth of P along the axis of eye k (cos(alpha_k) = z_k / d_k). For an escaped ray of unit direction it is
f^2 / z_k^3, because d_k is 1. It is zero where P is hidden from eye k, behind it, outside its image or seen from its
back. Cameras other than perspectives have other densities (`aiming.py`).

`average` [FA] gives every hit of a frame the weight 1. `balance` gives a hit of any eye, used in frame j, the weight
p_j / sum of n_k p_k over the eyes k of [j - N_r, j + N_r] (balance heuristic, [Veach95]).
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Real

from ..embree.packets import DIRECTION, ORIGIN, TFAR, TNEAR, Tracer, occlude, room_in
from ..inputs.cameras import OUTSIDE, Cameras, corner_of, project, project_to_pixel
from ..kernels.kernel import has_rows, index, inlined, kernel, step
from ..kernels.simd import (
    LANES,
    append,
    bits,
    compress,
    ctz,
    doubles,
    gather,
    lane_numbers,
    load,
    load_row,
    popcount,
    product,
    reals,
    select,
    store,
    store_row,
    triples_at,
)
from .aiming import EYE_END, PARTS, aim_tests, part_of, place_hits, place_within
from .hits import SURFACE, Hits, triple
from .rays import NO_RAYS, Rays


@inlined
def _project_hits(cams: Cameras, k: int, hits: Hits, i: int) -> tuple[int, Real, Real]:
    """The pixels of eye k into which hits i to i + 15 project, OUTSIDE if none, before any test of visibility.

    Also the two parts of the density p_k: N . (O_k - P), and the depth z_k.
    """
    o = cams.position
    x, y, z = triples_at(hits.position, i)
    gx, gy, gz = triples_at(hits.geometric, i)
    surface = load(hits.kind, i) == np.uint8(SURFACE)
    # P - O_k; an escaped ray has the same direction from all eyes
    from_eye = select(surface, np.float32(1.0), np.float32(0.0))
    dx, dy, dz = x - from_eye * o[k, 0], y - from_eye * o[k, 1], z - from_eye * o[k, 2]
    facing = -(doubles(dx) * doubles(gx) + doubles(dy) * doubles(gy) + doubles(dz) * doubles(gz))
    facing = select(surface, facing, 1.0)
    pixel, depth = project_to_pixel(cams, k, dx, dy, dz)
    return select(facing > 0.0, pixel, np.int32(OUTSIDE)), facing, doubles(depth)


@step
def _write_visibility_rays(cams: Cameras, first_eye: int, hits: Hits, stride: int, rays: Rays, n: int) -> None:
    """Write the n queued visibility rays: from a hit to an eye, or for an escaped ray from the eye out of the scene.

    An eye sees from the depth `cams.near` on, as for its native hits: rays start at that depth, or end near it.
    """
    one, nothing = np.float32(1.0), np.float32(0.0)
    near, f = np.float32(cams.near), cams.forward
    # fill the last packet with copies of the last ray
    for ray in range(n, (n + LANES - 1) // LANES * LANES):
        rays.place[ray], rays.number[0, ray] = rays.place[n - 1], rays.number[0, n - 1]
    for first in range(0, n, LANES):
        # hit i and row of its eye; eye O, point P or direction, geometric normal N
        place = load(rays.place, first)
        row = load(rays.number, first)
        i = place - row * np.int32(stride)
        surface = gather(hits.kind, i) == np.uint8(SURFACE)
        ox, oy, oz = triple(cams.position, row + np.int32(first_eye))
        px, py, pz = triple(hits.position, i)
        gx, gy, gz = triple(hits.geometric, i)
        e = gather(hits.offset, i)
        # origin: slightly above P, or O for an escaped ray
        x, y, z = px + e * gx, py + e * gy, pz + e * gz
        store_row(rays.packets, first, ORIGIN, select(surface, x, ox))
        store_row(rays.packets, first, ORIGIN + 1, select(surface, y, oy))
        store_row(rays.packets, first, ORIGIN + 2, select(surface, z, oz))
        # direction: to O, or of the escaped ray
        dx, dy, dz = select(surface, ox - x, px), select(surface, oy - y, py), select(surface, oz - z, pz)
        store_row(rays.packets, first, DIRECTION, dx)
        store_row(rays.packets, first, DIRECTION + 1, dy)
        store_row(rays.packets, first, DIRECTION + 2, dz)
        # depth along the optical axis, and cams.near as a fraction of it
        fx, fy, fz = triple(f, row + np.int32(first_eye))
        along = dx * fx + dy * fy + dz * fz
        depth = select(surface, -along, along)
        beyond = depth > near
        share = near / select(beyond, depth, one)
        # the ray starts or ends near that depth; a hit nearer than that is hidden
        end = select(beyond, one - EYE_END * share, -one)
        store_row(rays.packets, first, TNEAR, select(surface, nothing, share))
        store_row(rays.packets, first, TFAR, select(surface, end, np.float32(np.inf)))
        if has_rows(cams.lens):
            aim_tests(cams, first_eye, hits, stride, rays, first)


@step
def _drop_hidden(
    cams: Cameras, first_eye: int, hits: Hits, tracer: Tracer, rays: Rays, n: int, pixel: Int32, density: Float64
) -> None:
    """Trace the n queued visibility rays; hidden hits become OUTSIDE, with density 0."""
    if n == 0:
        return
    _write_visibility_rays(cams, first_eye, hits, pixel.shape[1], rays, n)
    occlude(tracer, rays.packets, n, True)
    nothing = np.float32(0.0)
    flat_pixel, flat_density = pixel.reshape(pixel.size), density.reshape(density.size)
    for first in range(0, n, LANES):
        hidden = bits((load_row(rays.packets, first, TFAR) < nothing) & (lane_numbers() < np.int32(n - first)))
        while hidden != 0:
            place = index(rays.place[index(first + ctz(hidden))])
            hidden &= hidden - 1
            flat_pixel[place] = OUTSIDE
            if density.size > 0:
                flat_density[place] = 0.0
    for first in range(0, n, LANES):  # shadow rays use the same packets, and start at 0
        store_row(rays.packets, first, TNEAR, np.float32(0.0))


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
    tested: bool,
) -> int:
    """Find the pixels in which eyes first_eye, first_eye + 1, ... see native hits 0 to n - 1 of eye c, and p_k.

    Args:
        pixel: (n_eyes, >= n, a multiple of LANES) overwritten: the pixel of each eye that sees the hit, or OUTSIDE.
        density: of the same shape, overwritten: p_k, pixel samples per area; or (0, 0) if it is not needed.
        tested: False to leave out whether anything hides the hit.

    Returns:
        number of visibility rays.
    """
    capacity, stride = room_in(rays.packets), pixel.shape[1]
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(0, n, LANES):
            # conditions 1 and 2 of an outer hit: P faces eye k and projects into its image
            seen, facing, depth = _project_hits(cams, k, hits, i)
            # eye c sees its own hits, even where rounding at borders and grazing angles disagrees
            if k == c:
                seen = gather(hits.pixel, lane_numbers() + np.int32(i))
            store(pixel, row * stride + i, seen)
            wanted = (seen >= np.int32(0)) & (lane_numbers() < np.int32(n - i))
            # p_k = f^2 N . (O_k - P) / z_k^3
            if density.size > 0:
                p = select(seen >= np.int32(0), cams.focal * cams.focal * facing / (depth * depth * depth), 0.0)
                if k == c:
                    p = select(p > 1e-30, p, 1e-30)
                store(density, row * stride + i, p)
            if has_rows(cams.lens):
                place_hits(cams, k, k == c, hits, i, row * stride + i, pixel, density)
                seen = load(pixel, row * stride + i)
                wanted = (seen >= np.int32(0)) & (lane_numbers() < np.int32(n - i))
            # queue a visibility ray for condition 3, nothing between P and O_k
            if k != c and tested:
                if waiting > capacity - LANES:
                    _drop_hidden(cams, first_eye, hits, tracer, rays, waiting, pixel, density)
                    total, waiting = total + waiting, 0
                append(wanted, lane_numbers() + np.int32(row * stride + i), rays.place, waiting)
                store(rays.number, waiting, np.int32(row))
                waiting += popcount(wanted)
    _drop_hidden(cams, first_eye, hits, tracer, rays, waiting, pixel, density)
    return total + waiting


@kernel
def balance_weights(
    counts: Float64,
    n_r: int,
    first_eye: int,
    first_frame: int,
    n: int,
    pixel: Int32,
    density: Float64,
    weight: Float32,
) -> None:
    """Compute balance-heuristic weights of hits 0 to n - 1 in each frame that uses them [Veach95].

    Args:
        counts: (n_frames, n_eyes) numbers n_k of native hits per pixel, in each frame.
        pixel, density: (n_eyes, >= n) from `outer_hits`, for all eyes of the windows of all frames of `weight`.
        weight: (n_frames, >= n) overwritten; row r is frame first_frame + r; 0 where the frame does not see the hit.
    """
    last_eye, stride = first_eye + pixel.shape[0] - 1, density.shape[1]
    for row in range(weight.shape[0]):
        j = first_frame + row
        own = j - first_eye
        for i in range(0, n, LANES):
            # w = p_j / sum of n_k p_k over the window of j
            total = doubles(lane_numbers()) * 0.0
            for k in range(max(j - n_r, first_eye), min(j + n_r, last_eye) + 1):
                total = total + product(load(density, (k - first_eye) * stride + i), counts[row, k - first_eye])
            seen = load(pixel, own * pixel.shape[1] + i) >= np.int32(0)
            w = select(seen, reals(load(density, own * stride + i) / total), np.float32(0.0))
            if i + LANES <= n:
                store(weight, row * weight.shape[1] + i, w)
            else:
                compress(lane_numbers() < np.int32(n - i), w, weight, row * weight.shape[1] + i)


@kernel
def scale_by_expected_hits(
    hits: Float32, of_pixel: Int32, first_eye: int, n: int, pixel: Int32, density: Float64
) -> None:
    """Multiply each density p_k by n_k, the number of native hits per pixel of the block it falls in.

    Args:
        hits: (n_c, n_blocks) native hits per pixel, of every eye.
        of_pixel: (n_pixels,) the block of each pixel.
        pixel, density: (n_eyes, >= n) from `outer_hits`; changes the densities of hits 0 to n - 1.
    """
    for row in range(pixel.shape[0]):
        for i in range(n):
            if pixel[row, i] != OUTSIDE:
                density[row, i] *= hits[first_eye + row, of_pixel[pixel[row, i]]]


@kernel
def divide_by_own_hits(hits: Float32, of_pixel: Int32, first_frame: int, n: int, pixel: Int32, weight: Float32) -> None:
    """Divide each weight by n_j, the number of native hits per pixel that eye j has in the block it falls in.

    Args:
        hits, of_pixel: as for `scale_by_expected_hits`.
        pixel: (n_frames, >= n) the pixel of each frame that sees the hit, or OUTSIDE.
        weight: (n_frames, >= n) changed in place.
    """
    for row in range(pixel.shape[0]):
        for i in range(n):
            if pixel[row, i] != OUTSIDE:
                weight[row, i] /= hits[first_frame + row, of_pixel[pixel[row, i]]]


@kernel
def sort_by_pixel(pixel: Int32, first: int, last: int, start: Int32, order: Int32) -> None:
    """Sort the hits that fall into pixels first to last - 1 by pixel; hits of one pixel keep their order.

    A counting sort. Threads may sort disjoint ranges of pixels at once: each writes its part of `start` and `order`.

    Args:
        pixel: (n,) pixel or OUTSIDE of each hit.
        start: (n_pixels + 1,) written from first to last - 1, and at n_pixels if that is `last`: hits
            order[start[p] : start[p + 1]] fall into pixel p.
        order: (n,) written from start[first] to start[last] - 1.
    """
    # count the hits of each pixel in `start`
    for p in range(first, last):
        start[p] = 0
    before = 0  # hits in pixels below `first`
    for i in range(pixel.shape[0]):
        p = pixel[i]
        if first <= p < last:
            start[index(p)] += 1
        elif OUTSIDE < p < first:
            before += 1
    # counts -> index of each pixel's first hit
    end = before  # hits in pixels below p
    for p in range(first, last):
        count = start[p]
        start[p] = end
        end += count
    # write the hits in order; start[p] moves to the end of pixel p
    for i in range(pixel.shape[0]):
        p = pixel[i]
        if first <= p < last:
            at = start[index(p)]
            order[index(at)] = i
            start[index(p)] = at + 1
    # the end of a pixel is the start of the next
    for p in range(last - 1, first, -1):
        start[p] = start[p - 1]
    if first < last:
        start[first] = before
    if last == start.shape[0] - 1:
        start[last] = end


@kernel
def find_subpixels(cams: Cameras, first_frame: int, hits: Hits, n: int, pixel: Int32, subpixel: Int32) -> None:
    """Find where hits 0 to n - 1 lie in the pixels of frames first_frame, first_frame + 1, ..., for weights by area.

    A sub-pixel is a byte: the pixel's box is cut into 16 x 16 parts, and its number is 16 row + column.

    Args:
        pixel: (n_frames, >= n, a multiple of LANES) the pixel of each frame that sees the hit, or OUTSIDE.
        subpixel: of the same shape, overwritten; arbitrary where the frame does not see the hit.
    """
    for row in range(pixel.shape[0]):
        j = first_frame + row
        o = cams.position
        for i in range(0, n, LANES):
            # P - O_j, or the direction of an escaped ray
            x, y, z = triples_at(hits.position, i)
            from_eye = select(load(hits.kind, i) == np.uint8(SURFACE), np.float32(1.0), np.float32(0.0))
            dx, dy, dz = x - from_eye * o[j, 0], y - from_eye * o[j, 1], z - from_eye * o[j, 2]
            across, down, _ = project(cams, j, dx, dy, dz)
            # rounding at a border may put a hit just outside the pixel that it belongs to
            of_pixel, at = load(pixel, row * pixel.shape[1] + i), row * subpixel.shape[1] + i
            left, top = corner_of(cams, of_pixel)
            column, line = part_of(across - left), part_of(down - top)
            store(subpixel, at, line * np.int32(PARTS) + column)
            if has_rows(cams.lens):
                place_within(cams, j, hits, i, at, of_pixel, subpixel)
