"""The frame loop [FA alg. 1]: find the hits of each eye once, and compose each frame as soon as its window is full."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence

from .frames.frame import find_frame
from .frames.pool import TracePool
from .frames.setup import FrameSetup
from .images.window import Window
from .terms.ambient.intensity import Ambient


def ready_frames(
    window: Window, setup: FrameSetup, wanted: Sequence[int], pool: TracePool,
    found: Callable[[int], None] = lambda eye: None, stops: Callable[[], bool] = lambda: False,
) -> Iterator[int]:  # fmt: skip
    """Find the hits that the wanted frames show, and yield each of these frames as soon as it can be composed.

    The caller may compose a frame more than once before it asks for the next one.

    Args:
        window: an empty one.
        wanted: frames in rising order.
        found: called with each eye whose hits were found; `stops`: called before each eye, True ends the frames.
    """
    waiting = deque(wanted)
    for eye in setup.eyes_for(wanted):
        if stops():
            return
        window.add(find_frame(setup, eye, pool))
        found(eye)
        while waiting and setup.eyes_of(waiting[0])[-1] <= eye:
            j = waiting.popleft()
            window.fill_holes(j)
            yield j
            window.drop(j, needed=setup.eyes_of(waiting[0])[0] if waiting else eye + 1)


def window_of(j: int, setup: FrameSetup, ambient: Ambient, pool: TracePool) -> Window:
    """A window that holds all hits that frame j shows."""
    window = Window(setup, ambient, pool)
    next(ready_frames(window, setup, [j], pool))
    return window
