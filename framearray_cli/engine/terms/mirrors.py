"""Mirrors: what native hits see by reflection, followed to a depth. Outer hits never have this part.

A reflected hit is a hit like any other, seen through a tint t: it gets direct light of all light positions and its own
W. So a mirror pixel needs a list of reflected hits, each with the product of reflectivities along its path.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..embree.packets import set_ray
from ..hits.hits import SURFACE, Hits, World, trace_hits
from ..hits.rays import NO_RAYS
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


def reflect(
    hits: Hits, n: int, throughput: Rgb, world: World, packets: Float32, reflected: Hits, reflected_throughput: Rgb
) -> int:
    """Follow hits 0 to n - 1 through one mirror bounce; paths at hits that are no mirror end.

    Args:
        throughput: (n, 3) tint t of each path so far.
        reflected: overwritten with the hits (or escapes) behind the mirrors, in order, with their next random streams.
        reflected_throughput: (n, 3) overwritten: t times the mirror's reflectivity.

    Returns:
        number of reflected hits, which is the number of rays.
    """
    m: int = _write_reflected_rays(hits, n, throughput, packets, reflected, reflected_throughput)
    if m:
        trace_hits(world, packets, m, coherent=True, near=0.0, mirrors=True, hits=reflected)
    return m


@kernel
def _write_reflected_rays(
    hits: Hits, n: int, throughput: Rgb, packets: Float32, reflected: Hits, reflected_throughput: Rgb
) -> int:
    """Write the rays of `reflect`, and what is known of their hits before tracing."""
    # Loop state
    m = NO_RAYS  # reflected rays
    for i in range(n):
        if not _is_mirror(hits, i):
            continue
        # mirror the direction d at the shading normal s
        d, g, s, p = hits.incoming[i], hits.geometric[i], hits.shading[i], hits.position[i]
        along = np.float32(2.0) * (d[0] * s[0] + d[1] * s[1] + d[2] * s[2])
        x, y, z = d[0] - along * s[0], d[1] - along * s[1], d[2] - along * s[2]
        # where that points into the surface, mirror it at the geometric normal g
        if not x * g[0] + y * g[1] + z * g[2] > 0.0:
            along = np.float32(2.0) * (d[0] * g[0] + d[1] * g[1] + d[2] * g[2])
            x, y, z = d[0] - along * g[0], d[1] - along * g[1], d[2] - along * g[2]
        # the reflected ray starts slightly above the mirror
        e = hits.offset[i]
        ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
        set_ray(packets, m, ox, oy, oz, x, y, z, np.float32(np.inf))
        # its tint, random stream, pixel and half
        for channel in range(3):
            reflected_throughput[m, channel] = throughput[i, channel] * hits.specular[i, channel]
        reflected.key[m] = mix(hits.key[i])
        reflected.pixel[m] = hits.pixel[i]
        reflected.half[m] = hits.half[i]
        m += 1
    return m
