"""Obscurance W with colour bleeding [FA eq. 1].

    W(P) = 1/pi * integral over the hemisphere of R(Q) rho(d) cos(theta) dw

Cosine-distributed rays cancel cos(theta) / pi, so W is the mean of R(Q) rho(d) over rays. The curve rho says how open a
surface at distance d leaves a point. docs/decisions/ambient.md explains the choices that the paper leaves open: the
curve, and rays that meet nothing.

Rays are written hit by hit and traced by direction. The five rays of a hit scatter over its hemisphere, and so do the
rays of sixteen neighbouring hits: a packet of them has nothing to share. Some eight hundred neighbouring hits have
enough rays to fill packets with rays of nearly one direction each. A counting sort orders the rays; a list of ranks
finds the values of a hit's rays again.

Notation of the kernels: rays from a hit P meet Q at distance d; S is the mean background radiance of escaping rays.
"""

import math
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Rgb

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
from ..hits.rays import NO_RAYS, ORDER, RANK, Rays
from ..inputs.random import HEMISPHERE, UNIT_24, above, cosine_direction, random_word
from ..inputs.surfaces import Surfaces, total_at
from ..kernels.bundle import bundle
from ..kernels.kernel import index, inlined, kernel, step
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
    sqrt,
    store,
    store_row,
    width_of_packets,
)

SQRT, LINEAR, CBRT, EXPONENTIAL, CONSTANT = range(5)
FALLOFFS = {"sqrt": SQRT, "linear": LINEAR, "cbrt": CBRT, "exponential": EXPONENTIAL, "constant": CONSTANT}
# Directions are sorted into 8 x 8 bins of an octahedral map; rays of no hit come last.
BINS = 64
# Rays that are traced together, and hits after which tracing starts afresh. Every batch of hits begins at a multiple of
# these, so which rays share a packet depends neither on the size of batches nor on the number of threads.
RAYS_TOGETHER, HITS_TOGETHER = 4096, 2048


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


@inlined
def rho_of_lanes(falloff: int, tau: Real, x: Real, room: Float32, at: int) -> Real:
    """`rho` of sixteen numbers; curves without a lane version go one by one through `room`, at flat offset `at`."""
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


@bundle
class ObscuranceSettings(NamedTuple):
    """The job's [obscurance] and [samples] tables for kernels.

    Attributes:
        d_max: range, scene units.
        falloff: code of the curve rho.
        tau: steepness of the exponential curve.
        n_rays: rays per hit.
        step_x, step_y: the lattice that spreads them, see `lattice_steps`.
        coherent: True if packets of rays of one direction are traced as coherent ones, which is faster; where two
            triangles meet a ray at the same distance, Embree may then report the other one.
        sky: True if rays continue past d_max, and see the background where they leave the scene.
        average: (3,) reflectivity that stands in for R(Q) where a ray meets nothing within d_max.
        background: (3,) radiance outside the scene.
    """

    d_max: float
    falloff: int
    tau: float
    n_rays: int
    step_x: int
    step_y: int
    coherent: bool
    sky: bool
    average: Rgb
    background: Rgb


