"""Indirect light by gather rays that read cells.

    E_indirect(P)[l] = mean over rays of R(Q) E(cell of Q)[l]        Q: the first surface that a ray meets

The rays are obscurance rays that run to the first surface, so one set of rays gives W and the indirect light of every
l. Where a ray is shorter than the finest cells are wide, the light at its end Q_1 is found without a cell: direct light
by shadow rays, and other light by gather rays that go on until one is long enough.

    E(Q_1)[l] = E_direct(Q_1)[l] + R(Q_2) E_direct(Q_2)[l] + ... + R(Q_2) ... R(Q_n) E(cell of Q_n)[l]

Notation of the kernels: rays from a hit P meet Q; E_indirect[l] = c colour[l] g[l], with the colour c of a hit.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ...embree.packets import intersect, room_in
from ...hits.hits import Hits, World, record_hits, reflects_in_lanes
from ...hits.rays import NO_RAYS, RANK, Rays
from ...inputs.lights import LightArrays
from ...inputs.random import lattice_steps
from ...kernels.bundle import bundle
from ...kernels.kernel import inlined, kernel, prefetch
from ...kernels.simd import LANES, compress, lane_numbers, load, popcount, reals, store
from ..direct import direct
from ..obscurance import (
    HITS_TOGETHER,
    RAYS_TOGETHER,
    ObscuranceSettings,
    add_to_hits,
    apply_textures,
    evaluate_rays,
    write_obscurance_rays,
)
from .ends import GatherScratch, NearHits, RayEnds, RaySpan, dim_gather_rays, find_ends, near_cell, weight_of
from .lookup import CONSTANT, MEAN, NOWHERE, TINT, Cells

# Rays that follow one that was too short, at most; the last reads a cell whatever its length.
MOST_STEPS = 4
# Mean over light positions of a cell without light, whose surfaces may still receive light: above 0, so that the light
# of the path counts, and below all else, so that it colours no other light.
_DIMMEST = np.float32(1e-20)
# Columns of a hit's row of indirect light: its colour c, the mean of g over all light positions of the job, and g.
COLOUR, LEVEL, LIGHT = 0, 3, 4
# Rays shorter than this many edges of the finest cells read no cell.
NEAR = 1.0
# Cells are prefetched this many hits before they are read.
AHEAD = 2
# Shorter ones count as this long for the mean of 1 / length.
SHORTEST = 0.1


@inlined
def light_near(
    world: World, lights: LightArrays, cells: Cells, n: int, once: ObscuranceSettings, reach: float, room: GatherScratch
) -> int:
    """Find the light of kept rays 0 to n - 1.

    Args:
        once: settings of one ray per hit that does not end.
        reach: rays shorter than this are too short.
        room: of the rays; R(Q) is read from its ends.

    Returns:
        number of rays traced.
    """
    if n == 0:
        return 0
    tracer, near = world.sight.tracer, room.near
    record_hits(world, near.rays.packets, n, False, near.hits)
    for k in range(n):
        near.root[k], near.start[k], near.own[k] = k, near.place[k], near.cell[k]
        for channel in range(3):
            near.throughput[channel, k] = room.ends.reflectivity[channel, near.place[k]]
        for channel in range(near.light.shape[1]):
            for l in range(near.light.shape[2]):
                near.light[k, channel, l] = 0.0
    total = NO_RAYS
    here, there = near, room.next
    left = n  # rays that were too short
    for step in range(MOST_STEPS):
        # direct light of the points, and one more ray from each
        total += direct(here.hits, left, lights, world.sight, room.tests, here.irradiance, False)
        for k in range(left):
            here.rays.place[k] = k
            _add_direct(cells, here, k, near)
        write_obscurance_rays(here.hits, here.rays, left, 0, 1, once, False)
        intersect(tracer, here.rays.packets, left, False, 0.0)
        total += left
        shortest = reach if step + 1 < MOST_STEPS else 0.0
        span = RaySpan(left, 0, 1)
        kept, reflected = find_ends(
            here.hits, world, cells, here.rays, span, here.ends, room.tests, there, shortest, room.mirrors
        )
        total += reflected
        for k in range(left):
            _go_on(here, k, near, there)
        if kept == 0:
            break
        record_hits(world, there.rays.packets, kept, False, there.hits)
        here, there, left = there, here, kept
    for k in range(n):
        _add_end(cells, k, room.ends, near)
    return total


@inlined
def _go_on(here: NearHits, k: int, near: NearHits, there: NearHits) -> None:
    """Note the end of the ray from point k, for the kept ray that the point belongs to."""
    root, ray = here.root[k], here.rays.number[RANK, k]
    cell = here.ends.cell[ray]
    if cell < NOWHERE:
        there.root[near_cell(cell)] = root
    else:
        near.end[root] = cell
    for channel in range(3):
        near.throughput[channel, root] *= here.ends.reflectivity[channel, ray]


@inlined
def _add_direct(cells: Cells, here: NearHits, k: int, near: NearHits) -> None:
    """Add the direct light at point k to the light of the kept ray that the point belongs to."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    root = here.root[k]
    for channel in range(channels):
        weight = near.throughput[channel, root]
        if channels == 1:
            weight = np.float32(0.0)
            for other in range(3):
                weight += cells.weights[other] * near.throughput[other, root]
        for l in range(0, n_lights, LANES):
            to = (root * channels + channel) * near.light.shape[2] + l
            found = load(here.irradiance, (k * channels + channel) * n_lights + l) * weight
            store(near.light, to, load(near.light, to) + found)


