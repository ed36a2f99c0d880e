"""The terms of a batch of hits: obscurance W, what is the same under every light, and the irradiance of every light."""

from time import perf_counter

from .crew import Scratch
from .hits import ESCAPED, Hits
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
    out.reflectivity[:n] = hits.reflectivity[:n]
    if work.has_constant:
        seen = (hits.kind[:n, None] == ESCAPED) * work.background
        out.constant[:n] = seen + hits.reflectivity[:n] * scratch.skylight[:n] if work.obscurance.sky else seen
    scratch.seconds[obscurance_kind] += middle - started
    scratch.seconds[shadow_kind] += perf_counter() - middle
