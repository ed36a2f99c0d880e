"""Reflected hits: native hits followed by rays of a strategy, such as mirrors. Each is a hit seen through a tint."""

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32, Int32, Rgb

from ..hits.glass import dim_traced
from ..hits.hits import Hits
from ..hits.native import PixelSamples, extra_hits, flag_mirrors
from ..inputs.panes import has_panes
from ..kernels.bundle import rows_from
from ..terms.bounces import count_mirrors, reflect
from ..terms.obscurance import HITS_TOGETHER
from .kept_light import LightStore, keep_reflected
from .passes import Pass, half_sizes
from .pool import TracePool
from .records import HitRecords, empty_by_frame
from .setup import Batch, FrameSetup, Reflected, Scratch
from .shading import record, shade

# Follows hits first to last - 1: writes what their rays meet to some hits and their tints, and returns the number.
Reflect: TypeAlias = Callable[[int, int, Hits, Rgb], int]

# The column of what passes thin glass between a hit and the eye of a frame, in 65535ths; its row where there is none.
TRANSMISSION, WHOLE_SHARE = "pane_transmission", np.float32(65535)
NO_GLASS = np.empty((1, 0, 3), np.uint16)


def passed_shares(stored: Any) -> Rgb:
    """Return the shares of light that pass glass, of the column of transmissions."""
    shares: Rgb = np.asarray(stored, np.float32) / WHOLE_SHARE
    return shares


def reflected_hits(batch: Batch, own: NDArray[np.uint16]) -> list[tuple[Int32, HitRecords]]:
    """Follow native hits of a batch; return pixels and records of their reflected hits.

    Rays of HITS_TOGETHER hits are reflected together, and what they meet at all bounces stands together. Batches begin
    at multiples of these, so neither the order of reflected hits nor which rays share a packet depends on the size of
    batches.

    Args:
        own: (n, 3) what passes the glass before the hits, in 65535ths, which mirrors too; (0, 3) without glass.
    """
    started, setup, n = perf_counter(), batch.setup, batch.n
    ends = [*range(0, n, HITS_TOGETHER), n]  # of the hits that are reflected together
    passed = passed_shares(own) if len(own) else np.ones((n, 3), np.float32)
    found: list[list[tuple[Int32, HitRecords]]] = [[] for _ in ends[1:]]
    for feature in setup.features:
        for k, pixels, records in feature.bounces(batch, passed, ends):
            found[k].append((pixels, records))
    if setup.depth and count_mirrors(batch.hits, n):
        for k, pixels, records in follow(batch, ends, mirror(batch, passed)):
            found[k].append((pixels, records))
    batch.scratch.seconds["mirror"] += perf_counter() - started
    return [path for paths in found for path in paths]


def follow(batch: Batch, ends: list[int], first: Reflect, *, by_lobe: bool = False) -> Iterator[Reflected]:
    """Follow hits by a strategy, and what they meet from mirror to mirror.

    Args:
        ends: see `Feature.bounces`.
        by_lobe: see `Batch`.
    """
    way = first
    for k in range(batch.setup.depth or 1):
        bounced = bounce(batch, ends, way, k, by_lobe=by_lobe)
        if bounced is None:
            break
        reflected, ends = bounced
        yield from spans(reflected, ends)
        way = mirror(reflected, reflected.throughput)


def bounce(
    batch: Batch, ends: list[int], way: Reflect, k: int = 0, *, by_lobe: bool = False, dimmed: bool = True
) -> tuple[Batch, list[int]] | None:
    """Follow hits through one bounce, those between two `ends` together; return what they meet, and its ends.

    Args:
        k: number of the bounce.
        dimmed: True if glass dims the reflected rays.
    """
    setup, scratch = batch.setup, batch.scratch
    reflected, tint = scratch.reflected[k % 2], scratch.throughput[k % 2]
    found = [0]
    for first, last in pairwise(ends):
        at, m = found[-1], 0
        if first < last:
            to = rows_from(reflected, at)
            m = way(first, last, to, tint[at:])
        if m:
            record(Batch(setup=setup, c=batch.c, hits=to, n=m, scratch=scratch, throughput=tint[at:], first=at))
            if dimmed:
                dim_reflected(setup, scratch, m, tint[at:])
        found.append(at + m)
    m = found[-1]
    if m == 0:
        return None
    scratch.rays["mirror"] += m
    met = Batch(
        setup=setup, c=batch.c, hits=reflected, n=m, scratch=scratch, throughput=tint, by_lobe=by_lobe,
        records=setup.empty_records(m, mirrored=True),
    )  # fmt: skip
    shade(met)
    return met, found


