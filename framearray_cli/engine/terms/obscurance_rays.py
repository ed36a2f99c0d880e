"""The rays of obscurances: written hit by hit, traced by direction.

The five rays of a hit scatter over its hemisphere, and so do those of sixteen hits side by side: a packet of them finds
nothing to share. Some eight hundred neighbouring hits have enough rays to fill packets with rays of nearly one
direction each. A counting sort puts them in order; a list of ranks finds the values of a hit's rays again.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Real, Rgb

from ..embree.packets import DIRECTION, ORIGIN, TFAR
from ..hits.hits import Hits, triple
from ..hits.rays import ORDER, RANK, Rays
from ..inputs.random import HEMISPHERE, UNIT_24, above, cosine_direction, random_word
from ..kernels.kernel import index, inlined, kernel
from ..kernels.simd import LANES, gather, integers, lane_numbers, load, reals, select, store, store_row

# Directions are sorted into 8 x 8 cells of an octahedral map; rays of no hit come last.
CELLS = 64


class ObscuranceSettings(NamedTuple):
    """The job's [obscurance] and [samples] tables for kernels.

    Attributes:
        d_max: range, scene units.
        falloff: code of the curve rho.
        tau: steepness of the exponential curve.
        n_rays: rays per hit.
        step_x, step_y: the lattice that spreads them, see `lattice_steps`.
        coherent: whether packets of rays of one direction are traced as coherent ones, which is faster; where two
            triangles meet a ray at the same distance, Embree may then report the other one.
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
    coherent: bool
    sky: bool
    average: Rgb
    background: Rgb


@inlined
def cell_of(x: Real, y: Real, z: Real) -> int:
    """The cell of unit directions, in Z order: cells that follow each other are neighbours."""
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
    found: int = i + j * two
    return found


@kernel
def _write_rays(
    hits: Hits, rays: Rays, n: int, first_ray: int, n_rays: int, settings: ObscuranceSettings, neighbours: bool
) -> int:
    """Write rays first_ray to first_ray + n_rays - 1 of the n listed hits to `rays.row`, and their cells to RANK.

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
            cell = cell_of(x, y, z) if neighbours else integers(lane_numbers()) & np.int32(0)
            store(rays.number, to + ray, select(counts, cell, np.int32(CELLS)))
            # the next point of the lattice
            a, b, ray = a + step_x, b + step_y, ray + LANES
    return ray


@kernel
def sort_rays(rays: Rays, n: int) -> None:
    """Sort rays 0 to n - 1 by their cells: ORDER lists them, and RANK, which held the cells, says where each stands.

    A counting sort; rays of one cell keep their order.
    """
    order, rank, start = rays.number[ORDER], rays.number[RANK], rays.start
    for cell in range(CELLS + 2):
        start[cell] = 0
    for ray in range(n):
        start[index(rank[ray] + 1)] += 1
    for cell in range(1, CELLS + 1):
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
        neighbours: whether the hits lie close together: only then do directions decide which rays share a packet.

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
