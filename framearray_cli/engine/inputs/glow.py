"""Surfaces that send out light although no source of the job names them: they are seen, and light nothing."""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Int32, Rgb
from framearray_cli.scene.paths.paths import Lights
from framearray_cli.scene.scene import Scene

from .emitters import NONE, Emitters
from .surfaces import surfaces


class Glow(NamedTuple):
    """What is seen of such surfaces.

    Attributes:
        emitters: with one "source" per material, and no triangles to draw points of; NONE where nothing glows.
        radiance: (n, 3) of each, which multiplies its texture.
    """

    emitters: Emitters
    radiance: Rgb


NO_GLOW = Glow(NONE, np.empty((0, 3), np.float32))


def glow(scene: Scene, lights: Lights, *, as_file: bool) -> Glow:
    """Find the materials of a scene that emit, and are those of no source; none unless surfaces follow the file."""
    if not as_file:
        return NO_GLOW
    sources = {source.emitter.material for source in lights.sources if source.emitter}
    named = np.array([name in sources for name in scene.material_names])
    rows = np.flatnonzero((scene.emission > 0).any(axis=1) & ~named & np.isin(np.arange(len(named)), scene.material))
    if not len(rows):
        return NO_GLOW
    source = np.full(len(named), -1, np.int32)
    source[rows] = np.arange(len(rows))
    back = np.where(scene.one_sided[rows] > 0, 1, -1).astype(np.float32)
    seen = NONE._replace(
        back=back, source=source, texture=scene.emission_texture, surfaces=surfaces(scene),
        normal=np.empty((0, 3), np.float32), span=np.zeros((len(rows), 2), np.int32),
    )  # fmt: skip
    return Glow(seen, np.ascontiguousarray(scene.emission[rows]))


def glowing(glow: Glow) -> Int32:
    """The materials that are seen shining."""
    return np.flatnonzero(glow.emitters.source >= 0).astype(np.int32)


def glows(glow: Glow) -> bool:
    """Whether anything is seen shining that is no source."""
    return len(glow.radiance) > 0
