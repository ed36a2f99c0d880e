"""Obscurance W with colour bleeding [FA eq. 1].

    W(P) = 1/pi * integral over the hemisphere of R(Q) rho(d) cos(theta) dw

Cosine-distributed rays cancel cos(theta) / pi, so W is the mean of R(Q) rho(d) over rays. What the paper leaves open
(the curve rho, rays that meet nothing) is decided in docs/decisions/obscurance.md.

Notation of the kernels: rays from a hit P meet Q at distance d; S is the mean background radiance of escaping rays.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Rgb

from ..embree.packets import (
    DIRECTION,
    GEOMETRY,
    ORIGIN,
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
from ..hits.hits import Hits, reflects_in_lanes, triple
from ..hits.rays import NO_RAYS, Rays
from ..inputs.random import HEMISPHERE, UNIT_24, above, cosine_direction, random_word
from ..inputs.surfaces import Surfaces, total_at
from ..kernels.kernel import kernel
from ..kernels.simd import (
    LANES,
    compress,
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
    store_row,
    width_of_packets,
)
from .falloff import CONSTANT, rho_of_lanes


class ObscuranceSettings(NamedTuple):
    """The job's [obscurance] and [samples] tables for kernels.

    Attributes:
        d_max: range, scene units.
        falloff: code of the curve rho.
        tau: steepness of the exponential curve.
        n_rays: rays per hit.
        step_x, step_y: the lattice that spreads them, see `lattice_steps`.
        sky: whether rays continue past d_max, and those that escape see the background.
        average: (3,) reflectivity that stands in for R(Q) where a ray meets nothing within d_max.
        background: (3,) radiance outside the scene.
    """

    d_max: float
    falloff: int
    tau: float
    n_rays: int
    step_x: int
    step_y: int
    sky: bool
    average: Rgb
    background: Rgb


@kernel
def _write_obscurance_rays(
    hits: Hits, rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings
) -> int:
    """Write rays first_ray to first_ray + n_rays - 1 of the n listed hits; returns the number of rays.

    Sixteen rays in a row are the same ray of 16 hits; n_rays such rows belong to the same hits.
    """
    reach, idle = np.float32(np.inf if settings.sky else settings.d_max), np.float32(-1.0)
    step_x, step_y = np.int32(np.uint32(settings.step_x)), np.int32(np.uint32(settings.step_y))
    # fill the last step with copies of the last hit, whose rays stay idle
    for k in range(n, (n + LANES - 1) // LANES * LANES):
        rays.place[k] = rays.place[n - 1]
    # Loop state
    ray = 0  # rays written
    for first in range(0, n, LANES):
        # shading normal m, geometric normal g, point P, and the origin of rays slightly above it
        hit = load(rays.place, first)
        e = gather(hits.offset, hit)
        mx, my, mz = triple(hits.shading, hit)
        gx, gy, gz = triple(hits.geometric, hit)
        px, py, pz = triple(hits.position, hit)
        ox, oy, oz = px + e * gx, py + e * gy, pz + e * gz
        # the hit's lattice, shifted at random: (a, b) is its point first_ray, in units of 2^-32
        random = random_word(gather(hits.key, hit), HEMISPHERE)
        a, b = integers(random) + np.int32(first_ray) * step_x, integers(random >> np.uint64(32))
        b = b + np.int32(first_ray) * step_y
        tfar = select(lane_numbers() < np.int32(n - first), reach, idle)
        for _ in range(n_rays):
            # direction with density cos(theta) / pi about m, mirrored above the triangle
            u, v = reals(a >> np.int32(8)) * UNIT_24, reals(b >> np.int32(8)) * UNIT_24
            x, y, z = cosine_direction(mx, my, mz, u, v)
            x, y, z = above(x, y, z, gx, gy, gz)
            # the ray
            store_row(rays.packets, ray, ORIGIN, ox)
            store_row(rays.packets, ray, ORIGIN + 1, oy)
            store_row(rays.packets, ray, ORIGIN + 2, oz)
            store_row(rays.packets, ray, DIRECTION, x)
            store_row(rays.packets, ray, DIRECTION + 1, y)
            store_row(rays.packets, ray, DIRECTION + 2, z)
            store_row(rays.packets, ray, TFAR, tfar)
            # the next point of the lattice
            a, b, ray = a + step_x, b + step_y, ray + LANES
    return ray


@kernel
def _evaluate_rays(surfaces: Surfaces, tracer: Tracer, rays: Rays, n: int, settings: ObscuranceSettings) -> int:
    """Compute R(Q) rho(d) of traced rays 0 to n - 1 into `rays.value`.

    Where R varies over the surface the value is only rho(d) so far; `rays.number[0]` lists such rays for
    `_apply_textures`. `rays.number[1]` is 1 for rays that see the background.

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
            compress(changing, lane_numbers() + np.int32(first), rays.number, varied)
            varied += popcount(changing)
    return varied


