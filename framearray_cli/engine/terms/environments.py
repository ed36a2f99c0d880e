"""Environments: the radiance that escaped rays see, and rays that gather environment light.

A ray that left the scene is a hit that reflects all light, and its irradiance under l is pi times the radiance that it
sees. So it is stored and composed as surfaces are.

In a room, few of the directions that are drawn from a map lead outside. So next to the one direction that a hit draws
from a map, n rays with density cos(theta) / pi find the light that comes in, under every light position at once. Both
kinds are weighed by the balance heuristic [Veach95]: of light L from a direction of density p in the map, a ray of
either kind carries L cos(theta) / (p + n cos(theta) / pi).
"""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Triple

from ..embree.packets import DIRECTION, ORIGIN, TFAR, Tracer, is_blocked, occlude, room_in
from ..hits.hits import ESCAPED, Hits, ray_origin, reflects, triple
from ..hits.rays import FROM, NO_RAYS, ORDER, RANK, REACH, TO, Rays
from ..inputs.lights import LightArrays
from ..inputs.maps import HEIGHT, MASK, SEEN, SEEN_HEIGHT, SEEN_WIDTH, TINT, WIDTH, Maps, map_row
from ..inputs.profiles import angle_of
from ..inputs.random import AROUND, cosine_direction, r2, random_word
from ..kernels.kernel import index, inlined, kernel
from ..kernels.simd import LANES, floor, gather, integers, lane_numbers, load, select, sqrt, store, store_row
from .obscurance import BINS, bin_of, sort_rays

PI = np.float32(np.pi)
GATHER_RAYS = 4  # rays per hit


def has_environments(lights: LightArrays) -> bool:
    """Return True if any source is an environment."""
    return len(lights.maps.tint) > 0


