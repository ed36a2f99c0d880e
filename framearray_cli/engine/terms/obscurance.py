"""Obscurance W with colour bleeding [FA eq. 1].

    W(P) = 1/pi * integral over the hemisphere of R(Q) rho(d) cos(theta) dw

Cosine-distributed rays cancel cos(theta) / pi, so W is the mean of R(Q) rho(d) over rays. What the paper leaves open
(the curve rho, rays that meet nothing) is decided in docs/decisions/ambient.md.

Notation of the kernels: rays from a hit P meet Q at distance d; S is the mean background radiance of escaping rays.
"""

import numpy as np

from framearray_cli.base.arrays import Rgb

from ..embree.packets import (
    GEOMETRY,
    TFAR,
    TRIANGLE,
    Tracer,
    U,
    V,
    intersect,
    place_in,
    room_in,
    scene_triangle,
)
from ..hits.hits import Hits, reflects_in_lanes
from ..hits.rays import NO_RAYS, ORDER, RANK, Rays
from ..inputs.surfaces import Surfaces, total_at
from ..kernels.kernel import kernel, step
from ..kernels.simd import (
    LANES,
    append,
    gather,
    integers,
    lane_numbers,
    load,
    load_row,
    popcount,
    reals,
    scatter,
    select,
    store,
    width_of_packets,
)
from .falloff import CONSTANT, rho_of_lanes
from .obscurance_rays import ObscuranceSettings as ObscuranceSettings
from .obscurance_rays import write_obscurance_rays

# Rays that are traced together, and hits after which tracing starts afresh. Every batch of hits begins at a multiple of
# these, so which rays share a packet depends neither on the size of batches nor on the number of threads.
RAYS_TOGETHER, HITS_TOGETHER = 4096, 2048


@step
def evaluate_rays(surfaces: Surfaces, tracer: Tracer, rays: Rays, n: int, settings: ObscuranceSettings) -> int:
    """Compute R(Q) rho(d) of traced rays 0 to n - 1 into `rays.value`.

    Where R varies over the surface the value is only rho(d) so far; `rays.number[0]` lists such rays for
    `apply_textures`. `rays.number[1]` is 1 for rays that see the background.

    Returns:
        number of listed rays.
    """
    second = rays.number.shape[1]
    bits, d_max = rays.packets.view(np.int32), np.float32(settings.d_max)
    # Loop state
    varied = NO_RAYS  # rays in the list
    for first in range(0, n, LANES):
        # distance d and triangle of Q, and which rays meet one within d_max
        distance, triangle = load_row(rays.packets, first, TFAR), load_row(bits, first, TRIANGLE)
        missed = triangle < np.int32(0)
        within = ~missed & (distance < d_max)
        nothing = ~within
        # rays that leave the scene see the background
        if settings.sky:
            nothing = nothing & ~missed
            store(rays.number, second + first, select(missed, integers(1), np.int32(0)))
        # rho(d), and the material of Q
        triangle = scene_triangle(tracer, triangle, load_row(bits, first, GEOMETRY))
        material = gather(surfaces.material, select(within, triangle, np.int32(0)))
        at, x = material * np.int32(3), select(within, distance, np.float32(0.0)) / d_max
        weight = rho_of_lanes(settings.falloff, settings.tau, x, rays.value, first)
        # R(Q) rho(d), or the average reflectivity beyond d_max; 0 for the background, which is not part of W
        for channel in range(3):
            value = weight * gather(surfaces.total, at + np.int32(channel))
            value = select(within, value, select(nothing, reals(settings.average[channel]), np.float32(0.0)))
            store(rays.value, channel * rays.value.shape[1] + first, value)
        # list the rays whose R(Q) depends on the place; rho = 0 needs no R(Q)
        if settings.falloff != CONSTANT:
            changing = within & (gather(surfaces.plain, material) == np.uint8(0))
            append(changing, lane_numbers() + np.int32(first), rays.number, varied)
            varied += popcount(changing)
    return varied


