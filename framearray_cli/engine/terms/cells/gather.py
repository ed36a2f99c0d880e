"""Indirect light by gather rays that read cells.

    E_indirect(P)[l] = mean over rays of R(Q) E(cell of Q)[l]        Q: the first surface that a ray meets

The rays are those of obscurance, but run to the first surface, so that one set of rays gives W and the indirect light
of every l. Q is moved within its surface by up to half a cell, which blurs the borders of cells.

Notation of the kernels: rays from a hit P meet Q; E_indirect[l] = c colour[l] g[l], with the colour c of a hit.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Rgb, Triple

from ...embree.packets import DIRECTION, TFAR, Tracer, intersect, room_in
from ...hits.hits import Hits, World, decode_hits, reflects_in_lanes
from ...hits.rays import NO_RAYS, ORDER, RANK, Rays
from ...inputs.random import CELLS, r2, random_word
from ...inputs.surfaces import Surfaces, geometric_normal, position_at, total_at
from ...kernels.kernel import inlined, kernel
from ...kernels.simd import LANES, compress, integers, lane_numbers, load, load_row, popcount, reals, select, store
from ..obscurance import HITS_TOGETHER, RAYS_TOGETHER, add_to_hits, apply_textures, evaluate_rays
from ..obscurance_rays import ObscuranceSettings, write_obscurance_rays
from .guards import choose_slots, write_guard_ray
from .table import CONSTANT, MEAN, NOWHERE, TINT, Cells, find_cell, level_of, shifts, side_of

# Columns of a hit's row of indirect light before those of g: its colour c, and 1 if it has any light.
COLOUR, ANY, LIGHT = 0, 3, 4


class GatherScratch(NamedTuple):
    """Arrays for one batch of gather rays.

    Attributes:
        cell: (n_rays,) the cell that each ray reads, or NOWHERE.
        reflectivity: (3, n_rays) R(Q).
        point: (6, LANES) Q and its normal, of sixteen rays.
    """

    cell: Int32
    reflectivity: Float32
    point: Float32


class Gathered(NamedTuple):
    """What gather rays estimate at n hits; all overwritten.

    Attributes:
        obscurance, skylight: W and S, see `obscurance`.
        light: (n, LIGHT + channels n_lights) c, whether there is light, and g[l].
        constant: (n, 3) radiance that arrives, the same under every l: mean over cosine-distributed rays.
    """

    obscurance: Rgb
    skylight: Rgb
    light: Float32
    constant: Rgb


def room_for_gathering(n_rays: int) -> GatherScratch:
    """Allocate arrays for n rays."""
    n = -(-n_rays // LANES) * LANES
    return GatherScratch(np.empty(n, np.int32), np.empty((3, n), np.float32), np.empty((6, LANES), np.float32))


@kernel
def _find_cells(
    hits: Hits, surfaces: Surfaces, tracer: Tracer, cells: Cells, rays: Rays, n: int, first_ray: int, n_rays: int,
    room: GatherScratch, tests: Rays,
) -> None:  # fmt: skip
    """Find the cells that traced rays 0 to n - 1 read, and R(Q); n_rays rows of 16 rays belong to the same hits."""
    # Loop state
    waiting = NO_RAYS  # rays to guards in the queue
    for first in range(0, n, LANES):
        # make room for sixteen rays to guards
        if waiting > room_in(tests.packets) - LANES:
            choose_slots(tracer, tests, waiting, cells.other, room.cell)
            waiting = NO_RAYS
        # Q, its normal, and R(Q)
        missed, triangle, u, v = decode_hits(tracer, rays.packets, first)
        dx, dy = load_row(rays.packets, first, DIRECTION), load_row(rays.packets, first, DIRECTION + 1)
        dz = load_row(rays.packets, first, DIRECTION + 2)
        px, py, pz = position_at(surfaces, triangle, u, v)
        nx, ny, nz = geometric_normal(surfaces, triangle, dx, dy, dz)
        total = total_at(surfaces, triangle, u, v)
        store(room.point, 0, px)
        store(room.point, LANES, py)
        store(room.point, 2 * LANES, pz)
        store(room.point, 3 * LANES, nx)
        store(room.point, 4 * LANES, ny)
        store(room.point, 5 * LANES, nz)
        for channel in range(3):
            store(room.reflectivity, channel * room.reflectivity.shape[1] + first, total[channel])
        store(rays.value, first, load_row(rays.packets, first, TFAR))
        store(room.cell, first, select(missed, integers(NOWHERE), np.int32(0)))
        for lane in range(min(n - first, LANES)):
            if room.cell[first + lane] == NOWHERE:
                continue
            # the ray as it was written, before rays were sorted by direction: its hit, and its number there
            written = rays.number[ORDER, first + lane]
            k, ray = written // (LANES * n_rays) * LANES + written % LANES, first_ray + written // LANES % n_rays
            # the cell of Q, moved within its surface; the queue holds rays to the guards of doubtful cells
            key, q = hits.key[rays.place[k]], room.point
            point, normal = (q[0, lane], q[1, lane], q[2, lane]), (q[3, lane], q[4, lane], q[5, lane])
            found = _cell_of(cells, point, normal, rays.value[0, first + lane], key, ray)
            room.cell[first + lane] = found
            if cells.other[found] != NOWHERE:
                write_guard_ray(cells.guard, found, point, normal, tests, waiting, first + lane)
                waiting += 1
    choose_slots(tracer, tests, waiting, cells.other, room.cell)


@inlined
def _cell_of(cells: Cells, point: Triple, normal: Triple, length: Real, key: np.uint64, ray: int) -> int:
    """The cell that a ray of some length reads at a point, moved within its surface at random."""
    a, b = r2(random_word(key, CELLS), ray)
    along, across = shifts(normal, a, b)
    level, side = level_of(cells.grid, length), side_of(normal[0], normal[1], normal[2])
    return find_cell(cells.grid, cells.slots, level, side, point, along, across)


@kernel
def _sum_cells(
    cells: Cells, rays: Rays, n: int, first_ray: int, n_rays: int, all_rays: int, room: GatherScratch,
    indirect: Float32, constant: Rgb,
) -> None:  # fmt: skip
    """Sum the light that rays of the n listed hits read, in the order of rays; the last rays complete the means."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    last, share = first_ray + n_rays == all_rays, np.float32(1.0 / all_rays)
    nothing = np.float32(0.0)
    for k in range(n):
        hit, rank = rays.place[k], rays.number[RANK]
        at = k // LANES * LANES * n_rays + k % LANES
        # 1. What has no l: the colour of the light, and the light that is the same at every position.
        for channel in range(3):
            hue = indirect[hit, COLOUR + channel] if first_ray > 0 else nothing
            same = constant[hit, channel] if first_ray > 0 else nothing
            for ray in range(n_rays):
                place = rank[at + ray * LANES]
                cell = room.cell[place]
                if cell == NOWHERE:
                    same += share * cells.background[channel]
                    continue
                r = share * room.reflectivity[channel, place]
                hue += r * cells.tint[cell, TINT + channel] * cells.tint[cell, MEAN]
                same += r * cells.tint[cell, CONSTANT + channel]
            indirect[hit, COLOUR + channel], constant[hit, channel] = hue, same
        # 2. g[l]: sixteen light positions at a time.
        for channel in range(channels):
            for l in range(0, n_lights, LANES):
                to = hit * indirect.shape[1] + LIGHT + channel * n_lights + l
                total = load(indirect, to) if first_ray > 0 else reals(lane_numbers()) * nothing
                for ray in range(n_rays):
                    place = rank[at + ray * LANES]
                    cell = room.cell[place]
                    if cell != NOWHERE:
                        weight = share * _weight(cells, room.reflectivity, cell, place, channel)
                        total = total + load(cells.light, (cell * channels + channel) * n_lights + l) * weight
                compress(lane_numbers() < np.int32(n_lights - l), total, indirect, to)
        # 3. The colour c, whose mean is 1.
        if last:
            mean = nothing
            for channel in range(3):
                mean += cells.weights[channel] * indirect[hit, COLOUR + channel]
            indirect[hit, ANY] = np.float32(1.0) if mean > nothing else nothing
            for channel in range(3):
                hue = indirect[hit, COLOUR + channel] / mean if mean > nothing else nothing
                indirect[hit, COLOUR + channel] = hue if channels == 1 else np.float32(1.0)


