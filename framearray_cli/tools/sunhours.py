"""Hours of direct sun of a sun study: a layer of its array, or counted in its images.

In images they are the positions with direct light times the time between them. The sun must be the only source of a
group, whose images hold its direct light and nothing else; so `indirect.method` must be "obscurance": with the other
methods images hold indirect light too.
There light that a mirror shows counts: the pixel shows a place in the sun. The layer holds the hours of the mirror.
"""

from collections.abc import Callable
from datetime import datetime

import numpy as np

from framearray_cli.array.images import SUN_HOURS, read_layers
from framearray_cli.array.manifest import Manifest, ManifestGroup, layers_path
from framearray_cli.array.moments import axis_moments
from framearray_cli.array.pictures import Pictures, Positions, Relight
from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.sundays import SunDay, short_days, sun_days
from framearray_cli.base.units import counted

NO_LIGHT = (0.0, 0.0, 0.0)
ReadHours = Callable[[SunDay, int], Float32]  # of a day and a camera, (h, w)


def open_sun_hours(manifest: Manifest) -> tuple[tuple[SunDay, ...], ReadHours]:
    """Return the days of a sun study, and what reads the hours of one: the layer where there is one, else the images.

    Raises:
        OutputError: there is no layer, and the images do not hold what hours of sun need, see `find_sun`.
    """
    if manifest.has_sun_hours:
        if moments := next(iter(axis_moments(manifest).values()), ()):
            return sun_days(moments), lambda day, c: read_sun_hours(manifest, day, c)
        raise OutputError(f"{manifest.directory}: expected the times of a sun beside its hours, found none")
    group, days = find_sun(manifest)
    pictures = Pictures(manifest)
    return days, lambda day, c: sun_hours(pictures, group, day, c)


def read_sun_hours(manifest: Manifest, day: SunDay, c: int) -> Float32:
    """Read the layer of hours of direct sun of a camera, (h, w).

    Raises:
        OutputError: the file is missing or damaged, or holds no hours of that day.
    """
    path, name = layers_path(manifest, c), f"{SUN_HOURS}.{day.date}"
    found = read_layers(path).get(name)
    if found is None:
        raise OutputError(f"{path}: expected the channel {name}, found none")
    if found.shape != manifest.resolution[::-1]:
        size, (width, height) = found.shape, manifest.resolution
        raise OutputError(f"{path}: expected {width} x {height} pixels, got {size[1]} x {size[0]}")
    return found


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
            'indirect.method = "cells" hold its indirect light too; render again with '
            "output.sun_hours = true"
        )
    apart = (
        'render again with output.sun_hours = true, or with a source of type "sun" that has a group of its own, as in '
        'group = "sun"'
    )
    found = [group for group in manifest.groups if any("time" in source for source in group.lights[0].sources)]
    if not found:
        what = "the direct light of a sun apart from all other light"
        lacks = "stores its light all together" if not manifest.groups else "has no group with a sun"
        raise OutputError(f"{folder}: hours of sun need {what}, and this array {lacks}; {apart}")
    group = found[0]
    if (n := len(group.lights[0].sources)) > 1:
        has = f'"{group.name}" has {counted(n, "source")}'
        raise OutputError(f"{folder}: hours of sun need a sun alone in its group, and {has}; {apart}")
    days = sun_days([datetime.fromisoformat(light.sources[0]["time"]) for light in group.lights])
    if short := short_days(days):
        raise OutputError(f"{folder}: hours of sun need {short}")
    return group, days


def sun_hours(pictures: Pictures, group: ManifestGroup, day: SunDay, c: int) -> Float32:
    """Count the hours of direct sun in each pixel of a camera, (h, w).

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
