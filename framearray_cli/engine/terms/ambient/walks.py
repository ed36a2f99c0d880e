"""Random walks over the scene, which all ambient estimates use.

A walk carries an RGB throughput. At a surface it continues by the diffuse part, continues by the mirror part, or ends,
with probabilities that keep the throughput at most 1.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb, Triple

from ...embree.packets import set_ray
from ...hits.hits import SURFACE, Hits, World, trace_hits
from ...hits.rays import NO_RAYS
from ...inputs.random import CHOICE, HEMISPHERE, above, cosine_direction, mix, r2, random_word
from ...kernels.kernel import inlined, kernel

DIFFUSE, MIRROR, END = 0, 1, 2
# Largest number of bounces; nearly all walks end by chance long before. 0.97^256 is four ten-thousandths.
MAX_BOUNCES = 256


class Walkers(NamedTuple):
    """Unfinished walks; each is at the hit of the same index.

    Attributes:
        walk: (n,) number of the walk in its batch.
        throughput: (n, 3) RGB.
        step: (n,) the walk's next step: DIFFUSE, MIRROR or END.
    """

    walk: Int32
    throughput: Rgb
    step: Int32


def empty_walkers(n: int) -> Walkers:
    """Allocate n walks."""
    return Walkers(np.empty(n, np.int32), np.empty((n, 3), np.float32), np.empty(n, np.int32))


@inlined
def choose_step(hits: Hits, walkers: Walkers, i: int, must_go_on: bool) -> None:
    """Choose how walk i leaves its hit, and divide its throughput by the probability of that choice.

    Args:
        must_go_on: end walks at black surfaces only, choose between the parts by their size, and keep the throughput.
    """
    # sizes of the parts
    r, s = hits.reflectivity[i], hits.specular[i]
    diffuse, mirror = max(r[0], r[1], r[2]), max(s[0], s[1], s[2])
    total = diffuse + mirror
    if hits.kind[i] != SURFACE or total <= 0.0:
        walkers.step[i] = END
        return
    # their probabilities; the rest up to 1 is that of an end
    scale = total if must_go_on or total > 1.0 else np.float32(1.0)
    diffuse, mirror = diffuse / scale, mirror / scale
    # the choice
    a, _ = r2(random_word(hits.key[i], CHOICE), 0)
    if a < diffuse:
        walkers.step[i] = DIFFUSE
    elif a < diffuse + mirror:
        walkers.step[i] = MIRROR
    else:
        walkers.step[i] = END
    # throughput times reflectivity over probability
    if must_go_on:
        return
    for channel in range(3):
        if walkers.step[i] == DIFFUSE:
            walkers.throughput[i, channel] *= r[channel] / diffuse
        elif walkers.step[i] == MIRROR:
            walkers.throughput[i, channel] *= s[channel] / mirror


@inlined
def _leave(hits: Hits, i: int, step: int) -> Triple:
    """Direction in which a walk leaves hit i: with density cos(theta) / pi, or mirrored."""
    g, m = hits.geometric[i], hits.shading[i]
    if step == DIFFUSE:
        a, b = r2(random_word(hits.key[i], HEMISPHERE), 0)
        x, y, z = cosine_direction(m[0], m[1], m[2], a, b)
        return above(x, y, z, g[0], g[1], g[2])
    d = hits.incoming[i]
    along = np.float32(2.0) * (d[0] * m[0] + d[1] * m[1] + d[2] * m[2])
    return above(d[0] - along * m[0], d[1] - along * m[1], d[2] - along * m[2], g[0], g[1], g[2])


def advance(
    hits: Hits,
    walkers: Walkers,
    n: int,
    world: World,
    packets: Float32,
    next_hits: Hits,
    next_walkers: Walkers,
) -> int:
    """Move every walk that continues to its next hit (or escape); returns their number."""
    m: int = _write_next_rays(hits, walkers, n, packets, next_hits, next_walkers)
    trace_hits(world, packets, m, coherent=False, near=0.0, mirrors=True, hits=next_hits)
    return m


@kernel
def _write_next_rays(
    hits: Hits, walkers: Walkers, n: int, packets: Float32, next_hits: Hits, next_walkers: Walkers
) -> int:
    """Write the rays of `advance`, and what is known of their walks before tracing."""
    # Loop state
    m = NO_RAYS  # walks that continue
    for i in range(n):
        if walkers.step[i] == END:
            continue
        # the ray from slightly above its hit
        x, y, z = _leave(hits, i, walkers.step[i])
        g, e, p = hits.geometric[i], hits.offset[i], hits.position[i]
        set_ray(packets, m, p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2], x, y, z, np.float32(np.inf))
        # its next random stream, number, step and throughput
        next_hits.key[m] = mix(hits.key[i])
        next_walkers.walk[m] = walkers.walk[i]
        next_walkers.step[m] = walkers.step[i]
        for channel in range(3):
            next_walkers.throughput[m, channel] = walkers.throughput[i, channel]
        m += 1
    return m


@kernel
def deposit(walkers: Walkers, n: int, irradiance: Float32, colour: Float32, sums: Float32) -> None:
    """Add throughput times irradiance of each walk's hit to the walk's sums.

    Args:
        irradiance: (n, 1 or 3, n_lights), in units of `colour`, (n_lights, 3).
        sums: (n_walks, 3, n_lights).
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    for i in range(n):
        for channel in range(3):
            t = walkers.throughput[i, channel]
            e, total = irradiance[i, channel if channels == 3 else 0], sums[walkers.walk[i], channel]
            for l in range(n_lights):
                total[l] += t * colour[l, channel] * e[l]
