"""Sixteen numbers at a time in kernels: one instruction computes all lanes of a ray packet.

LLVM vectorizes a plain loop only if it can prove that no array overlaps another. It cannot for loops that look things
up, so kernels that write packets use explicit vectors: `Lanes` of float32, float64, int32, uint8 or uint64, and flags,
with the operators of numbers. On processors with narrower registers LLVM splits the operations.

A function written with `select`, `gather`, `sqrt` and the like also works for single numbers.

Two things differ from single numbers. LLVM may fuse sums and products (one rounding instead of two), and `>>` shifts
int32 as bits, without the sign. Operands that do not fit together raise a typing error.
"""

from .access import append as append
from .access import compress as compress
from .access import gather as gather
from .access import lanes_from as lanes_from
from .access import load as load
from .access import load_row as load_row
from .access import put_shorts as put_shorts
from .access import put_triples as put_triples
from .access import row_at as row_at
from .access import scatter as scatter
from .access import shorts_from as shorts_from
from .access import store as store
from .access import store_columns as store_columns
from .access import store_row as store_row
from .access import stored as stored
from .access import triples_at as triples_at
from .access import width_of_packets as width_of_packets
from .lanes import LANES as LANES
from .lanes import Lanes as Lanes
from .lanes import bits as bits
from .lanes import ctz as ctz
from .lanes import doubles as doubles
from .lanes import floor as floor
from .lanes import integers as integers
from .lanes import lane_numbers as lane_numbers
from .lanes import largest_of_lanes as largest_of_lanes
from .lanes import popcount as popcount
from .lanes import product as product
from .lanes import reals as reals
from .lanes import select as select
from .lanes import sqrt as sqrt
from .lanes import sum_of_lanes as sum_of_lanes
from .lanes import words as words
