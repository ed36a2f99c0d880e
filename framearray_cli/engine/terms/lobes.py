"""What glossy surfaces reflect: one ray of the lobe of a hit finds a hit like any other, seen through a tint.

Like mirrors this depends on the eye, so only native hits have it. Wide lobes see the light of half a room: rays would
find it with much noise, so it counts as even light, see `followed_share`. Of dielectrics, which reflect little, only
some hits are followed, and count the more.
"""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..embree.packets import set_ray
from ..hits.hits import SURFACE, Hits, World, trace_hits
from ..hits.rays import NO_RAYS
from ..inputs.gloss import DIELECTRIC, albedo_at, facing, followed_share, sample_lobe
from ..inputs.random import FOLLOWED, LOBE, mix, r2, random_word
from ..kernels.kernel import kernel

# A hit that reflects this share of even light, or more, is followed for certain.
CERTAIN = np.float32(0.0625)


def follow_lobes(
    hits: Hits, n: int, throughput: Rgb, alpha: Float32, metal: Float32, albedo: Float32, world: World,
    packets: Float32, reflected: Hits, tint: Rgb,
) -> int:  # fmt: skip
    """Follow glossy hits among 0 to n - 1 by one ray each, or none.

    Args:
        throughput: (n, 3) what passes on the way to the hits.
        alpha, metal: (n,) gloss of the hits.
        albedo: see `albedo_table`.
        reflected: overwritten with the hits (or escapes) that the rays find, in order, with their random streams.
        tint: (>= number of rays, 3) overwritten: throughput times f cos over the density of the ray.

    Returns:
        number of rays.
    """
    m: int = _write_lobe_rays(hits, n, throughput, alpha, metal, albedo, packets, reflected, tint)
    if m:
        trace_hits(world, packets, m, coherent=True, near=0.0, mirrors=True, hits=reflected)
    return m


@kernel
def _write_lobe_rays(
    hits: Hits, n: int, throughput: Rgb, alpha: Float32, metal: Float32, albedo: Float32, packets: Float32,
    reflected: Hits, tint: Rgb,
) -> int:  # fmt: skip
    """Write the rays of `follow_lobes`, and what is known of their hits before tracing."""
    one, nothing = np.float32(1.0), np.float32(0.0)
    # Loop state
    m = NO_RAYS  # rays
    for i in range(n):
        share = followed_share(alpha[i])
        if hits.kind[i] != SURFACE or not (alpha[i] > nothing and share > nothing):
            continue
        # the direction v to the viewer, and the share of even light that the coat reflects there
        d, g, s, p, base = hits.incoming[i], hits.geometric[i], hits.shading[i], hits.position[i], hits.reflectivity[i]
        scale = -one / np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        v, normal = (scale * d[0], scale * d[1], scale * d[2]), (s[0], s[1], s[2])
        face_on, edge, _ = albedo_at(albedo, alpha[i], facing(normal, v))
        of_coat = DIELECTRIC * (one - metal[i])
        mean = of_coat + metal[i] * (base[0] + base[1] + base[2]) * np.float32(1 / 3)
        chance = share * (mean * face_on + edge) / CERTAIN
        chance = min(chance, one)
        # whether it is followed, and whereto; light from below the triangle does not count
        choice, _ = r2(random_word(hits.key[i], FOLLOWED), 0)
        if not choice < chance:
            continue
        a, b = r2(random_word(hits.key[i], LOBE), 0)
        to, weight, x = sample_lobe(alpha[i], normal, v, a, b)
        if not (weight > nothing and to[0] * g[0] + to[1] * g[1] + to[2] * g[2] > nothing):
            continue
        e = hits.offset[i]
        ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
        set_ray(packets, m, ox, oy, oz, to[0], to[1], to[2], np.float32(np.inf))
        for channel in range(3):
            f0 = of_coat + metal[i] * base[channel]
            tint[m, channel] = throughput[i, channel] * ((f0 + (one - f0) * x) * weight * share / chance)
        reflected.key[m] = mix(hits.key[i])
        reflected.pixel[m] = hits.pixel[i]
        reflected.half[m] = hits.half[i]
        m += 1
    return m
