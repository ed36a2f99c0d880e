"""The marks of hits, see `inputs/marks.py`, from the rays that found them."""

import numpy as np

from framearray_cli.base.arrays import CornerUvs, Float32, Int32, Points

from ..embree.packets import MISS, Tracer, U, V, hit_triangle
from ..inputs.marks import PAIR, POSITION, UV
from ..kernels.kernel import kernel
from ..kernels.simd import width_of_packets


@kernel
def record_marks(
    pair: Int32, uvs: CornerUvs, tracer: Tracer, packets: Float32, n: int, position: Points, marks: Float32
) -> None:
    """Write the marks of what traced rays 0 to n - 1 met.

    Args:
        pair, uvs: of `Marks`; uvs may be empty: texture coordinates are 0.
        position: (>= n, 3) of the hits.
        marks: (n, columns) overwritten.
    """
    width = width_of_packets()
    for i in range(n):
        for column in range(marks.shape[1]):
            marks[i, column] = 0.0
        triangle = hit_triangle(tracer, packets, i)
        if triangle == MISS:
            marks[i, PAIR] = -1.0
            continue
        marks[i, PAIR] = pair[triangle]
        if marks.shape[1] > POSITION:
            for axis in range(3):
                marks[i, POSITION + axis] = position[i, axis]
        if marks.shape[1] > UV and uvs.shape[0] > 0:
            u, v = packets[i // width, U, i % width], packets[i // width, V, i % width]
            w = np.float32(1.0) - u - v
            for axis in range(2):
                a, b, c = uvs[triangle, 0, axis], uvs[triangle, 1, axis], uvs[triangle, 2, axis]
                marks[i, UV + axis] = w * a + u * b + v * c
