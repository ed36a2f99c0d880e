"""What eyes and mirrors see of environments: the radiance of their maps, turned under every light position.

A ray that left the scene is a hit that reflects all light, and its irradiance under l is pi times the radiance that it
sees. So it is stored and composed as surfaces are.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Real, Triple

from ..hits.hits import ESCAPED, Hits, triple
from ..hits.rays import Rays
from ..inputs.lights import LightArrays
from ..inputs.maps import SEEN, SEEN_HEIGHT, SEEN_WIDTH, Maps
from ..inputs.profiles import angle_of
from ..kernels.kernel import index, inlined, kernel
from ..kernels.simd import LANES, floor, gather, integers, load, select, sqrt, store

PI = np.float32(np.pi)


def has_environments(lights: LightArrays) -> bool:
    """Whether any source is an environment."""
    return lights.maps.tint.ndim > 1


@kernel
def see_environments(hits: Hits, n: int, lights: LightArrays, rays: Rays, irradiance: Float32) -> None:
    """Add what rays 0 to n - 1 that left the scene see.

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
                at = 3 * s * n_lights + l
                to = (
                    -load(lights.vector, at),
                    -load(lights.vector, at + n_lights),
                    -load(lights.vector, at + 2 * n_lights),
                )
                u, v = place_in_map(
                    lights.maps, to, d, lights.maps.grid[s, SEEN_WIDTH], lights.maps.grid[s, SEEN_HEIGHT]
                )
                for channel in range(channels):
                    strength = load(lights.strength, (s * channels + channel) * n_lights + l)
                    store(rays.value, 0, PI * strength * _blended(lights.maps, s, u, v, channel))
                    for k in range(min(LANES, n_lights - l)):
                        irradiance[i, channel, l + k] += rays.value[0, index(k)]


@inlined
def place_in_map(maps: Maps, to: Triple, d: Triple, width: int, rows: int) -> tuple[Real, Real]:
    """Column and row, counted from the middles of the first, that a direction d sees of a map of that size.

    Args:
        to: directions to the middle of the map.
    """
    up = (maps.up[0], maps.up[1], maps.up[2])
    x, y, z = to
    north = d[0] * x + d[1] * y + d[2] * z
    east = d[0] * (y * up[2] - z * up[1]) + d[1] * (z * up[0] - x * up[2]) + d[2] * (x * up[1] - y * up[0])
    height = d[0] * up[0] + d[1] * up[1] + d[2] * up[2]
    elevation = angle_of(height, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - height * height))
    half = np.float32(0.5)
    u = (angle_of(east, north) / (PI + PI) + half) * np.float32(width) - half
    return u, (half - elevation / PI) * np.float32(rows) - half


@inlined
def _blended(maps: Maps, s: int, u: Real, v: Real, channel: int) -> Real:
    """The radiance between four texels, over the luminance of the whole map, integrated over all directions."""
    one, none = np.float32(1.0), np.int32(0)
    width, last = np.int32(maps.grid[s, SEEN_WIDTH]), np.int32(maps.grid[s, SEEN_HEIGHT]) - np.int32(1)
    f, g = u - floor(u), v - floor(v)
    left, top = integers(floor(u)), integers(floor(v))  # -1 to the last
    right, bottom = left + np.int32(1), top + np.int32(1)
    left, right = select(left < none, left + width, left), select(right >= width, right - width, right)
    top = select(top < none, none, top)
    bottom = select(bottom > last, last, bottom)
    first = np.int32(maps.grid[s, SEEN])
    upper, lower = first + top * width, first + bottom * width
    three, rgb = np.int32(3), np.int32(channel)
    a, b = gather(maps.seen, (upper + left) * three + rgb), gather(maps.seen, (upper + right) * three + rgb)
    c, d = gather(maps.seen, (lower + left) * three + rgb), gather(maps.seen, (lower + right) * three + rgb)
    above, below = a * (one - f) + b * f, c * (one - f) + d * f
    found: Real = (above * (one - g) + below * g) * maps.inverse[s]
    return found