@kernel
def apply_textures(surfaces: Surfaces, tracer: Tracer, rays: Rays, n: int) -> None:
    """Multiply the value of listed rays 0 to n - 1 by R(Q), looked up where each ray meets its surface."""
    if n == 0:
        return
    stride, width = np.int32(rays.value.shape[1]), np.int32(width_of_packets())
    for k in range(n, (n + LANES - 1) // LANES * LANES):
        rays.number[0, k] = rays.number[0, n - 1]  # lanes that repeat a ray compute and write the same value
    bits = rays.packets.view(np.int32)
    for first in range(0, n, LANES):
        # triangle and place (u, v) of each ray
        i = load(rays.number, first)
        at = place_in(rays.packets, i)
        triangle, geometry = (
            gather(bits, at + np.int32(TRIANGLE) * width),
            gather(bits, at + np.int32(GEOMETRY) * width),
        )
        triangle = scene_triangle(tracer, triangle, geometry)
        u, v = gather(rays.packets, at + np.int32(U) * width), gather(rays.packets, at + np.int32(V) * width)
        # rho(d) -> R(Q) rho(d)
        total = total_at(surfaces, triangle, u, v)
        for channel in range(3):
            place = i + np.int32(channel) * stride
            scatter(rays.value, place, gather(rays.value, place) * total[channel])


@step
def add_to_hits(
    rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings, result: Rgb, skylight: Rgb
) -> None:
    """Add values of rays to the sums of the n listed hits, in the order of rays; the last rays complete the means."""
    share, second = np.float32(1.0 / settings.n_rays), np.int32(rays.number.shape[1])
    rank, escapes = RANK * rays.number.shape[1], ORDER * rays.number.shape[1]
    for first in range(0, n, LANES):
        hit = load(rays.place, first) * np.int32(3)
        # sum of R(Q) rho(d), continued from earlier rays; the rays themselves are no longer needed
        for channel in range(3):
            row = np.int32(channel * rays.value.shape[1])
            total = (
                gather(result, hit + np.int32(channel)) if first_ray > 0 else reals(lane_numbers()) * np.float32(0.0)
            )
            for ray in range(n_rays):
                total = total + gather(rays.value, load(rays.number, rank + first * n_rays + ray * LANES) + row)
            store(rays.row, channel * rays.row.shape[1] + first, total)
        # number of rays that see the background
        if settings.sky:
            escaped = integers(lane_numbers()) & np.int32(0)
            for ray in range(n_rays):
                at = load(rays.number, rank + first * n_rays + ray * LANES)
                escaped = escaped + gather(rays.number, at + second)
            store(rays.number, escapes + first, escaped)
    # W once all rays are in, and S
    scale = share if first_ray + n_rays == settings.n_rays else np.float32(1.0)
    for k in range(n):
        hit = rays.place[k]
        for channel in range(3):
            result[hit, channel] = scale * rays.row[channel, k]
            if settings.sky:
                before = skylight[hit, channel] if first_ray > 0 else np.float32(0.0)
                light = share * settings.background[channel]
                skylight[hit, channel] = before + light * np.float32(rays.number[ORDER, k])


@step
def _trace_hits(
    hits: Hits,
    surfaces: Surfaces,
    tracer: Tracer,
    rays: Rays,
    n: int,
    settings: ObscuranceSettings,
    result: Rgb,
    skylight: Rgb,
    neighbours: bool,
) -> None:
    """Estimate W of the n hits listed in `rays.place`, tracing as many rays of each together as fit."""
    if n == 0:
        return
    most = min(room_in(rays.packets), RAYS_TOGETHER) // LANES
    for first_ray in range(0, settings.n_rays, most):
        # rays first_ray to first_ray + n_rays - 1 of every hit
        n_rays = min(settings.n_rays - first_ray, most)
        n_traced = write_obscurance_rays(hits, rays, n, first_ray, n_rays, settings, neighbours)
        intersect(tracer, rays.packets, n_traced, neighbours and settings.coherent)
        varied = evaluate_rays(surfaces, tracer, rays, n_traced, settings)
        apply_textures(surfaces, tracer, rays, varied)
        add_to_hits(rays, n, first_ray, n_rays, settings, result, skylight)


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
    neighbours: bool,
) -> int:
    """Estimate W of hits 0 to n - 1 [FA eq. 1]; hits that reflect nothing get 0.

    Args:
        rays: scratch; the kernel traces as many rays together as it holds, at most RAYS_TOGETHER.
        result: (n, 3) W, 0 to 1, overwritten.
        skylight: (n, 3) S, the mean background radiance of escaping rays, overwritten; (0, 3) unless `settings.sky`.
        neighbours: whether hits in a row lie close together, as native hits do: then rays of one direction share
            packets.

    Returns:
        number of rays.
    """
    most = min(room_in(rays.packets), RAYS_TOGETHER)
    fit = max(most // LANES // settings.n_rays, 1) * LANES  # hits whose rays fit into the packets
    # Loop state
    waiting = NO_RAYS  # hits in the list rays.place
    total = NO_RAYS  #   hits done
    for i in range(n):
        for channel in range(3):
            result[i, channel] = 0.0
            if settings.sky:
                skylight[i, channel] = 0.0
    for first in range(0, n, LANES):
        # list the hits that reflect
        wanted = reflects_in_lanes(hits, first, n)
        append(wanted, lane_numbers() + np.int32(first), rays.place, waiting)
        waiting += popcount(wanted)
        # trace a full list, and move what is left to its start
        if waiting >= fit:
            _trace_hits(hits, surfaces, tracer, rays, fit, settings, result, skylight, neighbours)
            total, waiting = total + fit, waiting - fit
            for k in range(waiting):
                rays.place[k] = rays.place[fit + k]
        # start afresh
        if (first + LANES) % HITS_TOGETHER == 0:
            _trace_hits(hits, surfaces, tracer, rays, waiting, settings, result, skylight, neighbours)
            total, waiting = total + waiting, 0
    _trace_hits(hits, surfaces, tracer, rays, waiting, settings, result, skylight, neighbours)
    return (total + waiting) * settings.n_rays
