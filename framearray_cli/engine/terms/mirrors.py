"""Mirrors: what native hits see by reflection, followed to a depth; never reused.

A reflected hit is a hit like any other, seen through a tint: it gets direct light of all light positions and its
obscurance. So what a mirror pixel needs is a list of reflected hits, each with throughput times reflectivity.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..embree.packets import intersect, set_ray
from ..hits.hits import SURFACE, Hits, World, record_hits
from ..inputs.random import mix
from ..kernels.kernel import inlined, kernel


@inlined
def _is_mirror(hits: Hits, i: int) -> bool:
    s = hits.specular
    return bool(hits.kind[i] == SURFACE and (s[i, 0] > 0.0 or s[i, 1] > 0.0 or s[i, 2] > 0.0))


@kernel
def count_mirrors(hits: Hits, n: int) -> int:
    """Number of hits 0 to n - 1 that reflect specularly."""
    total = 0
    for i in range(n):
        total += _is_mirror(hits, i)
    return total


@kernel
def reflect(
    hits: Hits, n: int, throughput: Rgb, world: World, packets: Float32, reflected: Hits, reflected_throughput: Rgb
) -> int:
    """Follow hits 0 to n - 1 one mirror bounce; those that are no mirror end here.

    Args:
        throughput: (n, 3) what the path so far lets through.
        reflected: overwritten with the hits (or escapes) behind the mirrors, in order; random streams move on.
        reflected_throughput: (n, 3) overwritten: throughput times the mirror's reflectivity.

    Returns:
        number of reflected hits, which is that of rays.
    """
    m = 0
    for i in range(n):
        if not _is_mirror(hits, i):
            continue
        d, g, s, p = hits.incoming[i], hits.geometric[i], hits.shading[i], hits.position[i]
        along = np.float32(2.0) * (d[0] * s[0] + d[1] * s[1] + d[2] * s[2])
        x, y, z = d[0] - along * s[0], d[1] - along * s[1], d[2] - along * s[2]
        if not x * g[0] + y * g[1] + z * g[2] > 0.0:  # the interpolated normal reflects into the surface: use the other
            along = np.float32(2.0) * (d[0] * g[0] + d[1] * g[1] + d[2] * g[2])
            x, y, z = d[0] - along * g[0], d[1] - along * g[1], d[2] - along * g[2]
        e = hits.offset[i]
        ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
        set_ray(packets, m, ox, oy, oz, x, y, z, np.float32(np.inf))
        for channel in range(3):
            reflected_throughput[m, channel] = throughput[i, channel] * hits.specular[i, channel]
        reflected.key[m] = mix(hits.key[i])
        reflected.pixel[m] = hits.pixel[i]
        reflected.half[m] = hits.half[i]
        m += 1
    intersect(world.tracer, packets, m, True)
    record_hits(world, packets, m, True, reflected)
    return m
