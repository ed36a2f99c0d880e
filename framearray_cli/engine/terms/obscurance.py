"""Obscurance W with colour bleeding [FA eq. 1].

    W(P) = 1/pi * integral over the hemisphere of R(Q) rho(d) cos(theta) dw

Cosine-distributed rays cancel cos(theta) / pi, so W is the mean of R(Q) rho(d) over rays. What the paper leaves open
(the curve rho, rays that meet nothing) is decided in docs/decisions/obscurance.md.
"""

import math
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Rgb

from ..embree.packets import DIRECTION, GEOMETRY, ORIGIN, TFAR, TRIANGLE, Tracer, U, V, intersect, scene_triangle
from ..hits.hits import Hits, reflecting, triple
from ..hits.rays import Rays
from ..inputs.random import HEMISPHERE, UNIT_24, above, cosine_direction, word
from ..inputs.surfaces import Surfaces, total_at
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import (
    LANES,
    compress,
    gather,
    integers,
    lane_numbers,
    load,
    popcount,
    reals,
    scatter,
    select,
    sqrt,
    store,
)

SQRT, LINEAR, CBRT, EXPONENTIAL, CONSTANT = range(5)
FALLOFFS = {"sqrt": SQRT, "linear": LINEAR, "cbrt": CBRT, "exponential": EXPONENTIAL, "constant": CONSTANT}


