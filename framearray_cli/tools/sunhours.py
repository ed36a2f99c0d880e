"""Hours of direct sun, from the images of a sun study: positions with direct light times the time between them.

The sun must be alone in a group of sources, whose images hold its direct light and nothing else; so light from cells
will not do, which they hold too. Light that a mirror
shows counts as well: the pixel shows a place in the sun.
"""

from dataclasses import dataclass
from datetime import datetime
from itertools import groupby, pairwise

import numpy as np

from framearray_cli.array.manifest import Manifest, ManifestGroup
from framearray_cli.array.pictures import Pictures, Positions, Relight
from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import counted

NO_LIGHT = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SunDay:
    """The light positions of one day.

    Attributes:
        date: "2026-06-21".
        lights: along the axis of the sun's group.
        step_h: hours from one to the next.
    """

    date: str
    lights: range
    step_h: float

    @property
    def most_h(self) -> float:
        """Hours of a place that is in the sun at all positions."""
        return len(self.lights) * self.step_h


def find_sun(manifest: Manifest) -> tuple[ManifestGroup, tuple[SunDay, ...]]:
    """Find the group of the sun, and the days of its positions.

    Raises:
        OutputError: there is no such group, the sun is not alone in it, its images hold indirect light too, or a day
            has only one position.
    """
    folder = manifest.directory
    if not manifest.uses_ambient:
        raise OutputError(
            f"{folder}: hours of sun need the direct light of a sun apart from all other light, and images with "
            'indirect.method = "cells" hold its indirect light too; render again with "obscurance"'
        )
    apart = 'render again with a source of type "sun" that has a group of its own, as in group = "sun"'
    found = [group for group in manifest.groups if any("time" in source for source in group.lights[0].sources)]
    if not found:
        what = "the direct light of a sun apart from all other light"
        lacks = "stores its light all together" if not manifest.groups else "has no group with a sun"
        raise OutputError(f"{folder}: hours of sun need {what}, and this array {lacks}; {apart}")
    group = found[0]
    if (n := len(group.lights[0].sources)) > 1:
        has = f'"{group.name}" has {counted(n, "source")}'
        raise OutputError(f"{folder}: hours of sun need a sun alone in its group, and {has}; {apart}")
    times = [datetime.fromisoformat(light.sources[0]["time"]) for light in group.lights]
    days, first = [], 0
    for date, each in groupby(times, key=datetime.date):
        moments = list(each)
        if len(moments) < 2:
            raise OutputError(f"{folder}: hours of sun need at least 2 light positions per day, got 1 on {date}")
        steps = [(b - a).total_seconds() / 3600 for a, b in pairwise(moments)]
        lights = range(first, first + len(moments))
        days.append(SunDay(date=date.isoformat(), lights=lights, step_h=float(np.median(steps))))
        first = lights.stop
    return group, tuple(days)


def sun_hours(pictures: Pictures, group: ManifestGroup, day: SunDay, c: int) -> Float32:
    """Return the hours of direct sun in each pixel of a camera, (h, w).

    Raises:
        OutputError: an image is missing or damaged.
    """
    manifest = pictures.manifest
    others = {name: NO_LIGHT for name in manifest.group_names if name != group.name}
    alone = Relight(groups=others, ambient=NO_LIGHT)
    hours = np.zeros(manifest.resolution[::-1], np.float32)
    for l in day.lights:
        positions: Positions = [float(l) if axis == group.axis else 0.0 for axis in manifest.axes]
        hours += (pictures.picture(c, positions, alone) > 0).any(axis=-1) * np.float32(day.step_h)
    return hours
