"""Where within a pixel a hit lies, for weights by area (`engine/images/area.py`).

A place is a byte: the pixel's box is cut into 16 x 16 parts, and a place is 16 row + column.
"""

import numpy as np

from framearray_cli.base.arrays import Int32

from ..inputs.cameras import Cameras, corner_of, project
from ..kernels.kernel import kernel
from ..kernels.simd import LANES, load, select, store, triples_at
from .aiming import PARTS, part_of, place_within
from .hits import SURFACE, Hits


@kernel
def find_places(cams: Cameras, first_frame: int, hits: Hits, n: int, pixel: Int32, place: Int32) -> None:
    """Find where hits 0 to n - 1 lie in the pixels of frames first_frame, first_frame + 1, ...

    Args:
        pixel: (n_frames, >= n, a multiple of LANES) the pixel of each frame that sees the hit, or OUTSIDE.
        place: of the same shape, overwritten; arbitrary where the frame does not see the hit.
    """
    for row in range(pixel.shape[0]):
        j = first_frame + row
        o = cams.position
        for i in range(0, n, LANES):
            # P - O_j, or the direction of an escaped ray
            x, y, z = triples_at(hits.position, i)
            from_eye = select(load(hits.kind, i) == np.uint8(SURFACE), np.float32(1.0), np.float32(0.0))
            dx, dy, dz = x - from_eye * o[j, 0], y - from_eye * o[j, 1], z - from_eye * o[j, 2]
            across, down, _ = project(cams, j, dx, dy, dz)
            # rounding at a border may put a hit just outside the pixel that it belongs to
            of_pixel, at = load(pixel, row * pixel.shape[1] + i), row * place.shape[1] + i
            left, top = corner_of(cams, of_pixel)
            column, line = part_of(across - left), part_of(down - top)
            store(place, at, line * np.int32(PARTS) + column)
            place_within(cams, j, hits, i, at, of_pixel, place)
