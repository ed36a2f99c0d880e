"""How many native hits each frame gets, and which pixels get more or fewer.

Every frame of the array is to rest on (2 N_r + 1) * hits hits a pixel. Frames at the ends of the path have fewer
neighbours: the frames that are missing are thought to be the path's own first or last ones, met again in reverse order,
and their native hits are given to those. So frame 0 of N_r = 3 has twice the hits, and so do frames 1 and 2.

Fewer than one hit a pixel, 1/m, means a hit in every m-th pixel, in other pixels each frame.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from framearray_cli.base.arrays import Float64, Int32

# The smallest share of pixels that may get a hit in a frame is one in this many.
SPARSEST = 8


def frame_hits(n_c: int, n_r: int, hits: float) -> Float64:
    """Native hits a pixel of each frame, (n_c,): `hits`, more where the window ends at the path's ends.

    The hits of any window [c - n_r, c + n_r] sum to at least (2 n_r + 1) * hits.
    """
    # the path, there and back again
    virtual = np.arange(-n_r, n_c + n_r) % (2 * n_c)
    counts: Float64 = np.bincount(np.minimum(virtual, 2 * n_c - 1 - virtual), minlength=n_c).astype(np.float64)
    counts *= hits
    return counts


def turns(hits: float) -> int:
    """After how many frames every pixel had a native hit: m for 1/m hits, 1 for whole ones."""
    return Fraction(hits - int(hits)).limit_denominator(SPARSEST).denominator


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pass:
    """Some native hits of a frame: `per_pixel` in each of `pixels`.

    Attributes:
        pixels: in the order in which they are traced.
        first_sample: sample number of the first hit of each pixel.
        first_hit: number of the pass's first hit in the frame.
    """

    pixels: Int32
    per_pixel: int
    first_sample: int
    first_hit: int

    @property
    def n(self) -> int:
        """Number of hits."""
        return len(self.pixels) * self.per_pixel


def passes(order: Int32, width: int, c: int, per_pixel: float) -> tuple[Pass, ...]:
    """Native hits of frame c: whole ones for every pixel, then one for the share of pixels that a fraction asks for.

    Args:
        order: (n_pixels,) every pixel once, in the order of tracing.
        per_pixel: hits a pixel, a multiple of 1/m with m at most `SPARSEST`.
    """
    whole = int(per_pixel)
    share = Fraction(per_pixel - whole).limit_denominator(SPARSEST)
    found = [Pass(pixels=order, per_pixel=whole, first_sample=0, first_hit=0)] if whole else []
    if share:
        m = share.denominator
        # a step of about m / golden ratio from row to row spreads the pixels of one frame, one of 1 those of the frames
        row_step = max(1, round(m * 0.382))
        turn = (order % width + row_step * (order // width) + c) % m
        some = np.ascontiguousarray(order[turn < share.numerator])
        found.append(Pass(pixels=some, per_pixel=1, first_sample=whole, first_hit=whole * len(order)))
    return tuple(found)


def passes_of_counts(order: Int32, counts: Int32) -> tuple[Pass, ...]:
    """The native hits of a frame whose pixels have different numbers of them: a pass for each number.

    Args:
        order: (n_pixels,) every pixel once, in the order of tracing.
        counts: (n_pixels,) hits of each pixel.
    """
    in_order, found, first_hit = counts[order], [], 0
    for count in np.unique(counts[counts > 0]).tolist():
        pixels = np.ascontiguousarray(order[in_order == count])
        found.append(Pass(pixels=pixels, per_pixel=count, first_sample=0, first_hit=first_hit))
        first_hit += found[-1].n
    return tuple(found)


def halves_of(first: int, n: int) -> Int32:
    """How many of the samples first to first + n - 1 have an even number, and how many an odd one: (2,)."""
    even = (first + n + 1) // 2 - (first + 1) // 2
    return np.array([even, n - even], np.int32)
