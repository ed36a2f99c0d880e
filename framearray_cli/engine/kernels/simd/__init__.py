"""Sixteen numbers at a time in kernels: one instruction computes all lanes of a ray packet.

LLVM vectorizes a plain loop only if it can prove that no array overlaps another. It cannot for loops that look things
up, so kernels that write packets use explicit vectors: `Lanes` of float32, float64, int32, uint8 or uint64, and flags,
with the operators of numbers. On processors with narrower registers LLVM splits the operations.

A function written with `select`, `gather`, `sqrt` and the like also works for single numbers.

Two things differ from single numbers. LLVM may fuse sums and products (one rounding instead of two), and `>>` shifts
int32 as bits, without the sign. Operands that do not fit together raise a typing error.
"""

from .access import (
    append,
    compress,
    gather,
    lanes_from,
    load,
    load_row,
    put_shorts,
    put_triples,
    row_at,
    scatter,
    shorts_from,
    store,
    store_columns,
    store_row,
    stored,
    triples_at,
    width_of_packets,
)
from .lanes import (
    LANES,
    Lanes,
    bits,
    ctz,
    doubles,
    floor,
    integers,
    lane_numbers,
    largest_of_lanes,
    popcount,
    product,
    reals,
    select,
    sqrt,
    sum_of_lanes,
    words,
)

__all__ = [
    "LANES",
    "Lanes",
    "append",
    "bits",
    "compress",
    "ctz",
    "doubles",
    "floor",
    "gather",
    "integers",
    "lane_numbers",
    "lanes_from",
    "largest_of_lanes",
    "load",
    "load_row",
    "popcount",
    "product",
    "put_shorts",
    "put_triples",
    "reals",
    "row_at",
    "scatter",
    "select",
    "shorts_from",
    "sqrt",
    "store",
    "store_columns",
    "store_row",
    "stored",
    "sum_of_lanes",
    "triples_at",
    "width_of_packets",
    "words",
]
