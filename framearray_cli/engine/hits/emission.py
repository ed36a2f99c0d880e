"""Light that hits send out themselves: surfaces that shine, seen by eyes and in mirrors."""

import numpy as np

from framearray_cli.base.arrays import Float32

from ..embree.packets import DIRECTION, MISS, Tracer, U, V, hit_triangle
from ..inputs.emitters import Emitters
from ..inputs.surfaces import emission_at
from ..kernels.kernel import kernel
from ..kernels.simd import width_of_packets

# Columns of what a hit sends out: the source that it belongs to, -1 without, and its texture, RGB.
SOURCE, TEXTURE = 0, 1
EMISSION_COLUMNS = 4


@kernel
def record_emission(emitters: Emitters, tracer: Tracer, packets: Float32, n: int, emission: Float32) -> None:
    """Find what traced rays 0 to n - 1 meet that shines on the side that they come from.

    Args:
        emission: (>= n, EMISSION_COLUMNS) overwritten; the texture is 0 where nothing shines.
    """
    surfaces, width = emitters.surfaces, width_of_packets()
    for i in range(n):
        emission[i, SOURCE] = -1.0
        emission[i, TEXTURE] = emission[i, TEXTURE + 1] = emission[i, TEXTURE + 2] = 0.0
        triangle = hit_triangle(tracer, packets, i)
        if triangle == MISS:
            continue
        material = surfaces.material[triangle]
        s = emitters.source[material]
        if s < 0:
            continue
        p, lane = i // width, i % width
        if emitters.back[s] > 0.0:
            # the front is where corners run counter-clockwise
            a, b, c = surfaces.corners[triangle, 0], surfaces.corners[triangle, 1], surfaces.corners[triangle, 2]
            x, y, z = np.float64(b[0]) - a[0], np.float64(b[1]) - a[1], np.float64(b[2]) - a[2]
            u, v, w = np.float64(c[0]) - a[0], np.float64(c[1]) - a[1], np.float64(c[2]) - a[2]
            towards = (y * w - z * v) * packets[p, DIRECTION, lane]
            towards += (z * u - x * w) * packets[p, DIRECTION + 1, lane]
            towards += (x * v - y * u) * packets[p, DIRECTION + 2, lane]
            if towards > 0.0:
                continue
        texture, at = emitters.texture[material], (packets[p, U, lane], packets[p, V, lane])
        red, green, blue = emission_at(surfaces, texture, triangle, at[0], at[1])
        emission[i, SOURCE] = s
        emission[i, TEXTURE] = red
        emission[i, TEXTURE + 1] = green
        emission[i, TEXTURE + 2] = blue
