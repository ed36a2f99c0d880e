"""Sixteen numbers at a time in kernels: the lanes of a ray packet, computed with one instruction each.

LLVM turns plain loops into such instructions only where it can prove that no array overlaps another, which it cannot
for loops that look things up. Kernels that write packets therefore say what they want: `Lanes` of float32, float64,
int32, uint8 or uint64, and flags, with the operators of numbers. On processors with narrower registers LLVM splits
the operations.

What is written with `select`, `gather`, `sqrt` and their like works for single numbers, too.

Two things differ from numbers one at a time: sums and products may be fused (one rounding instead of two), and whole
numbers are shifted to the right as bits, without their sign. What does not fit together is an error of typing.
"""

from .arithmetic import bits, ctz, doubles, floor, integers, lane_numbers, popcount, reals, select, sqrt, words
from .kinds import LANES, Lanes
from .memory import compress, gather, lanes_from, load, put_triples, scatter, store, stored, triples_at

__all__ = [
    "LANES",
    "Lanes",
    "bits",
    "compress",
    "ctz",
    "doubles",
    "floor",
    "gather",
    "integers",
    "lane_numbers",
    "lanes_from",
    "load",
    "popcount",
    "put_triples",
    "reals",
    "scatter",
    "select",
    "sqrt",
    "store",
    "stored",
    "triples_at",
    "words",
]
