"""Hours of direct sun at hits: the light positions at which the sun reaches a hit, times the hours between them.

Sun hours have shadow rays of their own, so they depend on no other light and on no colour of a surface.
"""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Int32, Rgb, with_room
from framearray_cli.base.sundays import SunDay

from ..embree.packets import Tracer
from ..hits.hits import SURFACE, Hits
from ..hits.rays import Rays
from ..inputs.lights import LightArrays
from ..inputs.panes import Sight
from ..kernels.kernel import kernel
from .direct import direct

NO_SURFACE = np.float32(-1.0)  # instead of the hours of a ray that escaped


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SunStudy:
    """The sun of a study of sun hours.

    Attributes:
        lights: only the sun, in one channel, at all of its positions.
        days: of these positions.
    """

    lights: LightArrays
    days: tuple[SunDay, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SunScratch:
    """The arrays of one thread for hours of sun.

    Attributes:
        irradiance: (batch, 1, n_lights) of the sun.
        white: (batch, 3) ones: a reflectivity with which surfaces of all colours count.
        first: (n_days + 1,) first light position of each day, and the end; `step_h`: (n_days,) hours of a position.
    """

    irradiance: Float32
    white: Rgb
    first: Int32
    step_h: Float32


def room_for_sun(study: SunStudy, batch: int) -> SunScratch:
    """Allocate arrays for batches of hits."""
    ends = [day.lights.start for day in study.days] + [study.days[-1].lights.stop]
    return SunScratch(
        irradiance=with_room((batch, 1, study.lights.n_lights), np.float32),
        white=with_room((batch, 3), np.float32, fill=1),
        first=np.array(ends, np.int32),
        step_h=np.array([day.step_h for day in study.days], np.float32),
    )


def find_sun_hours(
    hits: Hits, n: int, study: SunStudy, tracer: Tracer, rays: Rays, scratch: SunScratch, hours: Float32
) -> int:
    """Count the hours of direct sun per day at hits 0 to n - 1, and return the number of rays.

    A hit of a sun with a size meets one point of its disc, so that the mean over hits is the share of the disc.

    Args:
        rays: scratch; see `direct`.
        hours: (>= n, n_days) overwritten; NO_SURFACE where the ray escaped.
    """
    traced: int = direct(
        hits._replace(reflectivity=scratch.white), n, study.lights, Sight(tracer), rays, scratch.irradiance, True
    )
    _count_hours(hits.kind, n, scratch.irradiance, scratch.first, scratch.step_h, hours)
    return traced


@kernel
def _count_hours(kind: Bytes, n: int, irradiance: Float32, first: Int32, step_h: Float32, hours: Float32) -> None:
    """Sum the hours of the lit positions of each day, see `SunScratch`."""
    for i in range(n):
        for day in range(step_h.shape[0]):
            lit = 0
            for l in range(first[day], first[day + 1]):
                lit += 1 if irradiance[i, 0, l] > 0.0 else 0
            hours[i, day] = np.float32(lit) * step_h[day] if kind[i] == SURFACE else NO_SURFACE