class ObscuranceSettings(NamedTuple):
    """The job's [obscurance] and [samples] tables for kernels.

    Attributes:
        d_max: range, scene units.
        falloff: code of the curve rho.
        tau: steepness of the exponential curve.
        n_rays: rays a hit.
        step_x, step_y: the lattice that spreads them, see `lattice_steps`.
        sky: whether rays are traced past d_max and escaping ones see the background.
        average: (3,) reflectivity that stands in for R(Q) where a ray meets nothing.
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


@inlined
def rho(falloff: int, tau: Real, x: Real) -> Real:
    """The falloff curve at x = d / d_max, rising from 0 (0 for `constant`) at 0 to 1 at 1."""
    if falloff == SQRT:
        return np.float32(np.sqrt(x))
    if falloff == LINEAR:
        return x
    if falloff == CBRT:
        return np.float32(x ** np.float32(1.0 / 3.0))
    if falloff == EXPONENTIAL:
        return np.float32(math.expm1(-tau * x) / math.expm1(-tau))
    return np.float32(0.0)


@kernel
def _aim(hits: Hits, rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings) -> int:
    """Write rays first_ray to first_ray + n_rays - 1 of the n listed hits; returns the number of packets.

    A packet holds the same ray of 16 hits, and n_rays packets in a row belong to the same hits.
    """
    size = rays.packets.shape[1] * LANES
    reach, idle = np.float32(np.inf if settings.sky else settings.d_max), np.float32(-1.0)
    step_x, step_y = np.int32(np.uint32(settings.step_x)), np.int32(np.uint32(settings.step_y))
    for k in range(n, (n + LANES - 1) // LANES * LANES):
        rays.place[k] = rays.place[n - 1]
    packet = 0
    for first in range(0, n, LANES):
        hit = load(rays.place, first)
        e = gather(hits.offset, hit)
        mx, my, mz = triple(hits.shading, hit)
        gx, gy, gz = triple(hits.geometric, hit)
        px, py, pz = triple(hits.position, hit)
        ox, oy, oz = px + e * gx, py + e * gy, pz + e * gz
        random = word(gather(hits.key, hit), HEMISPHERE)
        a, b = integers(random) + np.int32(first_ray) * step_x, integers(random >> np.uint64(32))
        b = b + np.int32(first_ray) * step_y
        tfar = select(lane_numbers() < np.int32(n - first), reach, idle)
        for _ in range(n_rays):
            u, v = reals(a >> np.int32(8)) * UNIT_24, reals(b >> np.int32(8)) * UNIT_24
            x, y, z = cosine_direction(mx, my, mz, u, v)
            x, y, z = above(x, y, z, gx, gy, gz)
            ray = packet * size
            store(rays.packets, ray + ORIGIN * LANES, ox)
            store(rays.packets, ray + (ORIGIN + 1) * LANES, oy)
            store(rays.packets, ray + (ORIGIN + 2) * LANES, oz)
            store(rays.packets, ray + DIRECTION * LANES, x)
            store(rays.packets, ray + (DIRECTION + 1) * LANES, y)
            store(rays.packets, ray + (DIRECTION + 2) * LANES, z)
            store(rays.packets, ray + TFAR * LANES, tfar)
            a, b, packet = a + step_x, b + step_y, packet + 1
    return packet


@inlined
def _rho_of_lanes(falloff: int, tau: Real, x: Real, room: Float32, at: int) -> Real:
    """`rho` of sixteen numbers; those that lanes cannot work out are worked out in `room`, from a flat offset on."""
    curve: Real = x
    if falloff == SQRT:
        curve = sqrt(x)
    elif falloff != LINEAR:
        store(room, at, x)
        flat = room.reshape(room.size)
        for i in range(at, at + LANES):
            flat[i] = rho(falloff, tau, flat[i])
        curve = load(room, at)
    return curve


@kernel
def _value(surfaces: Surfaces, tracer: Tracer, rays: Rays, n: int, settings: ObscuranceSettings) -> int:
    """Value traced rays 0 to n - 1: R(Q) rho(d) where they meet a surface within d_max.

    Of a surface that does not look the same everywhere only rho(d) is known then; such rays are listed in
    `rays.number[0]`. `rays.number[1]` says which rays see the background.

    Returns:
        how many are listed.
    """
    second, packet = rays.number.shape[1], rays.packets.shape[1] * LANES
    bits, d_max = rays.packets.view(np.int32), np.float32(settings.d_max)
    varied = 0
    for first in range(0, n, LANES):
        ray = (first >> 4) * packet
        distance, triangle = load(rays.packets, ray + TFAR * LANES), load(bits, ray + TRIANGLE * LANES)
        missed = triangle < np.int32(0)
        within = ~missed & (distance < d_max)
        nothing = ~within
        if settings.sky:
            nothing = nothing & ~missed
            store(rays.number, second + first, select(missed, integers(1), np.int32(0)))
        triangle = scene_triangle(tracer, triangle, load(bits, ray + GEOMETRY * LANES))
        material = gather(surfaces.material, select(within, triangle, np.int32(0)))
        at, x = material * np.int32(3), select(within, distance, np.float32(0.0)) / d_max
        weight = _rho_of_lanes(settings.falloff, settings.tau, x, rays.value, first)
        for channel in range(3):
            value = weight * gather(surfaces.total, at + np.int32(channel))
            value = select(within, value, select(nothing, reals(settings.average[channel]), np.float32(0.0)))
            store(rays.value, channel * rays.value.shape[1] + first, value)
        if settings.falloff != CONSTANT:
            changing = within & (gather(surfaces.plain, material) == np.uint8(0))
            compress(changing, lane_numbers() + np.int32(first), rays.number, varied)
            varied += popcount(changing)
    return varied


@kernel
def _tint(surfaces: Surfaces, tracer: Tracer, rays: Rays, n: int) -> None:
    """Multiply the value of listed rays 0 to n - 1 by R(Q), which depends on the place."""
    if n == 0:
        return
    stride, packet = np.int32(rays.value.shape[1]), np.int32(rays.packets.shape[1] * LANES)
    for k in range(n, (n + LANES - 1) // LANES * LANES):
        rays.number[0, k] = rays.number[0, n - 1]  # worked out twice at once, and written twice
    bits = rays.packets.view(np.int32)
    for first in range(0, n, LANES):
        i = load(rays.number, first)
        at = (i >> np.int32(4)) * packet + (i & np.int32(15))
        triangle, geometry = (
            gather(bits, at + np.int32(TRIANGLE * LANES)),
            gather(bits, at + np.int32(GEOMETRY * LANES)),
        )
        triangle = scene_triangle(tracer, triangle, geometry)
        u, v = gather(rays.packets, at + np.int32(U * LANES)), gather(rays.packets, at + np.int32(V * LANES))
        total = total_at(surfaces, triangle, u, v)
        for channel in range(3):
            place = i + np.int32(channel) * stride
            scatter(rays.value, place, gather(rays.value, place) * total[channel])


@kernel
def _hand_over(
    rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings, result: Rgb, skylight: Rgb
) -> None:
    """Add what was traced to the sums of the listed hits, ray by ray in their order; the last rays make them means."""
    share, second = np.float32(1.0 / settings.n_rays), rays.number.shape[1]
    for first in range(0, n, LANES):
        hit = load(rays.place, first) * np.int32(3)
        for channel in range(3):  # sums go where values were that are summed already
            row = channel * rays.value.shape[1]
            total = (
                gather(result, hit + np.int32(channel)) if first_ray > 0 else reals(lane_numbers()) * np.float32(0.0)
            )
            for ray in range(n_rays):
                total = total + load(rays.value, row + first * n_rays + ray * LANES)
            store(rays.value, row + first, total)
        if settings.sky:
            escaped = load(rays.number, second + first * n_rays)
            for ray in range(1, n_rays):
                escaped = escaped + load(rays.number, second + first * n_rays + ray * LANES)
            store(rays.number, second + first, escaped)
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
def _trace(
    hits: Hits,
    surfaces: Surfaces,
    tracer: Tracer,
    rays: Rays,
    n: int,
    settings: ObscuranceSettings,
    result: Rgb,
    skylight: Rgb,
) -> None:
    """Estimate W of the n hits listed in `rays.place`; as many rays of each as fit are traced together."""
    if n == 0:
        return
    room = rays.packets.shape[0]
    for first_ray in range(0, settings.n_rays, room):
        n_rays = min(settings.n_rays - first_ray, room)
        n_traced = LANES * _aim(hits, rays, n, first_ray, n_rays, settings)
        intersect(tracer, rays.packets, n_traced, False)
        varied = _value(surfaces, tracer, rays, n_traced, settings)
        _tint(surfaces, tracer, rays, varied)
        _hand_over(rays, n, first_ray, n_rays, settings, result, skylight)


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
        rays: room for rays; as many as fit are traced together.
        result: (n, 3) W, 0 to 1, overwritten.
        skylight: (n, 3) mean background radiance of escaping rays, overwritten; (0, 3) unless `settings.sky`.

    Returns:
        number of rays.
    """
    fit = max(rays.packets.shape[0] // settings.n_rays, 1) * LANES
    waiting = total = 0
    for i in range(n):
        for channel in range(3):
            result[i, channel] = 0.0
            if settings.sky:
                skylight[i, channel] = 0.0
    for first in range(0, n, LANES):
        wanted = reflecting(hits, first, n)
        compress(wanted, lane_numbers() + np.int32(first), rays.place, waiting)
        waiting += popcount(wanted)
        if waiting >= fit:
            _trace(hits, surfaces, tracer, rays, fit, settings, result, skylight)
            total, waiting = total + fit, waiting - fit
            for k in range(waiting):
                rays.place[k] = rays.place[fit + k]
    _trace(hits, surfaces, tracer, rays, waiting, settings, result, skylight)
    return (total + waiting) * settings.n_rays