@inlined
def _weight(cells: Cells, reflectivity: Float32, cell: int, ray: int, channel: int) -> Real:
    """What the light of a cell is multiplied by: R(Q) of a channel, or the mean of R(Q) c over all channels."""
    if cells.light.shape[1] == 3:
        r: Real = reflectivity[channel, ray]
        return r
    total = np.float32(0.0)
    for other in range(3):
        total += cells.weights[other] * reflectivity[other, ray] * cells.tint[cell, TINT + other]
    return total


@kernel
def _gather_hits(
    hits: Hits, world: World, cells: Cells, rays: Rays, n: int, settings: ObscuranceSettings, far: ObscuranceSettings,
    room: GatherScratch, tests: Rays, out: Gathered, neighbours: bool,
) -> None:  # fmt: skip
    """Gather at the n hits listed in `rays.place`, tracing as many rays of each together as fit."""
    if n == 0:
        return
    surfaces, tracer = world
    most = min(room_in(rays.packets), RAYS_TOGETHER) // LANES
    for first_ray in range(0, settings.n_rays, most):
        # rays first_ray to first_ray + n_rays - 1 of every hit
        n_rays = min(settings.n_rays - first_ray, most)
        n_traced = write_obscurance_rays(hits, rays, n, first_ray, n_rays, far, neighbours)
        intersect(tracer, rays.packets, n_traced, neighbours)
        _find_cells(hits, surfaces, tracer, cells, rays, n_traced, first_ray, n_rays, room, tests)
        _sum_cells(cells, rays, n, first_ray, n_rays, settings.n_rays, room, out.light, out.constant)
        # W, which has its own R(Q), rho and range
        varied = evaluate_rays(surfaces, tracer, rays, n_traced, settings)
        apply_textures(surfaces, tracer, rays, varied)
        add_to_hits(rays, n, first_ray, n_rays, settings, out.obscurance, out.skylight)


