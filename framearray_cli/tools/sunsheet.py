"""A sheet of hours of direct sun in false colour: camera positions from left to right, days from top to bottom."""

from pathlib import Path

import numpy as np

from framearray_cli.array.images import DATA, FOR_SCREENS, area_mean
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.units import counted

from .drawing import draw_scale, draw_sheet
from .progress import Progress
from .sheet import MOST_COLUMNS, WIDTH, SheetResult, choose_columns, sheet_format, tile_size, write_drawn, write_linear
from .sunhours import open_sun_hours

# sRGB codes from no sun to most: lightness rises evenly, so that the order is seen without the colours.
RAMP = np.array([[16, 16, 32], [56, 44, 120], [140, 50, 120], [224, 96, 70], [250, 176, 70], [252, 250, 190]])


def make_sun_sheet(
    out: Path,
    target: Path,
    *,
    cameras: str | None = None,
    columns: int = MOST_COLUMNS,
    width: int = WIDTH,
    progress: Progress | None = None,
    dry_run: bool = False,
) -> SheetResult:
    """Draw a sheet of hours of direct sun; EXR and TIFF hold the hours themselves, in all channels.

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
        OutputError: the array does not hold what hours of sun need, or a file cannot be read or written.
        MissingExtraError: no library here draws labels, or writes the format.
    """
    image_format, manifest = sheet_format(target, 0.0), read_manifest(out)
    days, read = open_sun_hours(manifest)
    chosen = choose_columns(manifest, cameras, columns)
    labels = [day.date for day in days] if image_format.format in FOR_SCREENS else []
    tile = tile_size(manifest, len(chosen), width, labels)
    lights = tuple(day.lights[0] for day in days)
    if dry_run:
        return SheetResult(target=target, cameras=chosen, lights=lights, size=(0, 0))
    tiles = np.zeros((len(days), len(chosen), tile[1], tile[0], 3), np.float32)
    for i, c in enumerate(chosen):
        for j, day in enumerate(days):
            hours = read(day, c)
            tiles[j, i] = area_mean(np.repeat(hours[..., None], 3, axis=2), *tile)
            if progress:
                progress(i * len(days) + j + 1, len(days) * len(chosen))
    if labels:
        most = max(day.most_h for day in days)
        heads = (manifest.name, f"hours of direct sun,  {counted(days[-1].lights.stop, 'light position')}")
        codes = draw_sheet(false_colours(tiles[..., 0], most), chosen, labels, heads, width)
        codes = draw_scale(codes, false_colours(np.linspace(0, most, 256, dtype=np.float32)[None], most), most, "h")
        size = write_drawn(target, codes)
    else:
        size = write_linear(target, tiles, image_format, DATA)
    return SheetResult(target=target, cameras=chosen, lights=lights, size=size)


def false_colours(hours: Float32, most: float) -> Bytes:
    """Return sRGB codes (..., 3) of hours from 0 to `most`."""
    at = np.clip(hours / max(most, 1e-9), 0, 1) * (len(RAMP) - 1)
    places = np.arange(len(RAMP))
    return np.stack([np.interp(at, places, RAMP[:, k]) for k in range(3)], axis=-1).round().astype(np.uint8)
