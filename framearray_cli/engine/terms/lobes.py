"""Reflections in glossy surfaces: rays of a lobe, followed to hits or summed over the lobe.

Like mirrors, lobes depend on the eye, so only native hits have them. A clear coat has a lobe of its own; rays
follow the coat or the lobe under it, by chance. There are three ways:

- Narrow lobes: one ray finds a hit like any other, seen through a tint. Wide lobes see the light of half a room, which
  single rays would find with much noise, so they count as even light (`followed_share`). Of dielectrics, which reflect
  little, only some hits are followed, and count the more.
- Wide lobes with cells: rays read cells where they end, all light positions at once.

      L(v)[l] = sum over rays of w R(Q) E(cell of Q)[l] / pi        w = f cos / density, Q: where a ray of the lobe ends

  A lobe of alpha is about 2 alpha wide, seen from the surface, so cells up to that size are as sharp as the lobe. Rays
  narrower than `SHARPEST` would show the borders of the finest cells.
- Wide lobes without cells: the ambient light of their rays. This is W for the lobe instead of the hemisphere. A ray
  that meets nothing brings the background.

      L(v)[l] = t I_A[l] sum over rays of w R(Q) rho(d) / sum over rays of w        Q: where a ray ends, at d
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Rgb, Triple

from ..embree.packets import Tracer
from ..hits.hits import SURFACE, Hits, World, trace_hits
from ..hits.rays import NO_RAYS, Rays
from ..inputs.gloss import DIELECTRIC, albedo_at, coat_share, facing, followed_share, sample_lobe, schlick
from ..inputs.random import FOLLOWED, LOBE, mix, r2, random_word
from ..kernels.bundle import allocated, bundle
from ..kernels.kernel import inlined, kernel
from .bounces import start_bounce
from .cells.gather import COLOUR, LEVEL, LIGHT
from .cells.lookup import CONSTANT, EDGE_OF_LENGTH, MEAN, NOWHERE, TINT, Cells, find_cells_at
from .obscurance import ObscuranceSettings, rho

# A hit that reflects this share of even light, or more, is followed for certain.
CERTAIN = np.float32(0.0625)
# alpha of the widest lobes that are followed as mirrors are.
SHARPEST = np.float32(0.04)
# Rays of a lobe; one where the coat reflects less than this share of what comes in the mirrored direction.
RAYS_OF_LOBE = 2
MUCH = np.float32(0.0625)


@bundle
class Lobes(NamedTuple):
    """Lobes of hits.

    Attributes:
        alpha, metal: (n,) see `gloss_at`.
        coat, rough: (n,) weight and roughness of their clear coats; no rows in a scene without.
    """

    alpha: Float32
    metal: Float32
    coat: Float32
    rough: Float32


@kernel
def choose_lobes(hits: Hits, n: int, lobes: Lobes, albedo: Float32, passed: Rgb) -> None:
    """Choose which lobe of coated hits rays follow, by chance, as much as it reflects.

    Args:
        lobes: changed: of a chosen coat, `alpha` and `metal` become the coat's.
        albedo: see `albedo_table`.
        passed: (n, 3) changed: times the share of the lobe over its chance.
    """
    nothing, one = np.float32(0.0), np.float32(1.0)
    for i in range(n):
        weight = lobes.coat[i]
        if hits.kind[i] != SURFACE or not (lobes.alpha[i] > nothing and weight > nothing):
            continue
        d, s, base, alpha = hits.incoming[i], hits.shading[i], hits.reflectivity[i], lobes.rough[i] * lobes.rough[i]
        scale = -one / np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        v, m = (scale * d[0], scale * d[1], scale * d[2]), (s[0], s[1], s[2])
        left, mean = coat_share(weight, m, v), (base[0] + base[1] + base[2]) * np.float32(1 / 3)
        face_on, edge, _ = albedo_at(albedo, lobes.alpha[i], facing(m, v))
        f0 = DIELECTRIC * (one - lobes.metal[i]) + lobes.metal[i] * mean
        under = left * followed_share(lobes.alpha[i]) * (f0 * face_on + edge)
        face_on, edge, _ = albedo_at(albedo, alpha, facing(m, v))
        over = weight * followed_share(alpha) * (DIELECTRIC * face_on + edge)
        if not under + over > nothing:
            continue
        _, choice = r2(random_word(hits.key[i], FOLLOWED), 0)
        factor, chance = left, under / (under + over)
        if choice >= chance:
            factor, chance = weight, one - chance
            lobes.alpha[i], lobes.metal[i] = alpha, nothing
        for channel in range(3):
            passed[i, channel] *= factor / chance


def follow_lobes(
    hits: Hits, n: int, throughput: Rgb, alpha: Float32, metal: Float32, albedo: Float32, world: World,
    packets: Float32, reflected: Hits, tint: Rgb,
) -> int:  # fmt: skip
    """Follow glossy hits among 0 to n - 1 by one ray each, or none.

    Args:
        throughput: (n, 3) transmission and reflection on the way to the hits.
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
    """Write the rays of `follow_lobes`, with keys, pixels and halves of their hits."""
    one, nothing = np.float32(1.0), np.float32(0.0)
    # Loop state
    m = NO_RAYS  # rays
    for i in range(n):
        share = followed_share(alpha[i])
        if hits.kind[i] != SURFACE or not (alpha[i] > nothing and share > nothing):
            continue
        # the direction v to the viewer, and the share of even light that the coat reflects there
        d, g, s, base = hits.incoming[i], hits.geometric[i], hits.shading[i], hits.reflectivity[i]
        scale = -one / np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        v, normal = (scale * d[0], scale * d[1], scale * d[2]), (s[0], s[1], s[2])
        face_on, edge, _ = albedo_at(albedo, alpha[i], facing(normal, v))
        of_coat = DIELECTRIC * (one - metal[i])
        mean = of_coat + metal[i] * (base[0] + base[1] + base[2]) * np.float32(1 / 3)
        chance = share * (mean * face_on + edge) / CERTAIN
        chance = min(chance, one)
        # the choice to follow it, and the direction; light from below the triangle does not count
        choice, _ = r2(random_word(hits.key[i], FOLLOWED), 0)
        if not choice < chance:
            continue
        a, b = r2(random_word(hits.key[i], LOBE), 0)
        to, weight, x = sample_lobe(alpha[i], normal, v, a, b)
        if not (weight > nothing and to[0] * g[0] + to[1] * g[1] + to[2] * g[2] > nothing):
            continue
        start_bounce(hits, i, to, mix(hits.key[i]), packets, reflected, m)
        for channel in range(3):
            f0 = of_coat + metal[i] * base[channel]
            tint[m, channel] = throughput[i, channel] * ((f0 + (one - f0) * x) * weight * share / chance)
        m += 1
    return m


