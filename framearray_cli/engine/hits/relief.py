"""Turn the shading normals of hits by normal maps; kernels of scenes without such maps do not contain this."""

import numpy as np

from framearray_cli.base.arrays import Directions, Float32

from ..embree.packets import Tracer, decode_hits
from ..inputs.surfaces import Relief, mapped_normal
from ..kernels.kernel import optional_step
from ..kernels.simd import LANES, gather, popcount, put_triples, select, triples_at


@optional_step("relief")
def turn_normals(
    relief: Relief, tracer: Tracer, packets: Float32, n: int, geometric: Directions, shading: Directions
) -> int:
    """Overwrite the shading normals of hits 0 to n - 1 whose material has a normal map.

    Args:
        packets: the traced rays of the hits.
        geometric, shading: see `Hits`.

    Returns:
        0.
    """
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        texture = gather(relief.texture, gather(relief.surfaces.material, triangle))
        mapped = ~missed & (texture >= np.int32(0))
        if popcount(mapped) > 0:
            g, m = triples_at(geometric, i), triples_at(shading, i)
            x, y, z = mapped_normal(relief, triangle, select(mapped, texture, np.int32(0)), u, v, g, m)
            put_triples(shading, i, select(mapped, x, m[0]), select(mapped, y, m[1]), select(mapped, z, m[2]))
    return 0