def spans(batch: Batch, ends: list[int]) -> Iterator[Reflected]:
    """Pixels and records of reflected hits, span by span."""
    assert batch.records is not None
    pixels = batch.hits.pixel[: batch.n].copy()
    for k, (first, last) in enumerate(pairwise(ends)):
        if first < last:
            yield k, pixels[first:last], batch.records.part(slice(first, last))


def mirror(batch: Batch, throughput: Rgb) -> Reflect:
    """The strategy of mirrors; paths at hits that are no mirror end."""

    def way(first: int, last: int, to: Hits, tint: Rgb) -> int:
        some, packets = rows_from(batch.hits, first), batch.scratch.hit_rays.packets
        return reflect(some, last - first, throughput[first:last], batch.setup.world, packets, to, tint)

    return way


def dim_reflected(setup: FrameSetup, scratch: Scratch, n: int, tint: Float32) -> None:
    """Dim the n reflected rays that are still in `scratch.hit_rays`, by the glass before what they met.

    Args:
        tint: (>= n, 3) changed.
    """
    if has_panes(setup.world.panes) and n:
        shares = np.ones((1, n, 3), np.float32)
        scratch.rays["glass"] += dim_traced(setup.world.panes, scratch.hit_rays, n, shares)
        tint[:n] *= shares[0]


def own_columns(batch: Batch) -> dict[str, Any]:
    """The frame columns of features, of native hits in the frame of their own eye, (1, n, *shape)."""
    found = empty_by_frame(batch.setup.feature_columns(), 1, batch.n)
    if found:
        see(batch, range(batch.c, batch.c + 1), np.zeros((1, batch.n), np.int32), found)
    return found


def see(batch: Batch, frames: range, pixel: Int32, columns: Mapping[str, Any]) -> None:
    """Write the frame columns of all features; see `Feature.see`."""
    started = perf_counter()
    for feature in batch.setup.features:
        feature.see(batch, frames, pixel, columns)
    batch.scratch.seconds["visibility"] += perf_counter() - started


def mirror_flags(setup: FrameSetup, c: int, pool: TracePool) -> Bytes:
    """Flags of the pixels of eye c that may see a mirror, (n_pixels,); see `flag_mirrors`."""
    flags = np.zeros(setup.n_pixels, np.uint8)

    def flag(first: int, scratch: Scratch) -> None:
        n = min(pool.batch, setup.n_pixels - first)
        packets, hits = scratch.hit_rays.packets, scratch.hits
        flag_mirrors(setup.cams, c, setup.order, first, n, setup.world, packets, hits, flags)
        scratch.rays["pilot"] += n

    pool.run(flag, range(0, setup.n_pixels, pool.batch))
    return flags


def extra_mirror_hits(
    setup: FrameSetup, c: int, parts: tuple[Pass, ...], pool: TracePool, own: Int32, store: LightStore
) -> list[tuple[Int32, HitRecords]]:
    """Find and follow the additional native hits of mirror pixels.

    Args:
        parts: the native hits of eye c that all pixels have.
        store: of the light of what is found.
        own: (2, n_zone) overwritten: the number of native hits of each pixel, with even and with odd sample numbers.
    """
    first_sample = setup.unused_sample(c)
    extra = max(setup.mirror_hits - setup.fewest_hits(c), 0)
    own[:] = 0
    for part in parts:
        counts = half_sizes(part.first_sample, part.per_pixel)[:, None]
        if len(part.pixels) == setup.n_pixels:
            own += counts
        else:
            inside = setup.in_zone(part.pixels)
            own[:, inside[inside >= 0]] += counts
    if not extra:
        return []
    flags = mirror_flags(setup, c, pool)

    def find(task: tuple[PixelSamples, int], scratch: Scratch) -> list[tuple[Int32, HitRecords]]:
        samples, first = task
        n = min(pool.batch, len(samples.pixels) * extra - first)
        extra_hits(setup.cams, c, samples, first, n, setup.world, scratch.hit_rays.packets, scratch.hits)
        scratch.rays["mirror"] += n
        batch = Batch(setup=setup, c=c, hits=scratch.hits, n=n, scratch=scratch)
        for feature in setup.features:
            if feature.follows:
                feature.record(batch)
        return keep_reflected(reflected_hits(batch, own_columns(batch).get(TRANSMISSION, NO_GLASS)[0]), store, setup)

    drawn = [
        PixelSamples(setup.seed, pixels, extra, first_sample, setup.halves != 0)
        for pixels in setup.tile_rows(setup.order[flags[setup.order] > 0])
    ]
    tasks = [(some, first) for some in drawn for first in range(0, len(some.pixels) * extra, pool.batch)]
    found = pool.run(find, tasks)
    first_pixel = setup.zone.start * setup.cams.width
    own += half_sizes(first_sample, extra)[:, None] * flags[first_pixel : first_pixel + setup.n_zone]
    return [path for batch in found for path in batch]