@bundle
class LobeLight(NamedTuple):
    """Light that the lobes of a batch of hits reflect; all overwritten.

    Attributes:
        share: (batch,) sum of the weights of the rays of a hit, of an achromatic coat that reflects all; 0 of hits
            that are not followed.
        tint: (batch, 3) mean of f cos / density over the rays, times the share that rays follow.
        light: (batch, LIGHT + channels n_lights) mean light by these weights, in the form of `Gathered.light`.
        constant: (batch, 3) mean radiance that is the same at every light position.
        closeness: (batch,) mean of 1 / (2 alpha length) of the rays: how fast the light changes along the surface.
        place: (batch,) the hit that each traced ray belongs to.
        weight: (batch,) its weight; `passed`: (batch, 3) the transmission of the glass on its way.
        length: (batch,) its length, times the width of the lobe over the width of a gather ray; infinite if it left the
            scene. `cell`: (batch,) the cell that it reads.
    """

    share: Float32
    tint: Rgb
    light: Float32
    constant: Rgb
    closeness: Float32
    place: Int32
    weight: Float32
    passed: Rgb
    length: Float32
    cell: Int32


def room_for_lobes(batch: int, values: int) -> LobeLight:
    """Allocate arrays; `values`: numbers of indirect light per hit."""
    n = batch
    return allocated(
        LobeLight, share=n, tint=(n, 3), light=(n, LIGHT + values), constant=(n, 3), closeness=n, place=n, weight=n,
        passed=(n, 3), length=n, cell=n,
    )  # fmt: skip


@inlined
def rays_of_lobe(f0: Real, m: Triple, v: Triple) -> int:
    """Number of rays of a hit, which depends on the hit alone: means would be biased by the ends of rays."""
    one = np.float32(1.0)
    return RAYS_OF_LOBE if f0 + (one - f0) * schlick(facing(m, v)) >= MUCH else 1