@inlined
def _add_end(cells: Cells, k: int, room: RayEnds, near: NearHits) -> None:
    """Add the light of the cell at the end of the path of kept ray k."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    own, cell = near.own[k], near.end[k]
    missed = cell == NOWHERE
    cell = 0 if missed else cell
    # 1. What has no l.
    for channel in range(3):
        r = room.reflectivity[channel, near.start[k]]
        dark = cells.tint[own, MEAN] <= 0.0
        near.hue[k, channel] = r * (_DIMMEST if dark else cells.tint[own, TINT + channel] * cells.tint[own, MEAN])
        arrives = cells.background[channel] if missed else cells.tint[cell, CONSTANT + channel]
        near.constant[k, channel] = near.throughput[channel, k] * arrives
    # 2. Light by sources, or its mean over channels, sixteen light positions at a time.
    if missed:
        return
    for channel in range(channels):
        weight = weight_of(cells, near.throughput, cell, k, channel)
        for l in range(0, n_lights, LANES):
            to = (k * channels + channel) * near.light.shape[2] + l
            found = load(cells.light, (cell * channels + channel) * n_lights + l) * weight
            store(near.light, to, load(near.light, to) + found)


@bundle
class GatherSettings(NamedTuple):
    """Settings of rays: of W, with rays that do not end, and with one such ray per hit."""

    obscurance: ObscuranceSettings
    far: ObscuranceSettings
    once: ObscuranceSettings


@bundle
class Gathered(NamedTuple):
    """Estimates by gather rays at n hits; all overwritten.

    Attributes:
        obscurance, skylight: W and S, see `obscurance`.
        light: (n, LIGHT + channels n_lights) c, the mean of g, and g[l]; no more than a mean of 0 if there is no light.
        constant: (n, 3) radiance that arrives, the same under every l: mean over cosine-distributed rays.
        closeness: (n,) mean of 1 / length of the rays.
    """

    obscurance: Rgb
    skylight: Rgb
    light: Float32
    constant: Rgb
    closeness: Float32


@inlined
def _prefetch_cells(cells: Cells, rays: Rays, k: int, n_rays: int, room: RayEnds) -> None:
    """Prefetch the cells that the rays of listed hit k read."""
    rank, bytes_of_light = rays.number[RANK], 4 * cells.light.shape[1] * cells.light.shape[2]
    at = k // LANES * LANES * n_rays + k % LANES
    for ray in range(n_rays):
        cell = max(room.cell[rank[at + ray * LANES]], 0)
        prefetch(cells.tint.ctypes.data + 4 * cells.tint.shape[1] * cell, 1)
        prefetch(cells.light.ctypes.data + bytes_of_light * cell, bytes_of_light)


@inlined
def _sum_cells(
    cells: Cells, rays: Rays, n: int, first_ray: int, n_rays: int, all_rays: int, room: RayEnds,
    near: NearHits, out: Gathered,
) -> None:  # fmt: skip
    """Sum the light that rays of the n listed hits read, in the order of rays; the last rays complete the means."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    indirect, constant = out.light, out.constant
    last, share = first_ray + n_rays == all_rays, np.float32(1.0 / all_rays)
    nothing, shortest = np.float32(0.0), np.float32(SHORTEST * cells.grid.edge)
    for k in range(n):
        if k + AHEAD < n:
            _prefetch_cells(cells, rays, k + AHEAD, n_rays, room)
        hit, rank = rays.place[k], rays.number[RANK]
        at = k // LANES * LANES * n_rays + k % LANES
        close = out.closeness[hit] if first_ray > 0 else nothing
        for ray in range(n_rays):
            close += share / max(rays.value[0, rank[at + ray * LANES]], shortest)
        out.closeness[hit] = close
        # 1. What has no l: the colour of the light, and the light that is the same at every position.
        for channel in range(3):
            hue = indirect[hit, COLOUR + channel] if first_ray > 0 else nothing
            same = constant[hit, channel] if first_ray > 0 else nothing
            for ray in range(n_rays):
                place = rank[at + ray * LANES]
                cell = room.cell[place]
                if cell == NOWHERE:
                    same += share * room.reflectivity[channel, place] * cells.background[channel]
                    continue
                if cell < NOWHERE:
                    hue += share * near.hue[near_cell(cell), channel]
                    same += share * near.constant[near_cell(cell), channel]
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
                    if cell > NOWHERE:
                        weight = share * weight_of(cells, room.reflectivity, cell, place, channel)
                        total = total + load(cells.light, (cell * channels + channel) * n_lights + l) * weight
                    elif cell < NOWHERE:
                        kept = (near_cell(cell) * channels + channel) * near.light.shape[2]
                        total = total + load(near.light, kept + l) * share
                compress(lane_numbers() < np.int32(n_lights - l), total, indirect, to)
        # 3. The colour c, whose mean is 1.
        if last:
            mean = nothing
            for channel in range(3):
                mean += cells.weights[channel] * indirect[hit, COLOUR + channel]
            indirect[hit, LEVEL] = mean
            for channel in range(3):
                hue = indirect[hit, COLOUR + channel] / mean if mean > nothing else nothing
                indirect[hit, COLOUR + channel] = hue if channels == 1 else np.float32(1.0)


