"""What mirrors show: native hits followed from mirror to mirror. A reflected hit is a hit seen through a tint.

Glossy surfaces are followed likewise, by one ray of their lobe, for some of their hits.
"""

from itertools import pairwise
from time import perf_counter
from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb

from ..hits.aiming import ray_origins
from ..hits.emission import SOURCE
from ..hits.hits import ESCAPED, Hits, trace_hits
from ..hits.native import Samples, extra_hits, flag_mirrors
from ..inputs.gloss import WIDE
from ..inputs.panes import bends_rays
from ..terms.lobe_cells import SHARPEST
from ..terms.lobes import follow_lobes
from ..terms.mirrors import count_mirrors, reflect
from ..terms.obscurance import HITS_TOGETHER
from ..terms.panes import FACES, Fronts, reflect_at_panes
from ..terms.refraction import bend, write_bent
from .glass import NO_GLASS, dim_reflected, own_view
from .lobes import wide_lobes
from .passes import Pass, half_sizes
from .records import LIT, HitRecords
from .scratch import Scratch
from .setup import FrameSetup
from .shading import estimate_terms, find_shine
from .threads import TracePool

Gloss: TypeAlias = tuple[Float32, Float32]  # alpha and metal of hits


def mirror_paths(
    setup: FrameSetup, c: int, hits: Hits, n: int, scratch: Scratch, own: Float32 = NO_GLASS, *, smooth: bool = False
) -> list[tuple[Int32, HitRecords]]:
    """Follow hits 0 to n - 1 of eye c that are on mirrors or glossy, and find what glass before hits mirrors.

    Returns pixels and records of the reflected hits of each face of glass, and of each bounce. Rays of HITS_TOGETHER
    hits are reflected together, and what they meet at all bounces stands together. Batches begin at multiples of these,
    so neither the order of reflected hits nor which rays share a packet depends on the size of batches.

    Args:
        own: (n, 3) what passes the glass before the hits, which mirrors too; (0, 3) without glass.
        smooth: whether hits in a row are neighbours in the image.
    """
    started = perf_counter()
    ends = [*range(0, n, HITS_TOGETHER), n]  # of the hits that are reflected together
    # reflected hits write their own gloss there
    gloss = (scratch.alpha[:n].copy(), scratch.metal[:n].copy()) if setup.lobes else None
    found: list[list[tuple[Int32, HitRecords]]] = [
        _glass_images(setup, c, hits, *span, scratch) if setup.has_glass else [] for span in pairwise(ends)
    ]
    if bends_rays(setup.world.panes):
        for paths, span in zip(found, pairwise(ends), strict=True):
            paths += _refracted(setup, c, hits, *span, scratch)
    throughput = own if len(own) else np.ones((n, 3), np.float32)
    if gloss is not None:
        if setup.reads_lobes:
            wide = wide_lobes(setup, hits, throughput, ends, *gloss, scratch, smooth=smooth)
            for paths, path in zip(found, wide, strict=True):
                if len(path[0]):
                    paths.append(path)
            gloss[0][gloss[0] >= SHARPEST] = 0.0
        _follow(setup, hits, throughput, ends, scratch, found, gloss)
    if setup.depth and count_mirrors(hits, n):
        _follow(setup, hits, throughput, ends, scratch, found, None)
    scratch.seconds["mirror"] += perf_counter() - started
    return [path for paths in found for path in paths]


def _follow(
    setup: FrameSetup,
    hits: Hits,
    throughput: Rgb,
    ends: list[int],
    scratch: Scratch,
    found: list[list[tuple[Int32, HitRecords]]],
    gloss: Gloss | None,
) -> None:
    """Follow hits, and add pixels and records of the reflected hits of each bounce to those of their ends.

    Args:
        throughput: (n, 3) what passes on the way to the hits.
        gloss: alpha and metal, to follow glossy hits by their lobes first; None to follow mirrors only.
    """
    for bounce in range(setup.depth or 1):
        reflected, next_throughput = scratch.reflected[bounce % 2], scratch.throughput[bounce % 2]
        lobes = gloss if bounce == 0 else None
        ends = _reflect(setup, hits, throughput, ends, scratch, reflected, next_throughput, lobes)
        m = ends[-1]
        if m == 0:
            break
        scratch.rays["mirror"] += m
        hits, throughput = reflected, next_throughput
        if gloss is not None:
            _widen(scratch.alpha[:m])
        records, pixels = setup.empty_records(m, mirrored=True), reflected.pixel[:m].copy()
        estimate_terms(setup, hits, m, scratch, records, "mirror obscurance", "mirror shadow", throughput)
        if gloss is not None:
            _hide_sources(setup, hits, m, records)
        for paths, (first, last) in zip(found, pairwise(ends), strict=True):
            if first < last:
                paths.append((pixels[first:last], records.part(slice(first, last))))


def _widen(alpha: Float32) -> None:
    """Widen narrow lobes of hits that lobes found [Kaplanyan13]: few rays meet their highlights, as bright dots."""
    np.maximum(alpha, WIDE, out=alpha, where=alpha > 0)


def _hide_sources(setup: FrameSetup, hits: Hits, n: int, records: HitRecords) -> None:
    """Leave out environments and surfaces that shine: composing finds what a lobe reflects of sources by themselves."""
    records.row[:n, LIT][hits.kind[:n] == ESCAPED] = 0.0
    if setup.shines:
        records.emission[:n, SOURCE] = -1.0


