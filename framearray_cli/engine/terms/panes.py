"""The mirror image in thin glass: what native hits see reflected by each face on the way to them.

A reflected hit is a hit seen through a tint, as behind a mirror: the share that the face reflects, times what passes
the faces before it. A sheet reflects 2 F / (1 + F), a face of a body F.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..embree.packets import MISS, TFAR, TNEAR, hit_triangle, intersect_on, set_ray
from ..hits.hits import SURFACE, Hits, World, trace_hits
from ..hits.rays import NO_RAYS, Rays
from ..inputs.panes import (
    Panes,
    colour_of,
    lift_of,
    mirrored_by,
    normal_of,
    passed_by,
    reflectance,
    step_beyond,
)
from ..inputs.random import mix
from ..kernels.kernel import kernel
from ..kernels.simd import width_of_packets

FACES = 4  # of glass on the way to a hit that mirror; those behind only pass
LEAST = np.float32(1e-4)  # share of light that is worth a ray


class Fronts:
    """Where the eye rays of a batch of hits have got to on their way through glass.

    Attributes:
        near: (n,) the depth from which on they look for glass, in lengths of their directions; infinite: none is left.
        through: (n, 3) what passes the faces met so far.
    """

    def __init__(self, n: int) -> None:
        self.near = np.zeros(n, np.float32)
        self.through = np.ones((n, 3), np.float32)


def reflect_at_panes(
    hits: Hits, n: int, eye: Float32, fronts: Fronts, panes: Panes, world: World, rays: Rays, reflected: Hits, tint: Rgb
) -> int:
    """Find what the next face of glass on the way to each of hits 0 to n - 1 mirrors.

    Args:
        eye: (n, 3) where the rays come from that found the hits, or (1, 3).
        rays: scratch, with rows for hits; of the reflected rays once they are traced.
        reflected: overwritten with what the faces mirror, in order.
        tint: (>= n, 3) overwritten: the tint of each.

    Returns:
        number of reflected hits.
    """
    m: int = _write_reflected(hits, n, eye, fronts.near, fronts.through, panes, rays, reflected, tint)
    if m:
        trace_hits(world, rays.packets, m, coherent=True, near=0.0, mirrors=True, hits=reflected)
    return m


@kernel
def _write_reflected(
    hits: Hits, n: int, eye: Float32, near: Float32, through: Rgb, panes: Panes, rays: Rays, reflected: Hits, tint: Rgb
) -> int:
    """Write the rays of `reflect_at_panes`, and what is known of their hits before tracing."""
    packets, width = rays.packets, width_of_packets()
    # 1. The next faces of glass.
    waiting = NO_RAYS
    for i in range(n):
        if near[i] == np.inf:
            continue
        dx, dy, dz = hits.incoming[i, 0], hits.incoming[i, 1], hits.incoming[i, 2]
        reach = np.float32(np.inf)
        o = eye[i if eye.shape[0] > 1 else 0]
        if hits.kind[i] == SURFACE:
            x, y, z = hits.position[i, 0] - o[0], hits.position[i, 1] - o[1], hits.position[i, 2] - o[2]
            reach = np.float32((x * dx + y * dy + z * dz) / (dx * dx + dy * dy + dz * dz)) * np.float32(1.0 - 1e-4)
        set_ray(packets, waiting, o[0], o[1], o[2], dx, dy, dz, reach)
        packets[waiting // width, TNEAR, waiting % width] = near[i]
        rays.place[waiting] = i
        waiting += 1
    intersect_on(panes.tracer, packets, waiting)
    # 2. The rays that they reflect: no more than were read, so that packets serve both.
    m = NO_RAYS
    for k in range(waiting):
        i, triangle, t = rays.place[k], hit_triangle(panes.tracer, packets, k), packets[k // width, TFAR, k % width]
        if triangle == MISS:
            near[i] = np.inf
            continue
        d = hits.incoming[i, 0], hits.incoming[i, 1], hits.incoming[i, 2]
        f = reflectance(panes, triangle, d)
        share, passed = mirrored_by(panes, triangle, f), passed_by(panes, triangle, f)
        near[i] = t + step_beyond(panes, triangle, d)
        if share > LEAST:
            g = normal_of(panes, triangle)
            along = d[0] * g[0] + d[1] * g[1] + d[2] * g[2]
            e = lift_of(panes, triangle) if along < 0.0 else -lift_of(panes, triangle)
            along = np.float32(2.0) * along
            x, y, z = d[0] - along * g[0], d[1] - along * g[1], d[2] - along * g[2]
            o = eye[i if eye.shape[0] > 1 else 0]
            ox, oy, oz = o[0] + t * d[0] + e * g[0], o[1] + t * d[1] + e * g[1], o[2] + t * d[2] + e * g[2]
            set_ray(packets, m, ox, oy, oz, x, y, z, np.float32(np.inf))
            for channel in range(3):
                tint[m, channel] = through[i, channel] * share
            reflected.key[m], reflected.pixel[m], reflected.half[m] = mix(mix(hits.key[i])), hits.pixel[i], hits.half[i]
            m += 1
        for channel in range(3):
            through[i, channel] *= passed * colour_of(panes, triangle, channel)
    return m