@inlined
def bin_of(x: Real, y: Real, z: Real) -> int:
    """Bins of unit directions, in Z order: bins that follow each other are neighbours."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    # onto the octahedron |x| + |y| + |z| = 1, its lower half folded outwards
    a, b = select(x < nothing, -x, x), select(y < nothing, -y, y)
    size = a + b + select(z < nothing, -z, z)
    a, b = a / size, b / size
    lower = z < nothing
    a, b = select(lower, one - b, a), select(lower, one - a, b)
    u, v = select(x < nothing, -a, a), select(y < nothing, -b, b)
    # 0 to 7 each, also where a direction is not finite
    i, j = (
        integers((u + one) * np.float32(3.9999)) & np.int32(7),
        integers((v + one) * np.float32(3.9999)) & np.int32(7),
    )
    one_bit, two, four = np.int32(1), np.int32(2), np.int32(4)
    i = (i & one_bit) + (i & two) * two + (i & four) * four
    j = (j & one_bit) + (j & two) * two + (j & four) * four
    return i + j * two


@kernel
def _write_rays(
    hits: Hits, rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings, neighbours: bool
) -> int:
    """Write rays first_ray to first_ray + n_rays - 1 of the n listed hits to `rays.row`, and their bins to RANK.

    Sixteen rays in a row are the same ray of 16 hits; n_rays such rows belong to the same hits. Returns their number.
    """
    room, to = rays.row.shape[1], RANK * rays.number.shape[1]
    step_x, step_y = np.int32(np.uint32(settings.step_x)), np.int32(np.uint32(settings.step_y))
    # fill the last step with copies of the last hit, whose rays count for no hit
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
        counts = lane_numbers() < np.int32(n - first)
        for _ in range(n_rays):
            # direction with density cos(theta) / pi about m, mirrored above the triangle
            u, v = reals(a >> np.int32(8)) * UNIT_24, reals(b >> np.int32(8)) * UNIT_24
            x, y, z = cosine_direction(mx, my, mz, u, v)
            x, y, z = above(x, y, z, gx, gy, gz)
            # the ray
            store(rays.row, ray, ox)
            store(rays.row, room + ray, oy)
            store(rays.row, 2 * room + ray, oz)
            store(rays.row, 3 * room + ray, x)
            store(rays.row, 4 * room + ray, y)
            store(rays.row, 5 * room + ray, z)
            cell = bin_of(x, y, z) if neighbours else integers(lane_numbers()) & np.int32(0)
            store(rays.number, to + ray, select(counts, cell, np.int32(BINS)))
            # the next point of the lattice
            a, b, ray = a + step_x, b + step_y, ray + LANES
    return ray


@kernel
def sort_rays(rays: Rays, n: int) -> None:
    """Sort rays 0 to n - 1 by their bins: ORDER lists them, and RANK, which held the bins, becomes the place of each.

    A counting sort; rays of one bin keep their order.
    """
    order, rank, start = rays.number[ORDER], rays.number[RANK], rays.start
    for cell in range(BINS + 2):
        start[cell] = 0
    for ray in range(n):
        start[index(rank[ray] + 1)] += 1
    for cell in range(1, BINS + 1):
        start[cell] += start[cell - 1]
    for ray in range(n):
        cell = index(rank[ray])
        at = start[cell]
        start[cell] = at + 1
        order[index(at)], rank[ray] = ray, at


@kernel
def write_obscurance_rays(
    hits: Hits, rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings, neighbours: bool
) -> int:
    """Write rays first_ray to first_ray + n_rays - 1 of the n listed hits into packets.

    Ray r of hit k is number RANK[(k - k % 16) n_rays + 16 r + k % 16] there; values of rays stand in that order, too.

    Args:
        rays: lists the hits in `place`; ORDER and RANK are overwritten.
        neighbours: True if the hits lie close together: only then rays of one direction share a packet.

    Returns:
        number of rays.
    """
    n_written = _write_rays(hits, rays, n, first_ray, n_rays, settings, neighbours)
    sort_rays(rays, n_written)
    stride, room = ORDER * rays.number.shape[1], np.int32(rays.row.shape[1])
    reach = np.float32(np.inf if settings.sky else settings.d_max)
    for first in range(0, n * n_rays, LANES):
        ray = load(rays.number, stride + first)
        for axis in range(3):
            store_row(rays.packets, first, ORIGIN + axis, gather(rays.row, ray + np.int32(axis) * room))
            store_row(rays.packets, first, DIRECTION + axis, gather(rays.row, ray + np.int32(3 + axis) * room))
        store_row(rays.packets, first, TFAR, reach)
    return n * n_rays


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
        intersect(tracer, rays.packets, n_traced, neighbours and settings.coherent, 0.0)
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
        neighbours: True if hits in a row lie close together, as native hits do: then rays of one direction share
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
