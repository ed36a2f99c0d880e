"""What wide lobes of glossy surfaces reflect, read from cells, all light positions at once.

    L(v)[l] = sum over rays of w R(Q) E(cell of Q)[l] / pi        w = f cos / density, Q: where a ray of the lobe ends

A lobe of alpha is about 2 alpha wide, seen from the surface, so cells up to that size are as sharp as it is. Rays of
`SHARPEST` and narrower would show the borders of the finest cells; `lobes.py` follows them as mirrors are followed.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Rgb, Triple, with_room

from ..embree.packets import Tracer, room_in, set_ray
from ..hits.hits import SURFACE, Hits
from ..hits.rays import NO_RAYS, Rays
from ..inputs.gloss import DIELECTRIC, facing, followed_share, sample_lobe, schlick
from ..inputs.random import CELLS, LOBE, mix, r2, random_word
from ..kernels.kernel import inlined, kernel
from .cells.gather import COLOUR, LEVEL, LIGHT
from .cells.guards import choose_slots, write_guard_ray
from .cells.lookups import GatherScratch
from .cells.table import CONSTANT, EDGE_OF_LENGTH, MEAN, NOWHERE, TINT, Cells, find_cell, level_of, shifts, side_of

# alpha of the widest lobes that are followed as mirrors are.
SHARPEST = np.float32(0.04)
# Rays of a lobe; one where the coat reflects less than this share of what comes in the mirrored direction.
RAYS_OF_LOBE = 2
MUCH = np.float32(0.0625)


class LobeLight(NamedTuple):
    """What the lobes of a batch of hits reflect; all overwritten.

    Attributes:
        share: (batch,) sum of the weights of the rays of a hit, of an achromatic coat that reflects all; 0 of hits
            that are not followed.
        tint: (batch, 3) mean of f cos / density over the rays, times the share that rays follow.
        light: (batch, LIGHT + channels n_lights) mean light by these weights, in the form of `Gathered.light`.
        constant: (batch, 3) mean radiance that is the same at every light position.
        closeness: (batch,) mean of 1 / (2 alpha length) of the rays: how fast the light changes along the surface.
        place: (batch,) the hit that each traced ray belongs to.
        weight: (batch,) its weight; `passed`: (batch, 3) what the glass on its way leaves.
    """

    share: Float32
    tint: Rgb
    light: Float32
    constant: Rgb
    closeness: Float32
    place: Int32
    weight: Float32
    passed: Rgb


def room_for_lobes(batch: int, values: int) -> LobeLight:
    """Allocate arrays; `values`: numbers of indirect light per hit."""
    return LobeLight(
        share=np.empty(batch, np.float32),
        tint=np.empty((batch, 3), np.float32),
        light=with_room((batch, LIGHT + values), np.float32),
        constant=np.empty((batch, 3), np.float32),
        closeness=np.empty(batch, np.float32),
        place=np.empty(batch, np.int32),
        weight=np.empty(batch, np.float32),
        passed=np.empty((batch, 3), np.float32),
    )


@inlined
def rays_of_lobe(f0: Real, m: Triple, v: Triple) -> int:
    """How many rays a hit has. It depends on the hit alone: if it depended on what rays find, means would be biased."""
    one = np.float32(1.0)
    return RAYS_OF_LOBE if f0 + (one - f0) * schlick(facing(m, v)) >= MUCH else 1


@kernel
def write_lobe(
    hits: Hits, first: int, last: int, ray: int, alpha: Float32, metal: Float32, packets: Float32, reflected: Hits,
    out: LobeLight,
) -> int:  # fmt: skip
    """Write ray number `ray` of the wide lobes of hits first to last - 1, and what is known of their ends.

    Args:
        alpha, metal: (n,) gloss of the hits.
        reflected: overwritten with the random streams of the ends.

    Returns:
        number of rays.
    """
    one, nothing = np.float32(1.0), np.float32(0.0)
    # Loop state
    m = NO_RAYS  # rays
    for i in range(first, last):
        if ray == 0:
            out.share[i] = out.closeness[i] = nothing
            for channel in range(3):
                out.tint[i, channel] = out.constant[i, channel] = nothing
            for column in range(out.light.shape[1]):
                out.light[i, column] = nothing
        followed = followed_share(alpha[i])
        if hits.kind[i] != SURFACE or alpha[i] < SHARPEST or not followed > nothing:
            continue
        d, g, s, p, base = hits.incoming[i], hits.geometric[i], hits.shading[i], hits.position[i], hits.reflectivity[i]
        scale = -one / np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        v, normal = (scale * d[0], scale * d[1], scale * d[2]), (s[0], s[1], s[2])
        of_coat = DIELECTRIC * (one - metal[i])
        n_rays = rays_of_lobe(of_coat + metal[i] * (base[0] + base[1] + base[2]) * np.float32(1 / 3), normal, v)
        if ray >= n_rays:
            continue
        a, b = r2(random_word(hits.key[i], LOBE), ray)
        to, weight, x = sample_lobe(alpha[i], normal, v, a, b)
        # light from below the triangle does not count
        if not (weight > nothing and to[0] * g[0] + to[1] * g[1] + to[2] * g[2] > nothing):
            continue
        e = hits.offset[i]
        ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
        set_ray(packets, m, ox, oy, oz, to[0], to[1], to[2], np.float32(np.inf))
        out.place[m], out.weight[m] = i, weight
        out.share[i] += weight
        for channel in range(3):
            f0 = of_coat + metal[i] * base[channel]
            out.tint[i, channel] += (f0 + (one - f0) * x) * weight * followed / np.float32(n_rays)
        reflected.key[m] = mix(hits.key[i] + np.uint64(ray))
        reflected.pixel[m], reflected.half[m] = hits.pixel[i], hits.half[i]
        for channel in range(3):
            out.passed[m, channel] = one
        m += 1
    return m


@kernel
def read_lobe(
    hits: Hits, reflected: Hits, m: int, alpha: Float32, glow: Rgb, cells: Cells, tracer: Tracer, room: GatherScratch,
    tests: Rays, out: LobeLight,
) -> int:  # fmt: skip
    """Add what rays 0 to m - 1 of lobes find at their ends to the sums of their hits.

    Args:
        glow: (>= m, 3) radiance that the ends send out without being sources, or (0, 3).

    Returns:
        the number of rays to guards.
    """
    total = _find_cells(hits, reflected, m, alpha, cells, tracer, room, tests, out)
    for k in range(m):
        if room.cell[k] == NOWHERE:
            for channel in range(3):
                light = out.weight[k] * out.passed[k, channel] * cells.background[channel]
                out.constant[out.place[k], channel] += light
        else:
            _add_cell(reflected, k, room.cell[k], glow, cells, out)
    return total


@inlined
def _find_cells(
    hits: Hits, reflected: Hits, m: int, alpha: Float32, cells: Cells, tracer: Tracer, room: GatherScratch,
    tests: Rays, out: LobeLight,
) -> int:  # fmt: skip
    """Find the cells at the ends of rays 0 to m - 1, moved within their surfaces by up to half a cell, at random.

    Args:
        room: cell k is overwritten, with NOWHERE where a ray left the scene.
        out: adds to `closeness`.

    Returns:
        the number of rays to guards.
    """
    capacity = room_in(tests.packets)
    one, half = np.float32(1.0), np.float32(0.5)
    # --- loop state ---
    waiting = NO_RAYS  # rays to guards in the queue
    total = NO_RAYS
    for k in range(m):
        room.cell[k] = NOWHERE
        if reflected.kind[k] != SURFACE:
            continue
        i = out.place[k]
        q, p, g = reflected.position[k], hits.position[i], reflected.geometric[k]
        x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        length, wide = np.sqrt(x * x + y * y + z * z), alpha[i] + alpha[i]
        out.closeness[i] += out.weight[k] / (wide * max(length, np.float32(half * cells.grid.edge)))
        level = level_of(cells.grid, length * min(wide * np.float32(1.0 / EDGE_OF_LENGTH), one))
        a, b = r2(random_word(reflected.key[k], CELLS), 0)
        normal, point = (g[0], g[1], g[2]), (q[0], q[1], q[2])
        along, across = shifts(normal, a, b)
        found = find_cell(cells.grid, cells.slots, level, side_of(g[0], g[1], g[2]), point, along, across)
        room.cell[k] = found
        if cells.other[found] != NOWHERE:
            write_guard_ray(cells.guard, found, point, normal, tests, waiting, k)
            waiting += 1
            if waiting == capacity:
                choose_slots(tracer, tests, waiting, cells.other, room.cell)
                total, waiting = total + waiting, NO_RAYS
    choose_slots(tracer, tests, waiting, cells.other, room.cell)
    return total + waiting


@inlined
def _add_cell(reflected: Hits, k: int, cell: int, glow: Rgb, cells: Cells, out: LobeLight) -> None:
    """Add the light of a cell at the end of ray k to the sums of its hit."""
    channels, n_lights = cells.light.shape[1], cells.light.shape[2]
    i, w, mean = out.place[k], out.weight[k], np.float32(0.0)
    for channel in range(3):
        left = w * out.passed[k, channel]
        r = left * (reflected.reflectivity[k, channel] + reflected.specular[k, channel])
        out.constant[i, channel] += r * cells.tint[cell, CONSTANT + channel]
        if glow.shape[0]:
            out.constant[i, channel] += left * glow[k, channel]
        hue = r * cells.tint[cell, TINT + channel]
        out.light[i, COLOUR + channel] += hue * cells.tint[cell, MEAN]
        mean += cells.weights[channel] * hue
    for channel in range(channels):
        factor = mean
        if channels == 3:
            factor = w * out.passed[k, channel]
            factor *= reflected.reflectivity[k, channel] + reflected.specular[k, channel]
        for l in range(n_lights):
            out.light[i, LIGHT + channel * n_lights + l] += factor * cells.light[cell, channel, l]


@kernel
def complete_lobes(n: int, cells: Cells, out: LobeLight) -> None:
    """Turn the sums of hits 0 to n - 1 into means."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    for i in range(n):
        if not out.share[i] > nothing:
            continue
        inverse, mean = one / out.share[i], nothing
        out.closeness[i] *= inverse
        for channel in range(3):
            out.constant[i, channel] *= inverse
            mean += cells.weights[channel] * out.light[i, COLOUR + channel]
        for column in range(LIGHT, out.light.shape[1]):
            out.light[i, column] *= inverse
        out.light[i, LEVEL] = mean * inverse
        for channel in range(3):
            hue = out.light[i, COLOUR + channel] / mean if mean > nothing else nothing
            out.light[i, COLOUR + channel] = hue if cells.light.shape[1] == 1 else one
