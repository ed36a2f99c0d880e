"""What passes the glass between hits and eyes, and what glass mirrors."""

from time import perf_counter

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..hits.hits import Hits
from ..hits.views import dim_traced, views_through
from .scratch import Scratch
from .setup import FrameSetup

NO_GLASS = np.empty((0, 3), np.float32)


def find_through(
    setup: FrameSetup, frames: range, hits: Hits, n: int, scratch: Scratch, pixel: Int32, through: Float32
) -> None:
    """Find what share of the light of native hits 0 to n - 1 arrives in each frame; nothing without glass.

    Args:
        pixel: (n_frames, n) where the frames see the hits.
        through: (n_frames, n, 3) overwritten.
    """
    if not setup.has_glass:
        return
    started = perf_counter()
    seen, found = np.ascontiguousarray(pixel), np.empty((len(frames), n, 3), np.float32)
    rays = views_through(setup.cams, frames.start, hits, n, seen, setup.lights.panes, scratch.hit_rays, found)
    through[:] = found
    scratch.rays["glass"] += rays
    scratch.seconds["visibility"] += perf_counter() - started


def own_view(setup: FrameSetup, c: int, hits: Hits, n: int, scratch: Scratch) -> Float32:
    """What share of the light of hits 0 to n - 1 arrives at eye c, which found them: (n, 3); (0, 3) without glass."""
    if not setup.has_glass:
        return NO_GLASS
    found, pixel = np.empty((1, n, 3), np.float32), np.zeros((1, n), np.int32)
    find_through(setup, range(c, c + 1), hits, n, scratch, pixel, found)
    own: Float32 = found[0]
    return own


def dim_reflected(setup: FrameSetup, scratch: Scratch, n: int, tint: Float32) -> None:
    """Dim the n reflected rays that are still in `scratch.hit_rays`, by the glass before what they met.

    Args:
        tint: (>= n, 3) changed.
    """
    if setup.has_glass and n:
        shares = np.ones((1, n, 3), np.float32)
        scratch.rays["glass"] += dim_traced(setup.lights.panes, scratch.hit_rays, n, shares)
        tint[:n] *= shares[0]
