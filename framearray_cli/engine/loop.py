"""The frame loop [FA alg. 1]: the hits of every eye are found once, in the order of the path."""

from collections import deque
from collections.abc import Iterator, Sequence

from .frames.frame import find_frame
from .frames.setup import FrameSetup
from .frames.threads import TracePool
from .images.window import Window
from .terms.ambient.estimate import Ambient


def ready_frames(window: Window, setup: FrameSetup, wanted: Sequence[int], pool: TracePool) -> Iterator[int]:
    """Find the hits that the wanted frames show, and yield each of these frames as soon as it can be composed.

    A frame may be composed several times until the next one is asked for; then the window drops what no later frame
    shows.

    Args:
        window: an empty one.
        wanted: frames in rising order.
    """
    waiting = deque(wanted)
    for c in setup.frames_for(wanted):
        window.add(find_frame(setup, c, pool))
        while waiting and setup.frames_around(waiting[0], setup.n_r)[-1] <= c:
            j = waiting.popleft()
            window.fill_holes(j)
            yield j
            window.drop(j, needed=waiting[0] - setup.n_r if waiting else setup.n_frames)


def window_of(j: int, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> Window:
    """A window that holds all that frame j shows."""
    window = Window(setup, ambient, pool)
    next(ready_frames(window, setup, [j], pool))
    return window
