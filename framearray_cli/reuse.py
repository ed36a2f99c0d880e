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

from .arrays import Float32, Float64, Int32, Real
from .camera import OUTSIDE, Cameras, project
from .embree.packets import LANES, Tracer, is_blocked, occlude, set_ray
from .hits import SURFACE, Hits
from .kernel import inlined, kernel
from .rays import Rays


@inlined
def _seen(cams: Cameras, k: int, hits: Hits, i: int) -> tuple[int, Real]:
    """The pixel of eye k that hit i falls into, were nothing in between, and the density p_k; OUTSIDE and 0 if none."""
    o, p, g = cams.position, hits.position, hits.geometric
    if hits.kind[i] != SURFACE:
        pixel, z = project(cams, k, p[i, 0], p[i, 1], p[i, 2])
        facing = 1.0
    else:
        x, y, z = p[i, 0] - o[k, 0], p[i, 1] - o[k, 1], p[i, 2] - o[k, 2]
        facing = -(np.float64(x) * g[i, 0] + np.float64(y) * g[i, 1] + np.float64(z) * g[i, 2])
        if not facing > 0.0:
            return OUTSIDE, 0.0
        pixel, z = project(cams, k, x, y, z)
    if pixel == OUTSIDE:
        return OUTSIDE, 0.0
    depth = np.float64(z)
    return pixel, cams.focal * cams.focal * facing / (depth * depth * depth)


@inlined
def _aim(cams: Cameras, k: int, hits: Hits, i: int, packets: Float32, ray: int) -> None:
    """Write the visibility ray between hit i and eye k; for an escaped ray, from the eye out of the scene."""
    o, p = cams.position, hits.position
    if hits.kind[i] != SURFACE:
        set_ray(packets, ray, o[k, 0], o[k, 1], o[k, 2], p[i, 0], p[i, 1], p[i, 2], np.float32(np.inf))
    else:
        g, e = hits.geometric, hits.offset[i]
        x, y, z = p[i, 0] + e * g[i, 0], p[i, 1] + e * g[i, 1], p[i, 2] + e * g[i, 2]
        set_ray(packets, ray, x, y, z, o[k, 0] - x, o[k, 1] - y, o[k, 2] - z, np.float32(1.0))


@kernel
def _confirm(tracer: Tracer, rays: Rays, n: int, pixel: Int32, density: Float64) -> None:
    """Trace the waiting visibility rays; what is hidden is forgotten."""
    occlude(tracer, rays.packets, n, True)
    flat_pixel, flat_density = pixel.reshape(pixel.size), density.reshape(density.size)
    for ray in range(n):
        if is_blocked(rays.packets, ray):
            flat_pixel[rays.place[ray]], flat_density[rays.place[ray]] = OUTSIDE, 0.0


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
        pixel: (n_eyes, >= n) overwritten: the pixel of each eye that sees the hit, or OUTSIDE.
        density: (n_eyes, >= n) overwritten: p_k, pixel samples per area.

    Returns:
        number of visibility rays.
    """
    capacity = rays.packets.shape[0] * LANES
    waiting = total = 0
    for row in range(pixel.shape[0]):
        k = first_eye + row
        for i in range(n):
            pixel[row, i], density[row, i] = _seen(cams, k, hits, i)
            if k == c:  # the eye that found the hit sees it, whatever rounding says of borders and grazing angles
                pixel[row, i] = hits.pixel[i]
                density[row, i] = max(density[row, i], 1e-30)
            elif pixel[row, i] != OUTSIDE:
                if waiting == capacity:
                    _confirm(tracer, rays, waiting, pixel, density)
                    total, waiting = total + waiting, 0
                _aim(cams, k, hits, i, rays.packets, waiting)
                rays.place[waiting] = row * pixel.shape[1] + i
                waiting += 1
    _confirm(tracer, rays, waiting, pixel, density)
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
def sort_by_pixel(pixel: Int32, n_pixels: int, start: Int32, order: Int32) -> None:
    """Counting sort of hits by the pixel they fall into; hits of one pixel stay in their order.

    Args:
        pixel: (n,) a pixel or OUTSIDE.
        start: (n_pixels + 1,) overwritten: hits order[start[p] : start[p + 1]] fall into pixel p.
        order: (n,) overwritten up to start[n_pixels].
    """
    for p in range(n_pixels + 1):
        start[p] = 0
    for i in range(pixel.shape[0]):
        if pixel[i] != OUTSIDE:
            start[pixel[i] + 1] += 1
    for p in range(n_pixels):
        start[p + 1] += start[p]
    for i in range(pixel.shape[0]):
        if pixel[i] != OUTSIDE:
            order[start[pixel[i]]] = i
            start[pixel[i]] += 1
    for p in range(n_pixels, 0, -1):  # each start has moved to its pixel's end, which is the next one's start
        start[p] = start[p - 1]
    start[0] = 0