@kernel
def write_lobe(
    hits: Hits, first: int, last: int, ray: int, alpha: Float32, metal: Float32, packets: Float32, reflected: Hits,
    out: LobeLight,
) -> int:  # fmt: skip
    """Write ray number `ray` of the wide lobes of hits first to last - 1, with keys, pixels and halves of their ends.

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
        d, g, s, base = hits.incoming[i], hits.geometric[i], hits.shading[i], hits.reflectivity[i]
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
        start_bounce(hits, i, to, mix(hits.key[i] + np.uint64(ray)), packets, reflected, m)
        out.place[m], out.weight[m] = i, weight
        out.share[i] += weight
        for channel in range(3):
            f0 = of_coat + metal[i] * base[channel]
            out.tint[i, channel] += (f0 + (one - f0) * x) * weight * followed / np.float32(n_rays)
        for channel in range(3):
            out.passed[m, channel] = one
        m += 1
    return m


@kernel
def read_lobe(
    hits: Hits, reflected: Hits, m: int, alpha: Float32, glow: Rgb, cells: Cells, tracer: Tracer, tests: Rays,
    out: LobeLight,
) -> int:  # fmt: skip
    """Add the light at the ends of rays 0 to m - 1 of lobes to the sums of their hits.

    Args:
        glow: (>= m, 3) radiance that the ends send out without being sources, or (0, 3).

    Returns:
        the number of rays to guards.
    """
    _measure_rays(hits, reflected, m, alpha, cells.grid.edge, out)
    total: int = find_cells_at(
        cells, m, reflected.position, reflected.geometric, out.length, reflected.key, tracer, tests, out.cell
    )
    for k in range(m):
        if out.cell[k] == NOWHERE:
            for channel in range(3):
                light = out.weight[k] * out.passed[k, channel] * cells.background[channel]
                out.constant[out.place[k], channel] += light
        else:
            _add_cell(reflected, k, out.cell[k], glow, cells, out)
    return total


@inlined
def _measure_rays(hits: Hits, reflected: Hits, m: int, alpha: Float32, edge: float, out: LobeLight) -> None:
    """Write `out.length` of rays 0 to m - 1, and add to `out.closeness`.

    Args:
        edge: of the finest cells.
    """
    one, half = np.float32(1.0), np.float32(0.5)
    for k in range(m):
        out.length[k] = np.inf
        if reflected.kind[k] != SURFACE:
            continue
        i = out.place[k]
        q, p = reflected.position[k], hits.position[i]
        x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        length, wide = np.sqrt(x * x + y * y + z * z), alpha[i] + alpha[i]
        out.closeness[i] += out.weight[k] / (wide * max(length, np.float32(half * edge)))
        out.length[k] = length * min(wide * np.float32(1.0 / EDGE_OF_LENGTH), one)


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


@kernel
def read_ambient(
    hits: Hits, reflected: Hits, m: int, glow: Rgb, background: Rgb, settings: ObscuranceSettings, out: LobeLight
) -> None:
    """Add R(Q) rho(d) at the ends of rays 0 to m - 1 of lobes to the sums of their hits, as their colour.

    Args:
        glow: (>= m, 3) radiance that the ends send out without being sources, or (0, 3).
        background: (3,) radiance outside the scene.
    """
    one, d_max = np.float32(1.0), np.float32(settings.d_max)
    for k in range(m):
        i, w = out.place[k], out.weight[k]
        if reflected.kind[k] != SURFACE:
            for channel in range(3):
                out.constant[i, channel] += w * out.passed[k, channel] * background[channel]
            continue
        q, p = reflected.position[k], hits.position[i]
        open_share: Real = one
        x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        distance = np.sqrt(x * x + y * y + z * z)
        if distance < d_max:
            open_share = rho(settings.falloff, np.float32(settings.tau), np.float32(distance / d_max))
        for channel in range(3):
            left = w * out.passed[k, channel]
            r = reflected.reflectivity[k, channel] + reflected.specular[k, channel]
            out.light[i, COLOUR + channel] += left * open_share * r
            if glow.shape[0]:
                out.constant[i, channel] += left * glow[k, channel]


@kernel
def complete_ambient(n: int, out: LobeLight) -> None:
    """Turn the sums of hits 0 to n - 1 into means."""
    for i in range(n):
        if out.share[i] > np.float32(0.0):
            inverse = np.float32(1.0) / out.share[i]
            for channel in range(3):
                out.constant[i, channel] *= inverse
                out.light[i, COLOUR + channel] *= inverse