@kernel
def see_environments(hits: Hits, n: int, lights: LightArrays, rays: Rays, irradiance: Float32) -> None:
    """Add the radiance of environments that rays 0 to n - 1 see if they left the scene.

    Args:
        hits: the reflectivity of rays that left is overwritten: 1.
        rays: scratch.
        irradiance: (n, channels, n_lights) changed; in units of `lights.colour`.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        if hits.kind[i] != ESCAPED:
            continue
        d = triple(hits.position, i)
        for channel in range(3):
            hits.reflectivity[i, channel] = 1.0
        for s in range(lights.kind.shape[0]):
            if lights.maps.grid[s, SEEN_WIDTH] == 0:
                continue
            for l in range(0, n_lights, LANES):
                width, rows = lights.maps.grid[s, SEEN_WIDTH], lights.maps.grid[s, SEEN_HEIGHT]
                u, v = place_in_map(lights, s, l, d, width, rows)
                first = np.int32(lights.maps.grid[s, SEEN]) + map_row(lights.maps, s, lane_numbers() + np.int32(l))
                for channel in range(channels):
                    strength = load(lights.strength, (s * channels + channel) * n_lights + l)
                    store(rays.value, 0, PI * strength * _blended(lights.maps, s, first, u, v, channel))
                    for k in range(min(LANES, n_lights - l)):
                        irradiance[i, channel, l + k] += rays.value[0, index(k)]


@inlined
def place_in_map(lights: LightArrays, s: int, l: int, d: Triple, width: int, rows: int) -> tuple[Real, Real]:
    """Column and row, counted from the middles of the first, that a direction d sees of a map of that size.

    Source s has the map; light positions are l to l + 15.
    """
    up, n_lights = (lights.maps.up[0], lights.maps.up[1], lights.maps.up[2]), lights.vector.shape[2]
    at = 3 * s * n_lights + l  # of the direction away from the middle of the map
    x, y = -load(lights.vector, at), -load(lights.vector, at + n_lights)
    z = -load(lights.vector, at + 2 * n_lights)
    north = d[0] * x + d[1] * y + d[2] * z
    east = d[0] * (y * up[2] - z * up[1]) + d[1] * (z * up[0] - x * up[2]) + d[2] * (x * up[1] - y * up[0])
    height = d[0] * up[0] + d[1] * up[1] + d[2] * up[2]
    elevation = angle_of(height, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - height * height))
    half = np.float32(0.5)
    u = (angle_of(east, north) / (PI + PI) + half) * np.float32(width) - half
    return u, (half - elevation / PI) * np.float32(rows) - half


@inlined
def _blended(maps: Maps, s: int, first: Any, u: Real, v: Real, channel: int) -> Real:
    """The radiance between four texels, over the luminance of the whole map, integrated over all directions.

    Args:
        first: pixel with which the map of each light position begins.
    """
    one, none = np.float32(1.0), np.int32(0)
    width, last = np.int32(maps.grid[s, SEEN_WIDTH]), np.int32(maps.grid[s, SEEN_HEIGHT]) - np.int32(1)
    f, g = u - floor(u), v - floor(v)
    left, top = integers(floor(u)), integers(floor(v))  # -1 to the last
    right, bottom = left + np.int32(1), top + np.int32(1)
    left, right = select(left < none, left + width, left), select(right >= width, right - width, right)
    top = select(top < none, none, top)
    bottom = select(bottom > last, last, bottom)
    upper, lower = first + top * width, first + bottom * width
    three, rgb = np.int32(3), np.int32(channel)
    a, b = gather(maps.seen, (upper + left) * three + rgb), gather(maps.seen, (upper + right) * three + rgb)
    c, d = gather(maps.seen, (lower + left) * three + rgb), gather(maps.seen, (lower + right) * three + rgb)
    above, below = a * (one - f) + b * f, c * (one - f) + d * f
    return (above * (one - g) + below * g) * maps.inverse[s]


def with_gathering(lights: LightArrays) -> LightArrays:
    """Lights for `direct` next to `gather_environments`; suns of a map, which are small, need no gather rays."""
    grid = lights.maps.grid
    wanted = (grid[:, MASK] > 0) & (grid[:, SEEN_WIDTH] > 0)
    return lights._replace(
        maps=lights.maps._replace(gathering=np.where(wanted, GATHER_RAYS / np.pi, 0).astype(np.float32))
    )


@kernel
def gather_environments(
    hits: Hits, n: int, lights: LightArrays, tracer: Tracer, rays: Rays, irradiance: Float32
) -> int:
    """Add the environment light that GATHER_RAYS rays of each of hits 0 to n - 1 meet, under every light position.

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
        if waiting > capacity - GATHER_RAYS:
            _add_seen(lights, tracer, rays, waiting, irradiance)
            total, waiting = total + waiting, 0
        ox, oy, oz = ray_origin(hits, i)
        gx, gy, gz = triple(hits.geometric, i)
        mx, my, mz = triple(hits.shading, i)
        random = random_word(hits.key[i], AROUND)
        for k in range(GATHER_RAYS):
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
def _sort_gather_rays(rays: Rays, n: int) -> None:
    """Write the n rays in the queue into packets, sorted by direction as obscurance rays are."""
    row, room, to = rays.row, np.int32(rays.row.shape[1]), RANK * rays.number.shape[1]
    for first in range(0, n, LANES):
        x, y, z = (
            load(row, TO * room + first),
            load(row, (TO + 1) * room + first),
            load(row, (TO + 2) * room + first),
        )
        counts = lane_numbers() < np.int32(n - first)
        store(rays.number, to + first, select(counts, bin_of(x, y, z), np.int32(BINS)))
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
    """Trace the n rays in the queue, and add the environment light of rays that leave the scene."""
    channels, n_lights, row, maps = irradiance.shape[1], irradiance.shape[2], rays.row, lights.maps
    _sort_gather_rays(rays, n)
    occlude(tracer, rays.packets, n, True)
    for ray in range(n):
        if is_blocked(rays.packets, ray):
            continue
        at = index(rays.number[ORDER, index(ray)])
        i = rays.place[at]
        d, cosine = (row[TO, at], row[TO + 1, at], row[TO + 2, at]), row[REACH, at]
        for s in range(lights.kind.shape[0]):
            if maps.gathering[s] == np.float32(0.0):
                continue
            width, rows = maps.grid[s, WIDTH], maps.grid[s, HEIGHT]
            for l in range(0, n_lights, LANES):
                # the texels that the ray sees at light positions l to l + 15
                u, v = place_in_map(lights, s, l, d, width, rows)
                column, line = integers(floor(u + np.float32(0.5))), integers(floor(v + np.float32(0.5)))
                column = select(column >= np.int32(width), column - np.int32(width), column)
                column = select(column < np.int32(0), np.int32(0), column)
                line = select(line >= np.int32(rows), np.int32(rows - 1), line)
                line = select(line < np.int32(0), np.int32(0), line)
                texel = line * np.int32(width) + column + np.int32(maps.grid[s, TINT])
                density = gather(maps.density, texel)
                weight = cosine * density / (density + maps.gathering[s] * cosine)
                row_of = map_row(maps, s, lane_numbers() + np.int32(l))
                for channel in range(channels):
                    strength = load(lights.strength, (s * channels + channel) * n_lights + l)
                    tint = gather(maps.tint, (texel + row_of) * np.int32(3) + np.int32(channel))
                    store(rays.value, 0, strength * tint * weight)
                    for k in range(min(LANES, n_lights - l)):
                        irradiance[i, channel, l + k] += rays.value[0, index(k)]