@inlined
def _gather_hits(
    hits: Hits, world: World, lights: LightArrays, cells: Cells, n: int, settings: GatherSettings, room: GatherScratch,
    out: Gathered, neighbours: bool,
) -> int:  # fmt: skip
    """Gather at the n hits listed in `room.rays.place`, tracing as many rays of each together as fit.

    Returns:
        number of rays.
    """
    of_w, rays = settings.obscurance, room.rays
    total = NO_RAYS
    surfaces, tracer = world.surfaces, world.sight.tracer
    most = min(room_in(rays.packets), RAYS_TOGETHER) // LANES
    for first_ray in range(0, of_w.n_rays, most):
        # rays first_ray to first_ray + n_rays - 1 of every hit
        n_rays = min(of_w.n_rays - first_ray, most)
        n_traced = write_obscurance_rays(hits, rays, n, first_ray, n_rays, settings.far, neighbours)
        intersect(tracer, rays.packets, n_traced, False, 0.0)
        reach, span = cells.grid.edge * NEAR, RaySpan(n_traced, first_ray, n_rays)
        kept, reflected = find_ends(
            hits, world, cells, rays, span, room.ends, room.tests, room.near, reach, room.mirrors
        )
        total += n_traced + reflected
        total += dim_gather_rays(world.sight.panes, rays, n_traced, room.tests, room.ends.reflectivity)
        total += light_near(world, lights, cells, kept, settings.once, reach, room)
        _sum_cells(cells, rays, n, first_ray, n_rays, of_w.n_rays, room.ends, room.near, out)
        # W, which has its own R(Q), rho and range
        varied = evaluate_rays(surfaces, tracer, rays, n_traced, of_w)
        apply_textures(surfaces, tracer, rays, varied)
        add_to_hits(rays, n, first_ray, n_rays, of_w, out.obscurance, out.skylight)
    return total


@kernel
def gather_cells(
    hits: Hits, n: int, settings: GatherSettings, world: World, lights: LightArrays, cells: Cells, room: GatherScratch,
    out: Gathered, neighbours: bool,
) -> int:  # fmt: skip
    """Estimate W and the indirect light of hits 0 to n - 1; hits that reflect nothing get none.

    Args:
        lights: of the direct light at the ends of short rays.
        room: scratch; the kernel traces as many rays together as it holds.
        neighbours: see `obscurance`.

    Returns:
        number of rays.
    """
    rays = room.rays
    most = min(room_in(rays.packets), RAYS_TOGETHER)
    fit = max(most // LANES // settings.obscurance.n_rays, 1) * LANES  # hits whose rays fit into the packets
    # Loop state
    waiting = NO_RAYS  # hits in the list rays.place
    total = NO_RAYS  #   rays traced
    for i in range(n):
        out.light[i, LEVEL] = 0.0
        for channel in range(3):
            out.obscurance[i, channel] = out.constant[i, channel] = 0.0
            if settings.obscurance.sky:
                out.skylight[i, channel] = 0.0
    for first in range(0, n, LANES):
        # list the hits that reflect
        wanted = reflects_in_lanes(hits, first, n)
        compress(wanted, lane_numbers() + np.int32(first), rays.place, waiting)
        waiting += popcount(wanted)
        # gather at a full list; at the end of hits that belong together, see `obscurance`, at all that are left
        ends = (first + LANES) % HITS_TOGETHER == 0 or first + LANES >= n
        while waiting >= fit or (ends and waiting > 0):
            some = min(waiting, fit)
            total += _gather_hits(hits, world, lights, cells, some, settings, room, out, neighbours)
            waiting -= some
            for k in range(waiting):
                rays.place[k] = rays.place[some + k]
    return total


def gather_settings(obscurance: ObscuranceSettings) -> GatherSettings:
    """The settings of gather rays."""
    far, (step_x, step_y) = obscurance._replace(sky=True), lattice_steps(1)
    return GatherSettings(obscurance, far, far._replace(n_rays=1, step_x=step_x, step_y=step_y))
