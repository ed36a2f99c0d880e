"""What mirrors show: native hits followed from mirror to mirror; a reflected hit is a hit seen through a tint."""

from time import perf_counter

import numpy as np

from .arrays import Int32
from .crew import Crew, Scratch
from .eyehits import extra_hits, pilot_hits
from .hits import Hits
from .plan import Pass, flag_mirrors, halves_of
from .shading import estimate_terms
from .terms.specular import count_mirrors, reflect
from .work import Records, Work, empty_records


def mirror_paths(work: Work, hits: Hits, n: int, scratch: Scratch) -> list[tuple[Int32, Records]]:
    """Follow the mirrors among hits 0 to n - 1; a (pixels, records) pair a bounce."""
    found: list[tuple[Int32, Records]] = []
    if count_mirrors(hits, n) == 0:
        return found
    started = perf_counter()
    throughput = np.ones((n, 3), np.float32)
    for bounce in range(work.depth):
        m = count_mirrors(hits, n)
        if m == 0:
            break
        reflected, next_throughput = scratch.reflected[bounce % 2], scratch.throughput[bounce % 2]
        reflect(hits, n, throughput, work.surfaces, work.tracer, scratch.hit_rays.packets, reflected, next_throughput)
        scratch.rays["mirror"] += m
        hits, n, throughput = reflected, m, next_throughput
        records = empty_records(work, m)
        estimate_terms(work, hits, m, scratch, records, "mirror obscurance", "mirror shadow", throughput)
        found.append((hits.pixel[:m].copy(), records))
    scratch.seconds["mirror"] += perf_counter() - started
    return found


def extra_mirror_hits(
    work: Work, c: int, parts: tuple[Pass, ...], crew: Crew, own: Int32
) -> list[tuple[Int32, Records]]:
    """Follow the native hits that only mirror pixels have.

    Args:
        own: (2, n_pixels) overwritten: native hits of each pixel, of even and of odd sample numbers.
    """
    most = max((part.first_sample + part.per_pixel for part in parts), default=0)
    extra = max(work.mirror_hits - work.fewest_hits(c), 0)
    own[:] = 0
    for part in parts:
        counts = halves_of(part.first_sample, part.per_pixel)[:, None]
        if len(part.pixels) == work.n_pixels:
            own += counts
        else:
            own[:, part.pixels] += counts
    if not extra:
        return []
    flags = np.zeros(work.n_pixels, np.uint8)

    def look(first: int, scratch: Scratch) -> None:
        n = min(crew.batch, work.n_pixels - first)
        hits = scratch.hits
        pilot_hits(work.cams, c, work.order, first, n, work.surfaces, work.tracer, scratch.hit_rays.packets, hits)
        scratch.rays["pilot"] += n
        flag_mirrors(hits, n, work.cams.width, work.cams.height, flags)

    def follow(first: int, scratch: Scratch) -> list[tuple[Int32, Records]]:
        n = min(crew.batch, len(pixels) * extra - first)
        extra_hits(
            work.cams, c, work.seed, pixels, most, extra, first, n, work.surfaces, work.tracer,
            scratch.hit_rays.packets, scratch.hits, work.halves != 0,
        )  # fmt: skip
        scratch.rays["mirror"] += n
        return mirror_paths(work, scratch.hits, n, scratch)

    crew.run(look, range(0, work.n_pixels, crew.batch))
    pixels = work.order[flags[work.order] > 0]
    found = crew.run(follow, range(0, len(pixels) * extra, crew.batch))
    own += halves_of(most, extra)[:, None] * flags
    return [path for batch in found for path in batch]
