"""Frames of a job with its visible lamps, one after another: for arrays, previews, coarse arrays and trials."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from framearray_cli.base.arrays import Images
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.intensity import Ambient

from .plan import image_ambient
from .prepare import Prepared


def compose_frames(
    prepared: Prepared,
    setup: FrameSetup,
    ambient: Ambient,
    pool: TracePool,
    wanted: Sequence[int],
    images: Callable[[], Images],
    lights: range | None = None,
    *,
    exact: bool = False,
    found: Callable[[int], None] = lambda c: None,
) -> Iterator[tuple[Composed, Images]]:
    """Find the hits of some frames, and yield each composed frame as soon as its window is complete.

    Args:
        setup: for a block of light positions.
        ambient: for all light positions.
        wanted: frames in rising order.
        images: lends the array, (len(lights), height, width, 3), that a frame is composed in; yielded with the frame.
        lights: the block; None: all.
        exact: True if a frame that is too bright for an array of halves is composed again, in floats.
        found: called with each eye whose hits were found.
    """
    lights, i_a = lights or range(prepared.n_lights), image_ambient(ambient, prepared.lights)
    window = Window(setup, i_a.at(lights), pool)

    def compose(j: int, room: Images) -> Composed:
        composed = window.compose(j, room)
        composed.beyond += draw_visible(prepared, setup, j, lights, composed.images, pool)
        return composed

    for j in ready_frames(window, setup, wanted, pool, found):
        room = images()
        composed = compose(j, room)
        if composed.beyond and exact:
            composed = compose(j, np.empty(room.shape, np.float32))
        yield composed, room


def draw_visible(prepared: Prepared, setup: FrameSetup, c: int, planes: range, images: Images, pool: TracePool) -> int:
    """Draw the shapes of visible sources into the images of eye c; see `draw_lamps`. Nothing happens without any."""
    shown = [source for source in prepared.lights.sources if source.visible]
    if not shown:
        return 0
    from framearray_cli.engine.images.lamps import draw_lamps

    return draw_lamps(setup, shown, prepared.scene.centre, planes, c, images, pool)
