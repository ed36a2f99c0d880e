"""Indirect light by gather rays that read cells.

    E_indirect(P)[l] = mean over rays of R(Q) E(cell of Q)[l]        Q: the first surface that a ray meets

The rays are those of obscurance, but run to the first surface, so that one set of rays gives W and the indirect light
of every l.

Notation of the kernels: rays from a hit P meet Q; E_indirect[l] = c colour[l] g[l], with the colour c of a hit.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ...embree.packets import intersect, room_in
from ...hits.hits import Hits, World, reflects_in_lanes
from ...hits.rays import NO_RAYS, RANK, Rays
from ...inputs.lights import LightArrays
from ...inputs.random import lattice_steps
from ...kernels.kernel import inlined, kernel, prefetch
from ...kernels.simd import LANES, compress, lane_numbers, load, popcount, reals
from ..obscurance import HITS_TOGETHER, RAYS_TOGETHER, add_to_hits, apply_textures, evaluate_rays
from ..obscurance_rays import ObscuranceSettings, write_obscurance_rays
from .glass import dim_gather_rays
from .lookups import GatherScratch, NearHits, near_cell, weight_of
from .mirrored import MirrorScratch, find_ends
from .near import light_near
from .table import CONSTANT, MEAN, NOWHERE, TINT, Cells

# Columns of a hit's row of indirect light before those of g: its colour c, and the mean of g over all light positions
# of the job.
COLOUR, LEVEL, LIGHT = 0, 3, 4


# Rays shorter than this many edges of the finest cells read no cell.
NEAR = 1.0
# What a hit reads is prefetched this many hits before.
AHEAD = 2
# Shorter ones count as this long for the mean of 1 / length.
SHORTEST = 0.1


class GatherSettings(NamedTuple):
    """Settings of rays: those of W, the same with rays that do not end, and with one such ray per hit."""

    obscurance: ObscuranceSettings
    far: ObscuranceSettings
    once: ObscuranceSettings


class Gathered(NamedTuple):
    """What gather rays estimate at n hits; all overwritten.

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
def _prefetch_cells(cells: Cells, rays: Rays, k: int, n_rays: int, room: GatherScratch) -> None:
    """Prefetch what the rays of listed hit k read."""
    rank, bytes_of_light = rays.number[RANK], 4 * cells.light.shape[1] * cells.light.shape[2]
    at = k // LANES * LANES * n_rays + k % LANES
    for ray in range(n_rays):
        cell = max(room.cell[rank[at + ray * LANES]], 0)
        prefetch(cells.tint.ctypes.data + 4 * cells.tint.shape[1] * cell, 1)
        prefetch(cells.light.ctypes.data + bytes_of_light * cell, bytes_of_light)


@inlined
def _sum_cells(
    cells: Cells, rays: Rays, n: int, first_ray: int, n_rays: int, all_rays: int, room: GatherScratch,
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
    hits: Hits, world: World, lights: LightArrays, cells: Cells, rays: Rays, n: int, settings: GatherSettings,
    room: GatherScratch, tests: Rays, near: tuple[NearHits, NearHits], mirrors: MirrorScratch, out: Gathered,
    neighbours: bool,
) -> int:  # fmt: skip
    """Gather at the n hits listed in `rays.place`, tracing as many rays of each together as fit.

    Returns:
        number of rays.
    """
    of_w = settings.obscurance
    total = NO_RAYS
    surfaces, tracer = world.surfaces, world.tracer
    most = min(room_in(rays.packets), RAYS_TOGETHER) // LANES
    for first_ray in range(0, of_w.n_rays, most):
        # rays first_ray to first_ray + n_rays - 1 of every hit
        n_rays = min(of_w.n_rays - first_ray, most)
        n_traced = write_obscurance_rays(hits, rays, n, first_ray, n_rays, settings.far, neighbours)
        intersect(tracer, rays.packets, n_traced, False)
        reach = cells.grid.edge * NEAR
        kept, reflected = find_ends(
            hits, world, cells, rays, n_traced, first_ray, n_rays, room, tests, near[0], reach, mirrors
        )  # fmt: skip
        total += n_traced + reflected
        total += dim_gather_rays(world.panes, rays, n_traced, tests, room.reflectivity)
        total += light_near(world, lights, cells, kept, settings.once, reach, room, tests, near[0], near[1], mirrors)
        _sum_cells(cells, rays, n, first_ray, n_rays, of_w.n_rays, room, near[0], out)
        # W, which has its own R(Q), rho and range
        varied = evaluate_rays(surfaces, tracer, rays, n_traced, of_w)
        apply_textures(surfaces, tracer, rays, varied)
        add_to_hits(rays, n, first_ray, n_rays, of_w, out.obscurance, out.skylight)
    return total


@kernel
def gather_cells(
    hits: Hits, n: int, settings: GatherSettings, world: World, lights: LightArrays, cells: Cells, rays: Rays,
    room: GatherScratch, tests: Rays, near: tuple[NearHits, NearHits], mirrors: MirrorScratch, out: Gathered,
    neighbours: bool,
) -> int:  # fmt: skip
    """Estimate W and the indirect light of hits 0 to n - 1; hits that reflect nothing get none.

    Args:
        lights: whose direct light is computed at hits.
        rays, room, tests, near, mirrors: scratch; the kernel traces as many rays together as they hold.
        neighbours: see `obscurance`.

    Returns:
        number of rays.
    """
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
            total += _gather_hits(
                hits, world, lights, cells, rays, some, settings, room, tests, near, mirrors, out, neighbours
            )  # fmt: skip
            waiting -= some
            for k in range(waiting):
                rays.place[k] = rays.place[some + k]
    return total


def gather_settings(obscurance: ObscuranceSettings) -> GatherSettings:
    """The settings of gather rays."""
    far, (step_x, step_y) = obscurance._replace(sky=True), lattice_steps(1)
    return GatherSettings(obscurance, far, far._replace(n_rays=1, step_x=step_x, step_y=step_y))