def _glass_images(
    setup: FrameSetup, c: int, hits: Hits, first: int, last: int, scratch: Scratch
) -> list[tuple[Int32, HitRecords]]:
    """Find what glass mirrors on the way from eye c to hits first to last - 1, face by face."""
    n, world = last - first, setup.world
    found: list[tuple[Int32, HitRecords]] = []
    reflected, tint = scratch.reflected[0], scratch.throughput[0]
    some, fronts = Hits._make(array[first:last] for array in hits), Fronts(n)
    eye = ray_origins(setup.cams, c, some, n)
    for _ in range(FACES):
        m = reflect_at_panes(some, n, eye, fronts, setup.world.panes, world, scratch.hit_rays, reflected, tint)
        if m == 0:
            break
        find_shine(setup, reflected, scratch, 0, m)
        dim_reflected(setup, scratch, m, tint)
        scratch.rays["mirror"] += m
        records, pixels = setup.empty_records(m, mirrored=True), reflected.pixel[:m].copy()
        estimate_terms(setup, reflected, m, scratch, records, "mirror obscurance", "mirror shadow", tint)
        found.append((pixels, records))
    return found


def _refracted(
    setup: FrameSetup, c: int, hits: Hits, first: int, last: int, scratch: Scratch
) -> list[tuple[Int32, HitRecords]]:
    """Find what eye c sees through solid glass in the place of hits first to last - 1."""
    reflected, packets = scratch.reflected[0], scratch.hit_rays.packets
    some = Hits._make(array[first:last] for array in hits)
    eye = ray_origins(setup.cams, c, some, last - first)
    bent = bend(some, last - first, eye, setup.world.panes, setup.world.tracer, packets)
    scratch.rays["glass"] += bent.rays
    m = len(bent.hit)
    if m == 0:
        return []
    write_bent(bent, some, packets, reflected)
    trace_hits(setup.world, packets, m, coherent=False, near=0.0, mirrors=True, hits=reflected)
    find_shine(setup, reflected, scratch, 0, m)
    scratch.rays["mirror"] += m
    records, pixels = setup.empty_records(m, mirrored=True), reflected.pixel[:m].copy()
    estimate_terms(setup, reflected, m, scratch, records, "mirror obscurance", "mirror shadow", bent.passed)
    return [(pixels, records)]


def _reflect(
    setup: FrameSetup,
    hits: Hits,
    throughput: Rgb,
    ends: list[int],
    scratch: Scratch,
    reflected: Hits,
    tint: Rgb,
    gloss: Gloss | None,
) -> list[int]:
    """Follow hits through one bounce, those between two `ends` together; return the ends of what they meet.

    Args:
        reflected, tint: overwritten, see `reflect`.
        gloss: see `_follow`.
    """
    found = [0]
    for first, last in pairwise(ends):
        at, m = found[-1], 0
        if first < last:
            some, to = Hits._make(array[first:last] for array in hits), Hits._make(array[at:] for array in reflected)
            packets = scratch.hit_rays.packets
            if gloss is None:
                m = reflect(some, last - first, throughput[first:last], setup.world, packets, to, tint[at:])
            else:
                coat = gloss[0][first:last], gloss[1][first:last], setup.glossy.albedo
                m = follow_lobes(some, last - first, throughput[first:last], *coat, setup.world, packets, to, tint[at:])
            find_shine(setup, to, scratch, at, m)
            dim_reflected(setup, scratch, m, tint[at:])
        found.append(at + m)
    return found


def extra_mirror_hits(
    setup: FrameSetup, c: int, parts: tuple[Pass, ...], pool: TracePool, own: Int32
) -> list[tuple[Int32, HitRecords]]:
    """Find and follow the additional native hits of mirror pixels.

    Args:
        parts: the native hits of eye c that all pixels have.
        own: (2, n_pixels) overwritten: the number of native hits of each pixel, with even and with odd sample numbers.
    """
    first_sample = max((part.first_sample + part.per_pixel for part in parts), default=0)
    extra = max(setup.mirror_hits - setup.fewest_hits(c), 0)
    own[:] = 0
    for part in parts:
        counts = half_sizes(part.first_sample, part.per_pixel)[:, None]
        if len(part.pixels) == setup.n_pixels:
            own += counts
        else:
            own[:, part.pixels] += counts
    if not extra:
        return []
    flags = np.zeros(setup.n_pixels, np.uint8)

    def flag(first: int, scratch: Scratch) -> None:
        n = min(pool.batch, setup.n_pixels - first)
        packets, hits = scratch.hit_rays.packets, scratch.hits
        flag_mirrors(setup.cams, c, setup.order, first, n, setup.world, packets, hits, flags)
        scratch.rays["pilot"] += n

    def follow(first: int, scratch: Scratch) -> list[tuple[Int32, HitRecords]]:
        n = min(pool.batch, len(pixels) * extra - first)
        extra_hits(setup.cams, c, samples, first, n, setup.world, scratch.hit_rays.packets, scratch.hits)
        scratch.rays["mirror"] += n
        if setup.lobes:
            find_shine(setup, scratch.hits, scratch, 0, n)
        own = own_view(setup, c, scratch.hits, n, scratch)[0]
        return mirror_paths(setup, c, scratch.hits, n, scratch, own)

    pool.run(flag, range(0, setup.n_pixels, pool.batch))
    pixels = setup.order[flags[setup.order] > 0]
    samples = Samples(setup.seed, pixels, extra, first_sample, setup.halves != 0)
    found = pool.run(follow, range(0, len(pixels) * extra, pool.batch))
    own += half_sizes(first_sample, extra)[:, None] * flags
    return [path for batch in found for path in batch]
