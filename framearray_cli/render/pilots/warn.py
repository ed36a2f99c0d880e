"""All warnings of a job, from its values and from pilots."""

from collections.abc import Iterator

import numpy as np

from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient

from ..prepare import Prepared
from .indirect import indirect_warnings
from .levels import level_warnings
from .reached import dark_light_positions, light_warnings
from .seen import bounds, buried_eyes, buried_warnings, crossing_warnings, empty_warnings, unseen_eyes
from .typed import layer_warnings, range_warnings, typed_warnings
from .views import Views, render_views


def find_warnings(prepared: Prepared, setup: FrameSetup, ambient: Ambient) -> tuple[str, ...]:
    """Render pilots, and describe what would make an array useless: number, place and remedy.

    No image depends on it.

    Args:
        setup: for all light positions.
        ambient: for all light positions.
    """
    views = render_views(prepared, setup, ambient)
    return (*indirect_warnings(prepared.job, setup, ambient.accuracy), *_warnings(views, prepared, setup))


def _warnings(views: Views, prepared: Prepared, setup: FrameSetup) -> Iterator[str]:
    job = prepared.job
    yield from typed_warnings(job)
    yield from layer_warnings(job, prepared.scene)
    yield from empty_warnings(views, prepared)
    empty, buried = unseen_eyes(views), buried_eyes(views)
    if empty.all():
        return
    yield from buried_warnings(views, prepared)
    yield from crossing_warnings(setup, prepared)
    low, high = bounds(prepared)
    yield from range_warnings(job, float(np.linalg.norm(high - low)), views.distance[views.surface])
    if (empty | buried).all():
        return
    lights = list(light_warnings(views, setup, prepared))
    yield from lights
    named = dark_light_positions(views) & bool(lights)
    yield from level_warnings(views, setup, prepared, ~(empty | buried), named)
