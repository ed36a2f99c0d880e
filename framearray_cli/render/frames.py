"""Frames of a job with its visible lamps, one after another: for arrays, previews, coarse arrays and trials."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

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
from .rows import image_format

if TYPE_CHECKING:
    from framearray_cli.engine.images.lamps import Lamps


def compose_frames(
    prepared: Prepared,
    setup: FrameSetup,
    ambient: Ambient,
    pool: TracePool,
    wanted: Sequence[int],
    images: Callable[[], Images],
    lights: range | None = None,
    *,
    slices: Sequence[range] | None = None,
    found: Callable[[int], None] = lambda c: None,
    stops: Callable[[], bool] = lambda: False,
) -> Iterator[tuple[Composed, Images]]:
    """Find the hits of some frames, and yield each frame as soon as its window is complete, slice by slice.

    Rows that are too bright for halves are composed again in floats, unless the job stores halves always.

    Args:
        setup: for a block of light positions.
        ambient: for all light positions.
        wanted: frames in rising order.
        images: lends the array, (len(lights), most rows of a slice, width, 3), that rows are composed in; yielded with
            them.
        lights: the block; None: all.
        slices: rows that are composed together, from top to bottom; None: all at once.
        found, stops: see `ready_frames`.
    """
    lights, i_a = lights or range(prepared.n_lights), image_ambient(ambient, prepared.lights)
    window, exact = Window(setup, i_a.at(lights), pool), prepared.job.output.half == "auto"

    def compose(j: int, rows: range, room: Images, lamps: "Lamps | None") -> Composed:
        composed = window.compose(j, room, rows=rows)
        if lamps:
            composed.beyond += lamps.draw(composed.images, rows)
        return composed

    for j in ready_frames(window, setup, wanted, pool, found, stops):
        lamps = visible_lamps(prepared, setup, j, lights, pool)
        for rows in slices or [setup.rows]:
            room = images()
            shape = len(room), len(rows), *room.shape[2:]
            composed = compose(j, rows, room.reshape(-1)[: math.prod(shape)].reshape(shape), lamps)
            if composed.beyond and exact and room.dtype == np.float16:
                composed = compose(j, rows, np.empty(shape, np.float32), lamps)
            yield composed, room


def compose_all(
    prepared: Prepared, setup: FrameSetup, ambient: Ambient, frames: Sequence[int], *, floats: bool = False
) -> list[Composed]:
    """Compose some frames that are not written, each into memory of its own.

    Args:
        floats: True for images of floats, whatever the job writes.
    """
    shape = (prepared.n_lights, setup.cams.height, setup.cams.width, 3)
    halves = image_format(prepared.job).composes_halves and not floats

    def images() -> Images:
        return np.empty(shape, np.float16) if halves else np.empty(shape, np.float32)

    with TracePool(setup, prepared.threads) as pool:
        return [composed for composed, _ in compose_frames(prepared, setup, ambient, pool, frames, images)]


def visible_lamps(prepared: Prepared, setup: FrameSetup, c: int, planes: range, pool: TracePool) -> "Lamps | None":
    """Return the visible sources in the picture of eye c; None if a job has none."""
    shown = [source for source in prepared.lights.sources if source.visible]
    if not shown:
        return None
    from framearray_cli.engine.images.lamps import Lamps

    return Lamps(setup, shown, prepared.scene.centre, planes, c, pool)