@kernel
def gather_cells(
    hits: Hits, n: int, settings: ObscuranceSettings, far: ObscuranceSettings, world: World, cells: Cells, rays: Rays,
    room: GatherScratch, tests: Rays, out: Gathered, neighbours: bool,
) -> int:  # fmt: skip
    """Estimate W and the indirect light of hits 0 to n - 1; hits that reflect nothing get none.

    Args:
        far: `settings`, with rays that do not end.
        rays, room, tests: scratch; the kernel traces as many rays together as they hold.
        neighbours: see `obscurance`.

    Returns:
        number of rays.
    """
    most = min(room_in(rays.packets), RAYS_TOGETHER)
    fit = max(most // LANES // settings.n_rays, 1) * LANES  # hits whose rays fit into the packets
    # Loop state
    waiting = NO_RAYS  # hits in the list rays.place
    total = NO_RAYS  #   hits done
    for i in range(n):
        out.light[i, ANY] = 0.0
        for channel in range(3):
            out.obscurance[i, channel] = out.constant[i, channel] = 0.0
            if settings.sky:
                out.skylight[i, channel] = 0.0
    for first in range(0, n, LANES):
        # list the hits that reflect
        wanted = reflects_in_lanes(hits, first, n)
        compress(wanted, lane_numbers() + np.int32(first), rays.place, waiting)
        waiting += popcount(wanted)
        # gather at a full list, and move what is left to its start
        if waiting >= fit:
            _gather_hits(hits, world, cells, rays, fit, settings, far, room, tests, out, neighbours)
            total, waiting = total + fit, waiting - fit
            for k in range(waiting):
                rays.place[k] = rays.place[fit + k]
        # start afresh, see `obscurance`
        if (first + LANES) % HITS_TOGETHER == 0:
            _gather_hits(hits, world, cells, rays, waiting, settings, far, room, tests, out, neighbours)
            total, waiting = total + waiting, 0
    _gather_hits(hits, world, cells, rays, waiting, settings, far, room, tests, out, neighbours)
    return (total + waiting) * settings.n_rays
