"""Hours of direct sun, a layer: the light positions at which the sun reaches a hit, times the hours between them.

Hits have shadow rays of their own for it, so that no other light and no colour of a surface plays a part.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Addresses, Bytes, Float32, Int32, Rgb, with_room
from framearray_cli.base.sundays import TOTAL, SunDay

from ..frames.records import Column, FrameHits, StoredLight
from ..frames.setup import RAYS, Batch, Composer, Feature, FrameSetup, PixelTask
from ..hits.hits import SURFACE
from ..hits.rays import Rays, room_for_tests
from ..images.accumulate import row_of, weight_of
from ..images.sourcelists import ORDER, START
from ..inputs.lights import LightArrays
from ..inputs.panes import Sight
from ..kernels.kernel import integer_at, kernel, real_at
from ..terms.direct import direct

NO_SURFACE = np.float32(-1.0)  # instead of the hours of a ray that escaped


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SunRoom:
    """The arrays of one thread.

    Attributes:
        rays: see `direct`.
        irradiance: (batch, 1, n_lights) of the sun.
        white: (batch, 3) ones: a reflectivity with which surfaces of all colours count.
    """

    rays: Rays
    irradiance: Float32
    white: Rgb


class SunHours(Feature):
    """The sun whose hours are counted.

    Attributes:
        lights: only the sun, in one channel, at all of its positions.
        days: of these positions.
    """

    name = "sun_hours"
    is_layer = True

    def __init__(self, lights: LightArrays, days: tuple[SunDay, ...]) -> None:
        self.lights, self.days, self.shadow_rays = lights, days, lights.n_lights
        self.layer_bytes = 4 * (len(days) + 1)
        ends = [day.lights.start for day in days] + [days[-1].lights.stop]
        self._first = np.array(ends, np.int32)  # light position of each day, and the end
        self._step_h = np.array([day.step_h for day in days], np.float32)  # hours of a position

    def columns(self, light: StoredLight, *, mirrored: bool) -> tuple[Column, ...]:
        return () if mirrored else (Column(self.name, (len(self.days),)),)

    def room(self, setup: FrameSetup, batch: int) -> SunRoom:
        return SunRoom(
            rays=room_for_tests(RAYS, self.lights.n_lights),
            irradiance=with_room((batch, 1, self.lights.n_lights), np.float32),
            white=with_room((batch, 3), np.float32, fill=1),
        )

    def shade(self, batch: Batch) -> None:
        """Count the hours of direct sun per day at hits; NO_SURFACE where the ray escaped.

        A hit of a sun with a size meets one point of its disc, so that the mean over hits is the share of the disc.
        """
        if not batch.owns(self.name):
            return
        n, room, sight = batch.n, batch.room(self), Sight(batch.setup.world.tracer)
        hits = batch.hits._replace(reflectivity=room.white)
        batch.count("shadow", direct(hits, n, self.lights, sight, room.rays, room.irradiance, True))
        _count_hours(hits.kind, n, room.irradiance, self._first, self._step_h, batch.column(self.name))

    def composer(self, frame: FrameHits, shown: range) -> Composer:
        return _SunComposer(self.days, len(shown))


class _SunComposer(Composer):
    """Hours of sun of the pixels of a frame: the mean over the hits on surfaces."""

    def __init__(self, days: tuple[SunDay, ...], n_pixels: int) -> None:
        self._days, self._hours = days, np.empty((n_pixels, len(days)), np.float32)

    def compose(self, task: PixelTask) -> None:
        average_sun_hours(task.hits, task.first, task.n, task.columns[SunHours.name], self._hours)

    def layers(self, means: Float32, samples: Int32, shape: tuple[int, ...]) -> Mapping[str, Any]:
        """The hours of each day by its date, and their sum TOTAL."""
        hours, name = self._hours, SunHours.name
        found = {f"{name}.{TOTAL}": hours.sum(axis=1, dtype=np.float32).reshape(shape)}
        return found | {f"{name}.{day.date}": hours[:, k].reshape(shape) for k, day in enumerate(self._days)}


@kernel
def _count_hours(kind: Bytes, n: int, irradiance: Float32, first: Int32, step_h: Float32, hours: Float32) -> None:
    """Sum the hours of the lit positions of each day.

    Args:
        irradiance: (>= n, 1, n_lights) of the sun.
        first: (n_days + 1,) first light position of each day, and the end; `step_h`: (n_days,) hours of a position.
        hours: (>= n, n_days) overwritten.
    """
    for i in range(n):
        for day in range(step_h.shape[0]):
            lit = 0
            for l in range(first[day], first[day + 1]):
                lit += 1 if irradiance[i, 0, l] > 0.0 else 0
            hours[i, day] = np.float32(lit) * step_h[day] if kind[i] == SURFACE else NO_SURFACE


@kernel
def average_sun_hours(sources: Addresses, first_pixel: int, n: int, column: int, out: Float32) -> None:
    """Average the hours of sun of pixels first_pixel to first_pixel + n - 1.

    Args:
        sources: of a `SourceList` with native and outer hits; `column`: the column of hours.
        out: (n_pixels, n_days) overwritten in these pixels; 0 where no hit is on a surface.
    """
    days = out.shape[1]
    for pixel in range(first_pixel, first_pixel + n):
        # --- loop state ---
        weight = np.float32(0.0)  # sum of w over hits on surfaces
        for day in range(days):
            out[pixel, day] = 0.0  # sum of w times hours

        for s in range(sources.shape[0]):
            listed = sources[s]
            if listed[START] == 0:  # no list, but a source of the one before
                continue
            for entry in range(integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)):
                hit = integer_at(listed[ORDER], entry)
                hours = sources[row_of(listed, s, entry)][column] + 4 * days * hit
                if real_at(hours, 0) < 0.0:  # NO_SURFACE
                    continue
                w = weight_of(listed, entry, hit)
                weight += w
                for day in range(days):
                    out[pixel, day] += w * real_at(hours, day)

        if weight > 0.0:
            for day in range(days):
                out[pixel, day] /= weight
