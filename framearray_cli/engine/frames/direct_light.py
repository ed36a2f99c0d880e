"""Direct light E[l] of a batch of hits, by all its ways; and of hits on glossy surfaces, which source it came from."""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..hits.gloss import keep_gloss, keep_light, keep_lit
from ..hits.hits import Hits
from ..inputs.lights import LightArrays
from ..terms.direct import direct
from ..terms.environments import has_environments, see_environments
from ..terms.looks import look_around, looking
from .records import HitRecords
from .scratch import Scratch
from .setup import FrameSetup


def estimate_direct(setup: FrameSetup, hits: Hits, n: int, scratch: Scratch, out: HitRecords, throughput: Rgb) -> int:
    """Estimate E[l] of hits 0 to n - 1, and keep what their gloss needs; return the number of rays.

    Args:
        throughput: see `estimate_terms`.
    """
    neighbours = not len(throughput)  # behind mirrors hits lie apart
    if setup.shiny:
        keep_gloss(hits, n, scratch.alpha, scratch.metal, throughput, setup.has_glass, out.gloss)
    if scratch.by_source:
        rays = _by_source(setup, hits, n, scratch, out, neighbours)
    else:
        rays = _drawn(setup, setup.lights, hits, n, scratch, out.irradiance, neighbours)
        if setup.shiny:
            _keep(setup, out.irradiance, n, 0, out)
    if has_environments(setup.lights):
        if not setup.has_glass:
            rays += look_around(hits, n, looking(setup.lights), setup.world.tracer, scratch.test_rays, out.irradiance)
        see_environments(hits, n, setup.lights, scratch.test_rays, out.irradiance)
    return rays


def _by_source(setup: FrameSetup, hits: Hits, n: int, scratch: Scratch, out: HitRecords, neighbours: bool) -> int:
    """Add the light of one source after the other, and note which gives any."""
    rays, light = 0, scratch.of_source
    out.irradiance[:n] = 0.0
    for s, source in enumerate(scratch.by_source):
        if source.lit.any():
            rays += _drawn(setup, source, hits, n, scratch, light, neighbours)
            _keep(setup, light, n, s, out)
            out.irradiance[:n] += light[:n]
    return rays


def _keep(setup: FrameSetup, irradiance: Float32, n: int, s: int, out: HitRecords) -> None:
    """Keep what the gloss of hits 0 to n - 1 needs of the light of source s."""
    if setup.has_glass:
        keep_light(irradiance, n, s, out.gloss)
    else:
        keep_lit(irradiance, n, s, out.gloss.view(np.int32))


def _drawn(
    setup: FrameSetup, lights: LightArrays, hits: Hits, n: int, scratch: Scratch, irradiance: Float32, neighbours: bool
) -> int:
    """Estimate E[l] of the points that hits draw of sources."""
    lights = looking(lights) if has_environments(lights) and not setup.has_glass else lights
    rays: int = direct(hits, n, lights, setup.world.sight, scratch.test_rays, irradiance, neighbours)
    return rays
