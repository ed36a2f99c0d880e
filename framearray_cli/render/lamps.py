"""Visible sources of a job, drawn into its composed images."""

from framearray_cli.base.arrays import Images
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup

from .prepare import Prepared


def draw_visible(prepared: Prepared, setup: FrameSetup, c: int, planes: range, images: Images, pool: TracePool) -> int:
    """Draw the shapes of visible sources into the images of eye c; see `draw_lamps`. Nothing happens without any."""
    shown = [source for source in prepared.lights.sources if source.visible]
    if not shown:
        return 0
    from framearray_cli.engine.images.lamps import draw_lamps

    return draw_lamps(setup, shown, prepared.scene.centre, planes, c, images, pool)
