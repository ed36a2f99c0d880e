"""What passes the glass between hits and eyes, and what glass mirrors."""

from time import perf_counter

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..hits.hits import Hits
from ..hits.views import dim_traced, panes_before, views_through
from ..inputs.marks import COVERED, PAIR, PANE
from .scratch import Scratch
from .setup import FrameSetup

NO_GLASS = np.empty((0, 3), np.float32)
MOST = 0.5  # of a hit
NO_PANE = np.empty((0, 2), np.float32)


def find_through(
    setup: FrameSetup,
    frames: range,
    hits: Hits,
    n: int,
    scratch: Scratch,
    pixel: Int32,
    through: Float32,
    front: Float32,
) -> None:
    """Find what share of the light of native hits 0 to n - 1 arrives in each frame, and the panes before them.

    Nothing is found without glass, and no panes unless mattes name them.

    Args:
        pixel: (n_frames, n) where the frames see the hits.
        through: (n_frames, n, 3) overwritten; front: (n_frames, n, 2), see `panes_before`.
    """
    if not setup.has_glass:
        return
    started = perf_counter()
    seen, found = np.ascontiguousarray(pixel), np.empty((len(frames), n, 3), np.float32)
    rays = views_through(setup.cams, frames.start, hits, n, seen, setup.world.panes, scratch.hit_rays, found)
    through[:] = found
    if setup.names_panes and setup.marks is not None:
        before, panes = np.empty((len(frames), n, 2), np.float32), setup.world.panes
        tables = setup.marks.pane_pair, setup.marks.whole
        rays += panes_before(setup.cams, frames.start, hits, n, seen, panes, scratch.hit_rays, found, *tables, before)
        front[:] = before
    scratch.rays["glass"] += rays
    scratch.seconds["visibility"] += perf_counter() - started


def own_view(setup: FrameSetup, c: int, hits: Hits, n: int, scratch: Scratch) -> tuple[Float32, Float32]:
    """What share of the light of hits 0 to n - 1 arrives at eye c, which found them, and the panes before them.

    Returns:
        (n, 3), (0, 3) without glass; and (n, 2), see `panes_before`, (0, 2) unless mattes name panes.
    """
    if not setup.has_glass:
        return NO_GLASS, NO_PANE
    found, pixel = np.empty((1, n, 3), np.float32), np.zeros((1, n), np.int32)
    front = np.empty((1, n if setup.names_panes else 0, 2), np.float32)
    find_through(setup, range(c, c + 1), hits, n, scratch, pixel, found, front)
    return found[0], front[0]


def hide_behind(front: Float32, marks: Float32) -> None:
    """Name the pane in the marks of hits on surfaces most of which it covers; for hits that fill holes.

    Args:
        front: see `own_view`.
        marks: (n, columns) changed.
    """
    if len(front):
        hidden = (front[:, COVERED] > MOST) & (marks[:, PAIR] >= 0)
        marks[hidden, PAIR] = front[hidden, PANE]


def dim_reflected(setup: FrameSetup, scratch: Scratch, n: int, tint: Float32) -> None:
    """Dim the n reflected rays that are still in `scratch.hit_rays`, by the glass before what they met.

    Args:
        tint: (>= n, 3) changed.
    """
    if setup.has_glass and n:
        shares = np.ones((1, n, 3), np.float32)
        scratch.rays["glass"] += dim_traced(setup.world.panes, scratch.hit_rays, n, shares)
        tint[:n] *= shares[0]
