"""Hours of direct sun of a sun study, from a layer of its array, as a sheet."""

from pathlib import Path

import numpy as np

from framearray_cli.array.images import DATA, FOR_SCREENS, SUN_HOURS, area_mean, read_channels
from framearray_cli.array.manifest import Manifest, axis_moments, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.sundays import SunDay, sun_days
from framearray_cli.base.units import counted

from . import Progress, SheetResult
from .contactsheet import (
    MOST_COLUMNS,
    WIDTH,
    choose_columns,
    sheet_format,
    tile_size,
    write_drawn,
    write_linear,
)
from .drawing import draw_scale, draw_sheet

# sRGB codes from no sun to most: lightness rises evenly, so that the order is seen without the colours.
RAMP = np.array([[16, 16, 32], [56, 44, 120], [140, 50, 120], [224, 96, 70], [250, 176, 70], [252, 250, 190]])


def _days_of_sun(manifest: Manifest) -> tuple[SunDay, ...]:
    """Return the days of a sun study with a layer of hours."""
    if not manifest.has_sun_hours:
        raise OutputError(f"{manifest.directory}: holds no hours of sun; render again with output.sun_hours = true")
    if moments := next(iter(axis_moments(manifest).values()), ()):
        return sun_days(moments)
    raise OutputError(f"{manifest.directory}: expected the times of a sun next to its hours, found none")


def make_sun_sheet(
    out: Path,
    target: Path,
    cameras: str | None = None,
    columns: int = MOST_COLUMNS,
    width: int = WIDTH,
    *,
    progress: Progress = lambda done, total: None,
) -> SheetResult:
    """Draw a sheet of hours of direct sun; EXR and TIFF contain the hours themselves, in all channels.

    Args:
        out: output folder of a render of a sun study, or its manifest.
        target: a .png, .jpg, .exr or .tif.
        cameras: places along the camera path, one per column; None: a few, evenly spaced.
        columns: the number of cameras, at most, where they are not named.
        width: of the sheet, at most, pixels.
        progress: called after each camera and day.

    Raises:
        JobError: a place is unknown, or images would be too small at that width.
        OutputError: the array lacks the data for hours of sun, or a file cannot be read or written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format, manifest = sheet_format(target, 0.0), read_manifest(out)
    days = _days_of_sun(manifest)
    chosen = choose_columns(manifest, cameras, columns)
    labels = [day.date for day in days] if image_format.format in FOR_SCREENS else []
    tile = tile_size(manifest, len(chosen), width, labels)
    lights = tuple(day.lights[0] for day in days)
    tiles = np.zeros((len(days), len(chosen), tile[1], tile[0], 3), np.float32)
    channels = [f"{SUN_HOURS}.{day.date}" for day in days]
    for i, c in enumerate(chosen):
        hours = read_channels(layers_path(manifest, c), channels, manifest.resolution)
        for j in range(len(days)):
            tiles[j, i] = area_mean(np.repeat(hours[..., j : j + 1], 3, axis=2), *tile)
            progress(i * len(days) + j + 1, len(days) * len(chosen))
    if labels:
        most = max(day.most_h for day in days)
        heads = (manifest.name, f"hours of direct sun,  {counted(days[-1].lights.stop, 'light position')}")
        codes = draw_sheet(false_colours(tiles[..., 0], most), chosen, labels, heads, width)
        codes = draw_scale(codes, false_colours(np.linspace(0, most, 256, dtype=np.float32)[None], most), most, "h")
        size = write_drawn(target, codes)
    else:
        size = write_linear(target, tiles, image_format, DATA)
    return SheetResult(file=str(target), cameras=chosen, lights=lights, size=size)


def false_colours(hours: Float32, most: float) -> Bytes:
    """Return sRGB codes (..., 3) of hours from 0 to `most`."""
    at = np.clip(hours / max(most, 1e-9), 0, 1) * (len(RAMP) - 1)
    places = np.arange(len(RAMP))
    return np.stack([np.interp(at, places, RAMP[:, k]) for k in range(3)], axis=-1).round().astype(np.uint8)
