"""Hours of direct sun of a sun study, from a layer of its array or counted in its images, and a sheet of them.

In images, hours are the positions with direct light times the time between them. The sun must be the only source of a
group, whose images have its direct light and nothing else; so `indirect.method` must be "obscurance": with the other
methods images have indirect light too. Light that a mirror shows counts there, as the pixel shows a place in the sun.
The layer has the hours of the mirror.
"""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np

from framearray_cli.array.images import DATA, FOR_SCREENS, SUN_HOURS, area_mean, read_channels
from framearray_cli.array.manifest import Manifest, ManifestGroup, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.moments import axis_moments
from framearray_cli.array.pictures import Pictures, Positions, Relight
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.sundays import SunDay, short_days, sun_days
from framearray_cli.base.units import counted

from . import Progress
from .contactsheet import (
    MOST_COLUMNS,
    WIDTH,
    SheetSummary,
    choose_columns,
    sheet_format,
    tile_size,
    write_drawn,
    write_linear,
)
from .drawing import draw_scale, draw_sheet

NO_LIGHT = (0.0, 0.0, 0.0)
ReadHours = Callable[[SunDay, int], Float32]  # of a day and a camera, (h, w)
# sRGB codes from no sun to most: lightness rises evenly, so that the order is seen without the colours.
RAMP = np.array([[16, 16, 32], [56, 44, 120], [140, 50, 120], [224, 96, 70], [250, 176, 70], [252, 250, 190]])


def open_sun_hours(manifest: Manifest) -> tuple[tuple[SunDay, ...], ReadHours]:
    """Return the days of a sun study, and what reads the hours of one: the layer where there is one, else the images.

    Raises:
        OutputError: there is no layer, and the images lack the data for hours of sun, see `find_sun`.
    """
    if manifest.has_sun_hours:
        if moments := next(iter(axis_moments(manifest).values()), ()):
            return sun_days(moments), lambda day, c: read_sun_hours(manifest, day, c)
        raise OutputError(f"{manifest.directory}: expected the times of a sun next to its hours, found none")
    group, days = find_sun(manifest)
    pictures = Pictures(manifest)
    return days, lambda day, c: sun_hours(pictures, group, day, c)


def read_sun_hours(manifest: Manifest, day: SunDay, c: int) -> Float32:
    """Read the layer of hours of direct sun of a camera, (h, w).

    Raises:
        OutputError: the file is missing or damaged, or has no hours of that day.
    """
    return read_channels(layers_path(manifest, c), [f"{SUN_HOURS}.{day.date}"], manifest.resolution)[..., 0]


def find_sun(manifest: Manifest) -> tuple[ManifestGroup, tuple[SunDay, ...]]:
    """Find the group of the sun, and the days of its positions.

    Raises:
        OutputError: there is no such group, the sun is not alone in it, its images have indirect light too, or a day
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


def make_sun_sheet(
    out: Path,
    target: Path,
    cameras: str | None = None,
    columns: int = MOST_COLUMNS,
    width: int = WIDTH,
    *,
    progress: Progress = lambda done, total: None,
    dry_run: bool = False,
) -> SheetSummary:
    """Draw a sheet of hours of direct sun; EXR and TIFF contain the hours themselves, in all channels.

    Args:
        out: output folder of a render of a sun study, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        cameras: places along the camera path, one per column; None: a few, evenly spaced.
        columns: the number of cameras, at most, where they are not named.
        width: of the sheet, at most, pixels.
        progress: called after each camera and day.
        dry_run: check everything but the images, and write nothing; the size is then (0, 0).

    Raises:
        JobError: a place is unknown, or images would be too small at that width.
        OutputError: the array lacks the data for hours of sun, or a file cannot be read or written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format, manifest = sheet_format(target, 0.0), read_manifest(out)
    days, read = open_sun_hours(manifest)
    chosen = choose_columns(manifest, cameras, columns)
    labels = [day.date for day in days] if image_format.format in FOR_SCREENS else []
    tile = tile_size(manifest, len(chosen), width, labels)
    lights = tuple(day.lights[0] for day in days)
    if dry_run:
        return SheetSummary(target=target, cameras=chosen, lights=lights, size=(0, 0))
    tiles = np.zeros((len(days), len(chosen), tile[1], tile[0], 3), np.float32)
    for i, c in enumerate(chosen):
        for j, day in enumerate(days):
            hours = read(day, c)
            tiles[j, i] = area_mean(np.repeat(hours[..., None], 3, axis=2), *tile)
            progress(i * len(days) + j + 1, len(days) * len(chosen))
    if labels:
        most = max(day.most_h for day in days)
        heads = (manifest.name, f"hours of direct sun,  {counted(days[-1].lights.stop, 'light position')}")
        codes = draw_sheet(false_colours(tiles[..., 0], most), chosen, labels, heads, width)
        codes = draw_scale(codes, false_colours(np.linspace(0, most, 256, dtype=np.float32)[None], most), most, "h")
        size = write_drawn(target, codes)
    else:
        size = write_linear(target, tiles, image_format, DATA)
    return SheetSummary(target=target, cameras=chosen, lights=lights, size=size)


def false_colours(hours: Float32, most: float) -> Bytes:
    """Return sRGB codes (..., 3) of hours from 0 to `most`."""
    at = np.clip(hours / max(most, 1e-9), 0, 1) * (len(RAMP) - 1)
    places = np.arange(len(RAMP))
    return np.stack([np.interp(at, places, RAMP[:, k]) for k in range(3)], axis=-1).round().astype(np.uint8)
