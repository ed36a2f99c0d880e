"""The terms of a batch of hits: obscurance W, what is the same under every light, and the irradiance of every light."""

from time import perf_counter

import numpy as np

from .arrays import Rgb
from .crew import Scratch
from .hits import ESCAPED, Hits
from .kernel import kernel
from .terms.direct import direct
from .terms.direct_steps import direct_by_steps
from .terms.obscurance import obscurance
from .work import Records, Work


def estimate_terms(
    work: Work, hits: Hits, n: int, scratch: Scratch, out: Records, obscurance_kind: str, shadow_kind: str
) -> None:
    """Estimate W, the constant part and E[l] of hits 0 to n - 1."""
    started = perf_counter()
    scratch.rays[obscurance_kind] += obscurance(
        hits, n, work.obscurance, work.surfaces, work.tracer, scratch.hit_rays, out.obscurance, scratch.skylight
    )
    middle = perf_counter()
    if scratch.steps is None:
        rays = direct(hits, n, work.lights, work.tracer, scratch.test_rays, out.irradiance)
    else:
        irradiance = out.irradiance if work.keeps_all else scratch.irradiance
        rays = direct_by_steps(
            hits, n, work.lights, work.shadow_step, work.shadow_unbiased, work.tracer, scratch.test_rays,
            scratch.steps, irradiance,
        )  # fmt: skip
        if not work.keeps_all:
            out.irradiance[:n] = irradiance[:n, :, work.kept.start : work.kept.stop]
    scratch.rays[shadow_kind] += rays
    _finish(hits, n, work.background, scratch.skylight, out.reflectivity, out.constant)
    scratch.seconds[obscurance_kind] += middle - started
    scratch.seconds[shadow_kind] += perf_counter() - middle


@kernel
def _finish(hits: Hits, n: int, background: Rgb, skylight: Rgb, reflectivity: Rgb, constant: Rgb) -> None:
    """Copy the reflectivity of n hits, and work out what of their light is the same whatever the lights do.

    Args:
        background: (3,) what escaped rays see.
        skylight: (n, 3) background that reaches each hit, or (0, 3).
        constant: (n, 3) overwritten, or (0, 3) where nothing is constant.
    """
    for i in range(n):
        for channel in range(3):
            reflectivity[i, channel] = hits.reflectivity[i, channel]
            if constant.shape[0]:
                seen = background[channel] if hits.kind[i] == ESCAPED else np.float32(0.0)
                if skylight.shape[0]:
                    seen += hits.reflectivity[i, channel] * skylight[i, channel]
                constant[i, channel] = seen