@kernel
def _apply_textures(surfaces: Surfaces, tracer: Tracer, rays: Rays, n: int) -> None:
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


@kernel
def _add_to_hits(
    rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings, result: Rgb, skylight: Rgb
) -> None:
    """Add values of rays to the sums of the n listed hits, in the order of rays; the last rays complete the means."""
    share, second = np.float32(1.0 / settings.n_rays), rays.number.shape[1]
    for first in range(0, n, LANES):
        hit = load(rays.place, first) * np.int32(3)
        # sum of R(Q) rho(d), continued from earlier rays; it overwrites values that are no longer needed
        for channel in range(3):
            row = channel * rays.value.shape[1]
            total = (
                gather(result, hit + np.int32(channel)) if first_ray > 0 else reals(lane_numbers()) * np.float32(0.0)
            )
            for ray in range(n_rays):
                total = total + load(rays.value, row + first * n_rays + ray * LANES)
            store(rays.value, row + first, total)
        # number of rays that see the background
        if settings.sky:
            escaped = load(rays.number, second + first * n_rays)
            for ray in range(1, n_rays):
                escaped = escaped + load(rays.number, second + first * n_rays + ray * LANES)
            store(rays.number, second + first, escaped)
    # W once all rays are in, and S
    scale = share if first_ray + n_rays == settings.n_rays else np.float32(1.0)
    for k in range(n):
        hit = rays.place[k]
        for channel in range(3):
            result[hit, channel] = scale * rays.value[channel, k]
            if settings.sky:
                before = skylight[hit, channel] if first_ray > 0 else np.float32(0.0)
                light = share * settings.background[channel]
                skylight[hit, channel] = before + light * np.float32(rays.number[1, k])


@kernel
def _trace_hits(
    hits: Hits,
    surfaces: Surfaces,
    tracer: Tracer,
    rays: Rays,
    n: int,
    settings: ObscuranceSettings,
    result: Rgb,
    skylight: Rgb,
) -> None:
    """Estimate W of the n hits listed in `rays.place`, tracing as many rays of each together as fit."""
    if n == 0:
        return
    room = room_in(rays.packets) // LANES
    for first_ray in range(0, settings.n_rays, room):
        # rays first_ray to first_ray + n_rays - 1 of every hit
        n_rays = min(settings.n_rays - first_ray, room)
        n_traced = _write_obscurance_rays(hits, rays, n, first_ray, n_rays, settings)
        intersect(tracer, rays.packets, n_traced, False, 0.0)
        varied = _evaluate_rays(surfaces, tracer, rays, n_traced, settings)
        _apply_textures(surfaces, tracer, rays, varied)
        _add_to_hits(rays, n, first_ray, n_rays, settings, result, skylight)


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
) -> int:
    """Estimate W of hits 0 to n - 1 [FA eq. 1]; hits that reflect nothing get 0.

    Args:
        rays: scratch; the kernel traces as many rays together as it holds.
        result: (n, 3) W, 0 to 1, overwritten.
        skylight: (n, 3) S, the mean background radiance of escaping rays, overwritten; (0, 3) unless `settings.sky`.

    Returns:
        number of rays.
    """
    fit = max(room_in(rays.packets) // LANES // settings.n_rays, 1) * LANES  # hits whose rays fit into the packets
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
        compress(wanted, lane_numbers() + np.int32(first), rays.place, waiting)
        waiting += popcount(wanted)
        # trace a full list, and move what is left to its start
        if waiting >= fit:
            _trace_hits(hits, surfaces, tracer, rays, fit, settings, result, skylight)
            total, waiting = total + fit, waiting - fit
            for k in range(waiting):
                rays.place[k] = rays.place[fit + k]
    _trace_hits(hits, surfaces, tracer, rays, waiting, settings, result, skylight)
    return (total + waiting) * settings.n_rays
