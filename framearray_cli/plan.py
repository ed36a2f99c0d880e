"""How many native hits each frame gets, and which pixels get more.

Every frame of the array is to rest on (2 N_r + 1) * hits hits a pixel. Frames at the ends of the path have fewer
neighbours: the frames that are missing are thought to be the path's own first or last ones, met again in reverse order,
and their native hits are given to those. So frame 0 of N_r = 3 has twice the hits, and so do frames 1 and 2.
"""

import numpy as np

from .arrays import Bytes, Int32
from .hits import Hits
from .kernel import kernel


def frame_hits(n_c: int, n_r: int, hits: int) -> Int32:
    """Native hits a pixel of each frame, (n_c,): `hits`, more where the window ends at the path's ends.

    The hits of any window [c - n_r, c + n_r] sum to at least (2 n_r + 1) * hits.
    """
    counts = np.zeros(n_c, np.int32)
    period = 2 * n_c
    for virtual in range(-n_r, n_c + n_r):
        k = virtual % period  # the path, there and back again
        counts[k if k < n_c else period - 1 - k] += hits
    return counts


@kernel
def flag_mirrors(hits: Hits, n: int, width: int, height: int, flags: Bytes) -> None:
    """Flag the pixels of mirror hits and their neighbours: a mirror's edge may pass beside the one ray that looked.

    Args:
        flags: (n_pixels,) set to 1 where a mirror may be seen.
    """
    for i in range(n):
        s = hits.specular[i]
        if s[0] > 0.0 or s[1] > 0.0 or s[2] > 0.0:
            x, y = hits.pixel[i] % width, hits.pixel[i] // width
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    flags[v * width + u] = 1
