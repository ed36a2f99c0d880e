"""Rays that look around for environments: in a room, few of the directions that are drawn from a map lead outside.

Beside the one direction that a hit draws from a map, n rays with density cos(theta) / pi see what light comes in, under
every light position at once. Both kinds are weighed by the balance heuristic [Veach95]: of light L from a direction of
density p in the map, a ray of either kind carries L cos(theta) / (p + n cos(theta) / pi).
"""

import numpy as np

from framearray_cli.base.arrays import Float32

from ..embree.packets import DIRECTION, ORIGIN, TFAR, Tracer, is_blocked, occlude, room_in
from ..hits.hits import Hits, ray_origin, reflects, triple
from ..hits.rays import FROM, NO_RAYS, ORDER, RANK, REACH, TO, Rays
from ..inputs.lights import LightArrays
from ..inputs.maps import HEIGHT, MASK, SEEN_WIDTH, TINT, WIDTH
from ..inputs.random import AROUND, cosine_direction, r2, random_word
from ..kernels.kernel import index, inlined, kernel
from ..kernels.simd import LANES, floor, gather, integers, lane_numbers, load, select, store, store_row
from .environments import place_in_map
from .obscurance_rays import CELLS, cell_of, sort_rays

LOOKS = 4  # rays per hit


def looking(lights: LightArrays) -> LightArrays:
    """The same lights, for `direct` beside `look_around`; suns of a map, which are small, need no looks."""
    grid = lights.maps.grid
    wanted = (grid[:, MASK] > 0) & (grid[:, SEEN_WIDTH] > 0)
    return lights._replace(maps=lights.maps._replace(looks=np.where(wanted, LOOKS / np.pi, 0).astype(np.float32)))


@kernel
def look_around(hits: Hits, n: int, lights: LightArrays, tracer: Tracer, rays: Rays, irradiance: Float32) -> int:
    """Add to E_direct of hits 0 to n - 1 what LOOKS rays of each see of environments, under every light position.

    Args:
        lights: of `looking`.
        rays: scratch.
        irradiance: (n, channels, n_lights) changed; in units of `lights.colour`.

    Returns:
        number of rays.
    """
    row, capacity = rays.row, room_in(rays.packets)
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for i in range(n):
        if not reflects(hits, i):
            continue
        if waiting > capacity - LOOKS:
            _add_seen(lights, tracer, rays, waiting, irradiance)
            total, waiting = total + waiting, 0
        ox, oy, oz = ray_origin(hits, i)
        gx, gy, gz = triple(hits.geometric, i)
        mx, my, mz = triple(hits.shading, i)
        random = random_word(hits.key[i], AROUND)
        for k in range(LOOKS):
            u, v = r2(random, k)
            x, y, z = cosine_direction(mx, my, mz, u, v)
            cosine = x * mx + y * my + z * mz
            if cosine > np.float32(0.0) and x * gx + y * gy + z * gz > np.float32(0.0):
                at = index(waiting)
                row[FROM, at], row[FROM + 1, at], row[FROM + 2, at] = ox, oy, oz
                row[TO, at], row[TO + 1, at], row[TO + 2, at], row[REACH, at] = x, y, z, cosine
                rays.place[at] = i
                waiting += 1
    _add_seen(lights, tracer, rays, waiting, irradiance)
    return total + waiting


@inlined
def _sort_looks(rays: Rays, n: int) -> None:
    """Write the n rays in the queue into packets, sorted by direction as obscurance rays are."""
    row, room, to = rays.row, np.int32(rays.row.shape[1]), RANK * rays.number.shape[1]
    for first in range(0, n, LANES):
        x, y, z = (
            load(row, TO * room + first),
            load(row, (TO + 1) * room + first),
            load(row, (TO + 2) * room + first),
        )
        counts = lane_numbers() < np.int32(n - first)
        store(rays.number, to + first, select(counts, cell_of(x, y, z), np.int32(CELLS)))
    sort_rays(rays, (n + LANES - 1) // LANES * LANES)
    stride = ORDER * rays.number.shape[1]
    for first in range(0, n, LANES):
        ray = load(rays.number, stride + first)
        for axis in range(3):
            store_row(rays.packets, first, ORIGIN + axis, gather(row, ray + np.int32(FROM + axis) * room))
            store_row(rays.packets, first, DIRECTION + axis, gather(row, ray + np.int32(TO + axis) * room))
        store_row(rays.packets, first, TFAR, np.float32(np.inf))


@inlined
def _add_seen(lights: LightArrays, tracer: Tracer, rays: Rays, n: int, irradiance: Float32) -> None:
    """Trace the n rays in the queue, and add what those see that leave the scene."""
    channels, n_lights, row, maps = irradiance.shape[1], irradiance.shape[2], rays.row, lights.maps
    _sort_looks(rays, n)
    occlude(tracer, rays.packets, n, True)
    for ray in range(n):
        if is_blocked(rays.packets, ray):
            continue
        at = index(rays.number[ORDER, index(ray)])
        i = rays.place[at]
        d, cosine = (row[TO, at], row[TO + 1, at], row[TO + 2, at]), row[REACH, at]
        for s in range(lights.kind.shape[0]):
            if maps.looks[s] == np.float32(0.0):
                continue
            width, rows = maps.grid[s, WIDTH], maps.grid[s, HEIGHT]
            for l in range(0, n_lights, LANES):
                # the texels that the ray sees at light positions l to l + 15
                of = 3 * s * n_lights + l
                to = (
                    -load(lights.vector, of),
                    -load(lights.vector, of + n_lights),
                    -load(lights.vector, of + 2 * n_lights),
                )
                u, v = place_in_map(maps, to, d, width, rows)
                column, line = integers(floor(u + np.float32(0.5))), integers(floor(v + np.float32(0.5)))
                column = select(column >= np.int32(width), column - np.int32(width), column)
                column = select(column < np.int32(0), np.int32(0), column)
                line = select(line >= np.int32(rows), np.int32(rows - 1), line)
                line = select(line < np.int32(0), np.int32(0), line)
                texel = line * np.int32(width) + column + np.int32(maps.grid[s, TINT])
                density = gather(maps.density, texel)
                weight = cosine * density / (density + maps.looks[s] * cosine)
                for channel in range(channels):
                    strength = load(lights.strength, (s * channels + channel) * n_lights + l)
                    tint = gather(maps.tint, texel * np.int32(3) + np.int32(channel))
                    store(rays.value, 0, strength * tint * weight)
                    for k in range(min(LANES, n_lights - l)):
                        irradiance[i, channel, l + k] += rays.value[0, index(k)]
